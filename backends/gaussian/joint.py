"""The joint Gaussian of the pose and a map: a mean and a triangular covariance, in arrays that grow."""

from copy import copy

import numpy as np

from ...core.factors import Map
from ...core.kernels._arrays import layout
from ...core.kernels._blas import routine
from ...core.se2 import Array, Ints, wrap
from . import _triangle
from ._beliefs import JointArrays
from ._ekf import OWED

EQUAL = 1e-4  # m; standard deviation of the difference of two landmarks that are one

SPACE = 64
"""Landmarks the vectors have space for at first, doubled when exhausted. The matrix grows by panels."""


class Joint:
    """A Gaussian over (x, y, heading, m1x, m1y, m2x, ...), landmarks in order of first sighting.

    On logs with loop closures other pairs are places and headings of kept poses: see `kept_poses`.
    """

    def __init__(self, pose: Array, cov: Array, *, fixed_points: bool) -> None:
        self.pairs = 0  # after the pose's three entries
        self.mean = np.zeros(3 + 2 * SPACE)
        self.points = self.mean  # (3 + 2 SPACE,) linearisation points: the mean itself, or fixed
        self.agreed = np.zeros(SPACE, np.int64)  # sightings that agreed with a landmark since its first; POSE
        self.pose = (cov + cov.T) / 2  # (3, 3), symmetric to the last bit
        self.cross = np.zeros((3, 2 * SPACE))  # covariance of the pose with the map
        self.flat = np.zeros(0)  # covariance of the map: see _triangle
        self.bound = np.full(SPACE, np.inf)  # m; of a landmark's deviation in any direction, which never grows
        self.predicted = np.zeros(3 + 2 * SPACE)  # scratch
        self.owed_pose, self.owed_map = np.zeros((OWED, 3)), np.zeros((OWED, 2 * SPACE))  # scratch
        self.columns = 0  # of the three that follow, which are for a part of a larger belief: see compressed.py
        self.transition, self.information, self.pull = np.zeros((3, 0)), np.zeros((0, 0)), np.zeros(0)
        self.owed_transition = np.zeros((OWED, 0))  # scratch
        self.blas = np.array([routine("dgemm"), routine("dsyrk")])
        self.mean[:3] = pose
        if fixed_points:
            self.points = self.mean.copy()
        self._arrays: JointArrays | None = None

    @property
    def address(self) -> int:
        """Of the arrays, for compiled code; the next `grow` may change it."""
        if self._arrays is None:
            own = vars(self)
            self._arrays = JointArrays(**{name: own[name] for name, _, _ in layout(JointArrays)})
        return self._arrays.address

    def moved(self) -> None:
        """Arrays have been replaced: their addresses are taken again."""
        self._arrays = None

    def grow(self, pairs: int) -> None:
        """Reserves space for that many pairs; the new ones' entries are zero."""
        self.pairs = pairs
        entries, space = len(self.flat), len(self.agreed)
        self.flat = _triangle.grown(self.flat, 2 * pairs)
        if self._arrays is not None and len(self.flat) > entries:  # it may have moved, and be the same array
            self._arrays = self._arrays.replaced(flat=self.flat)
        if pairs <= space:
            return
        self.moved()
        more = max(2 * space, pairs) - space
        own_points = self.points is not self.mean
        self.mean = np.pad(self.mean, (0, 2 * more))
        self.points = np.pad(self.points, (0, 2 * more)) if own_points else self.mean
        self.agreed = np.pad(self.agreed, (0, more))
        self.bound = np.pad(self.bound, (0, more), constant_values=np.inf)
        self.cross = np.pad(self.cross, ((0, 0), (0, 2 * more)))
        self.predicted = np.zeros(len(self.mean))
        self.owed_map = np.zeros((OWED, 2 * len(self.agreed)))

    def reduce(self, left: list[int]) -> None:
        """Takes out all pairs but those `left`, ascending: the rest of a Gaussian is what it was."""
        pairs = np.array(left, np.int64)
        cov, entries = self.cov_of(pairs), (2 * pairs[:, None] + [0, 1]).ravel()
        n = len(entries)
        self.pairs = len(left)
        self.flat = np.zeros(_triangle.space(n))
        _triangle.store(self.flat, cov)
        for columns in (self.mean, self.points) if self.points is not self.mean else (self.mean,):
            columns[3 : 3 + n] = columns[3 + entries]
            columns[3 + n :] = 0.0
        self.cross[:, :n] = self.cross[:, entries]
        self.cross[:, n:] = 0.0
        self.agreed[: len(left)], self.bound[: len(left)] = self.agreed[pairs], self.bound[pairs]
        self.agreed[len(left) :], self.bound[len(left) :] = 0, np.inf
        self.moved()

    def adopt(self, known: Map) -> None:
        """Adopts a map; one without covariance is held fixed: its block stays zero, and so does its gain."""
        n = 2 * len(known.ids)
        self.grow(len(known.ids))
        self.mean[3 : 3 + n] = self.points[3 : 3 + n] = known.xy.ravel()
        if known.cov is not None:
            _triangle.store(self.flat, np.array(known.cov, np.float64))

    def equate(self, pairs: Ints) -> None:
        """Corrects by the differences of two pairs each, (k, 2): they are zero, up to `EQUAL`."""
        n, k = 2 * self.pairs, len(pairs)
        P = np.empty((n + 3, n + 3))
        P[:3, :3], P[:3, 3:], P[3:, :3] = self.pose, self.cross[:, :n], self.cross[:, :n].T
        P[3:, 3:] = self.cov()
        H, rows = np.zeros((2 * k, n + 3)), np.arange(2 * k).reshape(k, 2)
        for h in range(2):
            H[rows[:, h], 3 + 2 * pairs[:, 0] + h], H[rows[:, h], 3 + 2 * pairs[:, 1] + h] = 1.0, -1.0
        PH = P @ H.T
        S = H @ PH + EQUAL**2 * np.eye(2 * k)
        gain = np.linalg.solve(S, PH.T).T
        self.mean[: n + 3] -= gain @ (H @ self.mean[: n + 3])
        self.mean[2] = wrap(self.mean[2])
        left = P - gain @ PH.T
        left = (left + left.T) / 2
        self.pose[:], self.cross[:, :n] = left[:3, :3], left[:3, 3:]
        _triangle.store(self.flat, np.ascontiguousarray(left[3:, 3:]))

    def xy(self) -> Array:
        """The means (n, 2) of all pairs."""
        return self.mean[3 : 3 + 2 * self.pairs].reshape(-1, 2).copy()

    def cov(self) -> Array:
        """The joint covariance (2n, 2n) of all pairs."""
        out = np.empty((2 * self.pairs, 2 * self.pairs))
        _triangle.whole(self.flat, len(out), out)
        return out

    def cov_of(self, pairs: Ints) -> Array:
        """The joint covariance (2k, 2k) of some pairs (k,)."""
        out = np.empty((2 * len(pairs), 2 * len(pairs)))
        _triangle.submatrix(self.flat, (2 * pairs[:, None] + [0, 1]).ravel(), out)
        return out

    def one(self, entry: int) -> tuple[float, float]:
        """The mean of an entry of the map, and its standard deviation."""
        return float(self.mean[3 + entry]), float(np.sqrt(self.cov_of(np.array([entry // 2]))[entry % 2, entry % 2]))

    def poses(self, entries: Ints) -> tuple[Array, Array]:
        """The kept poses (k, 3) at these `entries` (k, 2), and the covariance (k, 3, 3) of each."""
        three = np.column_stack((entries[:, 0], entries[:, 0] + 1, entries[:, 1]))
        path, cov = self.mean[3 + three], np.empty((len(three), 3, 3))
        path[:, 2] = wrap(path[:, 2])
        for own, out in zip(three, cov, strict=True):
            _triangle.submatrix(self.flat, own, out)
        return path, cov

    def copy(self) -> "Joint":
        """A copy that shares nothing mutable."""
        other = copy(self)
        other.moved()
        other.mean, other.pose, other.cross, other.flat, other.agreed, other.bound = (
            array.copy() for array in (self.mean, self.pose, self.cross, self.flat, self.agreed, self.bound)
        )
        other.points = other.mean if self.points is self.mean else self.points.copy()
        return other
