"""Remarks: what is legal in a log yet odd, one sentence each without its full stop.

A reader stores the remarks that only it can make in the log's notes, so that they stay with the log. The others are
found in the log itself: wrong units, columns that count something else, jumps and gaps. A remark is a hint, not a
verdict; it states the finding, and what was expected or a possible cause.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..core.errors import InputError
from ..core.factors import REMARKS, UNKNOWN, Dataset, Log
from ..core.partial import NO_IDS
from ..core.se2 import Array
from ..core.table import LARGEST
from ..frontend.pauses import PAUSE
from .hidden_ids import HIDDEN_NOTE
from .truth_remarks import of_truth
from .way_remarks import FAR, FEW, of_ways

GAP = 10.0  # a gap in time, relative to the median time between steps
JUMP = 20.0  # a jump of the odometry, in standard deviations of all other steps
STILL = 0.05  # share of the largest motions, below which a robot stands and its odometry jitters
NARROW = 0.1  # rad; bearings that are all nearer to 0 may have been divided by 57
SLOW = 100.0  # s; a median time between steps beyond it may be in milliseconds
SPINNING = 5.0  # rad/s; a median turning rate beyond it may be in degrees per second
UNNAMED = 0.1  # share of sightings without an id: a detector's false alarms are fewer, 3 % in DLR's log
TOO_NEAR = 3.0  # standard deviations of a range; within it, noise across turns the bearing by 0.36 rad and more
TOO_SURE = 25.0  # noise along over that across, as stated of such a sighting: in a published log it is up to 20
NEAR_SHARE = 0.002  # of the sightings; fewer, all from beyond one standard deviation, are of a robot that brushes past
UNKNOWN_HEADING = 1.0  # rad; a sine is 16 % off its slope there, so a linearised filter's covariance holds no more
KIDNAPPED = "kidnapped at step"  # in a log's notes, under "faults"
DETECTED = "columns of detections"  # the key of those that a log's sightings are of, among its notes
POINTS = ("t", "id", "x", "y")  # of detections as places in the body frame
NO_SIGHTING = "there is no sighting and no loop closure in it, so every backend gives dead reckoning"


def remarks(dataset: Dataset) -> list[str]:
    """Lists everything odd about the log, its reader's remarks first, each once."""
    with np.errstate(over="ignore", invalid="ignore"):  # what is beyond all numbers is infinite, and remarked as such
        return list(dict.fromkeys((*dataset.log.remarks, *_remarks(dataset.log), *of_truth(dataset))))


def remarked(log: Log, found: Sequence[str]) -> Log:
    """The log with more remarks of its reader."""
    return replace(log, notes={**log.notes, REMARKS: [*log.remarks, *found]}) if found else log


def refuse(name: str, found: Sequence[str]) -> None:
    """Raises InputError with the first of the remarks `found`, for --strict; `name` names the log."""
    if found:
        more = f"; and {len(found) - 1} more" if len(found) > 1 else ""
        raise InputError(f"--strict: {name}: {found[0]}{more}.")


def _remarks(log: Log) -> Iterator[str]:
    yield from _prior(log)
    yield from _kidnapped(log)
    yield from _times(log)
    yield from _sizes(log)
    yield from _motions(log)
    if not len(log.ids):
        if not len(log.loop_to) and log.partial is None and log.fixes is None:
            yield NO_SIGHTING
        if log.starts_nothing:
            yield NO_IDS
        return
    yield from _sightings(log)
    yield from _near(log)
    yield from _landmarks(log)
    yield from of_ways(log)


def _kidnapped(log: Log) -> Iterator[str]:
    """Of a simulated world's option: no odometry says so, and one backend may find it out and another not."""
    faults = log.notes.get("faults")
    step = faults.get(KIDNAPPED) if isinstance(faults, Mapping) else None
    if step is not None:
        yield f"the robot is put elsewhere before {_step(log, step)} (kidnap), which its odometry does not say"


def _prior(log: Log) -> Iterator[str]:
    sd = float(np.sqrt(log.prior.cov[2, 2]))
    if sd > UNKNOWN_HEADING:
        yield (
            f"the heading of the prior has a standard deviation of {sd:.3g} rad: a backend that linearises there "
            f"cannot be consistent, expected at most {UNKNOWN_HEADING:g} rad"
        )


