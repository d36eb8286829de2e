"""Describes a log in numbers: path, times, sightings, landmarks, returns, sensor and stated noise.

Lengths are in m, angles in rad, times in s. What a log does not have is None. It is quick at 10^6 steps.
"""

from typing import NamedTuple

import numpy as np

from ...core.arrays import numbered
from ...core.factors import UNKNOWN, Dataset, Log
from ...core.se2 import Array, Ints
from ..contradiction.constant import Constant
from ..contradiction.remark import STAGES as REMARKED
from ..contradiction.remark import Began, Remarks, remarked, silent
from .agreement import Known, known_of, length_of
from .difficulty import Difficulty, difficulty
from .measurements import FixCount, Noise, Parts, Sd, TurnCount, fixes_of, noise_of, parts_of, sd_of, turns_of
from .revisits import Returns, loops, returns, way
from .shown_path import Shown, shown

GAP = 5.0  # multiple of the median time between steps that makes a gap
SIGHT = 0.99  # share of the bearings that the field of view holds


class Way(NamedTuple):
    """The robot's path."""

    steps: int
    odometry_m: float
    known_m: float | None  # along the true path, else along the batch optimum
    speed: float | None  # m/s, by odometry
    turned: float  # rad, every turn counted
    turned_left: float  # rad, left minus right


class Times(NamedTuple):
    """The times of the steps of a log that is timed."""

    duration: float
    median: float  # from step to step
    longest: float
    gaps: int  # longer than GAP medians


class SightingCount(NamedTuple):
    """The number of sightings, those of a range or a bearing alone included."""

    sightings: int
    unknown: int  # without the id of a landmark
    mean: float  # a step
    p5: float
    p50: float
    p95: float
    most: int
    steps_without: int
    longest_without: int  # steps in a row
    longest_without_m: float
    longest_without_s: float | None


class Landmarks(NamedTuple):
    """The number of sightings of each landmark."""

    landmarks: int
    least: int
    median: float
    most: int
    once: int  # landmarks sighted a single time


class Back(NamedTuple):
    """The log's returns to places."""

    loops: int  # times
    after_m: float | None  # way without a landmark that makes its next sighting a return
    returns: int  # sightings
    landmarks: int  # that are returned to
    longest_m: float  # way of the longest absence: the size of the largest loop
    longest_steps: int
    closures: int  # relative poses


class Sensor(NamedTuple):
    """The sensor's range and field of view."""

    range_least: float
    range_median: float
    range_most: float
    view: float  # rad, the smallest angle that holds SIGHT of the bearings
    view_right: float  # rad, its ends; from left to right it goes counter-clockwise
    view_left: float


class Numbers(NamedTuple):
    """All numbers of a log."""

    way: Way
    times: Times | None
    seen: SightingCount
    landmarks: Landmarks | None
    back: Back
    sensor: Sensor | None
    noise: Noise
    known: Known
    difficulty: Difficulty | None  # of data association
    parts: Parts | None = None
    fixes: FixCount | None = None
    signature: Sd | None = None  # of signatures, as stated
    turns: TurnCount | None = None


class Subject(NamedTuple):
    """A log with all that is written and drawn of it."""

    label: str
    dataset: Dataset
    shown: Shown
    returns: Returns
    numbers: Numbers
    remarks: Remarks


STAGES = REMARKED | {"finding its path and landmarks": 4.0, "computing its numbers": 2.0}
"""Stages of `described`, each with its share of the time of a long log with a true path."""

_PATH, _NUMBERS = [*STAGES][-2:]


def described(label: str, dataset: Dataset, solve: bool | None, began: Began = silent) -> Subject:
    """Describes a log; `solve` as in `shown`. `began` is told each of STAGES."""
    odd = remarked(dataset, began=began)  # before the others, which take as much memory as a third of a long log
    began(_PATH)
    drawn, found = shown(dataset, solve), returns(dataset.log)
    began(_NUMBERS)
    return Subject(label, dataset, drawn, found, numbers(dataset, drawn, found, odd.constant), odd)


