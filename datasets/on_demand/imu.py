"""The inertial measurement unit of a rendered robot, for a recording: with noise and bias by the gyro's options.

A level robot's gyro turns about the vertical alone, and its accelerometer measures gravity and the robot's own
acceleration. One that rocks turns about the wheels' axis and along it as well, and gravity is then along all axes of
the unit, which is at the robot's origin, about which the body rocks.
"""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from ...core.se2 import Array
from ...frontend.inertial.imu import GRAVITY, Imu
from ...frontend.inertial.levels import OFFSET
from ...frontend.inertial.tilts import leaned
from .gyro import DEGREE, WorldGyro

RATE = 100.0  # Hz
SHAKES = 0.05  # m/s^2, white noise of the accelerometer while the robot drives
SOON = 1e-3  # s over which the true motion is differentiated


Drive = Callable[[Array], tuple[Array, Array]]
"""Times (n,), s -> the true poses (n, 3) and the distance driven (n,), m."""


class Body(Protocol):
    """A body that rocks."""

    def at(self, t: Array) -> Array:
        """(n, 2) rad, pitch and roll at `t` (n,), s."""
        ...

    def rates(self, t: Array) -> Array:
        """(n, 2) rad/s, how fast they change."""
        ...


def imu_of(
    options: WorldGyro, drive: Drive, end: float, rng: np.random.Generator, body: Body | None = None
) -> Imu | None:
    """The readings of a robot from 0 to `end`, s; None without a gyro. Without a `body` it is level.

    The accelerometer of one that rocks has an offset that nobody calibrated.
    """
    if not options.gyro:
        return None
    starting, walking, turning, shaking = rng.spawn(4)
    t = np.arange(int(np.ceil(end * RATE)) + 1) / RATE
    n = len(t)
    start = 1.0 if options.gyro_start == "given" else starting.standard_normal()
    walk = options.gyro_walk * DEGREE / np.sqrt(RATE) * walking.standard_normal(n)
    bias = options.gyro_bias * DEGREE * start + np.cumsum(walk)
    gyro = options.gyro * DEGREE * np.sqrt(RATE) * turning.standard_normal((n, 3))
    rate = _rate(lambda at: np.unwrap(drive(at)[0][:, 2]), t)
    way = _rate(lambda at: drive(at)[1], t)
    accel = np.column_stack((np.gradient(way, t), way * rate, np.full(n, GRAVITY)))
    noise = SHAKES * shaking.standard_normal((n, 3))
    if body is None:
        gyro[:, 2] += rate + bias
        return Imu(t, gyro, accel + noise)
    pitch, roll = body.at(t).T
    pitching, rolling = body.rates(t).T
    gyro += np.column_stack(
        (
            rolling - rate * np.sin(pitch),
            pitching * np.cos(roll) + rate * np.cos(pitch) * np.sin(roll),
            rate * np.cos(pitch) * np.cos(roll) - pitching * np.sin(roll) + bias,
        )
    )
    accel = np.einsum("nji,nj->ni", leaned(pitch, roll), accel)
    return Imu(t, gyro, accel + noise + OFFSET * shaking.standard_normal(3))


def _rate(along: Callable[[Array], Array], t: Array) -> Array:
    """(n,) the derivative at `t` (n,) of what changes in time; at 0, where the drive begins, that of what follows."""
    return (along(t + SOON) - along(np.maximum(t - SOON, 0.0))) / (t + SOON - np.maximum(t - SOON, 0.0))
