"""Landmarks: features that are seen again get an id, by descriptor and by the motion that they agree with."""

from typing import NamedTuple

import numpy as np

from ..se2 import Array, Ints
from .keyframe import Keyframe, sightings
from .pairs import Pair
from .settings import Settings


class Sighted(NamedTuple):
    """The columns of a log's sightings, in the order of their steps."""

    step: Ints  # (s,)
    ids: Ints  # (s,)
    z: Array  # (s, 2)
    cov: Array  # (s, 2, 2)


class Tracks:
    """The ids of features, and their sightings."""

    def __init__(self, settings: Settings) -> None:
        self._settings, self._parts, self._next = settings, list[Sighted](), 0

    def link(self, pair: Pair) -> None:
        """Makes the features of two keyframes that agree the same landmarks; an id is in a frame once."""
        first, second = pair.first, pair.second
        free = pair.rows[second.ids[pair.rows[:, 1]] < 0]
        known = first.ids[free[:, 0]]
        free = free[(known < 0) | ~np.isin(known, second.ids)]
        new = free[first.ids[free[:, 0]] < 0, 0]
        first.ids[new] = self._next + np.arange(len(new))
        self._next += len(new)
        second.ids[free[:, 1]] = first.ids[free[:, 0]]
        self._add(first, new)
        self._add(second, free[:, 1])

    def chosen(self) -> Sighted:
        """The sightings of landmarks that are seen often enough; those seen most often where a step has too many."""
        s = self._settings
        if not self._parts:
            return Sighted(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros((0, 2, 2)))
        all_ = Sighted(*(np.concatenate(parts) for parts in zip(*self._parts, strict=True)))
        times = np.bincount(all_.ids)[all_.ids]
        order = np.lexsort((all_.ids, -times, all_.step))
        order = order[times[order] >= s.seen_often]
        step = all_.step[order]
        rank = np.arange(len(step)) - np.searchsorted(step, step)
        return Sighted(*(column[order[rank < s.sightings]] for column in all_))

    def _add(self, frame: Keyframe, rows: Ints) -> None:
        z, cov = sightings(frame, rows, self._settings)
        self._parts.append(Sighted(np.full(len(rows), frame.step), frame.ids[rows], z, cov))
