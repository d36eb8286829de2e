"""Partial sightings and fixes in a joint belief, by the EKF's Jacobians: see `late_starts`."""

from math import cos, sin

import numpy as np

from ...core.se2 import Array, Ints, act, compose, compose_jacobians
from . import _partial, _triangle
from ._ekf import FIRST, IDEAL, POSE
from ._loops import keep
from ._partial import NO_ENTRY
from .joint import Joint


class JointParts:
    """The methods of `Parts` on a `Joint`, linearised at the points that `where` names."""

    def __init__(self, whole: Joint, where: int) -> None:
        self._whole, self._where = whole, where
        self._frame = np.full(3, NO_ENTRY)
        """Entries of the place and heading in the world of the state's frame; none if that is the world."""

    def start_at(self, pose: Array, cov: Array) -> None:
        """Has the state be in a frame whose place in the world is a part of it, at first this pose (3,).

        A heading that is not known then turns the map as a whole, and is no part of how it is linearised.
        """
        whole, first = self._whole, self.constant(0.0, 0.0)
        self.constant(0.0, 0.0)
        self._frame = first + np.arange(3)
        n = 2 * whole.pairs
        whole.mean[3 + self._frame] = whole.points[3 + self._frame] = pose
        for i in range(3):
            row = np.zeros(n)
            row[self._frame] = cov[i]
            _triangle.put_row(whole.flat, int(self._frame[i]), n, row)

    def pose(self) -> Array:
        """The pose (3,) in the world."""
        mean = self._whole.mean
        return mean[:3].copy() if self._frame[0] == NO_ENTRY else compose(mean[3 + self._frame], mean[:3])

    def pose_cov(self) -> Array:
        """Its covariance (3, 3)."""
        whole, frame = self._whole, self._frame
        if frame[0] == NO_ENTRY:
            return whole.pose.copy()
        joint = np.empty((6, 6))
        _triangle.submatrix(whole.flat, frame, joint[:3, :3])
        joint[3:, :3] = whole.cross[:, frame]
        joint[:3, 3:], joint[3:, 3:] = joint[3:, :3].T, whole.pose
        J = np.hstack(compose_jacobians(whole.mean[3 + frame], whole.mean[:3]))
        cov = J @ joint @ J.T
        return (cov + cov.T) / 2

    def places(self, pairs: Ints) -> Array:
        """The landmarks (k, 2) of these pairs in the world."""
        xy = self._whole.xy()[pairs]
        if self._frame[0] == NO_ENTRY:
            return xy
        frame = self._whole.mean[3 + self._frame]
        return act(np.broadcast_to(frame, (len(xy), 3)), xy)

    def places_cov(self, pairs: Ints) -> Array:
        """Their joint covariance (2k, 2k)."""
        if self._frame[0] == NO_ENTRY:
            return self._whole.cov_of(pairs)
        n, turned = 2 * len(pairs), self.places(pairs) - self._whole.mean[3 + self._frame[:2]]
        c, s = cos(self._whole.mean[3 + self._frame[2]]), sin(self._whole.mean[3 + self._frame[2]])
        joint = np.empty((n + 3, n + 3))
        _triangle.submatrix(
            self._whole.flat, np.concatenate(((2 * pairs[:, None] + [0, 1]).ravel(), self._frame)), joint
        )
        J = np.zeros((n, n + 3))
        J[:, :n] = np.kron(np.eye(len(pairs)), np.array([[c, -s], [s, c]]))
        J[0::2, n], J[1::2, n + 1], J[:, n + 2] = 1.0, 1.0, (turned[:, ::-1] * [-1.0, 1.0]).ravel()
        cov = J @ joint @ J.T
        return (cov + cov.T) / 2

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

    def one(self, entry: int) -> tuple[float, float]:
        """The present mean of an entry, and its standard deviation."""
        return self._whole.one(entry)

    def shift(self, entry: int, ahead: float, left: float) -> None:
        """Adds this entry's error, times a way in the body's frame, to that of the pose's position."""
        whole = self._whole
        c, s = cos(whole.mean[2]), sin(whole.mean[2])
        _partial.shift(whole.address, 2 * whole.pairs, entry, c * ahead - s * left, s * ahead + c * left)

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
        pose = np.array((-3, -2, -1, offset, *self._frame), np.int64)
        return _partial.fixed(self._whole.address, 2 * self._whole.pairs, pose, z, cov, arm, self._where, gate)

    def reduce(self, left: list[int]) -> None:
        """Takes out all pairs but those `left`, ascending."""
        self._whole.reduce(left)
        if self._frame[0] != NO_ENTRY:
            self._frame = 2 * left.index(int(self._frame[0]) // 2) + np.arange(3)
