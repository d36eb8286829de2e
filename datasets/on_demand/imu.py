"""The inertial measurement unit of a rendered robot, for a recording: with noise and bias by the gyro's options.

The robot is level: its gyro turns about the vertical alone, and its accelerometer measures gravity and the robot's own
acceleration.
"""

from collections.abc import Callable

import numpy as np

from ...core.se2 import Array
from ...frontend.inertial.imu import GRAVITY, Imu
from .gyro import DEGREE, WorldGyro

RATE = 100.0  # Hz
SHAKES = 0.05  # m/s^2, white noise of the accelerometer while the robot drives
SOON = 1e-3  # s over which the true motion is differentiated


Drive = Callable[[Array], tuple[Array, Array]]
"""Times (n,), s -> the true poses (n, 3) and the distance driven (n,), m."""


def imu_of(options: WorldGyro, drive: Drive, end: float, rng: np.random.Generator) -> Imu | None:
    """The readings of a robot from 0 to `end`, s; None without a gyro."""
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
    gyro[:, 2] += rate + bias
    way = _rate(lambda at: drive(at)[1], t)
    accel = np.column_stack((np.gradient(way, t), way * rate, np.full(n, GRAVITY)))
    return Imu(t, gyro, accel + SHAKES * shaking.standard_normal((n, 3)))


def _rate(along: Callable[[Array], Array], t: Array) -> Array:
    """(n,) the derivative at `t` (n,) of what changes in time; at 0, where the drive begins, that of what follows."""
    return (along(t + SOON) - along(np.maximum(t - SOON, 0.0))) / (t + SOON - np.maximum(t - SOON, 0.0))
