"""Finds returns: landmarks that are seen again after an absence, and the loops that these close."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.factors import UNKNOWN, Log
from ...core.se2 import Array, Ints

AWAY = 2.0  # median ranges of path without a landmark from which on its next sighting is a return, not sensor flicker


class Returns(NamedTuple):
    """The s sightings of a log with known landmarks, in the log's order."""

    row: Ints  # (s,) of the log's sightings
    step: Ints  # (s,)
    rank: Ints  # (s,) of the landmark: 0 is the one sighted first
    visit: Ints  # (s,) 0 from the first sighting of the landmark until it has been left, 1 after the first return ...
    before: Ints  # (s,) the step of the sighting of the same landmark before this one, -1 for the first
    returns: NDArray[np.bool]  # (s,) the first sighting after an absence
    after: float  # m of path without a landmark that make an absence


def way(log: Log) -> Array:
    """The path length (n,) in m from the start to each step, by odometry."""
    return np.concatenate((np.zeros(1), np.cumsum(np.hypot(*log.delta[1:, :2].T))))


def returns(log: Log) -> Returns:
    """Finds the returns: sightings of a landmark after AWAY median ranges of path without it."""
    row = np.flatnonzero(log.ids != UNKNOWN)
    step, ids = log.sighting_step[row], log.ids[row]
    after = AWAY * float(np.median(log.z[:, 0])) if len(row) else 0.0
    _, first, landmark = np.unique(ids, return_index=True, return_inverse=True)
    rank = np.empty(len(first), np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    order = np.argsort(landmark, kind="stable")  # by landmark, and of each in the order of time
    again = np.zeros(len(row), bool)
    again[1:] = landmark[order[1:]] == landmark[order[:-1]]
    before = np.full(len(row), -1)
    before[1:] = np.where(again[1:], step[order[:-1]], -1)
    gone = way(log)
    back = again & (gone[step[order]] - gone[before] > after)
    total = np.cumsum(back)
    start = np.flatnonzero(~again)
    visit = total - np.repeat(total[start], np.diff(np.append(start, len(row))))
    place = np.empty(len(row), np.int64)  # where each row of the log is in `order`
    place[order] = np.arange(len(row))
    return Returns(row, step, rank[landmark], visit[place], before[place], back[place], after)


def loops(log: Log, found: Returns) -> int:
    """Counts the loops that the log closes: the most of its absences of which no two overlap.

    An absence is from a sighting to the return of its landmark, or from a loop closure's earlier step to its later one.
    Always taking the one that ends first is optimal, so a robot that goes round n times closes n - 1 loops.
    """
    start = np.concatenate((found.before[found.returns], log.loop_to))
    end = np.concatenate((found.step[found.returns], log.loop_step))
    order = np.argsort(end, kind="stable")
    count, free = 0, -1
    for first, last in zip(start[order].tolist(), end[order].tolist(), strict=True):
        if first >= free:
            count, free = count + 1, last
    return count
