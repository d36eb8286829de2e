"""Positions and headings at the steps of a log: where they were measured, as sure as they are, and once."""

from dataclasses import replace

import numpy as np
import pytest

from refusals import refused
from slamduel.backends.keeping.smoother import build as smoother
from slamduel.bench.measure.nees import nees
from slamduel.core.factors import Log
from slamduel.core.fixes import residual
from slamduel.core.se2 import Array, act, wrap
from slamduel.frontend.wheels.motion import Drift
from slamduel.frontend.wheels.track import Track
from slamduel.frontend.world.compass import Compass, directions
from slamduel.frontend.world.fixes import motion_from, nearest, with_fixes
from slamduel.frontend.world.jumps import fitted, swapped, without_jumps
from slamduel.frontend.world.measured import headings, joined, positions
from slamduel.frontend.world.start import start
from tiers import first_quick
from world_drives import DECLINATION, NOISE, outdoors

SEEDS = range(8)


def squares(log: Log, true: Array) -> Array:
    """(f,) normalised squared errors of a log's fixes at the true poses (n, 3) of its steps, by what each measures."""
    table, out = log.fixes, list[float]()
    assert table is not None
    for row, k in enumerate(table.step.tolist()):
        off, _ = residual(true[k], table.z[row], table.arm[row])
        told = np.isfinite(table.z[row])
        square = off[told] @ np.linalg.solve(table.cov[row][np.ix_(told, told)], off[told])
        out.append(float(square) / int(told.sum()))
    return np.array(out)


@pytest.mark.parametrize("seed", first_quick(SEEDS, 2))
@pytest.mark.parametrize("sd", [0.01, 0.5])
def test_positions_between_steps_are_as_sure_as_stated(seed: int, sd: float) -> None:
    one = outdoors(seed, sd=sd)
    log, remarks = with_fixes(one.log, one.gps, one.motion)
    assert remarks == []
    assert log.fixes is not None
    assert len(log.fixes) == len(one.gps.t) > 100
    assert not np.isin(one.gps.t, log.t).any()
    found = squares(log, one.true(log.t))
    spread = np.sqrt(1 / len(found))  # of the mean of chi squares of 2 degrees of freedom, each divided by 2
    assert 0.7 - 4 * spread < found.mean() < 1 + 4 * spread


def test_the_robot_moves_the_antenna_exactly() -> None:
    one = outdoors(0, sd=1e-3)
    exact = replace(one.motion, poses=one.poses)
    true = positions(one.gps.t, act(one.true(one.gps.t), one.gps.arm), one.gps.cov[:, :2, :2], one.gps.arm[0])
    log, _ = with_fixes(one.log, true, exact)
    assert log.fixes is not None
    path = one.true(log.t)
    for row, k in enumerate(log.fixes.step.tolist()):
        off, _ = residual(path[k], log.fixes.z[row], log.fixes.arm[row])
        assert np.hypot(*off[:2]) < 1e-4  # true poses between readings are interpolated


def test_a_fix_at_a_step_is_what_was_measured() -> None:
    one = outdoors(1)
    at = positions(
        one.log.t,
        act(one.true(one.log.t), np.tile(one.gps.arm[0], (len(one.log), 1))),
        one.gps.cov[0, :2, :2],
        one.gps.arm[0],
    )
    log, _ = with_fixes(one.log, at, one.motion)
    assert log.fixes is not None
    np.testing.assert_array_equal(log.fixes.step, np.arange(len(log)))
    for mine, its in ((log.fixes.z, at.z), (log.fixes.cov, at.cov), (log.fixes.arm, at.arm)):
        np.testing.assert_array_equal(mine, its)
    for column in ("t", "delta", "delta_cov"):
        np.testing.assert_array_equal(getattr(log, column), getattr(one.log, column))


@pytest.mark.parametrize("forward", [True, False])
def test_covariances_cover_the_motion_to_a_step_by_numerical_derivatives(forward: bool) -> None:
    one, k = outdoors(2), 40
    at = float(one.log.t[k]) + (0.2 if forward else -0.2)
    moved = motion_from(one.log, k, at, one.motion)
    only = positions(np.array([at]), np.zeros((1, 2)), 1e-4 * np.eye(2), np.array([0.5, 0.2]))
    log, _ = with_fixes(one.log, only, one.motion)
    assert log.fixes is not None
    J, h = np.zeros((2, 3)), 1e-6
    for column in range(3):
        step = h * np.eye(3)[column]
        J[:, column] = (act(moved.delta + step, only.arm[0]) - act(moved.delta - step, only.arm[0])) / (2 * h)
    most = np.linalg.eigvalsh(J @ moved.cov @ J.T)[-1]
    np.testing.assert_allclose(log.fixes.cov[0, :2, :2] - 1e-4 * np.eye(2), most * np.eye(2), rtol=1e-5)


