"""A gyro's turns beside the odometry of a log: as far off as stated, wrapped, and each reading once."""

from dataclasses import replace

import numpy as np
import pytest

from inertial_drives import Drive, drive
from slamduel.core.factors import Log, Prior
from slamduel.core.factors.check import check
from slamduel.core.gyro import Gyro
from slamduel.core.se2 import Array, between, wrap
from slamduel.frontend.inertial.imu import Imu
from slamduel.frontend.inertial.log import NOTE, UNKNOWN, with_turns
from slamduel.frontend.inertial.standing import Standing, longest_stand, standing
from slamduel.frontend.inertial.turns import WITHOUT
from slamduel.frontend.inertial.words import about_turns


def log_at(at: Array, one: Drive) -> Log:
    """A log with the wheels' motions between the times `at`."""
    poses = np.column_stack([np.interp(at, one.t, column) for column in one.odometry.poses.T])
    delta = np.concatenate((np.full((1, 3), np.nan), between(poses[:-1], poses[1:])))
    none = np.zeros(0, np.int64)
    cov = np.full((len(at), 3, 3), 1e-4) * np.eye(3)
    return Log.from_arrays(
        "drive", Prior(poses[0], 1e-6 * np.eye(3)), at, delta, cov, none, none, np.zeros((0, 2)), np.zeros((0, 2, 2))
    )


def turned(log: Log) -> Gyro:
    check(log, "drive")
    assert log.gyro is not None
    return log.gyro


@pytest.mark.parametrize("seed", range(3))
def test_turns_are_the_robots_with_the_bias_of_its_stand(seed: int) -> None:
    one = drive(seed, hills=0.0)
    stood, at = standing(one.imu, one.odometry), np.arange(0, 59, 0.7)
    gyro = turned(with_turns(log_at(at, one), one.imu, stood))
    heading = np.interp(at, one.t, np.unwrap(one.heading))
    mean, sd = gyro.prior
    assert abs(mean - one.bias[2]) < 4 * sd
    stand = longest_stand(one.imu, stood)
    assert stand is not None
    off = wrap(gyro.turn - one.bias[2] * gyro.dt - np.diff(heading)[gyro.step - 1])
    assert 0.5 < (off**2 / gyro.var).mean() < 2


def test_no_reading_of_the_stand_is_in_a_turn_as_well() -> None:
    one = drive(0, hills=0.0)
    stood, at = standing(one.imu, one.odometry), np.arange(0.1, 59, 0.37)
    stand = longest_stand(one.imu, stood)
    assert stand is not None
    begin, end = stand.interval
    shifted = one.imu.gyro.copy()
    within = (one.t > begin) & (one.t < end)
    shifted[within] += 0.5  # what these readings say, turns do not know
    log = log_at(at, one)
    gyro, other = (turned(with_turns(log, imu, stood)) for imu in (one.imu, replace(one.imu, gyro=shifted)))
    assert other.prior.mean > gyro.prior.mean + 0.4
    np.testing.assert_allclose(other.turn, gyro.turn, atol=1e-12)
    np.testing.assert_allclose(gyro.dt.sum(), np.ptp(at) - min(end, at[-1]) + max(begin, at[0]))
    inside = 1 + np.flatnonzero((at[:-1] >= begin) & (at[1:] <= end))
    assert len(inside)
    assert not np.isin(inside, gyro.step).any()


def test_a_turn_of_more_than_half_a_turn_is_wrapped() -> None:
    t = np.arange(0, 10, 0.02)
    imu = Imu(t, np.column_stack((0 * t, 0 * t, np.full(len(t), 1.0))))
    log = log_at(np.array([0.0, 4.0, 8.0]), drive(0, 20.0))
    gyro = turned(with_turns(log, imu, Standing(np.zeros((0, 2)), 0.0, "wheels", None, None, None)))
    np.testing.assert_allclose(gyro.turn, [4 - 2 * np.pi] * 2)
    assert gyro.prior == UNKNOWN


def test_a_step_with_a_gap_has_no_turn_and_the_note_says_how_many() -> None:
    one = drive(0, 20.0, hills=0.0)
    kept = (one.t < 8) | (one.t > 11)
    imu = Imu(one.t[kept], one.imu.gyro[kept])
    at = np.arange(0.0, 20.0, 1.0)
    log = with_turns(log_at(at, one), imu, Standing(np.zeros((0, 2)), 0.0, "wheels", None, None, None))
    lost = np.setdiff1d(np.arange(1, len(at)), turned(log).step)
    np.testing.assert_array_equal(lost, [8, 9, 10, 11, 12])
    counts = {"turns": 14, "steps_without": 6, "at_first": 1, "in_gaps": 5}
    assert log.notes[NOTE] == {**counts, "bias": "assumed", "bias_at_first": list(UNKNOWN)}
    (said,) = about_turns(log.notes)
    assert said.startswith("turns by the gyro at 14 of 20 steps; 6 have none: 1 at the start, with nothing before it, ")
    assert said.endswith(", 5 with a gap in the readings")


def test_every_reason_of_a_step_without_a_turn_is_counted_once() -> None:
    """Readings from 1.5 to 18 s: a gap from 8 to 11 s, the range's end at 14.5 s, and a stand from 3 to 6 s."""
    t = np.arange(1.5, 18.0, 0.02)
    t = t[(t < 8) | (t > 11)]
    imu = Imu(t, np.zeros((len(t), 3)), clipped=np.abs(t - 14.5) < 0.1)
    at = np.arange(0.0, 20.0, 1.0)
    stood = Standing(np.array([[2.9, 6.1]]), 0.2, "wheels", np.zeros(3), np.full(3, 1e-3), 1e-6)
    found = with_turns(log_at(at, drive(0, 20.0)), imu, stood)
    told = found.notes[NOTE]
    gyro = turned(found)
    assert told["turns"] == len(gyro)
    assert {name: told[name] for name in ("at_first", "outside", "in_gaps", "at_end_of_range")} == {
        "at_first": 1,
        "outside": 4,
        "in_gaps": 5,
        "at_end_of_range": 1,
    }
    assert told["standing"] == 3
    reasons = sum(told[name] for name in ("at_first", *WITHOUT))
    assert told["steps_without"] == reasons == len(at) - len(gyro)


def test_readings_at_other_times_leave_the_factors_as_they_are_and_are_counted() -> None:
    one = drive(0, 20.0)
    log = log_at(np.arange(100.0, 105.0), one)
    found = with_turns(log, one.imu, standing(one.imu))
    assert found.digest == log.digest
    assert found.notes[NOTE] == {"turns": 0, "steps_without": 5, "at_first": 1, "outside": 4}


def test_a_log_whose_first_step_is_no_reading_has_its_turns_after_that() -> None:
    one = drive(0, 20.0)
    log = log_at(np.arange(0.0, 15.0, 0.5), one)
    first = turned(with_turns(log, one.imu, standing(one.imu), first=4)).step[0]
    assert first > 4