def _times(log: Log) -> Iterator[str]:
    between = np.diff(log.t)
    if len(between) < FEW:
        return
    median = float(np.median(between))
    if median > SLOW:
        yield f"the median time between steps is {median:.6g} s: perhaps the times are in milliseconds"
    gaps = np.flatnonzero(between > GAP * median)
    read = log.notes.get(PAUSE)  # a robot that stands makes no steps, and a camera may pause while the wheels are read
    if len(gaps) and not (isinstance(read, float) and read <= GAP * median):
        longest = int(gaps[np.argmax(between[gaps])])
        yield (
            f"{_count(len(gaps), 'gap')} in time of more than {GAP:g} times the median of {median:.3g} s, "
            f"the longest of {between[longest]:.3g} s before {_step(log, longest + 1)}"
        )


def _sizes(log: Log) -> Iterator[str]:
    """Finds lengths beyond those that graphs may have."""
    for name, table, lengths, steps in (
        ("motion", "odometry", np.abs(log.delta[1:, :2]).max(axis=1), np.arange(1, len(log))),
        ("range", "sightings", log.z[:, 0], log.sighting_step),
        ("loop closure", "loops", np.abs(log.loop_delta[:, :2]).max(axis=1), log.loop_step),
    ):
        beyond = np.flatnonzero(lengths > LARGEST)
        if len(beyond):
            row = int(beyond[0]) + (name == "motion")
            largest = f"the largest of {lengths.max():.3g} m"
            first = _place(log, table, row, int(steps[beyond[0]]))
            yield f"{_count(len(beyond), name)} of more than {LARGEST:g} m, {largest}, the first at {first}"


def _motions(log: Log) -> Iterator[str]:
    if len(log) <= FEW:
        return
    stride = np.hypot(*log.delta[1:, :2].T)
    if np.median(stride) > FAR:
        yield f"the median way of a step is {np.median(stride):.6g} m: perhaps the motions are in millimetres"
    turn = np.abs(log.delta[1:, 2])
    rates = (turn / np.diff(log.t))[turn > 0]
    if len(rates) >= FEW and np.median(rates) > SPINNING:
        rate = float(np.median(rates))
        yield f"the median turning rate while turning is {rate:.3g} rad/s: perhaps it was in degrees a second"
    between = np.diff(log.t)
    slower = np.minimum(np.median(between) / between, 1.0)  # a long motion in a long time is no jump,
    moves = _large(stride) | (turn > STILL * turn.max())  # nor any motion of a robot that mostly stands
    columns = (("dx", 1, "m"), ("dy", 2, "m"), ("dtheta", 1, "rad"))
    for column, (name, power, unit) in enumerate(columns):  # aside a curve goes as its square
        motion = log.delta[1:, column]
        far = (_score(motion[moves]) > JUMP) & (_score((motion * slower**power)[moves]) > JUMP)
        jumps = np.flatnonzero(moves)[far & ~_less(motion[moves])]
        if len(jumps):
            first = int(jumps[0])
            yield (
                f"{_count(len(jumps), 'jump')} of the odometry's {name}: more than {JUMP:g} standard deviations of the "
                f"other steps from their mean; the first of {motion[first]:.3g} {unit} at {_step(log, first + 1)}"
            )


def _step(log: Log, step: int) -> str:
    """Names a step: by the lines of the odometry's file if it is from one, else by its number; and its time."""
    return _place(log, "odometry", step, step)


def _place(log: Log, table: str, row: int, step: int) -> str:
    """Likewise a row of `table`, of that step; times that only count the steps are left out."""
    lines = log.lines.get(table)
    found = f"step {step}" if lines is None or row >= len(lines.first) else lines.words(row)
    return found if np.array_equal(log.t, np.arange(len(log))) else f"{found} ({log.t[step]:.10g} s)"


def _large(values: Array) -> NDArray[np.bool_]:
    """Those of (n,) that are no jitter beside the largest hundredth; all where these are few, as of a single jump."""
    large = values > STILL * np.quantile(values, 0.99)
    return large if large.sum() > FEW else np.ones(len(values), bool)


