"""The systematic errors of a robot's sensor and wheels, and a log that is corrected for them."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...core.factors import Log, Prior
from ...core.gyro import Gyro
from ...core.mounting import Mounting
from ...core.partial import RANGE, PartialTable
from ...core.se2 import Array, wrap
from .clock import motions_after


class Systematic(NamedTuple):
    """Errors that stay the same all along; 0: none.

    A sensor at (x, y, yaw) in the body's frame, `delay` s late, has ranges (1 + range_scale) r + range_offset and
    bearings (1 + bearing_scale) b. Odometry has (1 + wheel_scale) of the way, along the direction of motion, which is
    `heading` beside the robot's heading, and (1 + turn_scale) of the turn, and `drift` rad more for each metre ahead;
    all that `lag` s late, or ahead of the motion, as commands are, where it is negative. The turns of a gyro beside it,
    together with which they are found, have the same errors of turns, and are in time.
    """

    x: float = 0.0  # m
    y: float = 0.0  # m
    yaw: float = 0.0  # rad
    delay: float = 0.0  # s
    range_offset: float = 0.0  # m
    range_scale: float = 0.0
    bearing_scale: float = 0.0
    wheel_scale: float = 0.0
    turn_scale: float = 0.0
    drift: float = 0.0  # rad/m
    heading: float = 0.0  # rad
    lag: float = 0.0  # s


NAMES = Systematic._fields
SENSOR = NAMES[:7]
"""Those of the sensor; the others are of the wheels."""

NEAREST = 1e-3
"""m; least range that is left after an offset is taken off."""


def corrected(log: Log, errors: Systematic) -> Log:
    """The log as a sensor at the body's origin, in time, and wheels without these errors give it."""
    if errors == Systematic():
        return log
    delta, J = true_motions(log.delta, errors)
    delta_cov = J @ log.delta_cov @ J.T
    if errors.lag:
        delta, delta_cov = motions_after(log.t, delta, delta_cov, errors.lag)
    scale = np.array([1 + errors.range_scale, 1 + errors.bearing_scale])
    z = (log.z - np.array([errors.range_offset, 0.0])) / scale
    z[:, 0] = np.maximum(z[:, 0], NEAREST)
    changed = replace(
        log,
        delta=_frozen(delta),
        delta_cov=_frozen((delta_cov + delta_cov.swapaxes(1, 2)) / 2),
        z=_frozen(z),
        z_cov=_frozen(log.z_cov / np.outer(scale, scale)),
        partial=None if log.partial is None else _alone(log.partial, errors),
        gyro=None if log.gyro is None else _turned(log.gyro, log.delta, J[2]),
        prior=_known(log.prior, errors),
    )
    mounting = Mounting(errors.x, errors.y, errors.yaw, errors.delay)
    return changed if mounting == Mounting() else changed.of_sensor(mounting)


def _turned(gyro: Gyro, delta: Array, J: Array) -> Gyro:
    """Turns without the errors of the log's turns, whose derivative by the measured motion is `J` (3,)."""
    ahead = delta[gyro.step, :2] @ J[:2]
    return replace(
        gyro,
        turn=_frozen(wrap(J[2] * gyro.turn + ahead)),
        var=_frozen(J[2] ** 2 * gyro.var),
        dt=_frozen(J[2] * gyro.dt),
    )


def _alone(table: PartialTable, errors: Systematic) -> PartialTable:
    """Ranges and bearings alone without these errors."""
    is_range = table.kind == RANGE
    scale = np.where(is_range, 1 + errors.range_scale, 1 + errors.bearing_scale)
    z = (table.z - np.where(is_range, errors.range_offset, 0.0)) / scale
    return replace(table, z=_frozen(np.where(is_range, np.maximum(z, NEAREST), z)), var=_frozen(table.var / scale**2))


def _known(prior: Prior, errors: Systematic) -> Prior:
    """The prior without scales and the offset of ranges among what is unknown, where they are known now."""
    left = prior.systematic
    left = left._replace(
        range_scale=0.0 if errors.range_scale else left.range_scale,
        range_offset=0.0 if errors.range_offset else left.range_offset,
        wheel_scale=0.0 if errors.wheel_scale else left.wheel_scale,
    )
    return prior if left == prior.systematic else prior._replace(systematic=left)


def true_motions(delta: Array, errors: Systematic) -> tuple[Array, Array]:
    """Motions (n, 3) without the wheels' errors but their lag, and their derivative (3, 3) by what was measured."""
    c, s, k = np.cos(errors.heading), np.sin(errors.heading), 1 / (1 + errors.wheel_scale)
    J = np.array([[c * k, -s, 0.0], [s * k, c, 0.0], [0.0, 0.0, 0.0]])
    turn = 1 / (1 + errors.turn_scale)
    J[2] = -errors.drift * turn * J[0]
    J[2, 2] = turn
    return delta @ J.T, J


def measured_motions(moved: Array, errors: Systematic) -> tuple[Array, Array]:
    """Motions (n, 3) as wheels with these errors measure them, and their derivative (3, 3); undoes `true_motions`."""
    c, s, k = np.cos(errors.heading), np.sin(errors.heading), 1 + errors.wheel_scale
    J = np.array([[c * k, s * k, 0.0], [-s, c, 0.0], [errors.drift, 0.0, 1 + errors.turn_scale]])
    return moved @ J.T, J


def measured_sightings(expected: Array, errors: Systematic) -> tuple[Array, Array]:
    """Ranges and bearings (s, 2) as a sensor with these errors measures them, and their derivative (2,), diagonal."""
    scale = np.array([1 + errors.range_scale, 1 + errors.bearing_scale])
    return expected * scale + np.array([errors.range_offset, 0.0]), scale


def _frozen(values: Array) -> Array:
    values.flags.writeable = False
    return values
