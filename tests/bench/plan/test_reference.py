from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from random_logs import random_log
from slamduel.backends.api import Solution
from slamduel.backends.graphs import graph
from slamduel.bench.measure.accuracy import align, aligned, ate, own_map_rmse
from slamduel.bench.plan import reference
from slamduel.bench.report.tables import accuracy_table
from slamduel.bench.run.terminal import tables
from slamduel.bench.verdict.summary import lines
from slamduel.bench.verdict.verdict import verdict
from slamduel.core.factors import Dataset, Map, Truth
from slamduel.core.se2 import act
from slamduel.datasets.hidden_ids import hidden
from slamduel.datasets.worlds.outliers import swapped
from small_record import Record


@pytest.fixture(scope="module")
def world() -> Dataset:
    return random_log(np.random.default_rng(5), 200, 15)


def off(found: Truth | None, world: Dataset) -> float:
    """How far a reference is from where the robot was, m."""
    assert found.kind == "reference"
    return ate(aligned(align(found.poses, world.truth.poses), found.poses), world.truth.poses)


def test_without_outliers_the_reference_is_the_plain_optimum(world: Dataset) -> None:
    found = reference.reference(world.log)
    assert (found.words, found.places) == ("", "reference")
    assert off(found, world) < 0.05


@pytest.mark.parametrize("share", [0.01, 0.05])
def test_wrong_ids_do_not_rule_the_reference(world: Dataset, share: float) -> None:
    assert world.truth is not None
    spoilt = swapped(world.log, world.truth, share, np.random.default_rng(1)).log
    found = reference.reference(spoilt)
    assert "Cauchy loss" in found.words
    assert off(found, world) < 1.5 * off(reference.reference(world.log), world) + 0.005


def test_a_noise_that_is_stated_too_small_is_no_outlier(world: Dataset) -> None:
    bold = replace(world.log, z_cov=world.log.z_cov / 9, delta_cov=world.log.delta_cov / 9)
    found = reference.reference(bold)
    assert found.words == ""


def test_surveyed_landmarks_stay_beside_a_reference_path(world: Dataset) -> None:
    log, truth = world
    assert truth is not None
    assert truth.map is not None
    elsewhere = truth.map._replace(xy=act(np.broadcast_to((3.0, -2.0, 0.7), (len(truth.map.ids), 3)), truth.map.xy))
    alone = Truth(np.zeros(0), np.zeros((0, 3)), elsewhere, None, "truth")
    found, plain = reference.known(log, alone), reference.reference(log)
    assert found is not None
    assert found.map is not None
    assert plain is not None
    assert plain.map is not None
    assert (found.kind, found.places) == ("reference", "truth")
    np.testing.assert_array_equal(found.poses, plain.poses)
    # A turn and a move of all landmarks are no error of any map; and in the figures they lie where the paths are.
    assert own_map_rmse(plain.map, found.map) == pytest.approx(own_map_rmse(plain.map, truth.map), rel=1e-9)
    _, mine, theirs = np.intersect1d(found.map.ids, plain.map.ids, return_indices=True)
    assert np.hypot(*(found.map.xy[mine] - plain.map.xy[theirs]).T).max() < 0.2


def test_a_true_path_needs_no_reference(world: Dataset) -> None:
    assert reference.known(world.log, world.truth) is world.truth


@pytest.mark.parametrize("ids", ["hidden", 0.5])
def test_hidden_ids_leave_the_reference_as_it_was(
    world: Dataset, ids: float | str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And its entry in the cache: it is found again, not found anew."""
    monkeypatch.setenv("SLAMDUEL_CACHE", str(tmp_path))
    log, truth = hidden(Dataset(world.log, None), ids, np.random.default_rng(2))
    found, plain = reference.known(log, truth), reference.reference(world.log)
    np.testing.assert_array_equal(found.poses, plain.poses)
    np.testing.assert_array_equal(found.assigned, world.log.ids)
    assert len(list(tmp_path.iterdir())) == 1


def test_what_the_reference_is_stands_wherever_distances_do(tmp_path: Path) -> None:
    made = Record(tmp_path / "run")
    words = "the batch optimum with a Cauchy loss (3 of 90 sightings do not fit)"
    made.cell("park", "reference", "ekf", surveyed=1, reference=words)
    made.cell("park", "reference", "isam2", surveyed=1, reference=words, paths=("online", "final"))
    made.cell("field", "reference", "ekf")
    found = lines(made.store.cells())
    groups = {name: [line for line in found if line.dataset == name] for name in ("park", "field")}
    park, field = groups["park"], groups["field"]
    said = {name: verdict(group).sentences for name, group in groups.items()}
    assert words in said["park"][0]
    assert "batch optimum of the same factors" in said["field"][0]
    for name, group in groups.items():
        (shown,) = tables(group, 120)
        assert (words in str(shown.title)) == (name == "park")
        assert "the batch optimum" in str(shown.title)
    headings = [[column.heading for column in accuracy_table(group).headings] for group in (park, field)]
    assert "map" in headings[0]  # an error
    assert "map from reference" in headings[1]  # a distance
    assert any("error of the online map: " in sentence for sentence in said["park"])
    assert not any("map" in sentence for sentence in said["field"])
    assert [use.purpose for use in verdict(park).uses] == ["online", "final", "map"]
    assert list(verdict(park).comparisons) == ["map_rmse_m", "final_map_rmse_m"]


def test_a_batch_that_has_not_converged_is_no_reference(monkeypatch: pytest.MonkeyPatch, world: Dataset) -> None:
    here = world.log.head(5)
    stopped = Solution(np.zeros((5, 3)), Map(here.ids[:0], here.z[:0], None), None, converged=False)
    monkeypatch.setattr(graph.Graph, "finish", lambda _: stopped)
    assert reference.reference(here) is None


def test_a_log_without_truth_or_reference_has_a_remark(monkeypatch: pytest.MonkeyPatch, world: Dataset) -> None:
    monkeypatch.setattr(reference, "made_ready", lambda *_: Dataset(world.log, None))
    for found, remarks in ((world.truth, []), (None, [reference.NO_REFERENCE])):
        monkeypatch.setattr(reference, "reference", lambda _, found=found: found)
        assert reference.made_with_reference("circle", None, 0).log.remarks == remarks
