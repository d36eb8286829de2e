"""Finds the pose of sightings on a map from nothing but the map: an unknown start, a kidnapped robot, a lost filter.

Pairs of sightings are laid on pairs of landmarks as far apart. The best of these poses are refined by least squares in
the joint covariance of sightings and landmarks, and scored by their likelihood over chance: that of
sightings of landmarks strewn as densely as the map's, integrated over the poses, each as likely before. A pose is found
only where enough landmarks agree on it and no other place is nearly as likely.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...core.factors import UNKNOWN, Map, Step
from ...core.se2 import Array, Ints, wrap
from ._hypotheses import Hypotheses, search
from ._map_index import MapIndex
from ._places import SightedPlaces, grouped, merge
from ._refine import refine
from .map_index import indexed
from .virtual import Virtual, backward, virtual

LEAST = 6  # landmarks that have to agree
MARGIN = 10.0  # logarithm of the likelihood over chance, and over that of the best pose elsewhere
GATE = 9.21  # the 99 % point of chi-square with two degrees of freedom
PLACES = 16  # places used, the surest ones
SIGHTINGS = 400
"""Sightings used at most, those of the last steps: the cost of their joint covariance is quadratic."""
DOUBT = 16.0  # the odometry's covariances are multiplied by this: many logs state them too small
LAID = 20_000
"""Pairs of landmarks tried at most: those of the pairs of places that fit fewest come first."""
REFINED = 48  # poses refined


class Fix(NamedTuple):
    """A pose found on a map."""

    pose: Array  # (3,) at the last of the steps
    cov: Array  # (3, 3) of (x, y, heading) in the map's frame
    ids: Ints  # (s,) the landmark that each sighting of the steps was matched with, UNKNOWN: none
    gain: float  # logarithm of the likelihood over chance
    margin: float  # by which this is more than that of the best pose elsewhere


def locate(steps: Sequence[Step], known: Map | MapIndex, least: int = LEAST, margin: float = MARGIN) -> Fix | None:
    """Finds the pose at the last of the steps on the map, by their sightings and the odometry between them.

    A sighting with an id that the map has can only be of that landmark; any other, of each. None unless `least`
    landmarks agree and the best pose is `margin` likelier, by the logarithm, than chance and than the best elsewhere.
    """
    many = np.array([len(step.sightings.ids) for step in steps])
    used = max(1, int(np.searchsorted(np.cumsum(many[::-1]), SIGHTINGS, side="right")))
    seen = virtual(backward(steps[-used:]), DOUBT)
    if len(seen.ids) < least or len(known.ids) < least:
        return None
    on = known if isinstance(known, MapIndex) else indexed(known)
    places = _places(seen, on)
    if len(places.who) < least:
        return None
    found = _refined(places, on)
    if not found:
        return None
    best = max(found, key=lambda one: one.gain)
    elsewhere = max((one.gain for one in found if _elsewhere(one, best)), default=0.0)
    ahead = best.gain - max(elsewhere, 0.0)
    if (best.to >= 0).sum() < least or ahead < margin:
        return None
    matched = np.where(best.to >= 0, on.ids[best.to], UNKNOWN)
    ids = np.full(many.sum(), UNKNOWN)
    forward = np.argsort(-seen.step, kind="stable")  # sightings in the order of the steps
    ids[len(ids) - len(forward) :] = np.where(places.chosen >= 0, matched[places.chosen], UNKNOWN)[forward]
    return Fix(best.pose, best.cov, ids, best.gain, ahead)


class _Pose(NamedTuple):
    pose: Array  # (3,)
    cov: Array  # (3, 3)
    to: Ints  # (k,) the landmark of each place by its row in the map, -1: none
    gain: float


def _places(seen: Virtual, on: MapIndex) -> SightedPlaces:
    """Joins the sightings of each landmark, and chooses the surest places."""
    order = np.argsort(on.ids, kind="stable")
    at = order[np.minimum(np.searchsorted(on.ids, seen.ids, sorter=order), len(order) - 1)]
    row = np.where((on.ids[at] == seen.ids) & (seen.ids != UNKNOWN), at, -1)
    group = np.empty(len(seen.ids), np.int64)
    n = grouped(seen.ids, (row >= 0).astype(np.int64), seen.step, seen.xy, seen.cov, GATE, group)
    xy, cov = np.zeros((n, 2)), np.zeros((2 * n, 2 * n))
    merge(group, seen.xy, seen.cov, 1 / np.diag(seen.cov).reshape(-1, 2).sum(axis=1), xy, cov)
    half = 0.5 * (cov[::2, ::2] + cov[1::2, 1::2])
    best = np.sort(np.argsort(np.diag(half), kind="stable")[:PLACES])
    entries = (2 * best[:, None] + np.arange(2)).ravel()
    who, number = np.full(n, -1), np.full(n, -1)
    who[group] = row
    number[best] = np.arange(len(best))
    return SightedPlaces(
        xy=xy[best],
        cov=np.ascontiguousarray(cov[np.ix_(entries, entries)]),
        half=np.ascontiguousarray(half[np.ix_(best, best)]),
        who=who[best],
        chosen=number[group],
    )


def _hypotheses(places: SightedPlaces, on: MapIndex) -> Hypotheses:
    """Returns the pairs of places, each with the pairs of landmarks on which it may lie: those of fewest first."""
    i, j = np.tril_indices(len(places.xy), -1)
    length = np.hypot(*(places.xy[i] - places.xy[j]).T)
    half, widest = places.half, on.variance.max(initial=0.0)
    slack = np.sqrt(GATE * (half[i, i] + half[j, j] - 2 * half[i, j] + widest))
    low = np.searchsorted(on.length, length - slack)
    high = np.searchsorted(on.length, length + slack, side="right")
    order = np.argsort(high - low, kind="stable")
    order = order[length[order] > slack[order]]  # nearer, they tell no heading
    order = order[: max(1, int(np.searchsorted(np.cumsum((high - low)[order]), LAID)))]
    k = len(places.xy)
    return Hypotheses(
        pairs=np.column_stack((i[order], j[order])),
        low=low[order],
        high=high[order],
        lever=np.empty(k),
        spread=np.empty(k),
        best=np.empty(k + 1),
        kept=np.empty((REFINED, 4)),
    )


def _refined(places: SightedPlaces, on: MapIndex) -> list[_Pose]:
    """Returns the best poses on the map, refined."""
    hypotheses = _hypotheses(places, on)
    count = search(hypotheses, places, on, GATE, on.cell / 4)
    found, mean = list[_Pose](), places.xy.mean(axis=0)
    for x, y, heading, _ in hypotheses.kept[:count].tolist():
        c, s = np.cos(heading), np.sin(heading)
        pose = np.array((x - c * mean[0] + s * mean[1], y - s * mean[0] - c * mean[1], heading))
        to, cov = np.empty(len(places.xy), np.int64), np.empty((3, 3))
        gain = refine(places, on, pose, cov, to, GATE, 2)
        if gain > 0:
            pose[2] = wrap(pose[2])
            found.append(_Pose(pose, (cov + cov.T) / 2, to, gain))
    return found


def _elsewhere(one: _Pose, best: _Pose) -> bool:
    """Returns True where a pose matches fewer than half of the best one's places with the same landmarks."""
    return 2 * int(((one.to == best.to) & (best.to >= 0)).sum()) < int((best.to >= 0).sum())
