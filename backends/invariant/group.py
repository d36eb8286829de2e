"""The belief of the invariant filter: a mean, and the covariance of the group's error, in arrays that grow."""

from copy import copy

import numpy as np

from ...core.factors import Map
from ...core.kernels._blas import routine
from ...core.se2 import Array, Ints
from ..gaussian import _triangle
from ..gaussian.kept_poses import NOWHERE
from . import _invariant, _plain
from ._arrays import GroupArrays

SPACE = 64  # state entries reserved at first


class Group:
    """A Gaussian error of (heading, position, landmarks), and of kept poses beside them: see `_invariant`.

    The group's origin, here the robot's start, affects rounding only.
    """

    def __init__(self, pose: Array, cov: Array) -> None:
        self.origin = np.array(pose[:2])
        self.pose = np.array([0.0, 0.0, pose[2]])
        self.known = np.zeros((0, 2))  # landmarks held fixed, m from the origin
        self.n = 0  # entries of the mean after the pose
        self.mean = np.zeros(0)
        self.strip = np.zeros((3, 3))  # the pose's rows of the covariance
        self.flat = np.zeros(0)  # the landmarks' covariance without deferred updates: see _triangle, _invariant
        self.owed, self.owing = np.zeros((_invariant.RANK, 0)), np.zeros(2, np.int64)
        self.blas = np.array([routine("dgemm"), routine("dsyrk")])
        self.loops = self.late = NOWHERE  # (k, 2) entries of poses kept for loop closures, and of those of `GroupParts`
        self.kept = NOWHERE  # (k, 2) both: x, with y after it, and heading of what is an element of SE(2) of its own
        self._arrays: GroupArrays | None = None
        self.reserve(SPACE)
        self.strip[:, :3] = cov  # both errors agree at the origin

    @property
    def arrays(self) -> GroupArrays:
        """The arrays, for compiled code; the next `reserve` may change them."""
        if self._arrays is None:
            self._arrays = GroupArrays(
                pose=self.pose, mean=self.mean, strip=self.strip, flat=self.flat, owed=self.owed,
                owing=self.owing, known=self.known, origin=self.origin, blas=self.blas,
            )  # fmt: skip
        return self._arrays

    def beside(self, *, loops: Ints | None = None, late: Ints | None = None) -> None:
        """Has these entries move as elements of SE(2) of their own, in place of earlier ones of that sort."""
        self.loops = self.loops if loops is None else loops
        self.late = self.late if late is None else late
        self.kept = np.concatenate((self.loops, self.late)) if len(self.late) else self.loops

    def placed(self) -> Array:
        """The pose in the world."""
        return np.array([self.pose[0] + self.origin[0], self.pose[1] + self.origin[1], self.pose[2]])

    def pose_cov(self) -> Array:
        """The pose's covariance (3, 3) in plain coordinates."""
        plain = np.eye(3)
        plain[0, 2], plain[1, 2] = -self.pose[1], self.pose[0]
        cov = plain @ self.strip[:, :3] @ plain.T
        return (cov + cov.T) / 2

    def landmarks_cov(self) -> Array:
        """The covariance (n, n) in plain coordinates, of a state that has landmarks alone."""
        n = self.n
        block, around = np.empty((n, n)), lever(self.mean[:n])
        flat = self.flat.copy()  # later results must not change
        _invariant.fold(self.arrays.replaced(flat=flat, owing=self.owing.copy()), n)
        _triangle.whole(flat, n, block)
        turned = np.outer(around, self.strip[2, 3 : n + 3])
        return block + (turned + turned.T) + self.strip[2, 2] * np.outer(around, around)

    def marginals(self, slots: Ints) -> tuple[Array, Array, Array]:
        """The pose, places (k, 2) of the landmarks with these numbers and their joint covariance, the pose last."""
        n = len(slots)
        at, cov = np.empty((n, 2)), np.empty((2 * n + 3, 2 * n + 3))
        _plain.plain_joint(self.arrays.address, slots, at, cov)
        return self.placed(), at + self.origin, cov

    def adopt(self, known: Map) -> None:
        """Adopts a map, whose plain errors, unlike the group's, are independent of the pose's.

        Landmarks without covariance are held fixed, outside of the state. Their zero plain error is an error of the
        group caused by the heading alone, which the exponential inverts exactly: they do not move.
        """
        n, xy = known.xy.size, known.xy - self.origin
        if known.cov is None:
            self.known, self._arrays = xy, None
            return
        self.reserve(n)
        self.n, self.mean[:n] = n, xy.ravel()
        around = lever(self.mean[:n])
        self.strip[:, 3 : n + 3] = -np.outer(self.strip[:, 2], around)
        block = known.cov + self.strip[2, 2] * np.outer(around, around)
        _triangle.store(self.flat, block)

    def copy(self) -> "Group":
        """A copy that shares nothing mutable."""
        other = copy(self)
        other.pose, other.mean, other.strip, other.flat, other.owed, other.owing = (
            array.copy() for array in (self.pose, self.mean, self.strip, self.flat, self.owed, self.owing)
        )
        other._arrays = None
        return other

    def one(self, entry: int) -> tuple[float, float]:
        """The mean of an entry of the state, and its standard deviation."""
        row = np.empty(self.n)
        _invariant.gather_row(self.arrays, self.n, entry, row)
        return float(self.mean[entry]), float(np.sqrt(row[entry]))

    def fold(self) -> None:
        """Applies deferred updates."""
        _invariant.fold(self.arrays, self.n)

    def reserve(self, entries: int) -> None:
        """Reserves that many entries of the mean; half as many again in the vectors."""
        before = len(self.flat)
        self.flat = _triangle.grown(self.flat, entries)
        if self._arrays is not None and len(self.flat) > before:  # it may have moved, and be the same array
            self._arrays = self._arrays.replaced(flat=self.flat)
        if entries <= len(self.mean):
            return
        self._arrays = None
        more = max(SPACE, entries + entries // 2) - len(self.mean)
        self.mean = np.pad(self.mean, (0, more))
        self.strip = np.pad(self.strip, ((0, 0), (0, more)))
        self.owed = np.pad(self.owed, ((0, 0), (0, more)))

    def add(self, pairs: int) -> int:
        """Adds pairs whose entries and covariances are zero; returns the first of the entries."""
        first = self.n
        self.reserve(first + 2 * pairs)
        self.n += 2 * pairs
        return first

    def reduce(self, left: list[int]) -> None:
        """Takes out all pairs but those `left`, ascending: the rest of a Gaussian is what it was."""
        self.fold()
        entries = (2 * np.array(left, np.int64)[:, None] + [0, 1]).ravel()
        n = len(entries)
        cov = np.empty((n, n))
        _triangle.submatrix(self.flat, entries, cov)
        self.flat = np.zeros(_triangle.space(n))
        _triangle.store(self.flat, cov)
        self.mean[:n], self.mean[n:] = self.mean[entries], 0.0
        self.strip[:, 3 : 3 + n], self.strip[:, 3 + n :] = self.strip[:, 3 + entries], 0.0
        self.owed[:] = 0.0
        self.n, self._arrays = n, None


def lever(mean: Array) -> Array:
    """J f of every landmark, (n,): the landmarks' (n,) derivative under a rotation about the origin."""
    return (mean.reshape(-1, 2)[:, ::-1] * [-1.0, 1.0]).ravel()
