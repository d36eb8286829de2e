"""A body's tilts by gravity: as far off as stated, without the unit's own tilt, and never worse than its rocking."""

from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from inertial_drives import attitude
from inertial_drives import drive as lively_drive
from slamduel.core.se2 import Array
from slamduel.datasets.on_demand.gyro import WorldGyro
from slamduel.datasets.on_demand.imu import imu_of
from slamduel.datasets.on_demand.rocking import Rocking
from slamduel.datasets.rendering.disturbances import rocked
from slamduel.datasets.worlds.aruco_room import ENCODER
from slamduel.datasets.worlds.rendered_world import LOOP
from slamduel.datasets.worlds.wheeled_robot import count, drive
from slamduel.frontend.inertial.imu import Imu
from slamduel.frontend.inertial.levels import FIRST, LOST_AFTER, begins
from slamduel.frontend.inertial.tilts import STEEP, UNSURE, Tilts, leaned, speeds, tilts, unlevelled
from slamduel.frontend.wheels.motion import Drift
from slamduel.frontend.wheels.ticks import Wheels
from slamduel.frontend.wheels.track import Track, TrackNoise
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


def without(imu: Imu, begin: float, end: float) -> Imu:
    """The readings without those between two times, s."""
    assert imu.accel is not None
    kept = (imu.t <= begin) | (imu.t >= end)
    return Imu(imu.t[kept], imu.gyro[kept], imu.accel[kept])


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
    found = found_in(one, without(one.imu, 8, 10))
    assert [found.covers(t) for t in (-0.1, 0.0, 7.9, 9.0, 10.5, END, END + 1)] == [0, 1, 1, 0, 1, 1, 0]
    assert not found_in(one).unsure.any()
    assert found.at(9.0, 0.02) is None
    assert found.at(5.0, 0.02) is not None


RISES = 0.1  # rad


@pytest.mark.parametrize("seed", first_quick(range(8), 2))
def test_on_a_ramp_levels_follow_it_and_a_remark_says_so(seed: int) -> None:
    """By the change of the levels from the plane to the ramp, which the mean has no part in, and by all of them."""
    one, remarks = lively_drive(seed, 40.0, hills=0.0, sway=0.02, ramp=RISES), list[str]()
    found = tilts(one.imu, None, Track(one.t, one.odometry.poses, TrackNoise()), remarks)
    assert found is not None
    off = found.angles - np.column_stack((one.pitch, one.roll))
    ramp, plane = ((one.t > 0.46 * 40) & (one.t < 0.59 * 40)), (one.t > 3) & (one.t < 0.43 * 40)
    climbed = found.angles[ramp].mean(axis=0) - found.angles[plane].mean(axis=0)
    sways = np.column_stack((one.pitch, one.roll))
    expected = sways[ramp].mean(axis=0) - sways[plane].mean(axis=0)
    np.testing.assert_allclose(climbed, expected, atol=np.deg2rad(0.5))
    assert expected[0] == pytest.approx(-RISES, abs=0.01)
    assert (off**2 / found.sd**2).mean() < 3.0
    assert np.abs(off[:, 0].mean()) > np.deg2rad(0.4)  # the mean that was taken off has the ramp in it, and
    assert found.sd[:, 0].mean() > np.deg2rad(0.4)  # each level is stated so
    (remark,) = remarks
    assert "imu: the robot leans by up to " in remark
    assert " s in all, as on a ramp: it is levelled there, but the wheels' way is along the slope" in remark


@pytest.mark.parametrize("seed", first_quick(range(8), 2))
def test_without_a_ramp_nothing_is_said_of_one(seed: int) -> None:
    one, remarks = lively_drive(seed, 30.0, hills=0.0, sway=0.02), list[str]()
    motion = Track(one.t, one.odometry.poses, TrackNoise())
    assert tilts(one.imu, None, motion, remarks) is not None
    assert tilts(without(one.imu, 11.0, 13.0), None, motion, remarks) is not None
    assert remarks == []


def test_a_recording_shorter_than_a_ramp_has_none() -> None:
    one, remarks = lively_drive(0, 30.0, hills=0.0, sway=0.02), list[str]()
    for end in (1.0, 1.9):
        found = tilts(without(one.imu, end, 99.0), None, Track(one.t, one.odometry.poses, TrackNoise()), remarks)
        assert found is not None
        assert np.isfinite(found.sd).all()
    assert remarks == []


GAPS = (0.5, 2.0, 5.0)  # s
AFTER = 2.0  # s after a gap in which levels are judged


