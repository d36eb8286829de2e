"""Expected sightings with their joint covariance, for any belief that can state a few joint covariances."""

from math import atan2, sqrt

import numpy as np

from ..frontend.compiled import compiled
from ..frontend.se2 import Array, Ints
from ._models import sighted, wrap

LEAST_RANGE = 1e-6
"""m; a landmark that is closer to the robot has no bearing, and is not expected."""


@compiled
def may_be_seen(
    pose: Array, pose_sd: float, heading_sd: float, x: float, y: float, sd: float, z: Array, R: Array, k: int, gate: float
) -> bool:
    """Tells if one of k sightings z (k, 2), R (k, 2, 2) can be within `gate` of a landmark at (x, y).

    `pose_sd` and `sd` bound the standard deviation, m, of the positions of robot and landmark in any direction: no
    correlation makes that of their difference larger than the sum. So no landmark within the gate is left out.
    """
    dx, dy = x - pose[0], y - pose[1]
    r = sqrt(dx * dx + dy * dy)
    if not r > LEAST_RANGE:
        return False
    both = pose_sd + sd
    along = gate * both * both
    turned, across, bearing = False, 0.0, 0.0
    for i in range(k):
        off = z[i, 0] - r
        if not off * off <= along + gate * R[i, 0, 0]:
            continue
        if not turned:
            angle = heading_sd + both / r
            turned, across, bearing = True, gate * angle * angle, atan2(dy, dx) - pose[2]
        off = wrap(z[i, 1] - bearing)
        if off * off <= across + gate * R[i, 1, 1]:
            return True
    return False


@compiled
def spread(a: float, b: float, c: float) -> float:
    """The largest standard deviation in any direction of a covariance [a b; b c]."""
    half = (a - c) / 2
    return sqrt(max(0.0, (a + c) / 2 + sqrt(half * half + b * b)))


@compiled
def distance(dr: float, db: float, a: float, b: float, c: float) -> float:
    """Squared Mahalanobis distance of (dr, db) by the covariance [a b; b c]; infinite if that is none."""
    det = a * c - b * b
    if not (a > 0.0 and det > 0.0):
        return np.inf
    return (c * dr * dr - 2.0 * b * dr * db + a * db * db) / det


@compiled
def jointly(
    pose: Array,
    P: Array,
    at: Array,
    C: Array,
    L: Array,
    z: Array,
    R: Array,
    k: int,
    gate: float,
    pose_point: Array,
    points: Array,
) -> tuple[Ints, Array, Array]:
    """Expected sightings of those of c landmarks that are within `gate` of one of the k sightings z (k, 2), R (k, 2, 2).

    `pose` (3,) and `at` (c, 2) are the means, P (3, 3) the pose's covariance, C (3, 2c) that with the landmarks, L
    (2c, 2c) theirs, of which only blocks on and below the diagonal are read; the models are linearised at `pose_point`
    and `points`. Returns their indices (m,), range and bearing (m, 2), and the joint covariance of those (2m, 2m)
    without the noise of the sensor: ArUco EKF SLAM, eqs (13) and (15), H P H'.
    """
    c = len(at)
    index, expected = np.empty(c, np.int64), np.empty((c, 2))
    T, U, H = np.empty((c, 2, 3)), np.empty((c, 2, 2)), np.empty((c, 2, 2))
    m = 0
    for a in range(c):
        dx, dy = points[a, 0] - pose_point[0], points[a, 1] - pose_point[1]
        q = dx * dx + dy * dy
        if not q > LEAST_RANGE * LEAST_RANGE:
            continue
        r = sqrt(q)
        h, t, u = H[m], T[m], U[m]
        h[0, 0], h[0, 1], h[1, 0], h[1, 1] = dx / r, dy / r, -dy / q, dx / q
        for i in range(2):  # rows of H times the columns of the pose, and of the landmark itself
            turn = -1.0 if i == 1 else 0.0
            for j in range(3):
                t[i, j] = (
                    h[i, 0] * (C[j, 2 * a] - P[0, j]) + h[i, 1] * (C[j, 2 * a + 1] - P[1, j]) + turn * P[2, j]
                )
        own = 2 * a
        for i in range(2):
            turn = -1.0 if i == 1 else 0.0
            for j in range(2):
                first = L[own, own] if j == 0 else L[own + 1, own]
                second = L[own + 1, own + j]
                u[i, j] = (
                    h[i, 0] * (first - C[0, own + j]) + h[i, 1] * (second - C[1, own + j]) + turn * C[2, own + j]
                )
        s00, s10, s11 = _entry(t, u, h, 0, 0), _entry(t, u, h, 1, 0), _entry(t, u, h, 1, 1)
        er, eb = sighted(pose[0], pose[1], pose[2], at[a, 0], at[a, 1])
        for i in range(k):
            if distance(z[i, 0] - er, wrap(z[i, 1] - eb), s00 + R[i, 0, 0], s10 + R[i, 1, 0], s11 + R[i, 1, 1]) < gate:
                index[m], expected[m, 0], expected[m, 1] = a, er, eb
                m += 1
                break
    cov = np.empty((2 * m, 2 * m))
    for p in range(m):
        a = index[p]
        h, t, u = H[p], T[p], U[p]
        for q in range(p + 1):
            b = index[q]
            for i in range(2):
                turn = -1.0 if i == 1 else 0.0
                for j in range(2):
                    u[i, j] = (
                        h[i, 0] * (_block(L, a, b, 0, j) - C[0, 2 * b + j])
                        + h[i, 1] * (_block(L, a, b, 1, j) - C[1, 2 * b + j])
                        + turn * C[2, 2 * b + j]
                    )
            for i in range(2):
                for j in range(2):
                    value = _entry(t, u, H[q], i, j)
                    cov[2 * p + i, 2 * q + j] = value
                    cov[2 * q + j, 2 * p + i] = value
    return index[:m].copy(), expected[:m].copy(), cov


@compiled
def _block(L: Array, a: int, b: int, i: int, j: int) -> float:
    """Entry (i, j) of the block of landmarks a and b, a >= b; of a landmark's own block the lower triangle is read."""
    if a == b and j > i:
        return L[2 * a + j, 2 * a + i]
    return L[2 * a + i, 2 * b + j]


@compiled
def _entry(t: Array, u: Array, h: Array, i: int, j: int) -> float:
    """Entry (i, j) of (rows of H P by pose and landmark) times the other landmark's H'."""
    turn = -1.0 if j == 1 else 0.0
    return h[j, 0] * (u[i, 0] - t[i, 0]) + h[j, 1] * (u[i, 1] - t[i, 1]) + turn * t[i, 2]
