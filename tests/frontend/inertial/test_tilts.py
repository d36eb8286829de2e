"""A body's tilts by gravity: as far off as stated, without the unit's own tilt, and never worse than its rocking."""

from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from inertial_drives import attitude
from slamduel.core.se2 import Array
from slamduel.datasets.on_demand.gyro import WorldGyro
from slamduel.datasets.on_demand.imu import imu_of
from slamduel.datasets.on_demand.rocking import Rocking
from slamduel.datasets.rendering.disturbances import rocked
from slamduel.datasets.worlds.aruco_room import ENCODER
from slamduel.datasets.worlds.rendered_world import LOOP
from slamduel.datasets.worlds.wheeled_robot import count, drive
from slamduel.frontend.inertial.imu import Imu
from slamduel.frontend.inertial.tilts import STEEP, Tilts, leaned, speeds, tilts, unlevelled
from slamduel.frontend.wheels.motion import Drift
from slamduel.frontend.wheels.ticks import Wheels
from tiers import first_quick

END = 20.0  # s
SPEED = 0.4  # m/s


class Rocked(NamedTuple):
    """A drive on a body that rocks by 0.02 rad."""

    body: Rocking
    imu: Imu
    wheels: Wheels


@cache
def rocked_drive(seed: int) -> Rocked:
    shaking, reading, counting = np.random.default_rng(seed).spawn(3)
    body = Rocking.drawn(0.02, shaking)
    imu = imu_of(WorldGyro(gyro=0.02, gyro_bias=0.5), lambda t: drive(LOOP, SPEED, t), END, reading, body)
    assert imu is not None
    t = np.arange(0.0, END + 0.04, 0.02)
    return Rocked(body, imu, Wheels(count(*drive(LOOP, SPEED, t), t, ENCODER, counting), ENCODER))


def found_in(one: Rocked, imu: Imu | None = None) -> Tilts:
    found = tilts(imu or one.imu, None, one.wheels, [])
    assert found is not None
    return found


def turned(imu: Imu, pitch: float, roll: float) -> Imu:
    """The readings of a unit that is mounted with its own tilt."""
    assert imu.accel is not None
    own = leaned(pitch, roll)
    return replace(imu, gyro=imu.gyro @ own, accel=imu.accel @ own)


@pytest.mark.parametrize("seeds", first_quick([range(3), range(3, 15)]))
def test_tilts_are_as_far_off_as_stated(seeds: range) -> None:
    nees, rms = [], []
    for seed in seeds:
        one = rocked_drive(seed)
        found = found_in(one)
        off = found.angles - one.body.at(found.t)
        nees.append((off**2 / found.sd**2).mean())
        rms.append((off**2).mean())
        np.testing.assert_allclose(found.rocking, 0.02, atol=0.008)
    assert 0.2 < np.mean(nees) < 1.5
    assert np.sqrt(np.mean(rms)) < 0.01  # half of the rocking


def test_the_units_own_tilt_is_taken_off() -> None:
    one = rocked_drive(0)
    tilted, straight = found_in(one, turned(one.imu, 0.05, -0.04)), found_in(one)
    np.testing.assert_allclose(tilted.mean - straight.mean, [0.05, -0.04], atol=3e-3)
    np.testing.assert_allclose(tilted.angles, straight.angles, atol=5e-3)


def test_a_body_that_leans_by_more_than_its_axes_can_be_off_is_not_levelled() -> None:
    one, remarks = rocked_drive(0), list[str]()
    assert tilts(turned(one.imu, 1.2 * STEEP, 0.0), None, one.wheels, remarks) is None
    (remark,) = remarks
    assert "leans by 24 degrees on average, expected at most 20: sightings are not levelled" in remark


def test_without_an_accelerometer_or_a_speed_there_are_none() -> None:
    one, drift = rocked_drive(0), Drift(0.4, 0.6)
    assert tilts(replace(one.imu, accel=None), None, one.wheels, []) is None
    assert speeds(drift, one.imu.t) is None
    assert tilts(one.imu, None, drift, []) is None


