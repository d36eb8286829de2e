"""All motions and loop closures of a log, for the path at its end."""

import numpy as np

from ...core.factors import Odometry, RelativePoses
from ...core.se2 import Array, Ints, wrap
from . import _gradients
from .compacted import Which

NEWTON, STILL = 20, 1e-6
"""Most iterations of Gauss-Newton at the end; m, rad: the largest offset after which there is no other."""

MOST, ENOUGH = 300, 1e-8
"""Iterations of conjugate gradients in each, and the share of what J could fall by at which they end."""

TOGETHER = 4096  # loop closures that are put in one array
SIX = np.triu_indices(3)


class Way:
    """Motions and loop closures, nine numbers each."""

    def __init__(self) -> None:
        self._motions = np.zeros((1024, 9))
        self._steps = 0
        self._ends, self._loops = list[Ints](), list[Array]()  # of loop closures, (k, 2) and (k, 9)
        self._new_ends, self._new = list[tuple[int, int]](), list[Array]()

    def add(self, odometry: Odometry | None, loops: RelativePoses) -> None:
        """Adds the next step."""
        k = self._steps
        if k == len(self._motions):
            self._motions = np.concatenate((self._motions, np.zeros_like(self._motions)))
        if odometry is not None:
            self._motions[k, :3], self._motions[k, 3:] = odometry.delta, odometry.cov[SIX]
        for to, delta, cov in zip(loops.to.tolist(), loops.delta, loops.cov, strict=True):
            self._new_ends.append((to, k))
            self._new.append(np.concatenate((delta, cov[SIX])))
        if len(self._new) >= TOGETHER:
            self._pack()
        self._steps += 1

    def smoothed(self, path: Array, free: Which, settings: Array) -> Array:
        """A path (n, 3) that minimises what these add to J, by the steps that are `free` (n,); the others stay.

        `settings` begin with kind and scale of the loop closures' loss. It is the path itself where J is flat.
        """
        self._pack()
        n = self._steps
        ends = np.concatenate((np.stack((np.arange(n - 1), np.arange(1, n)), axis=1), *self._ends))
        motions = np.concatenate((self._motions[1:n], *self._loops))
        some = np.asarray(free[ends[:, 0]] | free[ends[:, 1]])
        ends, motions, loops = ends[some], motions[some], int(np.count_nonzero(some[n - 1 :]))
        a, b = np.ascontiguousarray(ends.T)
        e, g, W = np.empty((len(a), 3)), np.empty((len(a), 2)), np.empty((len(a), 6))
        out, x = path.copy(), np.zeros((n, 3))
        for _ in range(NEWTON):
            if not _gradients.linearise(out, a, b, motions, loops, settings, e, g, W):
                return path
            if _gradients.offsets(a, b, e, g, W, free, MOST, ENOUGH, x) < 0:
                return path
            out += x
            out[:, 2] = wrap(out[:, 2])
            if np.abs(x).max() < STILL:
                break
        return out

    def _pack(self) -> None:
        if self._new:
            self._ends.append(np.array(self._new_ends, np.int64))
            self._loops.append(np.array(self._new))
            self._new_ends, self._new = [], []
