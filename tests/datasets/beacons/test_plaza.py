"""The Plaza logs: what GTSAM ships, a small file of the same kind, and files that are none."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

from refusals import refused_at
from slamduel.bench.measure.accuracy import align, aligned
from slamduel.bench.plan.load import load
from slamduel.core.factors import Log, Systematic, Truth
from slamduel.core.factors.check import problems
from slamduel.core.partial import PartialTable
from slamduel.core.se2 import Array, Ints, wrap
from slamduel.core.truth.check import check_truth
from slamduel.core.truth.errors import sighted_from
from slamduel.datasets.beacons.plaza import Options, make

RADIUS, SPEED = 10.0, 2.0
BEACONS = np.array([[0.0, 12.0, 3.0], [5.0, -4.0, 15.0]])


def along(t: Array) -> Array:
    """(n, 3) a robot on a circle to the left, from the origin along x."""
    turn = SPEED / RADIUS * t
    return np.column_stack((RADIUS * np.sin(turn), RADIUS * (1 - np.cos(turn)), wrap(turn)))


def tables() -> dict[str, Any]:
    """20 s, odometry every 0.2 s, ranges every 0.3 s without errors but 10 % too long; one of them is there twice."""
    t: Array = 100 + 0.2 * np.arange(101.0)
    true = np.column_stack((t, along(t - 100)))
    seen: Array = 100.1 + 0.3 * np.arange(60.0)
    who = np.arange(60) % 2
    z = 1.1 * np.hypot(*(along(seen - 100)[:, :2] - BEACONS[who, 1:]).T)
    rows = np.column_stack((seen, np.full(60, 2.0), BEACONS[who, 0], z))
    motions = np.column_stack((t[1:], np.full(100, SPEED * 0.2), np.full(100, SPEED / RADIUS * 0.2)))
    return {"DR": motions, "DRp": true, "GT": true, "TL": BEACONS, "TD": np.concatenate((rows[30:], rows[:31]))}


def saved(folder: Path, change: dict[str, Any] | None = None) -> Path:
    found = {name: table for name, table in (tables() | (change or {})).items() if table is not None}
    savemat(folder / "some.mat", found)
    return folder / "some.mat"


def made(path: Path, **options: Any) -> tuple[Log, Truth, PartialTable]:
    log, truth = make(Options(path=str(path), **options), np.random.default_rng(0))
    assert truth is not None
    assert log.partial is not None
    assert list(problems(log)) == []
    check_truth(log, truth, "some")
    return log, truth, log.partial


def test_every_range_is_a_step_and_the_motions_lead_there(tmp_path: Path) -> None:
    log, truth, partial = made(saved(tmp_path), scale=1.1)
    t = log.t[partial.step]
    np.testing.assert_allclose(t, 100.1 + 0.3 * np.arange(60))
    assert np.diff(log.t).max() <= 1.0 + 1e-9
    np.testing.assert_allclose(log.dead_reckoned()[:, :2], along(log.t - 100)[:, :2], atol=1e-9)
    np.testing.assert_allclose(truth.poses[:, :2], along(truth.t - 100)[:, :2], atol=2e-3)
    assert truth.map is not None
    right = sighted_from(along(t - 100), truth.map.xy[np.searchsorted(truth.map.ids, partial.ids)])
    np.testing.assert_allclose(partial.z, right[:, 0], rtol=1e-9)
    assert log.notes["dropped"] == {"ranges of a beacon at the time of another": 1}


def test_the_noise_and_what_is_constant_are_as_stated(tmp_path: Path) -> None:
    path = saved(tmp_path)
    log, _, partial = made(path, range_sd=0.7, forward=0.1, turn=0.02, range_scale=0.05, range_offset=0.3, each=True)
    assert log.prior.systematic == Systematic(0.05, 0.3, each=True)
    assert set(partial.var.tolist()) == {0.7**2}
    way = SPEED * np.diff(log.t)
    along_it = log.delta_cov[1:, 0, 0] - 1e-6  # without the floor
    np.testing.assert_allclose(along_it, 0.01 * way, rtol=0.02)
    np.testing.assert_allclose(log.delta_cov[1:, 2, 2] - 1e-8, 0.0004 * np.diff(log.t), rtol=1e-9)
    assert made(path)[0].prior.systematic == Systematic(range_scale=0.1)


FAULTS: dict[str, tuple[dict[str, Any], str]] = {
    "no table": ({"TL": None}, "found no table TL of 3 columns, expected one."),
    "other columns": ({"TD": np.ones((3, 3))}, "found no table TD of 4 columns, expected one."),
    "text": ({"DR": np.array([["a", "b", "c"]])}, "DR is of type <U1, expected numbers."),
    "a range below zero": ({"TD": np.array([[101, 2, 0, -3.0]])}, "TD row 0: found id 0 and range -3.0, expected"),
    "half an id": ({"TD": np.array([[101, 2, 0.5, 3.0]])}, "TD row 0: found id 0.5 and range 3.0, expected"),
    "a range too early": ({"TD": np.array([[99, 2, 0, 3.0]])}, "TD row 0: t is 99.0, expected 100.0 to 120.0"),
    "NaN": ({"DR": np.array([[101, np.nan, 0]])}, "DR row 0: found nan, expected a number"),
    "odometry out of order": ({"DR": np.array([[101.0, 1, 0], [101, 1, 0]])}, "DR row 1: t is 101.0, expected later"),
}


@pytest.mark.parametrize("case", FAULTS)
def test_a_fault_is_named(tmp_path: Path, case: str) -> None:
    change, said = FAULTS[case]
    path = saved(tmp_path, change)
    refused_at(path, said, make, Options(path=str(path)), np.random.default_rng(0))


def test_a_file_that_is_none_is_named(tmp_path: Path) -> None:
    path = tmp_path / "some.mat"
    refused_at(path, "there is no such file", make, Options(path=str(path)), np.random.default_rng(0))
    path.write_text("no file of Matlab, but long enough that its header could be one " * 10)
    refused_at(path, "is damaged or no file of Matlab", make, Options(path=str(path)), np.random.default_rng(0))


@pytest.mark.parametrize(("number", "steps", "ranges", "off"), [(1, 4429, 3527, 1.472), (2, 1818, 1816, 15.97)])
def test_the_shipped_logs_are_as_published(number: int, steps: int, ranges: int, off: float) -> None:
    """Dead reckoning's error is that measured before, and the ranges are 7 % too long, without one that is wrong."""
    log, truth = load(f"plaza[log={number},gyro=false]")
    assert truth is not None
    assert truth.map is not None
    assert log.partial is not None
    assert (len(log), len(log.partial), len(truth.t)) == (steps, ranges, steps)
    reckoned = log.dead_reckoned()
    error = np.hypot(*(aligned(align(reckoned, truth.poses), reckoned) - truth.poses)[:, :2].T)
    assert np.sqrt((error**2).mean()) == pytest.approx(off, abs=0.005)
    row: Ints = np.searchsorted(np.sort(truth.map.ids), log.partial.ids)
    places = truth.map.xy[np.argsort(truth.map.ids)][row]
    right = sighted_from(truth.poses[log.partial.step], places)[:, 0]
    assert np.median(log.partial.z / right) == pytest.approx(1.07, abs=0.002)
    assert np.abs(log.partial.z / 1.07 - right).max() < 2.0


