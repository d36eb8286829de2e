"""The turn of a robot between steps: its gyro's rate about the vertical, integrated.

The rate of the heading is (sin(roll) w_y + cos(roll) w_z) / cos(pitch), of Euler angles in the order yaw, pitch, roll:
on a slope the body's z axis alone would turn too little. Between readings the rate changes evenly. A step of which a
part is not known, before the first reading, after the last, in a gap, or beyond the gyro's range, has no turn.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import NamedTuple

import numpy as np

from ...core.se2 import Array, Ints
from .imu import Imu
from .levels import Levels

BIAS_WALK = 1e-4
"""rad/s per root second by which a small gyro's bias drifts: 0.14 degrees/s in ten minutes."""

KNOTS = 5.0  # s at least between two rows at which the bias has moved


WITHOUT = {
    "outside": "before the first reading or after the last one",
    "standing": "while the robot stands, whose readings are in the bias",
    "in_gaps": "with a gap in the readings",
    "at_end_of_range": "with readings at the end of the gyro's range",
}
"""Reasons why a step has no turn, the first that holds, in words behind their number."""


class Turns(NamedTuple):
    """Turns between consecutive steps, where they are known: turn = change of the heading + bias * dt + noise."""

    step: Ints  # (m,) k of a turn from step k - 1 to k
    turn: Array  # (m,) rad, not wrapped
    var: Array  # (m,) rad^2, without that of the bias
    dt: Array  # (m,) s, over which the rate was summed
    walk: Array  # (m,) (rad/s)^2, variance by which the bias has moved since the last row at which it did
    without: Mapping[str, int]  # steps that have none, by the reason, a key of WITHOUT


def turns(
    imu: Imu,
    at: Array,
    levels: Levels | None = None,
    noise: float | None = None,
    bias_walk: float = BIAS_WALK,
    still: Array | None = None,
) -> Turns:
    """The turns between the times `at` (n,), s, strictly increasing.

    `noise` is the density of the gyro's white noise, rad^2/s, as standing still tells it; at least that which the
    readings show. Without `levels` the robot is level all the time. From `still[0]` to `still[1]`, s, it does not turn,
    and no reading counts: a step that is within has no turn.
    """
    rate = yaw_rate(imu, levels)
    over = _summing(at, still)
    unknown = over(partial(integrated_steps, imu.t, np.where(imu.sound, 0.0, np.diff(imu.t))))
    inside = (at[:-1] >= imu.t[0]) & (at[1:] <= imu.t[-1])
    dt = over(lambda to: to)
    gap = over(partial(integrated_steps, imu.t, np.where(imu.missing, np.diff(imu.t), 0.0))) > 0
    step = np.flatnonzero(inside & (unknown == 0) & (dt > 0)) + 1
    lost = inside & (unknown > 0) & (dt > 0)
    reasons = dict(zip(WITHOUT, (~inside, inside & (dt <= 0), lost & gap, lost & ~gap), strict=True))
    density = max(imu.noise, noise or 0.0)
    var = density * dt + over(partial(integrated_steps, imu.t, _bent(imu, rate, density)))
    if levels is not None:
        var = var + _tilted(imu, levels, over)
    angle = over(partial(integrated, imu.t, rate))
    without = {name: int(steps.sum()) for name, steps in reasons.items() if steps.any()}
    return Turns(step, angle[step - 1], var[step - 1], dt[step - 1], _walk(at, step, bias_walk**2), without)


_Sum = Callable[[Callable[[Array], Array]], Array]


def _summing(at: Array, still: Array | None) -> _Sum:
    """Turns sums up to times (n,) into those between them (n - 1,), without what is from `still[0]` to `still[1]`."""
    if still is None:
        return lambda up_to: np.diff(up_to(at))
    before, after = np.minimum(at, still[0]), np.maximum(at, still[1])
    return lambda up_to: np.diff(up_to(before)) + np.diff(up_to(after))


def yaw_rate(imu: Imu, levels: Levels | None) -> Array:
    """(n,) rad/s, the rate of the heading at the readings."""
    if levels is None:
        return imu.gyro[:, 2]
    _, y, z = imu.gyro.T
    roll, pitch = levels.roll, levels.pitch
    return (np.sin(roll) * y + np.cos(roll) * z) / np.cos(pitch)


def integrated(t: Array, rate: Array, at: Array) -> Array:
    """(m,) the integral up to `at` (m,) of the `rate` (n,) at `t` (n,), which changes evenly in between."""
    between = np.diff(t)
    whole = np.concatenate(([0.0], np.cumsum((rate[:-1] + rate[1:]) / 2 * between)))
    row = np.clip(np.searchsorted(t, at, "right") - 1, 0, len(t) - 2)
    since = np.clip(at - t[row], 0.0, between[row])
    return whole[row] + since * (rate[row] + (rate[row + 1] - rate[row]) * since / (2 * between[row]))


def integrated_steps(t: Array, values: Array, at: Array) -> Array:
    """(m,) the sums up to `at` (m,) of `values` (n - 1,), each spread evenly between two of the times `t` (n,)."""
    whole = np.concatenate(([0.0], np.cumsum(values)))
    between = np.diff(t)
    row = np.clip(np.searchsorted(t, at, "right") - 1, 0, len(t) - 2)
    return whole[row] + values[row] * np.clip((at - t[row]) / between[row], 0.0, 1.0)


def _bent(imu: Imu, rate: Array, density: float) -> Array:
    """(n - 1,) rad^2, variances of what lies between readings, where the rate is no straight line.

    The error of the trapezium over h s is h^3 / 12 of the second derivative; its mean square is that of second
    differences without what white noise has in them, 6 times its variance.
    """
    between, usual = np.diff(imu.t), imu.usual
    second = np.diff(rate, n=2)[~(imu.missing[1:] | imu.missing[:-1])]
    if not len(second):
        return np.zeros(len(between))
    square = max(float((second**2).mean()) - 6 * density / usual, 0.0)
    return (between**3 / (12 * usual**2)) ** 2 * square


def _tilted(imu: Imu, levels: Levels, over: _Sum) -> Array:
    """(n - 1,) rad^2, variances by those of the levels, whose errors last longer than a step."""
    _, y, z = imu.gyro.T
    roll, pitch = levels.roll, levels.pitch
    by_roll = (np.cos(roll) * y - np.sin(roll) * z) / np.cos(pitch)
    by_pitch = yaw_rate(imu, levels) * np.tan(pitch)
    parts = (by_roll * levels.roll_sd, by_pitch * levels.pitch_sd)
    return np.sum([over(partial(integrated, imu.t, part)) ** 2 for part in parts], axis=0)


def _walk(at: Array, step: Ints, per_second: float) -> Array:
    """(m,) variances of the bias' random walk, gathered at rows at least `KNOTS` apart."""
    walk = np.zeros(len(step))
    last = at[step[0] - 1] if len(step) else 0.0
    for row, begin in enumerate(at[step - 1].tolist()):
        if begin - last >= KNOTS:
            walk[row], last = per_second * (begin - last), begin
    return walk
