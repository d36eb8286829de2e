"""All motions and loop closures of a log, for the path at its end."""

import numpy as np

from ...core.factors import Odometry, RelativePoses
from ...core.se2 import Array, Ints, wrap
from . import _gradients
from .compacted import Which

NEWTON, STILL = 20, 1e-6
"""Most iterations of Gauss-Newton at the end; m, rad: the largest offset after which there is no other."""

ENOUGH = 1e-10
"""Share of what J could fall by at which conjugate gradients end.

A bend of the whole path is a share of 1e-5 of a random draw for 30,000 steps, and is found last.
"""

DRAWS = 24  # of the path's error, at random

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

    def factors(self, free: Which, settings: Array) -> "Factors":
        """Those that tell of the steps that are `free` (n,); `settings` begin with kind and scale of the loss."""
        self._pack()
        n = self._steps
        ends = np.concatenate((np.stack((np.arange(n - 1), np.arange(1, n)), axis=1), *self._ends))
        some = np.asarray(free[ends[:, 0]] | free[ends[:, 1]])
        a, b = np.ascontiguousarray(ends[some].T)
        motions = np.concatenate((self._motions[1:n], *self._loops))[some]
        return Factors(a, b, motions, int(np.count_nonzero(some[n - 1 :])), free, settings)

    def _pack(self) -> None:
        if self._new:
            self._ends.append(np.array(self._new_ends, np.int64))
            self._loops.append(np.array(self._new))
            self._new_ends, self._new = [], []


class Factors:
    """Motions and loop closures, the last ones, from steps a (m,) to steps b (m,), and what they are linearised to."""

    def __init__(self, a: Ints, b: Ints, motions: Array, loops: int, free: Which, settings: Array) -> None:
        m, n = len(a), len(free)
        self._a, self._b, self._motions, self._loops, self._free, self._settings = a, b, motions, loops, free, settings
        self._e, self._g, self._W = np.empty((m, 3)), np.empty((m, 2)), np.empty((m, 6))
        self._D, self._E = np.empty((n, 3, 3)), np.empty((n, 3, 3))
        self._r, self._x = np.empty((n, 3)), np.empty((n, 3))

    def smoothed(self, path: Array) -> Array | None:
        """A path (n, 3) that minimises what they add to J, by the steps that are free; the others stay.

        It begins at a path (n, 3), and is None where J is flat.
        """
        out = path.copy()
        for _ in range(NEWTON):
            if not self._linearised(out):
                return None
            _gradients.pulled(self._a, self._b, self._e, self._g, self._W, self._free, self._r)
            self._solve()
            out += self._x
            out[:, 2] = wrap(out[:, 2])
            if np.abs(self._x).max() < STILL:
                break
        return out

    def covariances(self, rng: np.random.Generator) -> Array:
        """(n, 3, 3) of the free steps given the others, where the path was smoothed, by random draws of its error.

        The sum of squares is divided by the draws less four: then an error's squared Mahalanobis distance is three in
        the mean, as with the true covariance (the mean of an inverse Wishart matrix).
        """
        out = np.zeros((len(self._free), 3, 3))
        for _ in range(DRAWS):
            noise = rng.standard_normal((len(self._a), 3))
            _gradients.drawn(self._a, self._b, self._g, self._W, self._free, noise, self._r)
            self._solve()
            _gradients.add_squares(self._x, out)
        return out / (DRAWS - 4)

    def _linearised(self, path: Array) -> bool:
        a, b, g, W = self._a, self._b, self._g, self._W
        return bool(
            _gradients.linearise(path, a, b, self._motions, self._loops, self._settings, self._e, g, W)
            and _gradients.chain(a, b, g, W, self._free, self._D, self._E)
        )

    def _solve(self) -> None:
        _gradients.offsets(self._a, self._b, self._g, self._W, self._free, self._D, self._E, self._r, ENOUGH, self._x)