def test_what_the_gyro_turns_while_the_wheels_stand_is_taken_off(tmp_path: Path) -> None:
    """A second before the robot moves, and a gyro that is off by 0.05 rad/s all along."""
    some = tables()
    stood = np.column_stack((100 + 0.2 * np.arange(-4, 1), np.zeros((5, 2))))
    motions = np.concatenate((stood, some["DR"]))
    motions[:, 2] += 0.05 * 0.2
    start = np.array([[99.0, 0.0, 0.0, 0.0]])
    changed: dict[str, Any] = {"DR": motions, "DRp": start}
    log, _, _ = made(saved(tmp_path, changed))
    np.testing.assert_allclose(log.dead_reckoned()[:, :2], along(np.maximum(log.t - 100, 0))[:, :2], atol=1e-9)
    drifting, _, _ = made(saved(tmp_path, changed), gyro=False)
    assert np.hypot(*(drifting.dead_reckoned() - log.dead_reckoned())[-1, :2]) > 5


@pytest.mark.parametrize(("number", "off"), [(1, 1.495), (2, 5.344)])
def test_the_levelled_gyro_of_the_shipped_logs_is_a_better_one_where_it_drifts(number: int, off: float) -> None:
    log, truth = load(f"plaza[log={number}]")
    assert truth is not None
    reckoned = log.dead_reckoned()
    error = np.hypot(*(aligned(align(reckoned, truth.poses), reckoned) - truth.poses)[:, :2].T)
    assert np.sqrt((error**2).mean()) == pytest.approx(off, abs=0.005)


@pytest.mark.parametrize("number", [1, 2])
def test_the_noise_of_the_other_log_is_stated_and_its_scale_is_not(number: int) -> None:
    log, _ = load(f"plaza[log={number}]")
    other, _ = load(f"plaza[log={number},noise=others]")
    assert log.partial is not None
    assert other.partial is not None
    assert other.partial.z.tobytes() == log.partial.z.tobytes()
    assert other.prior.systematic == log.prior.systematic
    assert np.sqrt(other.partial.var) == pytest.approx(0.55, abs=0.03)
    assert other.notes["noise"]["fitted_on"] == [{1: "plaza[log=2]", 2: "plaza"}[number]]
