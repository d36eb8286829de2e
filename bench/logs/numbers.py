"""Describes a log in numbers: path, times, sightings, landmarks, returns, sensor and stated noise.

Lengths are in m, angles in rad, times in s. What a log does not have is None. It is quick at 10^6 steps.
"""

from typing import NamedTuple

import numpy as np

from ...core.arrays import numbered
from ...core.factors import UNKNOWN, Dataset, Log, Truth
from ...core.fixes import FixTable
from ...core.gyro import Gyro
from ...core.partial import BEARING, RANGE, PartialTable
from ...core.se2 import Array, Ints
from ...core.truth.errors import Errors, driven_errors, sighting_errors
from ..contradiction.constant import LEFT, Constant
from ..contradiction.remark import STAGES as REMARKED
from ..contradiction.remark import Began, Remarks, remarked, silent
from ..measure.landmark_places import Places, Scattered, judge, placed, scattered_ids
from ..measure.stated_noise import Measured, NoiseCheck, measured, noise_check
from ..systematic.words import sentences
from .difficulty import Difficulty, difficulty
from .part_errors import PartCheck, part_checks
from .revisits import Returns, loops, returns, way
from .shown_path import Shown, shown

GAP = 5.0  # multiple of the median time between steps that makes a gap
SIGHT = 0.99  # share of the bearings that the field of view holds
ROUND = 1e-6  # relative; standard deviations that differ by less are equal


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


class Corrected(NamedTuple):
    """The agreement of a log with the ground truth without errors of sensor and wheels that stay."""

    errors: tuple[str, ...]  # in words, a sentence each
    sightings: NoiseCheck | None  # None: as they were, nearly, as the next
    odometry: NoiseCheck | None
    measured: Measured | None  # the sightings' noise, where those are not None


class Known(NamedTuple):
    """The ground truth of a log, and the log's agreement with it."""

    kind: str  # truth, reference or "" where no path is known
    steps: int  # with a known pose
    landmarks: int  # with a known place
    sightings: NoiseCheck | None  # with truth alone, as the next
    odometry: NoiseCheck | None
    measured: Measured | None  # the sightings' noise
    medians: bool  # both are against landmarks' median places, as true ones are unknown or elsewhere
    scattered: Scattered | None  # by a known path, where the landmarks' places are not
    drift_m: float | None  # of dead reckoning at the end of the known path
    drift_share: float | None  # of that path's length
    relations: int  # pairs of poses with a known motion
    corrected: Corrected | None = None  # where errors that stay are most of what the log is off by
    ranges: PartCheck | None = None  # alone, with truth, as the next
    bearings: PartCheck | None = None


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
        _noise(log),
        _known(dataset, drawn, stays),
        difficulty(dataset),
        None if log.partial is None else _parts(log.partial),
        None if log.fixes is None else _fixes(log.fixes),
        None if log.signatures is None else _sd(log.signatures.var),
        None if log.gyro is None else _turns(log.gyro, len(log)),
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
    known = None if drawn.poses is drawn.reckoned else _length(drawn.poses)
    speed = None if timed is None else length / timed.duration
    return Way(len(log), length, known, speed, float(np.abs(turns).sum()), float(turns.sum()))


def _length(poses: Array) -> float:
    return float(np.hypot(*np.diff(poses[:, :2], axis=0).T).sum())


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


def _parts(found: PartialTable) -> Parts:
    ranges, bearings = (found.kind == kind for kind in (RANGE, BEARING))
    z = found.z[ranges]
    spread = (float(z.min()), float(np.median(z)), float(z.max())) if len(z) else (None, None, None)
    counts = int(ranges.sum()), int(bearings.sum())
    return Parts(*counts, *spread, _sd(found.var[ranges]), _sd(found.var[bearings]))


