"""Standing still, by wheels and by quiet readings, and the bias of the gyro from it."""

import numpy as np
import pytest

from inertial_drives import drive
from slamduel.frontend.inertial.imu import Imu
from slamduel.frontend.inertial.standing import standing, still_times
from slamduel.frontend.wheels.commands import Speeds
from slamduel.frontend.wheels.ticks import Ticks


@pytest.mark.parametrize("by", ["wheels", "quiet readings"])
def test_the_bias_is_that_while_the_robot_stands(by: str) -> None:
    off = []
    for seed in range(8):
        one = drive(seed)
        found = standing(one.imu, one.odometry if by == "wheels" else None)
        assert found.by == by
        assert found.bias is not None
        assert found.sd is not None
        off.append((found.bias - one.bias) / found.sd)
        at = np.concatenate([one.t[(one.t >= begin) & (one.t <= end)] for begin, end in found.intervals])
        assert (np.interp(at, one.t, one.speed) == 0).mean() > 0.95
        assert 0.3 * (one.speed == 0).mean() < found.share <= (one.speed == 0).mean() + 0.02
        assert found.noise == pytest.approx(0.004**2 / 100, rel=0.6)
    assert 0.4 < np.mean(np.square(off)) < 2


def test_a_robot_that_never_stands_has_no_bias() -> None:
    one = drive(0)
    moving = one.speed > 0.1
    longest = max(np.split(np.flatnonzero(moving), np.flatnonzero(np.diff(np.flatnonzero(moving)) > 1) + 1), key=len)
    imu = Imu(one.t[longest], one.imu.gyro[longest], None if one.imu.accel is None else one.imu.accel[longest])
    assert standing(imu, one.odometry).bias is None
    assert len(standing(imu, one.odometry).intervals) == 0


def test_a_robot_that_is_turned_by_hand_while_its_wheels_stand_does_not_stand() -> None:
    one = drive(3, 60.0)
    t, gyro = one.t, one.imu.gyro.copy()
    stood = standing(one.imu, one.odometry)
    assert stood.bias is not None
    begin = stood.intervals[0, 0]
    pushed = (t > begin + 1) & (t < begin + 2)
    gyro[pushed, 2] += 0.1
    found = standing(Imu(t, gyro), one.odometry)
    assert found.bias is not None
    assert abs(found.bias[2] - stood.bias[2]) < 1e-3


def test_wheels_stand_where_counts_and_commands_say_so() -> None:
    t = np.arange(0, 10, 0.1)
    moves = (t > 3) & (t < 6)
    counts = np.cumsum(np.column_stack((moves, moves)) * 5.0, axis=0, dtype=np.float64)
    by_counts = still_times(Ticks(t, counts))
    by_commands = still_times(Speeds(t, np.column_stack((0.3 * moves, 0 * t))))
    for found in (by_counts, by_commands):
        np.testing.assert_allclose(found, [[0.25, 2.75], [6.25, 9.65]], atol=0.11)