@cache
def gap_squares(seed: int, places: int) -> tuple[list[float], list[float], list[float]]:
    """Of gaps at random places of a lively drive, by their length: the mean normalised squared error of the levels in
    `AFTER` s after each, and in the first of these that count; and the furthest off, rad, of one that counts."""
    one, rng = lively_drive(seed, 30.0, hills=0.0, sway=0.02), np.random.default_rng(100 + seed)
    motion = Track(one.t, one.odometry.poses, TrackNoise())
    nees, first, furthest = [], [], []
    for gap in GAPS:
        squares, soon, off_by = [], [], []
        for begin in rng.uniform(2.0, one.t[-1] - gap - AFTER, places).tolist():
            found = tilts(without(one.imu, begin, begin + gap), None, motion, [])
            assert found is not None
            off = found.angles - np.column_stack([np.interp(found.t, one.t, way) for way in (one.pitch, one.roll)])
            after = (found.t >= begin + gap) & (found.t < begin + gap + AFTER)
            used = np.flatnonzero(after & ~found.unsure)
            squares.append((off[after] ** 2 / found.sd[after] ** 2).mean())
            soon.append((off[used[:20]] ** 2 / found.sd[used[:20]] ** 2).mean())
            off_by.append(float(np.abs(off[used]).max()))
        nees.append(float(np.mean(squares)))
        first.append(float(np.mean(soon)))
        furthest.append(max(off_by))
    return nees, first, furthest


@pytest.mark.slow
def test_levels_after_a_gap_are_as_far_off_as_stated() -> None:
    """Of each length of a gap, 8 places on each of 8 drives."""
    nees, first, furthest = (np.array(one) for one in zip(*(gap_squares(seed, 8) for seed in range(8)), strict=True))
    for one in (nees, first):
        assert (one.mean(axis=0) > 0.5).all()
        assert (one.mean(axis=0) < 2.0).all()
    assert furthest.max() < np.deg2rad(4.0)


def test_levels_after_a_few_gaps_are_not_further_off_than_stated() -> None:
    nees, first, furthest = (np.array(one) for one in zip(*(gap_squares(seed, 1) for seed in range(2)), strict=True))
    assert nees.mean() < 2.0
    assert first.mean() < 2.0
    assert furthest.max() < np.deg2rad(4.0)


@pytest.mark.parametrize("gap", GAPS)
def test_after_a_gap_a_level_counts_once_it_is_certain_enough(gap: float) -> None:
    one = lively_drive(2, 30.0, hills=0.0, sway=0.02)
    motion, end = Track(one.t, one.odometry.poses, TrackNoise()), 12.0 + gap
    found = tilts(without(one.imu, 12.0, end), None, motion, [])
    assert found is not None
    after = int(np.searchsorted(found.t, end))
    unsure = found.unsure[after:]
    assert unsure[0]
    settled = int(np.argmin(unsure))
    assert not unsure[settled:].any()
    assert found.t[after + settled] < end + FIRST
    at = [float(found.t[after]), float(found.t[after + settled]), 20.0]
    assert [found.covers(t) for t in at] == [False, True, True]
    assert (np.diff(found.own[[after, after + 5, after + 50]]) < 0).all()
    assert found.own[after] > UNSURE * np.median(found.own)
    # Neither the mean nor the rocking has a part in them.
    np.testing.assert_allclose(found.mean, found_mean_of(found), atol=1e-12)
    np.testing.assert_allclose(found.rocking, 0.02, atol=0.008)


def found_mean_of(found: Tilts) -> Array:
    """(2,) rad, that of the levels that are certain enough."""
    return np.column_stack((found.levels.pitch, found.levels.roll))[~found.unsure].mean(axis=0)


@pytest.mark.parametrize(("gap", "anew"), [(0.15, False), (LOST_AFTER - 0.02, False), (LOST_AFTER + 0.02, True)])
def test_the_filter_begins_anew_after_a_gap_in_which_a_level_is_lost(gap: float, anew: bool) -> None:
    imu = without(rocked_drive(0).imu, 8.0, 8.0 + gap)
    rows = begins(imu).tolist()
    assert rows == ([0, int(np.searchsorted(imu.t, 8.0 + gap))] if anew else [0])


def test_what_is_not_levelled_is_counted_by_its_reason() -> None:
    found = found_in(rocked_drive(2), without(rocked_drive(2).imu, 8, 10))
    found = replace(found, unsure=(found.t > 9) & (found.t < 10.5))
    unfelt, unsure = found.remarks([-1.0, 5.0, 9.0, 10.2, 10.3, 11.0], "frames", "so be it")
    assert unfelt == "imu: has no readings around the times of 2 of 6 frames, which are not levelled: so be it"
    assert unsure.startswith("imu: soon after a gap pitch and roll are known to no better than ")
    assert unsure.endswith(" degrees at the times of 2 of 6 frames, which are not levelled: so be it")
    assert found.remarks([5.0, 11.0], "frames", "so be it") == []


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
