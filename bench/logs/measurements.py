"""Measurements of a log beside whole sightings, counted, and the noise that all of them state.

Lengths are in m, angles in rad. A measurement that a log does not have is None.
"""

from typing import NamedTuple

import numpy as np

from ...core.factors import Log
from ...core.fixes import FixTable
from ...core.gyro import Gyro
from ...core.partial import BEARING, RANGE, PartialTable
from ...core.se2 import Array
from .revisits import way

ROUND = 1e-6  # relative; standard deviations that differ by less are equal


class Sd(NamedTuple):
    """A stated standard deviation over the measurements."""

    p5: float
    median: float
    p95: float
    constant: bool


class Parts(NamedTuple):
    """The sightings of a range or a bearing alone, among all."""

    ranges: int
    bearings: int
    range_least: float | None
    range_median: float | None
    range_most: float | None
    range_sd: Sd | None  # as stated
    bearing_sd: Sd | None


class FixCount(NamedTuple):
    """Measurements of the pose in the world."""

    positions: int  # of x, of y or of both
    headings: int
    position_sd: Sd | None  # as stated, of x and of y
    heading_sd: Sd | None
    steps: int  # that have one
    longest_without: int  # steps in a row, between two or at the ends


class TurnCount(NamedTuple):
    """Turns by a gyro since the step before."""

    turns: int
    sd: Sd | None  # of their white noise, as stated, rad
    bias: float  # rad/s, before the first
    bias_sd: float
    moves: int  # of the bias
    moves_sd: float  # rad/s, of all moves together
    longest_without: int  # steps in a row, after the first one of the log


class Noise(NamedTuple):
    """The noise that the log states."""

    range: Sd | None
    bearing: Sd | None
    forward: Sd | None  # of a step's motion
    sideways: Sd | None
    turn: Sd | None
    forward_1m: float | None  # of a metre of way: the root of all variance over all way
    sideways_1m: float | None
    turn_1m: float | None


def parts_of(found: PartialTable) -> Parts:
    """Counts the ranges and bearings alone."""
    ranges, bearings = (found.kind == kind for kind in (RANGE, BEARING))
    z = found.z[ranges]
    spread = (float(z.min()), float(np.median(z)), float(z.max())) if len(z) else (None, None, None)
    counts = int(ranges.sum()), int(bearings.sum())
    return Parts(*counts, *spread, sd_of(found.var[ranges]), sd_of(found.var[bearings]))


def fixes_of(found: FixTable) -> FixCount:
    """Counts the fixes."""
    variance = np.einsum("fii->fi", found.cov)
    position, heading = (one[~np.isnan(one)] for one in (variance[:, :2], variance[:, 2]))
    at = np.unique(found.step)
    steps = len(found.first) - 1
    without = np.diff(np.concatenate(([-1], at, [steps]))) - 1
    measured = ~np.isnan(found.z)
    counts = int(measured[:, :2].any(axis=1).sum()), int(measured[:, 2].sum())
    return FixCount(*counts, sd_of(position), sd_of(heading), len(at), int(without.max()))


def turns_of(found: Gyro, steps: int) -> TurnCount:
    """Counts the turns by a gyro, in a log of that many steps."""
    without = np.diff(np.concatenate(([0], found.step, [steps]))) - 1
    walked = float(np.sqrt(found.walk.sum()))
    moves = int((found.walk > 0).sum())
    return TurnCount(len(found), sd_of(found.var), *found.prior, moves, walked, int(without.max()))


def noise_of(log: Log) -> Noise:
    """The noise of sightings and motions, as stated."""
    variance = np.einsum("kii->ki", log.delta_cov[1:])
    length = float(way(log)[-1])
    metre = np.sqrt(variance.sum(axis=0) / length).tolist() if length > 0 else (None, None, None)
    range_sd, bearing_sd = (sd_of(log.z_cov[:, i, i]) for i in range(2))
    forward, sideways, turn = (sd_of(variance[:, i]) for i in range(3))
    return Noise(range_sd, bearing_sd, forward, sideways, turn, *metre)


def sd_of(variance: Array) -> Sd | None:
    """The standard deviations of these variances (n,); None without any."""
    if not len(variance):
        return None
    low, p5, median, p95, high = np.sqrt(np.percentile(variance, (0, 5, 50, 95, 100))).tolist()
    return Sd(p5, median, p95, high - low <= ROUND * high)
