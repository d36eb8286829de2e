"""Landmarks: features that are seen again get an id, by descriptor and by the motion that they agree with."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.elementary import arctan2, hypot
from ...core.files import Rows
from ...core.se2 import Array, Ints
from ...core.small_matrices import propagated
from ._depth_image import apart
from .pairs import Keyframe, Pair
from .points import SHARED
from .settings import Settings

LINKED = 3
"""One in so many of a step's sightings, at least, are of landmarks that a step before sees, too."""

BACK = 3  # steps back to the first one that a step's landmarks are compared with


SIGHTING = np.dtype([("step", np.int64), ("id", np.int64), ("z", float, (2,)), ("cov", float, (2, 2))])
"""A sighting. Those of a drive are several times as many as its log will have: they wait in a file."""


class Sighted(NamedTuple):
    """The columns of a log's sightings, in the order of their steps."""

    step: Ints  # (s,)
    ids: Ints  # (s,)
    z: Array  # (s, 2)
    cov: Array  # (s, 2, 2)


class Tracks:
    """The ids of features, and their sightings."""

    def __init__(self, settings: Settings) -> None:
        self._settings, self._all, self._next = settings, Rows(SIGHTING), 0

    def link(self, pair: Pair) -> None:
        """Makes the features of two keyframes that agree the same landmarks; an id is in a frame once.

        A feature whose depth is that of a landmark beside it becomes none: their errors would be alike.
        """
        first, second = pair.first, pair.second
        free = pair.rows[second.ids[pair.rows[:, 1]] < 0]
        known = first.ids[free[:, 0]]
        free = free[(known < 0) | ~np.isin(known, second.ids)]
        without = np.flatnonzero(first.ids[free[:, 0]] < 0)
        alone = apart(first.features.pixels, first.ids >= 0, free[without, 0], SHARED)
        free = np.delete(free, without[~alone], axis=0)
        new = free[first.ids[free[:, 0]] < 0, 0]
        first.ids[new] = self._next + np.arange(len(new))
        self._next += len(new)
        second.ids[free[:, 1]] = first.ids[free[:, 0]]
        self._add(first, new)
        self._add(second, free[:, 1])

    def chosen(self) -> Sighted:
        """The sightings of landmarks that have enough of them; those seen most often where a step has too many.

        A landmark that is left with too few is dropped, those with the fewest first, and others take its place. Where
        a step then has too few landmarks in common with one before, others that both see come first, even those that
        only these two see: without them nothing but the wheels would tell the motion.
        """
        s, rows = self._settings, self._all.all()
        all_ = Sighted(rows["step"].copy(), rows["id"].copy(), rows["z"], rows["cov"])
        enough = s.sightings // LINKED
        links, first = _links(all_, enough), np.zeros(len(all_.ids), bool)
        while True:
            kept = self._kept(all_, first)
            there, before = np.zeros(len(first), bool), int(first.sum())
            there[kept] = True
            for common in links:
                together = there[common].all(axis=1)
                others = common[~together & ~first[common].all(axis=1)]
                first[others[: max(enough - int(together.sum()), 0)]] = True
            if first.sum() == before:
                return Sighted(all_.step[kept], all_.ids[kept], all_.z[kept], all_.cov[kept])

    def _kept(self, all_: Sighted, first: NDArray[np.bool_]) -> Ints:
        """The rows of the sightings that steps have room for, in the order of the steps; those of `first` come first.

        Landmarks with a sighting in `first` may be seen twice only.
        """
        s, times = self._settings, np.bincount(all_.ids)
        least = np.full(len(times), s.seen_often)
        least[all_.ids[first]] = 2
        order = np.lexsort((all_.ids, -times[all_.ids], ~first, all_.step))
        order = order[(times >= least)[all_.ids[order]]]
        while True:
            step = all_.step[order]
            kept = order[np.arange(len(step)) - np.searchsorted(step, step) < s.sightings]
            left = np.bincount(all_.ids[kept], minlength=len(times))  # of each landmark; none where steps have no room
            few = (left > 0) & (left < least)
            if not few.any():
                return kept
            dropped = np.flatnonzero(few & (left == left[few].min()))
            order = order[~np.isin(all_.ids[order], dropped)]

    def _add(self, frame: Keyframe, rows: Ints) -> None:
        z, cov = sightings(frame, rows, self._settings)
        new = np.empty(len(rows), SIGHTING)
        new["step"], new["id"], new["z"], new["cov"] = frame.step, frame.ids[rows], z, cov
        self._all.add(new)


def sightings(frame: Keyframe, rows: Ints, settings: Settings) -> tuple[Array, Array]:
    """Ranges (m) and bearings (rad), (k, 2), of the features `rows` from the robot, and their covariances (k, 2, 2).

    The error of the level, which the features of a frame share, is part of each covariance. That of the place in the
    image is larger than between neighbouring frames: it changes slowly with the view, and a landmark is seen from far
    and near.
    """
    points, (R, t) = frame.features.points.taken(rows), (frame.level.T[:3, :3], frame.level.T[:3, 3])
    points = points._replace(ray_sd=settings.seen_apart * points.ray_sd)
    x, y, up = (points.xyz @ R.T + t).T
    cov = propagated(R[:2], points.cov)
    by_level = np.zeros((len(rows), 2, 2))  # of x and y by turns about x and y
    by_level[:, 0, 1], by_level[:, 1, 0] = up, -up
    cov += propagated(by_level, frame.level.cov[:2, :2])
    away = hypot(x, y)
    J = np.stack((x / away, y / away, -y / away**2, x / away**2), axis=-1).reshape(-1, 2, 2)
    cov = propagated(J, cov) + np.diag([settings.floor**2, settings.turn_floor**2])
    return np.column_stack((away, arctan2(y, x))), (cov + cov.swapaxes(1, 2)) / 2


def _links(all_: Sighted, enough: int) -> list[Ints]:
    """For each step the sightings (k, 2) of landmarks that it and one before both see, those seen most often first.

    The one before is the last that has `enough` of them in common, else the one with the most.
    """
    times, out = np.bincount(all_.ids), list[Ints]()
    order = np.lexsort((all_.ids, all_.step))
    starts = np.searchsorted(all_.step[order], np.arange(all_.step.max(initial=-1) + 2))
    steps = [order[a:b] for a, b in pairwise(starts)]
    for k, rows in enumerate(steps):
        best = np.zeros((0, 2), np.int64)
        for before in steps[max(k - BACK, 0) : k][::-1]:
            _, a, b = np.intersect1d(all_.ids[before], all_.ids[rows], assume_unique=True, return_indices=True)
            if len(a) > len(best):
                best = np.column_stack((before[a], rows[b]))
            if len(best) >= enough:
                break
        out.append(best[np.argsort(-times[all_.ids[best[:, 0]]], kind="stable")])
    return out
