"""Truth that contradicts its log is named; truth that does not, is not."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mistaken_logs import drawn
from slamduel.bench.contradiction.remark import remarked
from slamduel.bench.contradiction.truth import of_sightings
from slamduel.core.factors import Dataset, Map, Truth
from slamduel.core.se2 import Array

SEEDS = [3001, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (3003, 3005, 3007, 3009, 3011, 3013))]


def poses(change: Callable[[Array], Array]) -> Callable[[Truth], Truth]:
    return lambda truth: truth._replace(poses=change(truth.poses.copy()))


def places(change: Callable[[Array], Array]) -> Callable[[Truth], Truth]:
    def changed(truth: Truth) -> Truth:
        assert truth.map is not None
        return truth._replace(map=Map(truth.map.ids, change(truth.map.xy.copy()), None))

    return changed


def renumbered(truth: Truth) -> Truth:
    assert truth.map is not None
    return truth._replace(map=Map(np.roll(truth.map.ids, 3), truth.map.xy, None))


def late(delay: float) -> Callable[[Truth], Truth]:
    def changed(truth: Truth) -> Truth:
        then = np.column_stack([np.interp(truth.t - delay, truth.t, column) for column in truth.poses.T])
        return truth._replace(poses=then)

    return changed


def elsewhere(xy: Array) -> Array:
    c, s = np.cos(0.7), np.sin(0.7)
    return xy @ np.array([[c, s], [-s, c]]) + 100.0


def swapped(xy: Array) -> Array:
    xy[[0, 5]] = xy[[5, 0]]
    return xy


def ahead(poses: Array) -> Array:
    poses[:, :2] += 0.6 * np.column_stack((np.cos(poses[:, 2]), np.sin(poses[:, 2])))
    return poses


def frozen(poses: Array) -> Array:
    poses[len(poses) // 2 :] = poses[len(poses) // 2]
    return poses


FAR = "they are typically .* times what is stated, and .* % are far out"

CASES: dict[str, tuple[Callable[[Truth], Truth], str]] = {
    "x and y swapped": (poses(lambda p: p[:, [1, 0, 2]]), "mirror image"),
    "y of the other sign": (poses(lambda p: p * [1, -1, 1]), "mirror image"),
    "clockwise headings": (poses(lambda p: p * [1, 1, -1]), "headings of the truth are clockwise"),
    "headings from north": (
        poses(lambda p: p + np.array([0, 0, np.pi / 2])),
        "turned by a constant of about 90 degrees",
    ),
    "places in mm": (places(lambda xy: 1000 * xy), "places of landmarks are in millimetres"),
    "places mirrored": (places(lambda xy: xy[:, ::-1]), "places of landmarks are mirrored"),
    "places in another frame": (places(elsewhere), "in another frame than the true path"),
    "places renumbered": (renumbered, "have other ids"),
    "two places swapped": (
        places(swapped),
        r"the true places of landmarks \d+ and \d+ look swapped|is not where its sightings have it",
    ),
    "another place on the robot": (poses(ahead), f"{FAR}|its clock"),
    "a path that ends halfway": (poses(frozen), f"{FAR}|its clock"),
    "another drive": (poses(lambda p: p[::-1]), f"{FAR}|mirror"),
    "a late clock": (late(5.0), rf"its clock is about (4\.\d|5|5\.\d) s late|{FAR}"),
    "a clock that is a second late": (late(1.0), r"its clock is about (0\.9\d?|1|1\.1) s late"),
    "an early clock": (late(-0.5), rf"its clock is about 0\.(4\d|5|5\d) s early|{FAR}"),
}


def known(seed: int, folder: Path) -> Dataset:
    dataset, one = drawn(seed, None, folder)
    assert dataset.truth is not None
    return Dataset(dataset.log, dataset.truth._replace(map=Map(np.arange(len(one.landmarks)), one.landmarks, None)))


@pytest.mark.parametrize("seed", SEEDS)
def test_right_truth_has_no_remark(seed: int, tmp_path: Path):
    assert not remarked(known(seed, tmp_path)).contradictions


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("case", CASES)
def test_a_mistake_in_the_truth_is_named(case: str, seed: int, tmp_path: Path):
    log, truth = known(seed, tmp_path)
    assert truth is not None
    change, words = CASES[case]
    said = remarked(Dataset(log, change(truth))).contradictions
    assert (
        said or "clock is" in words or case == "two places swapped"
    )  # which a straight path does not tell, or one seen
    assert all(re.search(words, one) for one in said)


@pytest.mark.parametrize("case", ["places in mm", "places mirrored"])
def test_places_without_a_true_path_are_compared_among_themselves(case: str, tmp_path: Path):
    log, truth = known(3001, tmp_path)
    assert truth is not None
    alone = truth._replace(t=truth.t[:0], poses=truth.poses[:0])
    assert not remarked(Dataset(log, alone)).contradictions
    change, words = CASES[case]
    (said,) = remarked(Dataset(log, change(alone))).contradictions
    assert words in said


def test_imprecise_places_of_landmarks_do_not_accuse_the_true_path(tmp_path: Path):
    log, truth = known(3001, tmp_path)
    assert truth is not None
    rough = places(lambda xy: xy + np.random.default_rng(0).normal(0.0, 0.3, xy.shape))
    (said,) = remarked(Dataset(log, rough(truth))).contradictions
    assert "the true places of landmarks are less precise than the sensor" in said


def test_sightings_with_outliers_are_not_said_to_agree(tmp_path: Path):
    """Ids are others from halfway on: sightings are far from the truth, which is innocent."""
    log, truth = known(3005, tmp_path)
    assert truth is not None
    step, names = np.repeat(np.arange(len(log)), np.diff(log.sighting_first)), np.unique(log.ids)
    others = np.roll(names, 5)[np.searchsorted(names, log.ids)]
    renumbered = replace(log, ids=np.where(step > len(log) // 2, others, log.ids))
    assert any("agree with one another" in said for said in of_sightings(renumbered, truth))
    found = remarked(Dataset(renumbered, truth))
    assert found.outliers
    assert not any("agree with one another" in said for said in found.all)