def test_without_wheels_the_log_tells_what_is_between_its_steps() -> None:
    one = outdoors(3)
    log, _ = with_fixes(one.log, one.gps, None)
    assert squares(log, one.true(log.t)).mean() < 1.5
    moved = motion_from(one.log, 5, float(one.log.t[5]) + 0.125, None)
    np.testing.assert_allclose(moved.delta, one.log.delta[6] / 4)


def test_odometry_that_is_made_of_the_positions_is_refused() -> None:
    one = outdoors(4)
    xy = act(one.motion.poses[::10], np.zeros((len(one.t[::10]), 2)))
    own = positions(one.t[::10], xy, 0.01 * np.eye(2), np.zeros(2))
    refused("made of these positions, which would count twice", with_fixes, one.log, own, one.motion)
    turns = headings(one.t[::10], one.motion.poses[::10, 2] + 0.3, 0.1)
    refused("made of these headings, which would count twice", with_fixes, one.log, turns, one.motion)
    with_fixes(one.log, one.gps, one.motion)
    with_fixes(one.log, own, Drift(1.0, 1.0))


def test_positions_outside_the_steps_are_left_out_with_a_remark() -> None:
    one = outdoors(5)
    late = one.gps._replace(t=one.gps.t + 30)
    log, (remark,) = with_fixes(one.log, late, one.motion)
    assert "positions (50 %) are before or after its steps, 0 to 59.5 s, and left out" in remark
    assert log.notes["fixes"]["positions"] == len(log.fixes or ())
    gone, _ = with_fixes(one.log, one.gps._replace(t=one.gps.t + 1000), one.motion)
    assert gone.digest == one.log.digest


def test_the_nearest_step_is_found_by_search() -> None:
    rng = np.random.default_rng(0)
    t, at = np.sort(rng.uniform(0, 10, 30)), rng.uniform(-1, 11, 200)
    np.testing.assert_array_equal(nearest(t, at), np.abs(at[:, None] - t).argmin(axis=1))


@pytest.mark.parametrize("seed", first_quick(SEEDS, 2))
def test_a_compass_points_where_the_robot_does(seed: int) -> None:
    one = outdoors(seed)
    remarks = list[str]()
    found = directions(one.imu, Compass(DECLINATION, 0.02), None, remarks)
    assert found is not None
    assert remarks == []
    assert np.diff(found.t).min() >= 1 - 1e-9
    assert np.abs(wrap(found.z[:, 2] - one.true(found.t)[:, 2])).max() < 1e-9
    log, _ = with_fixes(one.log, found._replace(t=found.t + 0.1), one.motion)
    assert log.notes["fixes"] == {"positions": 0, "headings": len(found.t)}


def test_iron_on_the_robot_is_taken_off() -> None:
    one, remarks = outdoors(0), list[str]()
    assert one.imu.mag is not None
    iron = replace(one.imu, mag=one.imu.mag + np.array([1.5e-5, -1e-5, 0]))
    found = directions(iron, Compass(DECLINATION), None, remarks)
    assert found is not None
    assert "around 1.5e-05, -1e-05 T, 90 % of its radius from zero: a field of iron on the robot" in remarks[0]
    assert np.abs(wrap(found.z[:, 2] - one.true(found.t)[:, 2])).max() < 1e-6


def test_readings_near_iron_are_left_out() -> None:
    one, remarks = outdoors(0), list[str]()
    assert one.imu.mag is not None
    near = (one.t > 20) & (one.t < 26)
    iron = replace(one.imu, mag=one.imu.mag + near[:, None] * (3e-5, 0, 0))
    found = directions(iron, Compass(DECLINATION), None, remarks)
    assert found is not None
    assert "near iron, which are left out" in remarks[-1]
    assert np.median(np.abs(wrap(found.z[:, 2] - one.true(found.t)[:, 2]))) < 1e-2
    assert ((found.t > 20.5) & (found.t < 25.5)).sum() <= 3


FIELDS = {
    "repeats one reading": lambda mag, rng: np.tile(mag[0], (len(mag), 1)),
    "expected 5e-06 to 4.5e-05 T of the Earth's field": lambda mag, rng: 10 * mag,
    "it is near iron or motors": lambda mag, rng: mag * rng.uniform(0.2, 3, (len(mag), 1)),
    "has 1 readings, expected at least 2": lambda mag, rng: np.where(np.arange(len(mag))[:, None] == 3, mag, np.nan),
}


