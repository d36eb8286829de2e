"""Partial sightings and fixes in the invariant filter's belief: see `late_starts`, and `_partial` for the equations."""

from math import cos, sin

import numpy as np

from ...core.se2 import Array, Ints
from ..gaussian import _triangle
from . import _partial
from ._invariant_loops import keep
from .group import Group

NO_PLACE = np.zeros(2)
"""In place of that of a landmark held fixed."""


class GroupParts:
    """The methods of `Parts` on a `Group`.

    A pair of constant errors must not turn with the map. It is the place of a kept pose whose heading has no variance:
    the exponential of its error is a sum.
    """

    def __init__(self, group: Group) -> None:
        self._group = group
        self._still = -1  # the entry of that heading, one for all constant errors

    @property
    def pairs(self) -> int:
        """The pairs of the state."""
        return self._group.n // 2

    def constant(self, first: float, second: float) -> int:
        """Adds a pair of constant errors around zero, with these standard deviations; returns its first entry."""
        group = self._group
        if self._still < 0:
            self._still = group.add(1)
        at = group.add(1)
        rows = np.zeros((2, group.n))
        rows[0, at], rows[1, at + 1] = first**2, second**2
        _triangle.put(group.flat, at, group.n, rows)
        self._add([(at, self._still)])
        return at

    def constants(self, entry: int) -> tuple[float, float]:
        """The present means of a pair of constant errors."""
        first, second = self._group.mean[entry : entry + 2].tolist()
        return first, second

    def one(self, entry: int) -> tuple[float, float]:
        """The present mean of an entry, and its standard deviation."""
        return self._group.one(entry)

    def shift(self, entry: int, ahead: float, left: float) -> None:
        """Adds this entry's error, times a way in the body's frame, to that of the pose's position."""
        group = self._group
        c, s = cos(group.pose[2]), sin(group.pose[2])
        _partial.shift(group.arrays.address, group.n, entry, c * ahead - s * left, s * ahead + c * left)

    def space(self) -> list[tuple[int, int]]:
        """Adds space for two poses to keep, whose headings make a pair."""
        place = self._group.add(3)
        added = [(place + 2, place + 5), (place, place + 4)]
        self._add(added)
        return added

    def keep(self, clone: tuple[int, int]) -> None:
        """Clones the pose into these entries."""
        keep(self._group.arrays.address, self._group.n, *clone)

    def poses(self, clones: Ints) -> tuple[Array, Array]:
        """Kept poses (k, 3) in the world at entries (k, 2), and their joint covariance (3k, 3k), of plain errors."""
        group = self._group
        group.fold()
        entries = np.column_stack((clones[:, 0], clones[:, 0] + 1, clones[:, 1]))
        k = len(entries)
        poses, cov = group.mean[entries], np.empty((3 * k, 3 * k))
        _triangle.submatrix(group.flat, entries.ravel(), cov)
        plain = np.tile(np.eye(3), (k, 1, 1))
        plain[:, 0, 2], plain[:, 1, 2] = -poses[:, 1], poses[:, 0]
        cov = np.einsum("iab,ibjd,jcd->iajc", plain, cov.reshape(k, 3, k, 3), plain).reshape(3 * k, 3 * k)
        poses[:, :2] += group.origin
        return poses, cov

    def begin(self, xy: Array, sd: float, agreed: int) -> int:
        """Adds a landmark at xy (2,), independent, of standard deviation `sd` (m); returns its pair."""
        del agreed
        group = self._group
        at = group.add(1)
        _partial.begin(group.arrays.address, group.n, at, xy - group.origin, sd)
        return at // 2

    def partly(self, entries: Ints, slot: int, kind: int, z: float, var: float, gate: float) -> tuple[int, float]:
        """Corrects by a partial sighting; landmark k of those held fixed has the number -2 - k."""
        place = NO_PLACE if slot >= 0 else self._group.known[-2 - slot]
        one = np.array([kind]), np.array([z]), np.array([var])
        group = self._group
        return _partial.partly(group.arrays.address, group.n, group.kept, entries[None], place, *one, gate)

    def together(self, entries: Ints, kind: Ints, z: Array, var: Array) -> int:
        """Corrects by several partial sightings at once, entries (k, 7)."""
        group = self._group
        why, _ = _partial.partly(
            group.arrays.address, group.n, group.kept, entries, NO_PLACE, kind, z, var, 0.0
        )  # fmt: skip
        return why

    def fixed(self, offset: int, z: Array, cov: Array, arm: Array, gate: float) -> tuple[int, float, int]:
        """Corrects by a fix."""
        group = self._group
        from_origin = z - np.array([*group.origin, 0.0])
        return _partial.fixed(group.arrays.address, group.n, group.kept, offset, from_origin, cov, arm, gate)

    def reduce(self, left: list[int]) -> None:
        """Takes out all pairs but those `left`, ascending."""
        place = {pair: i for i, pair in enumerate(left)}
        self._group.reduce(left)
        stay = [one for one in self._group.late.tolist() if all(entry // 2 in place for entry in one)]
        moved = [[2 * place[entry // 2] + entry % 2 for entry in one] for one in stay]
        self._group.beside(late=np.array(moved, np.int64).reshape(-1, 2))
        if self._still >= 0:
            self._still = 2 * place[self._still // 2]

    def _add(self, elements: list[tuple[int, int]]) -> None:
        """Has these entries, of x and of the heading, move as elements of SE(2) of their own."""
        self._group.beside(late=np.concatenate((self._group.late, np.array(elements, np.int64))))
