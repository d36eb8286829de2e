"""Drives in the open, with wheels and what a GPS receiver and a magnetometer on the robot would measure."""

from typing import NamedTuple

import numpy as np

from slamduel.core.factors import Log, Prior
from slamduel.core.se2 import Array, act, compose
from slamduel.frontend.inertial.imu import GRAVITY, Imu
from slamduel.frontend.wheels.track import Track, TrackNoise
from slamduel.frontend.world.measured import Measured, positions

NOISE = TrackNoise(forward=0.01, turning=0.01, turning_by_turn=0.01)
ANTENNA = np.array([0.3, -0.1])
FIELD = 2e-5  # T, horizontal
DECLINATION = 0.05
START = np.array([12.0, -7.0, 0.8])


class Outdoors(NamedTuple):
    """The truth of a drive and its readings."""

    t: Array  # (n,) s, of the wheels' readings
    poses: Array  # (n, 3) true ones
    motion: Track
    log: Log  # of the wheels alone, a step every 0.5 s
    gps: Measured  # at times between the steps
    imu: Imu  # with a magnetometer

    def true(self, t: Array) -> Array:
        """The poses (m, 3) at `t` (m,)."""
        return np.column_stack([np.interp(t, self.t, column) for column in self.poses.T])


def outdoors(seed: int, seconds: float = 60.0, sd: float = 0.05, hz: float = 2.3) -> Outdoors:
    """A drive of loops at 1 m/s; positions are `sd`, m, off."""
    rng = np.random.default_rng(seed)
    t = np.arange(int(50 * seconds)) / 50
    heading = START[2] + 0.5 * t + 0.8 * np.sin(0.4 * t)  # not wrapped
    moved = np.column_stack((np.full(len(t) - 1, 1 / 50), np.zeros(len(t) - 1), np.diff(heading)))
    poses = np.array(_summed(START, moved))
    poses[:, 2] = heading
    way, turn = np.abs(moved[:, 0]), np.abs(moved[:, 2])
    moved[:, 0] += NOISE.forward * np.sqrt(way) * rng.standard_normal(len(way))
    moved[:, 2] += np.sqrt(NOISE.turning**2 * way + NOISE.turning_by_turn**2 * turn) * rng.standard_normal(len(way))
    motion = Track(t, np.array(_summed(np.zeros(3), moved)), NOISE)
    at = t[::25]
    ends = list(zip(at[:-1].tolist(), at[1:].tolist(), strict=True))
    told = [motion.odometry(*one) for one in ends]
    nothing = np.zeros(0, np.int64)
    log = Log.from_arrays(
        "outdoors", Prior(START, 1e-6 * np.eye(3)), at,
        np.concatenate((np.full((1, 3), np.nan), [one.delta for one in told])),
        np.concatenate((np.full((1, 3, 3), np.nan), [one.cov for one in told])),
        nothing, nothing, np.zeros((0, 2)), np.zeros((0, 2, 2)),
    )  # fmt: skip
    fixed = np.arange(0.21, float(at[-1]), 1 / hz)
    true = np.column_stack([np.interp(fixed, t, column) for column in poses.T])
    xy = act(true, np.tile(ANTENNA, (len(fixed), 1))) + sd * rng.standard_normal((len(fixed), 2))
    gps = positions(fixed, xy, np.tile(sd**2 * np.eye(2), (len(fixed), 1, 1)), ANTENNA)
    return Outdoors(t, poses, motion, log, gps, _imu(t, heading))


def _imu(t: Array, heading: Array) -> Imu:
    """The readings of a level unit at rest, whose magnetometer turns by `heading` (n,)."""
    north = np.pi / 2 - DECLINATION - heading
    mag = np.column_stack((FIELD * np.cos(north), FIELD * np.sin(north), np.full(len(t), -4e-5)))
    return Imu(t, np.zeros((len(t), 3)), np.tile([0, 0, GRAVITY], (len(t), 1)), mag)


def _summed(start: Array, moved: Array) -> list[Array]:
    path = [start]
    for one in moved:
        path.append(compose(path[-1], one))
    return path
