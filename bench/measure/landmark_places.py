"""Places a log's landmarks by its own sightings from a known path, and finds ids that are not in one place."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.factors import UNKNOWN, Log, Map, Truth
from ...core.se2 import Array, Ints, act
from ...core.truth_doubts import judges

LEAST = 8  # sightings of an id from which on their median is a place to judge by
WIDE = 8.0  # an id with more than this multiple of the typical id's spread is not in one place
BEYOND = 3.0  # an id is in one place within this multiple of the stated standard deviation


class Places(NamedTuple):
    """Every id's place by its own sightings from the path, ids in order."""

    ids: Ints  # (l,)
    xy: Array  # (l, 2) m, median
    spread: Array  # (l,) m, the median distance of its sightings from there
    sightings: Ints  # (l,) how many, from a known pose
    scattered: NDArray[np.bool_]  # (l,) not in one place


class Scattered(NamedTuple):
    """The ids that are not in one place."""

    ids: tuple[int, ...]
    sightings: int
    spread_least: float  # m
    spread_most: float


def placed(log: Log, poses: Array, pose_at: Ints, *, known: bool) -> Places:
    """Places ids from `poses` (m, 3), step k being row `pose_at[k]` or -1; none is scattered if not `known`."""
    row = np.flatnonzero((log.ids != UNKNOWN) & (pose_at[log.sighting_step] >= 0))
    ids, landmark = np.unique(log.ids[row], return_inverse=True)
    points = sighted(poses[pose_at[log.sighting_step[row]]], log.z[row])
    count = np.bincount(landmark, minlength=len(ids))
    xy = np.column_stack([_medians(landmark, count, points[:, i]) for i in (0, 1)])
    spread = _medians(landmark, count, np.hypot(*(points - xy[landmark]).T))
    sd = np.sqrt(log.z_cov[row, 0, 0] + log.z[row, 0] ** 2 * log.z_cov[row, 1, 1])
    judged = (count >= LEAST) & known
    typical = float(np.median(spread[judged])) if judged.any() else 0.0
    scattered = judged & (spread > np.maximum(WIDE * typical, BEYOND * _medians(landmark, count, sd)))
    return Places(ids, xy, spread, count, scattered)


def scattered_ids(places: Places | None) -> Scattered | None:
    """The ids that are not in one place; None without any."""
    if places is None or not places.scattered.any():
        return None
    spread = places.spread[places.scattered]
    ids = tuple(places.ids[places.scattered].tolist())
    return Scattered(ids, int(places.sightings[places.scattered].sum()), float(spread.min()), float(spread.max()))


def judge(log: Log, truth: Truth | None, places: Places | None) -> Truth | None:
    """Returns what a log's noise is compared with: exact truth of it alone; unknown landmarks are at their medians."""
    if truth is None or not judges(log, truth):
        return None
    if places is None:
        return truth
    sure = (places.sightings >= LEAST) & ~places.scattered
    return truth._replace(map=Map(places.ids[sure], places.xy[sure], None), assigned=None)


def sighted(poses: Array, z: Array) -> Array:
    """Returns where (s, 2) in the world the sightings `z` (s, 2) made from `poses` (s, 3) are."""
    return act(poses, z[:, :1] * np.column_stack((np.cos(z[:, 1]), np.sin(z[:, 1]))))


def _medians(landmark: Ints, count: Ints, values: Array) -> Array:
    """The median (l,) of each landmark's `values`; landmark k has `count[k]` of them, at least one."""
    ordered = values[np.lexsort((values, landmark))]
    first = np.cumsum(count) - count
    return (ordered[first + (count - 1) // 2] + ordered[first + count // 2]) / 2
