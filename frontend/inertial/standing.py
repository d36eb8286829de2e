"""When a robot stands still, by its wheels or by quiet readings, and the gyro's bias from then.

Without wheels a window is one of standing where gyro and accelerometer vary little: the detectors by angular rate and
by the accelerometer's variance of Skog, Haendel, Nilsson and Rantakokko, "Zero-Velocity Detection - An Algorithm
Evaluation", IEEE Transactions on Biomedical Engineering 57(11), 2010, with thresholds from the quietest windows.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.se2 import Array
from ..wheels.commands import Speeds
from ..wheels.ticks import Ticks
from ..wheels.track import Poses
from .imu import Imu

WINDOW = 0.5  # s, in which the robot stands or does not
TRIM = 0.25  # s at both ends of a stand of the wheels, in which the body still rocks
FEW, MANY = 4, 10  # windows from which their scatter tells a standard error, and a density of noise
BEYOND = 3.0  # times the density of white noise beyond which that of the windows is no chance

CREEP, TURN = 0.005, 0.005  # m/s and rad/s, below which integrated odometry stands
APART = 1.0  # s between two readings of the wheels beyond which nothing says that they stood

QUIETEST, TIMES = 0.02, 3.0
"""Share of the windows that are the quietest, and how many times as much as these a quiet one may vary."""

LOUDEST, LOUDER = 0.95, 4.0
"""Share of the windows below the loudest, which vary so many times as much as the quietest, in one of the sensors: else
the robot does the same all the time, and nothing says that it ever stands."""

AT_REST_GYRO, AT_REST_ACCEL = 0.01, 0.1  # rad/s and m/s^2, below which even the loudest are of a robot at rest

STILL_GYRO, STILL_ACCEL = 0.03, 0.3  # rad/s and m/s^2, the most by which a standing robot's readings vary
MOST_BIAS = 0.15  # rad/s; no gyro in use has a larger one, so beyond it the robot turns evenly
ALIKE = 0.02  # rad/s from the median of all windows beyond which a window is of a robot that turns slowly

Readings = Poses | Ticks | Speeds


class Stand(NamedTuple):
    """The gyro while the robot stands, once."""

    interval: Array  # (2,) s
    bias: float  # rad/s of the yaw rate
    sd: float  # rad/s, its standard error
    at: float  # s, the middle

    @property
    def seconds(self) -> float:
        """Its length, s."""
        return float(self.interval[1] - self.interval[0])


class Standing(NamedTuple):
    """The times at which a robot stands, and the gyro then."""

    intervals: Array  # (k, 2) s
    share: float  # of the readings' time
    by: str  # wheels; quiet readings
    bias: Array | None  # (3,) rad/s of the gyro; None: it never stands
    sd: Array | None  # (3,) rad/s, the standard errors of `bias`
    noise: float | None  # rad^2/s, the yaw gyro's white noise
    bias_at: float = 0.0  # s, the mean time of the readings that `bias` is of


def standing(imu: Imu, odometry: Readings | None = None) -> Standing:
    """Finds when the robot stands, by its odometry where there is some; with the bias of the gyro from these times.

    The standard error is the larger of two: that of white noise, and that by which the windows' means scatter, where
    there are enough of them. What the bias does later is a random walk beyond it.
    """
    by = "quiet readings" if odometry is None else "wheels"
    first, count = _windows(imu)
    if not len(first):
        return Standing(np.zeros((0, 2)), 0.0, by, None, None, None)
    rows = first[:, None] + np.arange(count)
    gyro, begin, end = imu.gyro[rows], imu.t[rows[:, 0]], imu.t[rows[:, -1]]
    mean = gyro.mean(axis=1)
    still = np.linalg.norm(gyro.std(axis=1), axis=1)
    kept = (np.abs(mean) < MOST_BIAS).all(axis=1)
    if odometry is None:
        sensors = [_quiet(still, STILL_GYRO, AT_REST_GYRO)]
        if imu.accel is not None:
            shakes = np.linalg.norm(imu.accel[rows].std(axis=1), axis=1)
            sensors.append(_quiet(shakes, STILL_ACCEL, AT_REST_ACCEL))
        kept &= np.all([one.windows for one in sensors], axis=0) & any(one.told for one in sensors)
        kept &= _in_a_row(kept)
    else:
        kept &= _within(begin, end, still_times(odometry))
    if kept.any():
        kept &= (np.abs(mean - np.median(mean[kept], axis=0)) < ALIKE).all(axis=1)
    if not kept.any():
        return Standing(np.zeros((0, 2)), 0.0, by, None, None, None)
    intervals = _joined(np.column_stack((begin, end))[kept], 1.5 * imu.usual)
    share = float(np.diff(intervals, axis=1).sum() / (imu.t[-1] - imu.t[0]))
    white = gyro[kept].var(axis=1, ddof=1).mean(axis=0)
    means, k = mean[kept], int(kept.sum())
    lasting = float((end - begin)[kept].mean()) + imu.usual
    variance, density = white / (k * count), white[2] * imu.usual
    if k >= FEW:
        variance = np.maximum(variance, means.var(axis=0, ddof=1) / k)
        neighbours = np.flatnonzero(np.diff(np.flatnonzero(kept)) == 1)
        if len(neighbours) >= MANY:  # the Allan variance at the window's length
            allan = float((np.diff(means[:, 2])[neighbours] ** 2).mean() / 2)
            density = allan * lasting if allan * lasting > BEYOND * density else density
    at = float(imu.t[rows[kept]].mean())
    return Standing(intervals, share, by, means.mean(axis=0), np.sqrt(variance), float(density), at)


def longest_stand(imu: Imu, stood: Standing) -> Stand | None:
    """The longest of the times at which the robot stands; None where it never does.

    Its standard error is that of the drive's white noise, more than at rest, as motors that run move a bias as well.
    """
    if not len(stood.intervals) or stood.noise is None:
        return None
    begin, end = stood.intervals[int(np.diff(stood.intervals, axis=1).argmax())].tolist()
    rows = (imu.t >= begin) & (imu.t <= end)
    sd = np.sqrt(max(stood.noise, imu.noise) / (end - begin))
    return Stand(np.array([begin, end]), float(imu.gyro[rows, 2].mean()), float(sd), (begin + end) / 2)


def still_times(odometry: Readings) -> Array:
    """(k, 2) s, the times at which the wheels stand, without `TRIM` at their ends."""
    t, apart = odometry.t, np.diff(odometry.t)
    if isinstance(odometry, Poses):
        moved = np.hypot(*np.diff(odometry.poses[:, :2], axis=0).T)
        turned = np.abs(np.diff(np.unwrap(odometry.poses[:, 2])))
        still = (moved <= CREEP * apart) & (turned <= TURN * apart) & (apart <= APART)
    elif isinstance(odometry, Ticks):
        still = (np.diff(odometry.counts, axis=0) == 0).all(axis=1) & (apart <= APART)
    else:
        still = (odometry.speeds[:-1] == 0).all(axis=1)
    found = _joined(np.column_stack((t[:-1], t[1:]))[still], 0.0)
    found = found + np.array([TRIM, -TRIM])
    return found[found[:, 1] > found[:, 0]]


def _windows(imu: Imu) -> tuple[NDArray[np.int64], int]:
    """First rows (w,) of windows one after another without a gap, and how many readings each has."""
    count = max(round(WINDOW * imu.rate), 4)
    first = np.arange(0, len(imu) - count + 1, count)
    lost = np.concatenate(([0], np.cumsum(~imu.sound)))
    return first[lost[first + count - 1] == lost[first]], count


class _Quiet(NamedTuple):
    """The windows as one sensor has them."""

    windows: NDArray[np.bool_]  # (w,) those that vary little
    told: bool  # others vary much, or none does


def _quiet(varies: Array, most: float, at_rest: float) -> _Quiet:
    """Compares how much windows vary (w,) with the quietest, but for `most`."""
    quietest, loudest = np.quantile(varies, (QUIETEST, LOUDEST)).tolist()
    if loudest <= at_rest:
        return _Quiet(np.ones(len(varies), np.bool_), told=True)
    return _Quiet(varies <= min(most, TIMES * quietest), told=loudest >= LOUDER * quietest)


def _in_a_row(kept: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(w,) those beside which another is kept as well."""
    before, after = np.append(False, kept[:-1]), np.append(kept[1:], False)
    return kept & (before | after)


def _within(begin: Array, end: Array, times: Array) -> NDArray[np.bool_]:
    """(w,) which windows lie within one of the `times` (k, 2)."""
    at = np.searchsorted(times[:, 0], begin, "right") - 1
    ends = np.append(times[:, 1], -np.inf)  # row -1: none began before
    return ends[at] >= end


def _joined(intervals: Array, near: float) -> Array:
    """(k, 2) intervals in order, those that touch, up to `near` s, as one."""
    if not len(intervals):
        return np.zeros((0, 2))
    new = np.append(True, intervals[1:, 0] - intervals[:-1, 1] > near)
    last = np.append(np.flatnonzero(new)[1:] - 1, len(intervals) - 1)
    return np.column_stack((intervals[new, 0], intervals[last, 1]))
