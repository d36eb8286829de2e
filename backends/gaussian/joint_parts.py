"""Partial sightings and fixes in a joint belief, by the EKF's Jacobians: see `late_starts`."""

import numpy as np

from ...core.se2 import Array, Ints
from . import _partial, _triangle
from ._ekf import FIRST, IDEAL, POSE
from ._loops import keep
from .joint import Joint


class JointParts:
    """The methods of `Parts` on a `Joint`, linearised at the points that `where` names."""

    def __init__(self, whole: Joint, where: int) -> None:
        self._whole, self._where = whole, where

    @property
    def pairs(self) -> int:
        """The pairs of the state."""
        return self._whole.pairs

    def constant(self, first: float, second: float) -> int:
        """Adds a pair of constant errors around zero, with these standard deviations; returns its first entry."""
        whole = self._whole
        pair = whole.pairs
        whole.grow(pair + 1)
        whole.agreed[pair] = POSE
        rows = np.zeros((2, 2 * pair + 2))
        rows[0, 2 * pair], rows[1, 2 * pair + 1] = first**2, second**2
        _triangle.put(whole.flat, 2 * pair, 2 * pair + 2, rows)
        return 2 * pair

    def constants(self, entry: int) -> tuple[float, float]:
        """The present means of a pair of constant errors."""
        first, second = self._whole.mean[3 + entry : 5 + entry].tolist()
        return first, second

    def space(self) -> list[tuple[int, int]]:
        """Adds space for two poses to keep, whose headings make a pair."""
        whole = self._whole
        place = 2 * whole.pairs
        whole.grow(whole.pairs + 3)
        whole.agreed[whole.pairs - 3 : whole.pairs] = POSE
        return [(place + 2, place + 5), (place, place + 4)]

    def keep(self, clone: tuple[int, int]) -> None:
        """Clones the pose into these entries."""
        keep(self._whole.address, 2 * self._whole.pairs, 0, *clone)

    def poses(self, clones: Ints) -> tuple[Array, Array]:
        """Kept poses (k, 3) at entries (k, 2), and their joint covariance (3k, 3k)."""
        entries = np.column_stack((clones[:, 0], clones[:, 0] + 1, clones[:, 1]))
        cov = np.empty((entries.size, entries.size))
        _triangle.submatrix(self._whole.flat, entries.ravel(), cov)
        return self._whole.mean[3 + entries], cov

    def begin(self, xy: Array, sd: float, agreed: int) -> int:
        """Adds a landmark at xy (2,), independent, of standard deviation `sd` (m); returns its pair."""
        whole = self._whole
        pair = whole.pairs
        whole.grow(pair + 1)
        whole.agreed[pair] = agreed
        _partial.begin(whole.address, 2 * whole.pairs, 2 * pair, xy, sd, whole.points is not whole.mean)
        return pair

    def partly(self, entries: Ints, slot: int, kind: int, z: float, var: float, gate: float) -> tuple[int, float]:
        """Corrects by a partial sighting; a landmark held fixed has entries without variance."""
        del slot
        return _partial.partly(
            self._whole.address, 2 * self._whole.pairs, entries, kind, z, var, self._where, gate
        )  # fmt: skip

    def together(self, entries: Ints, kind: Ints, z: Array, var: Array) -> int:
        """Corrects by several partial sightings at once, entries (k, 7)."""
        why, _ = _partial.together(
            self._whole.address, 2 * self._whole.pairs, entries, kind, z, var, self._where in (FIRST, IDEAL)
        )  # fmt: skip
        return why

    def fixed(self, offset: int, z: Array, cov: Array, arm: Array, gate: float) -> tuple[int, float, int]:
        """Corrects by a fix."""
        pose = np.array((-3, -2, -1, offset), np.int64)
        return _partial.fixed(self._whole.address, 2 * self._whole.pairs, pose, z, cov, arm, self._where, gate)

    def reduce(self, left: list[int]) -> None:
        """Takes out all pairs but those `left`, ascending."""
        self._whole.reduce(left)
