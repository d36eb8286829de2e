"""The drift of poses, one against the other: covariances as seen from the last of them.

An error in a motion that ends at p is, seen from the last pose, one of all poses before it: it shifts them, and turns
them about p. With A(d) what such an error is at a point d away, A(a + b) = A(a) A(b). So poses i <= j at p_i and p_j
have the covariance A(p_i) T_j A(p_j)', where T_j sums A(-p) C A(-p)' over the motions after j: C in the world's axes.
"""

import numpy as np

from ...core.factors import Odometry
from ...core.se2 import Array, Ints

ROOM = 64  # motions at first; doubled when there are more


def shifted(points: Array) -> Array:
    """(k, 3, 3) A: what an error of a pose is for what is rigidly `points` (k, 2) away from it, in the world's axes."""
    A = np.tile(np.eye(3), (len(points), 1, 1))
    A[:, 0, 2], A[:, 1, 2] = -points[:, 1], points[:, 0]
    return A


def relative(places: Array, cov: Array) -> Array:
    """(3k, 3k) the covariance of k poses at `places` (k, 2), as seen from the last, from that in the world."""
    k = len(places)
    D = np.eye(3 * k)
    D[:, -3:] -= shifted(places - places[-1]).reshape(3 * k, 3)
    return D @ cov @ D.T


def wandered(path: Array, motion_cov: Array, at: Ints) -> Array:
    """(3k, 3k) the covariance of the poses at rows `at` (k,) of a path (n, 3), as seen from the last of them.

    `motion_cov` (n, 3, 3) are those of the motion before each pose, in the frame of the pose before it. The rows `at`
    are in ascending order.
    """
    k, first, last = len(at), int(at[0]), int(at[-1])
    path, covs = path[first : last + 1], motion_cov[first + 1 : last + 1]
    c, s = np.cos(path[:-1, 2]), np.sin(path[:-1, 2])
    here = path[:, :2] - path[-1, :2]
    turn = np.zeros((len(path) - 1, 3, 3))
    turn[:, 0, 0], turn[:, 0, 1], turn[:, 1, 0], turn[:, 1, 1], turn[:, 2, 2] = c, -s, s, c, 1.0
    by_motion = shifted(-here[1:]) @ turn
    since = np.zeros((len(path), 3, 3))
    since[:-1] = (by_motion @ covs @ by_motion.transpose(0, 2, 1))[::-1].cumsum(axis=0)[::-1]
    since, A = since[at - first], shifted(here[at - first])
    out = np.empty((k, 3, k, 3))
    order = np.maximum.outer(np.arange(k), np.arange(k))
    out[:] = np.einsum("iab,ijbc,jdc->iajd", A, since[order], A, optimize=True)
    return out.reshape(3 * k, 3 * k)


class Drift:
    """Dead reckoning since a step, for the covariances of the poses since."""

    def __init__(self) -> None:
        self._begin, self._n = 0, 0
        self._delta, self._cov = np.zeros((ROOM, 3)), np.zeros((ROOM, 3, 3))

    def begin(self, step: int) -> None:
        """Forgets all before `step`."""
        self._begin, self._n = step, 1

    def move(self, odometry: Odometry | None) -> None:
        """Adds the motion to the next step."""
        if self._n == len(self._delta):
            self._delta = np.concatenate((self._delta, np.zeros_like(self._delta)))
            self._cov = np.concatenate((self._cov, np.zeros_like(self._cov)))
        if odometry is None:
            self._delta[self._n], self._cov[self._n] = 0.0, 0.0
        else:
            self._delta[self._n], self._cov[self._n] = odometry
        self._n += 1

    def between(self, steps: Ints, heading: float) -> Array:
        """(3k, 3k) the covariance of the poses of steps (k,), ascending, as seen from the last, with that `heading`."""
        at = steps - self._begin
        rows = slice(int(at[0]), int(at[-1]) + 1)
        delta = self._delta[rows]
        path = np.zeros((len(delta), 3))
        path[1:, 2] = delta[1:, 2].cumsum()
        path[:, 2] += heading - path[-1, 2]
        c, s = np.cos(path[:-1, 2]), np.sin(path[:-1, 2])
        path[1:, 0] = (c * delta[1:, 0] - s * delta[1:, 1]).cumsum()
        path[1:, 1] = (s * delta[1:, 0] + c * delta[1:, 1]).cumsum()
        return wandered(path, self._cov[rows], at - at[0])