def numbers(dataset: Dataset, drawn: Shown, found: Returns, stays: Constant | None = None) -> Numbers:
    """Computes the numbers of a log; `drawn` is its path, `found` its returns, `stays` its errors that stay."""
    log = dataset.log
    return Numbers(
        _way(log, drawn),
        times(log),
        _seen(log),
        _landmarks(log),
        _back(log, found),
        _sensor(log.z) if len(log.z) else None,
        noise_of(log),
        known_of(dataset, drawn, stays),
        difficulty(dataset),
        None if log.partial is None else parts_of(log.partial),
        None if log.fixes is None else fixes_of(log.fixes),
        None if log.signatures is None else sd_of(log.signatures.var),
        None if log.gyro is None else turns_of(log.gyro, len(log)),
    )


def times(log: Log) -> Times | None:
    """The times; None for a log of one step, and for one that numbers its steps."""
    if len(log) < 2 or numbered(log.t):
        return None
    apart = np.diff(log.t)
    median = float(np.median(apart))
    return Times(float(log.t[-1] - log.t[0]), median, float(apart.max()), int((apart > GAP * median).sum()))


def sightings_a_step(log: Log) -> Ints:
    """(n,) the sightings of every step, those of a range or a bearing alone included."""
    whole = np.diff(log.sighting_first)
    return whole if log.partial is None else whole + np.diff(log.partial.first)


def empty_runs(log: Log) -> Ints:
    """Returns (m, 2) the first and last step of every run of steps without a sighting."""
    empty = np.concatenate(([False], sightings_a_step(log) == 0, [False]))
    change = np.flatnonzero(np.diff(empty))
    return np.column_stack((change[::2], change[1::2] - 1))


def _way(log: Log, drawn: Shown) -> Way:
    length = float(way(log)[-1])
    timed = times(log)
    turns = log.delta[1:, 2]
    known = None if drawn.poses is drawn.reckoned else length_of(drawn.poses)
    speed = None if timed is None else length / timed.duration
    return Way(len(log), length, known, speed, float(np.abs(turns).sum()), float(turns.sum()))


def _seen(log: Log) -> SightingCount:
    count = sightings_a_step(log)
    p5, p50, p95 = np.percentile(count, (5, 50, 95))
    runs, gone = empty_runs(log), way(log)
    before, after = np.maximum(runs[:, 0] - 1, 0), np.minimum(runs[:, 1] + 1, len(log) - 1)
    longest = int((runs[:, 1] - runs[:, 0] + 1).max(initial=0))
    longest_m = float((gone[after] - gone[before]).max(initial=0))
    longest_s = None if times(log) is None else float((log.t[after] - log.t[before]).max(initial=0))
    spread = (float(count.mean()), float(p5), float(p50), float(p95), int(count.max()))
    return SightingCount(int(count.sum()), log.unknown, *spread, int((count == 0).sum()), longest, longest_m, longest_s)


def _landmarks(log: Log) -> Landmarks | None:
    count = np.unique(log.seen[log.seen != UNKNOWN], return_counts=True)[1]
    if not len(count):
        return None
    spread = (int(count.min()), float(np.median(count)), int(count.max()))
    return Landmarks(len(count), *spread, int((count == 1).sum()))


def _back(log: Log, found: Returns) -> Back:
    gone = way(log)
    now = np.concatenate((found.step[found.returns], log.loop_step))
    then = np.concatenate((found.before[found.returns], log.loop_to))
    return Back(
        loops(log, found),
        found.after if len(found.row) else None,
        int(found.returns.sum()),
        len(np.unique(found.rank[found.returns])),
        float((gone[now] - gone[then]).max(initial=0)),
        int((now - then).max(initial=0)),
        len(log.loop_to),
    )


def _sensor(z: Array) -> Sensor:
    """Finds range and field of view, the shortest arc that holds SIGHT of the bearings."""
    bearings = np.sort(z[:, 1])
    inside = int(np.ceil(SIGHT * len(bearings)))
    on = np.concatenate((bearings, bearings + 2 * np.pi))
    arcs = on[inside - 1 : inside - 1 + len(bearings)] - bearings
    first = int(np.argmin(arcs))
    left = float(on[first + inside - 1])
    ranges = (float(z[:, 0].min()), float(np.median(z[:, 0])), float(z[:, 0].max()))
    return Sensor(*ranges, float(arcs[first]), float(bearings[first]), left - 2 * np.pi * (left > np.pi))
