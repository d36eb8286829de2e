"""Levels by gravity: on hills, while a robot speeds up and brakes, as far off as stated."""

from dataclasses import replace

import numpy as np
import pytest

from inertial_drives import drive
from refusals import refused
from slamduel.frontend.inertial.imu import GRAVITY, Imu
from slamduel.frontend.inertial.levels import levels
from slamduel.frontend.inertial.standing import standing
from tiers import first_quick


@pytest.mark.parametrize("seeds", first_quick([range(3), range(3, 20)]))
def test_levels_are_as_far_off_as_stated(seeds: range) -> None:
    nees, plain, errors = [], [], []
    for seed in seeds:
        one = drive(seed)
        found = levels(one.imu, standing(one.imu))
        off = np.stack((found.roll - one.roll, found.pitch - one.pitch))
        nees.append((off**2 / np.stack((found.roll_sd, found.pitch_sd)) ** 2).mean())
        errors.append((off**2).mean())
        accel = one.imu.accel
        assert accel is not None
        by_accel = np.stack((np.arctan2(accel[:, 1], accel[:, 2]), np.arcsin(np.clip(-accel[:, 0] / GRAVITY, -1, 1))))
        plain.append(((by_accel - np.stack((one.roll, one.pitch))) ** 2).mean())
    assert 0.2 < np.mean(nees) < 1.5
    assert np.sqrt(np.mean(errors)) < 0.015  # rad
    assert np.mean(errors) < np.mean(plain) / 10


def test_a_known_speed_takes_the_robots_acceleration_off() -> None:
    one = drive(1)
    stood = standing(one.imu)
    with_speed, without = levels(one.imu, stood, one.speed), levels(one.imu, stood)
    assert with_speed.push < without.push
    assert ((with_speed.pitch - one.pitch) ** 2).mean() < ((without.pitch - one.pitch) ** 2).mean() / 2


def test_a_robot_that_stands_on_a_slope_has_its_slope() -> None:
    t = np.arange(500) / 100
    roll, pitch = 0.1, -0.2
    up = GRAVITY * np.array([-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)])
    rng = np.random.default_rng(0)
    imu = Imu(t, rng.normal(0, 0.002, (500, 3)), up + rng.normal(0, 0.02, (500, 3)))
    found = levels(imu, standing(imu))
    np.testing.assert_allclose([found.roll[-1], found.pitch[-1]], [roll, pitch], atol=2e-3)
    assert found.pitch_sd[-1] < 0.01


def test_a_gap_widens_the_levels_and_they_come_back() -> None:
    one = drive(2)
    kept = (one.t < 30) | (one.t > 35)
    assert one.imu.accel is not None
    imu = Imu(one.t[kept], one.imu.gyro[kept], one.imu.accel[kept])
    found, whole = levels(imu), levels(one.imu)
    after = int(np.searchsorted(imu.t, 35.0))
    assert found.roll_sd[after] > 2 * whole.roll_sd[kept][after]
    late = imu.t > 45
    np.testing.assert_allclose(found.roll[late], whole.roll[kept][late], atol=0.03)


def test_without_an_accelerometer_there_are_none() -> None:
    refused("has no accelerometer, expected one", levels, replace(drive(0, 5.0).imu, accel=None))
