"""Planted false loops: the log is otherwise the same, the truth names them, and a folder keeps them."""

from functools import cache
from pathlib import Path

import gtsam
import numpy as np
import pytest

import slamduel
from laps import laps
from refusals import refused
from slamduel.bench.plan import reference
from slamduel.bench.plan.spec import read_options
from slamduel.core.factors import Dataset, Log, Truth
from slamduel.core.factors.check import problems
from slamduel.core.se2 import Array, Ints, between, compose
from slamduel.core.truth.check import check_truth
from slamduel.datasets import archive, registry
from slamduel.datasets.cache import generator
from slamduel.datasets.false_loops import FALSE_NOTE, FalseLoops, planted
from slamduel.datasets.formats import log_folder
from slamduel.datasets.truth import digest

SHARES = (0.05, 0.2, 0.5)


@cache
def world() -> Dataset:
    return laps(np.random.default_rng(0))


def made(share: float, seed: int = 0) -> Dataset:
    return planted(world(), share, np.random.default_rng(seed))


def true(dataset: Dataset) -> Truth:
    assert dataset.truth is not None
    return dataset.truth


def false(dataset: Dataset) -> Ints:
    found = true(dataset).false_loops
    assert found is not None
    return found


def rows(log: Log, which: Ints) -> set[bytes]:
    """The loops in rows `which`, each as its bits."""
    columns = (log.loop_step, log.loop_to, log.loop_delta, log.loop_cov)
    return {b"".join(np.ascontiguousarray(column[k]).tobytes() for column in columns) for k in which}


def own(dataset: Dataset) -> Ints:
    return np.setdiff1d(np.arange(len(dataset.log.loop_to)), false(dataset))


@pytest.mark.parametrize("share", SHARES)
def test_so_many_are_added_and_everything_else_stays(share: float) -> None:
    log, truth = world()
    found = made(share)
    assert not list(problems(found.log))
    check_truth(found.log, true(found), "with false loops")
    count = round(share * len(log.loop_to))
    assert len(false(found)) == count == len(found.log.loop_to) - len(log.loop_to)
    assert found.log.notes[FALSE_NOTE] == f"{count} of {len(found.log.loop_to)}"
    for name in ("loop_step", "loop_to", "loop_delta", "loop_cov"):
        np.testing.assert_array_equal(getattr(found.log, name)[own(found)], getattr(log, name))
    for name in ("t", "delta", "delta_cov", "ids", "z"):
        assert getattr(found.log, name) is getattr(log, name)
    assert found.log.prior.pose is log.prior.pose
    assert true(found).poses is truth.poses


def claimed(log: Log, which: Ints) -> Array:
    """Where the loops put their steps, seen from dead reckoning."""
    return compose(log.dead_reckoned()[log.loop_to[which]], log.loop_delta[which])


def test_they_are_anywhere_the_robot_was_with_the_covariances_of_correct_ones() -> None:
    every = [made(0.5, seed) for seed in range(20)]
    path = world().log.dead_reckoned()
    at = np.concatenate([claimed(one.log, false(one)) for one in every])
    low, high = path[:, :2].min(axis=0), path[:, :2].max(axis=0)
    assert (at[:, :2] >= low - 1e-9).all()
    assert (at[:, :2] <= high + 1e-9).all()
    share = np.column_stack(((at[:, :2] - low) / (high - low), at[:, 2] / (2 * np.pi) + 0.5))
    for column in share.T:  # uniform: 4 sd of the mean of so many
        assert abs(column.mean() - 0.5) < 4 * np.sqrt(1 / 12 / len(column))
        assert abs((column < 0.25).mean() - 0.25) < 4 * np.sqrt(3 / 16 / len(column))
    covs = {cov.tobytes() for cov in world().log.loop_cov}
    for one in every:
        assert {cov.tobytes() for cov in one.log.loop_cov[false(one)]} <= covs
        assert (one.log.loop_to < one.log.loop_step).all()
    step = np.concatenate([one.log.loop_step[false(one)] for one in every])
    thirds = np.histogram(step, 3, (1, len(world().log)))[0] / len(step)
    np.testing.assert_allclose(thirds, 1 / 3, atol=4 * np.sqrt(2 / 9 / len(step)))


def test_they_are_false_by_far() -> None:
    log, truth = made(0.5)
    which = false(Dataset(log, truth))
    right = between(truth.poses[log.loop_to[which]], truth.poses[log.loop_step[which]])
    off = np.abs(log.loop_delta[which] - right) / np.sqrt(np.einsum("lii->li", log.loop_cov[which]))
    assert (off.max(axis=1) > 5).all()


def test_a_larger_share_includes_a_smaller_one_and_a_seed_is_one_log() -> None:
    few, more = made(0.1), made(0.4)
    assert rows(few.log, false(few)) < rows(more.log, false(more))
    assert made(0.1).log.digest == few.log.digest
    assert rows(few.log, false(few)).isdisjoint(rows(made(0.1, 1).log, false(made(0.1, 1))))


def test_without_the_option_nothing_changes() -> None:
    assert planted(world(), 0.0, np.random.default_rng(0)) is world()
    plain, found = true(world()), true(made(0.1))
    assert digest(plain) != digest(found)
    assert digest(found._replace(false_loops=None)) == digest(plain)


