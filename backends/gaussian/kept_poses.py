"""The poses that a filter keeps in its state, so that loop closures can come back to them.

A delayed-state filter (Eustice, Singh and Leonard, Exactly Sparse Delayed-State Filters for View-Based SLAM, IEEE
Trans. Robotics 22(6), 2006) clones its pose after every step: the clone has the pose's covariance and its
cross-covariances, and stays where it is when the robot moves on. A loop closure measures the present pose in the frame
of a clone, and corrects both and all that is correlated with them. With all poses kept the state at the end is the path
given all measurements.

Where only some can be kept, they are spread evenly over the steps: each new pose replaces the one whose neighbours are
the fewest steps apart. Leaving a pose out of a Gaussian is exact; what is lost is the loop closures to it.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ...core.factors import RelativePoses
from ...core.se2 import Array, Ints

SPACE = 64  # rows of the table at first, doubled when exhausted

SUMMARY = "on logs with loop closures: poses kept in the state for them, spread evenly over the steps; 0: all"
"""The option `poses`."""

NOWHERE = np.zeros((0, 2), np.int64)  # the entries of no poses


class Loops(NamedTuple):
    """The k loop closures of a step to poses that are kept, and where its own pose is to be kept."""

    to: Ints  # (k,) steps
    entries: Ints  # (k, 2) of x, with y after it; of the heading
    delta: Array  # (k, 3)
    cov: Array  # (k, 3, 3)
    clone: tuple[int, int]  # the same two entries

    def pairs(self) -> list[int]:
        """The pairs of the state with these entries, each once."""
        return list(dict.fromkeys(entry // 2 for entry in (*self.entries.ravel().tolist(), *self.clone)))

    def moved(self, place: Mapping[int, int]) -> "Loops":
        """The same with pair i of the state at `place[i]` of a part of it."""
        entries = [2 * place[entry // 2] + entry % 2 for entry in (*self.entries.ravel().tolist(), *self.clone)]
        return self._replace(entries=np.array(entries[:-2], np.int64).reshape(-1, 2), clone=(entries[-2], entries[-1]))


class KeptPoses:
    """Which steps' poses are kept, and at which entries of the state after the pose's own three."""

    def __init__(self, most: int) -> None:
        self._most = most  # 0: all
        self._row: dict[int, int] = {}  # step -> its row, steps ascending
        self._entries = np.zeros((SPACE, 2), np.int64)  # of x, with y after it; of the heading
        self._spare: list[int] = []  # headings come in pairs: the one not yet used
        self.steps = 0  # so far

    @property
    def kept(self) -> list[int]:
        """The steps whose poses are kept, ascending."""
        return list(self._row)

    @property
    def complete(self) -> bool:
        """True while the pose of every step is kept."""
        return len(self._row) == self.steps

    @property
    def entries(self) -> Ints:
        """(k, 2) entries of x and of the heading of every pose kept; by step where all are."""
        return self._entries[: len(self._row)]

    def take(self, loops: RelativePoses, pairs: int) -> tuple[Loops, int]:
        """The next step, in a state of that many pairs: its loop closures to kept poses, and the pairs it then has."""
        kept = [i for i, to in enumerate(loops.to.tolist()) if to in self._row]
        to = loops.to[kept]
        entries = self._entries[[self._row[step] for step in to.tolist()]]
        row, pairs = self._next(pairs)
        at, turn = self._entries[row].tolist()
        return Loops(to, entries, np.array(loops.delta[kept]), np.array(loops.cov[kept], order="C"), (at, turn)), pairs

    def _next(self, pairs: int) -> tuple[int, int]:
        """The row of the next step's pose, and the pairs of the state with it."""
        if self._most and len(self._row) == self._most:
            row = self._row.pop(self._densest())
        else:
            row = len(self._row)
            pairs = self._add(row, pairs)
        self._row[self.steps] = row
        self.steps += 1
        return row, pairs

    def _add(self, row: int, pairs: int) -> int:
        """Fills a new row: a pair of entries for the place, and half a pair for the heading."""
        if row == len(self._entries):
            self._entries = np.concatenate((self._entries, np.zeros_like(self._entries)))
        place, pairs = 2 * pairs, pairs + 1
        if not self._spare:
            self._spare, pairs = [2 * pairs + 1, 2 * pairs], pairs + 1
        self._entries[row] = place, self._spare.pop()
        return pairs

    def _densest(self) -> int:
        """The step whose neighbours, the coming step among them, are closest; the earliest of those that are."""
        steps = np.fromiter((*self._row, self.steps), np.int64, len(self._row) + 1)
        gaps = steps[2:] - steps[:-2]
        return int(steps[1 + np.argmin(gaps)] if len(gaps) else steps[0])
