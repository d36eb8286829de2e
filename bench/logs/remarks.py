"""Finds what is legal in a log yet odd: wrong units, columns that count something else, jumps and gaps.

A remark is a hint, not a verdict; each states the finding and a possible cause.
"""

from collections.abc import Iterator

import numpy as np

from ...frontend.factors import UNKNOWN, Dataset, Log
from ...frontend.se2 import Array
from ...frontend.table import LARGEST

GAP = 10.0  # a gap in time, relative to the median time between steps
JUMP = 20.0  # a jump of the odometry, in standard deviations of all other steps
NARROW = 0.1  # rad; bearings that are all nearer to 0 may have been divided by 57
FAR = 1000.0  # m; a median range or stride beyond it may be in millimetres
SLOW = 100.0  # s; a median time between steps beyond it may be in milliseconds
SPINNING = 5.0  # rad/s; a median turning rate beyond it may be in degrees per second
FEW = 10  # rows below which nothing is odd


def remarks(dataset: Dataset) -> list[str]:
    """Lists everything odd about the log, one sentence each without its full stop."""
    with np.errstate(over="ignore"):  # what is beyond all numbers is infinite, and remarked as such
        return list(_remarks(dataset.log))


def _remarks(log: Log) -> Iterator[str]:
    yield from _times(log)
    yield from _sizes(log)
    yield from _motions(log)
    if not len(log.ids):
        yield "there is no sighting: every estimate will be that of dead reckoning"
        return
    yield from _sightings(log)
    yield from _landmarks(log)


def _times(log: Log) -> Iterator[str]:
    between = np.diff(log.t)
    if len(between) < FEW:
        return
    median = float(np.median(between))
    if median > SLOW:
        yield f"the median time between steps is {median:.6g} s: perhaps the times are in milliseconds"
    gaps = np.flatnonzero(between > GAP * median)
    if len(gaps):
        longest = int(gaps[np.argmax(between[gaps])])
        yield (
            f"{_count(len(gaps), 'gap')} in time of more than {GAP:g} times the median of {median:.3g} s, "
            f"the longest of {between[longest]:.3g} s before step {longest + 1}"
        )


def _sizes(log: Log) -> Iterator[str]:
    """Finds lengths beyond those that graphs may have."""
    for name, lengths, first in (
        ("motion", np.abs(log.delta[1:, :2]).max(axis=1), "the first at step {}"),
        ("range", log.z[:, 0], "the first of sighting {}"),
        ("loop closure", np.abs(log.loop_delta[:, :2]).max(axis=1), "the first of loop closure {}"),
    ):
        beyond = np.flatnonzero(lengths > LARGEST)
        if len(beyond):
            row = int(beyond[0]) + (name == "motion")
            largest = f"the largest of {lengths.max():.3g} m"
            yield f"{_count(len(beyond), name)} of more than {LARGEST:g} m, {largest}, {first.format(row)}"


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
    for name, motion in (("dx", log.delta[1:, 0]), ("dy", log.delta[1:, 1]), ("dtheta", log.delta[1:, 2])):
        jumps = np.flatnonzero(_score(motion) > JUMP)
        if len(jumps):
            first = int(jumps[0])
            yield (
                f"{_count(len(jumps), 'jump')} of the odometry's {name}, {JUMP:g} standard deviations of the other "
                f"steps from their mean, the first of {motion[first]:.3g} at step {first + 1}"
            )


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
        yield (
            f"the last sighting is of step {step[-1]}, the log has {len(log)}: perhaps the column step counts "
            "something else than the rows of odometry.csv"
        )
    unknown = int(np.sum(log.ids == UNKNOWN))
    if unknown:
        yield f"{unknown} of {len(r)} sightings have no id: a backend that does not associate leaves them out"


def _landmarks(log: Log) -> Iterator[str]:
    ids, times = np.unique(log.ids[log.ids != UNKNOWN], return_counts=True)
    once = int(np.sum(times == 1))
    if len(ids) >= FEW and once > len(ids) / 4:
        yield f"{once} of {len(ids)} landmarks are sighted only once and do not constrain the path"


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'s' * (number > 1)}"