@pytest.mark.parametrize("said", FIELDS)
def test_a_field_that_is_not_the_earths_makes_no_heading(said: str) -> None:
    one, remarks = outdoors(0), list[str]()
    assert one.imu.mag is not None
    odd = replace(one.imu, mag=FIELDS[said](one.imu.mag, np.random.default_rng(0)))
    assert directions(odd, Compass(), None, remarks) is None
    assert said in remarks[-1]
    assert "not in the log" in remarks[-1]


@pytest.mark.parametrize("seed", first_quick(SEEDS, 2))
def test_jumps_there_and_back_are_left_out(seed: int) -> None:
    one, remarks, rng = outdoors(seed), list[str](), np.random.default_rng(seed)
    bad = np.zeros(len(one.gps.t), bool)
    bad[rng.choice(np.arange(5, len(bad) - 5), 6, replace=False)] = True
    off = np.concatenate((np.where(bad[:, None], (80.0, 60.0), 0.0), np.zeros((len(bad), 1))), axis=1)
    jumping = one.gps._replace(z=one.gps.z + off)
    way = np.full(len(bad) - 1, 1 / 2.3)
    kept = without_jumps("gps", jumping, way, remarks)
    np.testing.assert_array_equal(kept.t, one.gps.t[~bad])
    assert "6 of 137 positions are out of the robot's reach" in remarks[0]
    assert "m, and are left out" in remarks[0]
    assert len(without_jumps("gps", jumping, None, list[str]()).t) == len(kept.t)


def test_a_jump_that_stays_is_a_remark() -> None:
    one, remarks = outdoors(0), list[str]()
    late = one.gps.t > 30
    moved = one.gps._replace(z=one.gps.z + late[:, None] * (100.0, 0.0, 0.0))
    assert len(without_jumps("gps", moved, None, remarks).t) == len(one.gps.t)
    assert "and stay there, farther than the robot drove" in remarks[0]
    quiet = list[str]()
    without_jumps("gps", one.gps, np.full(len(late) - 1, 1 / 2.3), quiet)
    assert quiet == []


@pytest.mark.parametrize("seed", first_quick(SEEDS, 2))
def test_swapped_degrees_are_a_remark(seed: int) -> None:
    one = outdoors(seed)
    path = one.true(one.gps.t)[:, :2]
    assert swapped("gps", path, one.gps) == []
    mirrored = one.gps._replace(z=one.gps.z[:, [1, 0, 2]])
    assert "perhaps latitude and longitude are swapped" in swapped("gps", path, mirrored)[0]
    straight = positions(one.gps.t, np.column_stack((one.gps.t, 0 * one.gps.t)), 0.01 * np.eye(2), np.zeros(2))
    assert swapped("gps", straight.z[:, :2], straight) == []


def test_a_path_is_laid_upon_positions_exactly() -> None:
    rng = np.random.default_rng(0)
    path, pose = rng.normal(size=(20, 2)), np.array([3.0, -4.0, 2.0])
    found = fitted(path, act(pose, path))
    np.testing.assert_allclose((*found.shift, found.turn), pose, atol=1e-12)
    assert found.error < 1e-12


@pytest.mark.parametrize("seed", first_quick(SEEDS, 2))
@pytest.mark.parametrize("by", ["gps", "both"])
def test_a_start_that_nobody_gave_is_found(seed: int, by: str) -> None:
    one = outdoors(seed, sd=0.3)
    lost = replace(one.log, prior=one.log.prior._replace(pose=np.zeros(3)))
    compass = directions(one.imu, Compass(DECLINATION), None, list[str]())
    assert compass is not None
    found = one.gps if by == "gps" else joined(one.gps, compass)
    prior = start(lost, found, one.motion)
    off = prior.pose - one.true(one.log.t[:1])[0]
    off[2] = wrap(off[2])
    assert off @ np.linalg.solve(prior.cov, off) / 3 < 2
    assert np.sqrt(prior.cov[2, 2]) < 0.5
    log, _ = with_fixes(replace(lost, prior=prior), found, one.motion)
    backend = smoother.make(log.prior, smoother.options(), np.random.default_rng(0))
    poses, covs = list[np.ndarray](), list[np.ndarray]()
    for step in log:
        pose, cov = backend.step(step), backend.belief().cov
        assert pose is not None
        assert cov is not None
        poses.append(pose)
        covs.append(cov)
    assert nees(np.array(poses), np.array(covs), one.true(log.t)).mean() / 3 < 2.5  # of one drive: its poses err alike


def test_a_start_that_nothing_tells_is_refused() -> None:
    one = outdoors(0, sd=50.0)
    refused("nothing says which way the robot started: its positions tell that to", start, one.log, one.gps, one.motion)
    assert isinstance(one.motion, Track)
    assert one.motion.noise == NOISE
