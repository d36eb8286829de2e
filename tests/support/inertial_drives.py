"""A drive over hills, with stops, and what an inertial measurement unit on the robot would measure."""

from typing import NamedTuple

import numpy as np

from slamduel.core.se2 import Array
from slamduel.datasets.on_demand.rocking import Rocking
from slamduel.frontend.inertial.imu import GRAVITY, Imu
from slamduel.frontend.wheels.track import Poses

FIELD = np.array([2e-5, 0.0, -4e-5])
"""T, of the Earth, north being x."""


class Drive(NamedTuple):
    """The truth of a drive and its readings."""

    t: Array  # (n,) s
    roll: Array  # (n,) rad
    pitch: Array
    heading: Array
    speed: Array  # (n,) m/s
    bias: Array  # (3,) rad/s
    imu: Imu

    @property
    def odometry(self) -> Poses:
        """What wheels without errors tell on the plane."""
        way = np.diff(self.t, prepend=self.t[0]) * self.speed
        x, y = (np.cumsum(way * one) for one in (np.cos(self.heading), np.sin(self.heading)))
        return Poses(self.t, np.column_stack((x, y, self.heading)))


def attitude(roll: Array, pitch: Array, heading: Array) -> Array:
    """(n, 3, 3) rotations from the robot to the world: yaw, pitch, roll."""
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(one), np.sin(one)) for one in (roll, pitch, heading))
    rows = (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, cp * sr, cp * cr),
    )
    return np.moveaxis(np.array(rows), 2, 0)


def drive(
    seed: int = 0,
    seconds: float = 60.0,
    hz: float = 100.0,
    hills: float = 1.0,
    noise: float = 1.0,
    sway: float = 0.0,
    ramp: float = 0.0,
) -> Drive:
    """A drive whose speed and turning rate change every few seconds, by at most 0.8 m/s^2 and 1 rad/s^2.

    On its springs the body rocks by `sway`, rad, in pitch and in roll. From 45 to 60 % of the time it is on a ramp that
    goes up by `ramp`, rad.

    The gyro has a bias of some 0.01 rad/s and noise of 0.004 rad/s, the accelerometer an offset of 0.05 m/s^2 and noise
    of 0.3 while the robot drives and of 0.05 while it stands, `noise` times.
    """
    rng = np.random.default_rng(seed)
    n = int(seconds * hz)
    t, speed, turning = np.arange(n) / hz, np.zeros(n), np.zeros(n)
    goal, change = (0.0, 0.0), 5.0
    for k in range(1, n):
        if t[k] >= change:
            goal = (0.0, 0.0) if rng.random() < 0.3 else (rng.uniform(0.2, 1.2), rng.normal(0, 0.4))
            change = t[k] + rng.uniform(2, 6)
        speed[k] = speed[k - 1] + np.clip(goal[0] - speed[k - 1], -0.8 / hz, 0.8 / hz)
        turning[k] = turning[k - 1] + np.clip(goal[1] - turning[k - 1], -1.0 / hz, 1.0 / hz)
    way = np.cumsum(speed) / hz
    pitch = hills * (0.12 * np.sin(way / 4) + 0.02 * np.sin(1.1 * way))
    roll = hills * 0.08 * np.sin(way / 3 + 1)
    if sway:
        rocking = Rocking.drawn(sway, np.random.default_rng([seed, 1])).at(t)
        pitch, roll = pitch + rocking[:, 0], roll + rocking[:, 1]
    if ramp:
        pitch = pitch - ramp * np.interp(t / seconds, (0.44, 0.45, 0.6, 0.61), (0.0, 1.0, 1.0, 0.0))
    heading = np.append(0.0, np.cumsum((turning[1:] + turning[:-1]) / 2 / hz))
    rolling, pitching = (np.gradient(one, t) for one in (roll, pitch))
    gyro = np.column_stack(
        (
            rolling - turning * np.sin(pitch),
            pitching * np.cos(roll) + turning * np.cos(pitch) * np.sin(roll),
            turning * np.cos(pitch) * np.cos(roll) - pitching * np.sin(roll),
        )
    )
    turned = attitude(roll, pitch, heading)
    force = np.gradient(turned[:, :, 0] * speed[:, None], t, axis=0) + np.array([0.0, 0.0, GRAVITY])
    accel = np.einsum("nij,ni->nj", turned, force)
    mag = np.einsum("nij,i->nj", turned, FIELD)
    bias = noise * rng.normal(0, 0.01, 3)
    gyro = gyro + bias + noise * rng.normal(0, 0.004, gyro.shape)
    shaking = np.where(speed > 0, 0.3, 0.05)[:, None]
    accel = accel + noise * (rng.normal(0, 0.05, 3) + shaking * rng.normal(0, 1, accel.shape))
    return Drive(t, roll, pitch, heading, speed, bias, Imu(t, gyro, accel, mag))
