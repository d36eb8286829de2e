"""Finds ids that are sighted at two places, as of a marker that was printed twice, along a known or fitted path."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.factors import UNKNOWN, Log
from ...core.se2 import Array
from ..measure.landmark_places import LEAST, Places, sighted_along
from ..measure.misplaced import across

APART = 10.0  # distance of two places over the spread of sightings about them, and about landmarks in one place
BOTH = 0.1  # share of an id's sightings that is at the one place, the least
BETWEEN = 0.1  # share that may be at neither, farther than a quarter of the distance: a landmark that moves has more
WIDE = 5.0  # spread about a place over that of landmarks in one place, the most
MANY = 0.2  # share of the ids from which on the path is wrong, not they
ROUNDS = 10  # of assigning sightings to the nearer place, the most


class TwoPlaces(NamedTuple):
    """An id that is sighted at two places."""

    id: int
    distance: float  # m
    sightings: tuple[int, int]  # at either, the place that was sighted first before the other


def two_places(log: Log, path: Array, places: Places) -> list[TwoPlaces]:
    """Lists them by id; `path` (n, 3) has a pose for every step, or NaN, and `places` are the landmarks' by it."""
    there = np.asarray(np.isfinite(path).all(axis=1))
    known = np.flatnonzero((log.ids != UNKNOWN) & there[log.sighting_step])
    of = np.searchsorted(places.ids, log.ids[known])
    often = places.sightings >= LEAST
    if not often.any():
        return []
    points, sd = sighted_along(log, path, np.arange(len(path)), known), across(log)[known]
    own = np.bincount(of, sd) / np.maximum(places.sightings, 1)
    scale = float(np.median(places.spread[often] / own[often]))
    usual = np.maximum(float(np.median(places.spread[often])), scale * own)
    off = np.hypot(*(points - places.xy[of]).T) > APART / 2 * usual[of]
    some = often & (np.bincount(of, off) > BOTH / 2 * places.sightings)
    if some.sum() > MANY * often.sum() + 1:
        return []
    found = [_split(int(places.ids[k]), points[of == k], float(usual[k])) for k in np.flatnonzero(some)]
    return [one for one in found if one is not None]


def _split(name: int, points: Array, usual: float) -> TwoPlaces | None:
    """Divides an id's `points` (m, 2), in order of time, in two; None where these are no two places.

    First along their longest direction, where that leaves least, then by the nearer of the two medians.
    """
    centred = points - points.mean(axis=0)
    centred /= np.abs(centred).max()  # whose squares would be infinite, of what is huge
    along = centred @ np.linalg.eigh(centred.T @ centred)[1][:, 1]
    order, count = np.argsort(along, kind="stable"), np.arange(1, len(along))
    total = np.cumsum(along[order])[:-1]
    second = np.zeros(len(along), bool)
    second[order[int(np.argmax(total**2 / count + total**2 / (len(along) - count))) + 1 :]] = True
    middles, off = _about(points, second)
    for _ in range(ROUNDS):
        nearer = off[:, 1] < off[:, 0]
        if nearer.all() or not nearer.any():
            return None
        if (nearer == second).all():
            break
        second = nearer
        middles, off = _about(points, second)
    least, distance = off.min(axis=1), float(np.hypot(*(middles[1] - middles[0])))
    within = max(float(np.median(least[second])), float(np.median(least[~second])))
    counts = int((second == second[0]).sum()), int((second != second[0]).sum())
    if (
        min(counts) < max(LEAST, BOTH * len(points))
        or within > WIDE * usual
        or distance < APART * max(within, usual)
        or np.mean(least > distance / 4) > BETWEEN
    ):
        return None
    return TwoPlaces(name, distance, counts)


def _about(points: Array, second: NDArray[np.bool_]) -> tuple[Array, Array]:
    """The medians (2, 2) of either part of `points` (m, 2), and the distances (m, 2) from them."""
    middles = np.stack([np.median(points[~second], axis=0), np.median(points[second], axis=0)])
    return middles, np.hypot(*(points[:, None] - middles).transpose(2, 0, 1))
