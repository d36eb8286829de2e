"""Equations along a known path with everything eliminated but the systematic errors.

No landmark then shares a measurement with another one: each is eliminated by itself, so that thousands cost little.
"""

import numpy as np
from scipy.sparse import csr_matrix

from ...core.se2 import Array
from ...datasets.noise.systematic import NAMES, Systematic
from .reduced import HELD, Reduced, edges_of, rows_of_stretches
from .system import System


class OnPath:
    """A system's equations where its path is known, at its state and those errors."""

    def __init__(self, system: System, errors: Systematic, *, evenly: bool = False) -> None:
        r, J, step = system.linearised(errors, evenly=evenly)
        by_place, by_errors = J[:, : system.xy.size], J[:, system.xy.size :].toarray()
        edges = edges_of(system)
        self._parts = [_Blocks.of(by_place[rows], by_errors[rows], r[rows]) for rows in rows_of_stretches(edges, step)]
        self._whole = _Blocks.of(by_place, by_errors, r)

    def reduced(self) -> Reduced:
        """The equations of the errors."""
        H, g = self._whole.errors_alone(self._whole)
        without = [(self._whole - part).errors_alone(self._whole) for part in self._parts]
        H_without, g_without = (np.array(one) for one in zip(*without, strict=True))
        return Reduced(H, g, H_without, g_without)

    def change(self, errors: Array) -> Array:
        """Changes (variables,) of landmarks that go with those (p,) of the errors, and the latter."""
        whole = self._whole
        pull = whole.pull + whole.mixed @ errors
        return np.concatenate((-whole.solved(pull[..., None], whole)[..., 0].ravel(), errors))


class _Blocks:
    """Normal equations of m landmarks and p errors."""

    def __init__(self, own: Array, mixed: Array, H: Array, pull: Array, g: Array) -> None:
        self.own = own  # (m, 2, 2) of each landmark
        self.mixed = mixed  # (m, 2, p)
        self.H = H  # (p, p)
        self.pull = pull  # (m, 2)
        self.g = g  # (p,)

    @classmethod
    def of(cls, by_place: csr_matrix, by_errors: Array, r: Array) -> "_Blocks":
        """Those of residuals (r,) and their derivatives."""
        square = by_place.T @ by_place
        x, y = square.diagonal()[::2], square.diagonal()[1::2]
        m = len(x)
        xy = square.diagonal(1)[::2] if m else x
        own = np.stack((x, xy, xy, y), axis=-1).reshape(-1, 2, 2)
        mixed = np.asarray(by_place.T @ by_errors).reshape(m, 2, len(NAMES))
        pull = np.asarray(by_place.T @ r).reshape(m, 2)
        return cls(own, mixed, by_errors.T @ by_errors, pull, by_errors.T @ r)

    def __sub__(self, other: "_Blocks") -> "_Blocks":
        return _Blocks(
            self.own - other.own, self.mixed - other.mixed, self.H - other.H, self.pull - other.pull, self.g - other.g
        )

    def errors_alone(self, whole: "_Blocks") -> tuple[Array, Array]:
        """The Schur complement of the errors."""
        solved = self.solved(np.concatenate((self.mixed, self.pull[..., None]), axis=2), whole)
        taken = np.einsum("mip,miq->pq", self.mixed, solved)
        return self.H - taken[:, :-1], self.g - taken[:, -1]

    def solved(self, b: Array, whole: "_Blocks") -> Array:
        """Each landmark's own^-1 b (m, 2, k), with 0 for one of which nothing is left of the `whole`."""
        size = np.einsum("mii->mi", whole.own)
        left = (np.einsum("mii->mi", self.own) > 1e-9 * size).all(axis=1)
        found = np.zeros_like(b)
        held = HELD * size[left][..., None] * np.eye(2)
        found[left] = np.linalg.solve(self.own[left] + held, b[left])
        return found