def _fixes(found: FixTable) -> FixCount:
    variance = np.einsum("fii->fi", found.cov)
    position, heading = (one[~np.isnan(one)] for one in (variance[:, :2], variance[:, 2]))
    at = np.unique(found.step)
    steps = len(found.first) - 1
    without = np.diff(np.concatenate(([-1], at, [steps]))) - 1
    measured = ~np.isnan(found.z)
    counts = int(measured[:, :2].any(axis=1).sum()), int(measured[:, 2].sum())
    return FixCount(*counts, _sd(position), _sd(heading), len(at), int(without.max()))


def _turns(found: Gyro, steps: int) -> TurnCount:
    without = np.diff(np.concatenate(([0], found.step, [steps]))) - 1
    walked = float(np.sqrt(found.walk.sum()))
    return TurnCount(len(found), _sd(found.var), *found.prior, int((found.walk > 0).sum()), walked, int(without.max()))


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


def _noise(log: Log) -> Noise:
    variance = np.einsum("kii->ki", log.delta_cov[1:])
    length = float(way(log)[-1])
    metre = np.sqrt(variance.sum(axis=0) / length).tolist() if length > 0 else (None, None, None)
    range_sd, bearing_sd = (_sd(log.z_cov[:, i, i]) for i in range(2))
    forward, sideways, turn = (_sd(variance[:, i]) for i in range(3))
    return Noise(range_sd, bearing_sd, forward, sideways, turn, *metre)


def _sd(variance: Array) -> Sd | None:
    if not len(variance):
        return None
    low, p5, median, p95, high = np.sqrt(np.percentile(variance, (0, 5, 50, 95, 100))).tolist()
    return Sd(p5, median, p95, high - low <= ROUND * high)


def _known(dataset: Dataset, drawn: Shown, stays: Constant | None) -> Known:
    log, truth = dataset
    at_sightings, at_odometry = _errors(log, truth, drawn.places)
    checks = _checks(log, at_sightings, at_odometry)
    path = truth if truth is not None and len(truth.t) else drawn.solved
    off = share = None
    if path is not None:
        off = float(np.hypot(*(drawn.reckoned[drawn.step[-1]] - drawn.poses[-1])[:2]))
        length = _length(drawn.poses)
        share = off / length if length > 0 else None
    return Known(
        "" if path is None else path.kind,
        0 if path is None else len(path.t),
        0 if truth is None or truth.map is None else len(truth.map.ids),
        *checks,
        None if at_sightings is None else measured(at_sightings),
        at_sightings is not None and len(at_sightings.row) > 0 and drawn.places is not None,
        scattered_ids(drawn.places),
        off,
        share,
        0 if truth is None or truth.relations is None else len(truth.relations.delta),
        None if stays is None else _corrected(stays, truth, drawn, checks),
        *part_checks(log, truth),
    )


def _errors(log: Log, truth: Truth | None, places: Places | None) -> tuple[Errors | None, Errors | None]:
    """Errors of sightings and motions by the truth; None without one that judges the log."""
    right = judge(log, truth, places)
    return (None, None) if right is None else (sighting_errors(log, right), driven_errors(log, right))


def _checks(log: Log, seen: Errors | None, driven: Errors | None) -> tuple[NoiseCheck | None, NoiseCheck | None]:
    return (
        None if seen is None else noise_check(seen, log.z_cov),
        None if driven is None else noise_check(driven, log.delta_cov),
    )


def _corrected(
    stays: Constant, truth: Truth | None, drawn: Shown, before: tuple[NoiseCheck | None, NoiseCheck | None]
) -> Corrected | None:
    """The log without its errors that stay, in what these are most of; None where they are not."""
    log = stays.log
    places = None if drawn.places is None else placed(log, drawn.poses, drawn.pose_at(len(log)), known=True)
    seen, driven = _errors(log, truth, places)
    sightings, odometry = (
        after if one is not None and after is not None and after.median < LEFT * one.median else None
        for one, after in zip(before, _checks(log, seen, driven), strict=True)
    )
    if sightings is None and odometry is None:
        return None
    left = None if sightings is None or seen is None else measured(seen)
    return Corrected(tuple(sentences(stays.fit)), sightings, odometry, left)