def _less(values: Array) -> NDArray[np.bool_]:
    """Those of (n,) from 0 to the usual one: a motion that is slower, or in a shorter time, is no jump."""
    usual = float(np.median(values))
    return (values * np.sign(usual) >= 0) & (np.abs(values) <= np.abs(usual))


def _score(values: Array) -> Array:
    """Returns (n,) how many standard deviations of all others each value is from the mean of all others."""
    n, size = len(values), max(float(np.abs(values).max()), 1.0)
    share = values / size  # the squares of what is huge would be infinite
    off = share - share.mean()
    others = off * n / (n - 1)
    left = np.maximum((np.sum(off**2) - off**2 * n / (n - 1)) / (n - 1), 0.0)
    return np.abs(others) / np.maximum(np.sqrt(left), 1e-9)  # under which the sums are rounding


def _sightings(log: Log) -> Iterator[str]:
    r, bearing = log.z.T
    step = log.sighting_step
    median = float(np.median(r))
    if median > FAR:
        yield f"the median range is {median:.6g} m: perhaps the ranges are in millimetres"
    if len(r) >= FEW and np.abs(bearing).max() < NARROW and np.ptp(r) > 0.1 * median:
        widest = float(np.abs(bearing).max())
        yield f"every bearing is within {widest:.2g} rad of ahead: perhaps it is in other units than radians"
    if len(log) > FEW and step[-1] < len(log) / 2:
        at = _place(log, "sightings", len(step) - 1, int(step[-1]))
        counts = ""
        if "files" not in log.notes:  # which has no column of that name
            counts = ", or in a log's folder the column step counts something else than the rows of odometry.csv"
        yield f"the last sighting is at {at}, the log has {len(log)} steps: perhaps the sensor stopped{counts}"
    unknown = int(np.sum(log.ids == UNKNOWN))
    if unknown > UNNAMED * len(r) and HIDDEN_NOTE not in log.notes:
        yield f"{unknown} of {len(r)} sightings have no id: a backend that does not associate leaves them out"


def _near(log: Log) -> Iterator[str]:
    """Finds sightings from so near that their bearings cannot be as good as stated: a robot passes over a landmark.

    Of a point known to s in x and y, the bearing is known to s / r at a range r beyond s, and not at all at less.
    """
    r, sd, turn = log.z[:, 0], *np.sqrt(np.einsum("sii->is", log.z_cov))
    near = (r < TOO_NEAR * sd) & (turn * np.maximum(r, sd) < sd / TOO_SURE)
    if near.mean() > NEAR_SHARE or (r[near] < sd[near]).any():
        one = int(np.flatnonzero(near)[np.argmin(r[near])])
        yield (
            f"{_count(int(near.sum()), 'sighting')} of {len(r)} from within {TOO_NEAR:g} standard deviations of the "
            f"range, the nearest at {r[one]:.2g} m, stated to {sd[one]:.2g} m, with a bearing stated to "
            f"{turn[one]:.2g} rad: the noise across, which turns it, is hardly that much smaller than the one along; "
            f"{_wider(log)}"
        )


def _wider(log: Log) -> str:
    """Names what states the noise of near sightings, by the columns that a log was made of."""
    columns = log.notes.get(DETECTED)
    if columns == ",".join(POINTS):
        return "option xy_sd states that of x and y, in place of range_sd and bearing_sd"
    if columns is not None:
        return f"option bearing_sd is the same at all ranges: {','.join(POINTS)} with option xy_sd has that of each"
    if "sightings" in log.lines:
        return "column cbb of sightings.csv states each bearing's variance"
    return "a bearing's variance is at least that across by the square of the range"


def _landmarks(log: Log) -> Iterator[str]:
    ids, times = np.unique(log.seen[log.seen != UNKNOWN], return_counts=True)
    once = int(np.sum(times == 1))
    if len(ids) >= FEW and once > len(ids) / 4:
        yield f"{once} of {len(ids)} landmarks are sighted only once and do not constrain the path"


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'s' * (number > 1)}"
