"""The motion between any two steps, as well as it is known: along the way of least variance, over steps and loops."""

from typing import Any

import numpy as np

from ...core.se2 import Array, Ints, compose, inverse
from ._ways import ways_to
from .planar import Planar, back, chained

ROOM = 256  # nodes, and edges, that there is room for at first; then always for twice as many


class Ways:
    """Motions between steps, as edges of a graph that begins with step 0."""

    def __init__(self) -> None:
        self._steps, self._edges = 1, 0
        self._first = np.full(ROOM, -1)  # of the edges that lead to each step
        self._next, self._other = np.full(ROOM, -1), np.full(ROOM, -1)  # of each edge: the one after it; its start
        self._variance, self._motions = np.zeros(ROOM), np.zeros((ROOM, 12))  # and delta with covariance
        self._to, self._came, self._least = -1, np.zeros(0, np.int64), np.zeros(0)  # ways to the step last asked for

    def step(self, motion: Planar) -> None:
        """Adds a step, with the motion since the one before."""
        self._steps += 1
        if self._steps > len(self._first):
            self._first = np.concatenate((self._first, np.full(len(self._first), -1)))
        self.join(self._steps - 2, self._steps - 1, motion)

    def join(self, first: int, second: int, motion: Planar) -> None:
        """Adds the motion from one step to another; a radian counts as the metre by which it moves what is that far."""
        self._add(first, second, motion)
        self._add(second, first, back(motion))
        self._to = -1

    def motion(self, first: int, second: int) -> Planar:
        """The motion from one step to another."""
        if self._to != second:
            self._to, (self._came, self._least) = second, self._ways_to(second)
        way = list[int]()
        while first != second:
            edge = int(self._came[first])
            way.append(edge)
            first = int(self._target(edge))
        rows = self._motions[way]
        return chained(rows[:, :3], rows[:, 3:].reshape(-1, 3, 3))

    def path(self) -> Array:
        """The poses (n, 3) of all steps in the frame of the first one, each along its way to it."""
        came, least = self._ways_to(0)
        out = np.zeros((self._steps, 3))
        for step in np.argsort(least, kind="stable")[1:].tolist():  # the next step on a way is nearer to its end
            edge = int(came[step])
            out[step] = compose(out[self._target(edge)], inverse(self._motions[edge, :3]))
        return out

    def variance(self, first: int, second: int) -> float:
        """The sum of the variances on the way from one step to another."""
        self.motion(first, second)
        return float(self._least[first])

    def _add(self, first: int, second: int, motion: Planar) -> None:
        """Adds an edge; those there and back are neighbours, as even and odd rows."""
        e = self._edges
        if e == len(self._next):
            self._next, self._other = _doubled(self._next), _doubled(self._other)
            self._variance, self._motions = _doubled(self._variance), _doubled(self._motions)
        self._next[e], self._first[second], self._other[e] = self._first[second], e, first
        self._variance[e] = np.trace(motion.cov)
        self._motions[e, :3], self._motions[e, 3:] = motion.delta, motion.cov.ravel()
        self._edges += 1

    def _target(self, edge: int) -> int:
        """The step that an edge leads to: where the one back starts."""
        return self._other[edge ^ 1]

    def _ways_to(self, end: int) -> tuple[Ints, Array]:
        """(n,) the edge on which the way from each step to `end` begins, and its variance."""
        n, e = self._steps, self._edges
        came, least = np.empty(n, np.int64), np.empty(n)
        ways_to(end, self._first[:n], self._next[:e], self._other[:e], self._variance[:e], least, came)
        return came, least


def _doubled(part: Any) -> Any:
    """The same rows, and as many more."""
    return np.concatenate((part, np.zeros_like(part)))


def joined(way: list[Planar]) -> Planar:
    """Motions one after another, as one."""
    return chained(np.array([one.delta for one in way]), np.array([one.cov for one in way]))