@pytest.mark.parametrize(("hz", "levelled"), [(2, False), (5, False), (10, True), (100, True)])
def test_a_body_is_not_levelled_by_readings_too_seldom_to_follow_its_rocking(hz: int, levelled: bool) -> None:
    one = rocked_drive(0)
    assert one.imu.accel is not None
    rows = slice(None, None, round(one.imu.rate / hz))
    imu = Imu(one.imu.t[rows], one.imu.gyro[rows], one.imu.accel[rows])
    assert imu.rate == pytest.approx(hz)
    assert (tilts(imu, None, one.wheels, []) is not None) == levelled
    assert unlevelled(imu, one.wheels) == (
        "" if levelled else f"readings come at {hz} Hz (median), expected at least 10 to follow a body that rocks"
    )


def test_speeds_are_those_of_the_wheels() -> None:
    one = rocked_drive(0)
    found = speeds(one.wheels, one.imu.t)
    assert found is not None
    late = one.imu.t > 6.0  # up to speed
    np.testing.assert_allclose(found[late], SPEED, atol=0.05)
    assert found[0] < SPEED / 2


@pytest.mark.parametrize("sway", [1e-4, 0.005, 0.02, 0.1])
def test_what_is_left_is_less_than_either_says(sway: float) -> None:
    found = replace(found_in(rocked_drive(1)), rocking=np.zeros(2))
    row = 700
    tilt = found.at(float(found.t[row]), sway)
    assert tilt is not None
    pitching, rolling = np.linalg.norm(tilt.leaning, axis=1)
    np.testing.assert_allclose([pitching**-2, rolling**-2], found.sd[row] ** -2.0 + sway**-2)
    kept = sway**2 / (sway**2 + found.sd[row] ** 2)
    np.testing.assert_allclose(tilt.turn[:3, :3], leaned(*(kept * found.angles[row])), atol=1e-12)


def test_a_body_that_is_shown_to_rock_more_than_stated_is_levelled_by_what_is_shown() -> None:
    found = found_in(rocked_drive(1))
    t = float(found.t[700])
    small, none, as_shown = (found.at(t, sway) for sway in (1e-3, 0.0, float(found.rocking.min())))
    assert small is not None
    assert none is not None
    assert as_shown is not None
    np.testing.assert_array_equal(small.turn, none.turn)
    np.testing.assert_allclose(none.turn, as_shown.turn)
    assert replace(found, rocking=np.zeros(2)).at(t, 0.0) is None


def test_outside_the_readings_and_in_their_gaps_nothing_is_known() -> None:
    one = rocked_drive(2)
    imu = one.imu
    assert imu.accel is not None
    kept = (imu.t < 8) | (imu.t > 10)
    found = found_in(one, Imu(imu.t[kept], imu.gyro[kept], imu.accel[kept]))
    assert [found.covers(t) for t in (-0.1, 0.0, 7.9, 9.0, 10.1, END, END + 1)] == [0, 1, 1, 0, 1, 1, 0]
    assert found.at(9.0, 0.02) is None
    assert found.at(5.0, 0.02) is not None


def test_a_leaning_body_is_turned_as_the_frames_are_rendered() -> None:
    rng = np.random.default_rng(0)
    pitch, roll = rng.normal(0, 0.3, (2, 20))
    found = leaned(pitch, roll)
    np.testing.assert_allclose(found, attitude(roll, pitch, np.zeros(20)), atol=1e-15)
    np.testing.assert_allclose(found[3], rocked(float(pitch[3]), float(roll[3]))[:3, :3], atol=1e-15)


def numeric_turn(pitch: float, roll: float, by: Array) -> Array:
    """The turn (3,) about the level axes for a change of pitch and roll along `by` (2,)."""
    ends = [leaned(pitch + way * by[0], roll + way * by[1]) for way in (-1e-6, 1e-6)]
    skew = (ends[1] - ends[0]) / 2e-6 @ leaned(pitch, roll).T
    return np.array([skew[2, 1], skew[0, 2], skew[1, 0]])


def test_what_is_left_is_a_turn_about_the_level_axes() -> None:
    found = replace(found_in(rocked_drive(3)), angles=np.full((len(rocked_drive(3).imu), 2), [0.2, -0.1]))
    tilt = found.at(5.0, 10.0)  # so wide that the levels are all
    assert tilt is not None
    row = int(np.searchsorted(found.t, 5.0))
    for of, axis in zip(tilt.leaning, np.eye(2), strict=True):
        sd = found.sd[row] @ axis
        np.testing.assert_allclose(of, sd * numeric_turn(0.2, -0.1, axis), rtol=1e-3, atol=1e-7)
