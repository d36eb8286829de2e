"""Places a log's landmarks by its own sightings from a known path, and finds ids that are not in one place."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.arrays import slices
from ...core.factors import UNKNOWN, Log, Map, Truth
from ...core.se2 import Array, Ints, act
from ...core.truth.doubts import judges
from ...core.truth.errors import rows_of, standing

LEAST = 8  # sightings of an id from which on their median is a place to judge by
WIDE = 8.0  # an id with more than this multiple of the typical id's spread is not in one place
ELSEWHERE = 0.3  # of a map's size; a median distance beyond it is no error of sightings: the map is another one
LEFT = 0.25  # of that distance, which is left where a turn and a shift of the map explain it
FEWEST = 5  # landmarks with a true place from which on these can be told to be another map's
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
    count = np.bincount(landmark, minlength=len(ids))
    if len(ids) <= np.iinfo(np.uint16).max:  # a quarter of the memory, and NumPy sorts such integers in linear time
        landmark = landmark.astype(np.uint16)
    order = np.argsort(landmark, kind="stable")
    points = sighted_along(log, poses, pose_at, row)
    xy = np.column_stack([_medians(order, count, points[:, i]) for i in (0, 1)])
    off, sd = np.empty(len(row)), np.empty(len(row))
    for some in slices(len(row)):
        off[some] = np.hypot(*(points[some] - xy[landmark[some]]).T)
        mine = row[some]
        sd[some] = np.sqrt(log.z_cov[mine, 0, 0] + log.z[mine, 0] ** 2 * log.z_cov[mine, 1, 1])
    spread = _medians(order, count, off)
    judged = (count >= LEAST) & known
    typical = float(np.median(spread[judged])) if judged.any() else 0.0
    scattered = judged & (spread > np.maximum(WIDE * typical, BEYOND * _medians(order, count, sd)))
    return Places(ids, xy, spread, count, scattered)


def sighted_along(log: Log, poses: Array, pose_at: Ints, row: Ints) -> Array:
    """Returns where (m, 2) in the world the sightings of the rows (m,) are; `poses` and `pose_at` as in `placed`."""
    step, points = log.sighting_step, np.empty((len(row), 2))
    for some in slices(len(row)):
        points[some] = sighted(poses[pose_at[step[row[some]]]], log.z[row[some]])
    return points


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


def elsewhere(truth: Truth, places: Places) -> bool:
    """True where true landmarks are not where sightings from the true path have them, as of another frame or unit."""
    known = standing(truth)
    sure = places.ids[~places.scattered]
    row = np.full(len(sure), -1) if known is None else rows_of(known.ids, sure)
    if known is None or (row >= 0).sum() < FEWEST:
        return False
    here = places.xy[~places.scattered][row >= 0]
    there = known.xy[row[row >= 0]]
    noise = np.median(places.spread[~places.scattered][row >= 0])
    off, left = (np.median(np.hypot(*(one - here).T)) for one in (there, _onto(there, here)))
    size = np.sqrt(((here - here.mean(axis=0)) ** 2).sum(axis=1).mean())
    return bool((off > BEYOND * noise and off > ELSEWHERE * size) or (off > WIDE * noise and left < LEFT * off))


def _onto(points: Array, others: Array) -> Array:
    """Turns and moves points (n, 2) onto others by least squares."""
    middle, target = points.mean(axis=0), others.mean(axis=0)
    a, b = points - middle, others - target
    angle = np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum())
    return act(np.array([[*target, angle]]), a)


def comparable(log: Log, truth: Truth) -> Truth:
    """The truth to compare sightings with: landmarks without a true place, or elsewhere, are at their medians."""
    places = placed(log, truth.poses, rows_of(truth.t, log.t), known=True)
    if truth.map is not None and not elsewhere(truth, places):
        return truth
    return judge(log, truth, places) or truth


def sighted(poses: Array, z: Array) -> Array:
    """Returns where (s, 2) in the world the sightings `z` (s, 2) made from `poses` (s, 3) are."""
    return act(poses, z[:, :1] * np.column_stack((np.cos(z[:, 1]), np.sin(z[:, 1]))))


def _medians(order: Ints, count: Ints, values: Array) -> Array:
    """The median (l,) of each landmark's `values`; the `count[k]`, at least one, of landmark k are next in `order`."""
    ordered = values[order]
    first = np.cumsum(count) - count
    for begin, size in zip(first.tolist(), count.tolist(), strict=True):
        ordered[begin : begin + size].sort()
    return (ordered[first + (count - 1) // 2] + ordered[first + count // 2]) / 2