def test_a_log_without_ground_truth_gets_one_without_path_or_map() -> None:
    log, truth = planted(Dataset(world().log, None), 0.1, np.random.default_rng(0))
    assert len(truth.t) == 0
    assert truth.map is None
    assert rows(log, false(Dataset(log, truth))) == rows(made(0.1).log, false(made(0.1)))


def test_a_log_without_loops_has_none_to_add_to() -> None:
    bare = Dataset(world().log.without_loops(), world().truth)
    refused(r"^option false_loops=0\.1: laps has no loop closures,", planted, bare, 0.1, np.random.default_rng(0))


# --- the option


def test_every_dataset_with_loops_of_its_own_can_have_false_ones() -> None:
    able = {name for name in registry.BUILTIN if issubclass(registry.find(name).options, FalseLoops)}
    files = {"aces", "city10000", "fr079", "intel-lab", "killian", "manhattan", "mit-csail", "w10000", "w20000"}
    assert able == {"carmen", "g2o", "gtsam", "jrl", "laser-floor", "patrol", "pyfg", "toro", *files}


@pytest.mark.parametrize("share", ["0.6", "-0.1", "some"])
def test_a_share_is_between_none_and_half(share: str) -> None:
    toro = registry.find("toro").options
    refused(f"option false_loops={share}", read_options, toro, [("false_loops", share)], "dataset toro")


def test_a_graph_file_with_false_loops_is_the_file_in_everything_else() -> None:
    path = gtsam.findExampleDataFile("w100.graph")
    plain, found = (slamduel.load(f"toro[path={path}{more}]") for more in ("", ",false_loops=0.1"))
    expected = planted(plain, 0.1, generator("false loops of toro", 0))
    assert found.log.digest == expected.log.digest != plain.log.digest
    np.testing.assert_array_equal(false(found), false(expected))


@pytest.mark.slow
def test_the_laser_floor_is_matched_once_for_all_shares(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("SLAMDUEL_CACHE", str(tmp_path))
    short = "laser-floor[laps=1.2,people=0,beams=61,scan_rate=2.5{}]"
    plain = slamduel.load(short.format(""))
    assert len(plain.log.loop_to) > 10
    kept = sorted(tmp_path.iterdir())
    found = slamduel.load(short.format(",false_loops=0.2"))
    assert sorted(tmp_path.iterdir()) == kept
    assert len(false(found)) == round(0.2 * len(plain.log.loop_to))
    np.testing.assert_array_equal(found.log.loop_delta[own(found)], plain.log.loop_delta)


# --- kept, and judged


def test_an_archive_and_a_folder_keep_which_loops_are_false(tmp_path: Path) -> None:
    found = made(0.1)
    archive.save(tmp_path / "a.npz", found)
    np.testing.assert_array_equal(false(archive.load(tmp_path / "a.npz")), false(found))
    log_folder.write(tmp_path / "log", *found)
    again = log_folder.read(tmp_path / "log")
    assert again.log.digest == found.log.digest
    assert digest(true(again)) == digest(true(found))
    np.testing.assert_array_equal(false(again), false(found))
    without_path = planted(Dataset(world().log, None), 0.1, np.random.default_rng(0))
    log_folder.write(tmp_path / "bare", *without_path)
    np.testing.assert_array_equal(false(log_folder.read(tmp_path / "bare")), false(without_path))


def test_a_folder_says_where_a_flag_is_odd(tmp_path: Path) -> None:
    log_folder.write(tmp_path / "log", *made(0.1))
    path = tmp_path / "log" / "loops.csv"
    lines = path.read_text().splitlines()
    assert lines[0].endswith(",false")
    path.write_text("\n".join([*lines[:3], lines[3][:-1] + "7", *lines[4:]]) + "\n")
    refused(r"loops\.csv, line 4: false is 7\.0, expected 0 or 1", log_folder.read, tmp_path / "log")


@pytest.mark.parametrize(
    ("which", "message"),
    [
        ([-1], "row 0: found -1, expected the row of a loop closure"),
        ([0, 10**6], "row 1: found 1000000, expected the row of a loop closure"),
        ([3, 3], "row 1: found 3, expected more than 3"),
        ([1.5], "entries of type float64, expected whole numbers"),
    ],
)
def test_a_truth_that_names_no_loop_is_refused(which: list[float], message: str) -> None:
    log, truth = world()
    refused(f"false_loops.*{message}", check_truth, log, truth._replace(false_loops=np.array(which)), "x")


def test_false_loops_do_not_rule_the_reference() -> None:
    log, truth = planted(Dataset(world().log, None), 0.1, np.random.default_rng(0))
    plain, found = reference.reference(world().log), reference.known(log, truth)
    assert plain.words == ""
    count = len(false(Dataset(log, truth)))
    said = f"the batch optimum with a Cauchy loss ({count} of {len(log.loop_to)} loop closures do not fit)"
    assert found.words == said
    np.testing.assert_array_equal(found.false_loops, truth.false_loops)
    assert np.abs((found.poses - plain.poses)[:, :2]).max() < 0.05
