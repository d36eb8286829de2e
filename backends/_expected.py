"""Expected sightings with their joint covariance, for any belief that can state a few joint covariances."""

from math import atan2, cos, sin, sqrt

import numpy as np

from ..frontend.compiled import compiled
from ..frontend.se2 import Array, Ints
from ._models import moved, sighted, wrap

LEAST_RANGE = 1e-6
"""m; a landmark that is closer to the robot has no bearing, and is not expected."""


@compiled
def may_be_seen(
    pose: Array, pose_sd: float, heading_sd: float, x: float, y: float, sd: float, z: Array, R: Array, gate: float
) -> bool:
    """Tells if one of the sightings z (k, 2), R (k, 2, 2) can be within `gate` of a landmark at (x, y).

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
    for i in range(len(z)):
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
def spreads(cov: Array, landmarks: int) -> Array:
    """The largest standard deviation in any direction of each landmark, first in a joint covariance: (landmarks,) m."""
    out = np.empty(landmarks)
    for a in range(landmarks):
        out[a] = spread(cov[2 * a, 2 * a], cov[2 * a + 1, 2 * a], cov[2 * a + 1, 2 * a + 1])
    return out


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
    gate: float,
    pose_point: Array,
    points: Array,
) -> tuple[Ints, Array, Array]:
    """Expected sightings of those of c landmarks that are within `gate` of one of the sightings z (k, 2), R (k, 2, 2).

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
                t[i, j] = h[i, 0] * (C[j, 2 * a] - P[0, j]) + h[i, 1] * (C[j, 2 * a + 1] - P[1, j]) + turn * P[2, j]
        own = 2 * a
        for i in range(2):
            turn = -1.0 if i == 1 else 0.0
            for j in range(2):
                first = L[own, own] if j == 0 else L[own + 1, own]
                second = L[own + 1, own + j]
                u[i, j] = h[i, 0] * (first - C[0, own + j]) + h[i, 1] * (second - C[1, own + j]) + turn * C[2, own + j]
        s00, s10, s11 = _entry(t, u, h, 0, 0), _entry(t, u, h, 1, 0), _entry(t, u, h, 1, 1)
        er, eb = sighted(pose[0], pose[1], pose[2], at[a, 0], at[a, 1])
        for i in range(len(z)):
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


@compiled
def near_ones(pose: Array, P: Array, xy: Array, sd: Array, z: Array, R: Array, gate: float) -> Ints:
    """Landmarks near xy (n, 2), with deviations of at most sd (n,), that a sighting z (k, 2), R (k, 2, 2) may be of.

    Returns their indices (m,).

    A landmark that has been corrected since it was at `xy` has moved by a normal vector of the covariance it has lost:
    the sum of that and of an error within the gate is within twice the gate.
    """
    pose_sd, heading_sd = spread(P[0, 0], P[1, 0], P[1, 1]), sqrt(P[2, 2])
    furthest, wide = 0.0, sqrt(2.0 * gate)
    for i in range(len(z)):
        furthest = max(furthest, z[i, 0] + wide * sqrt(R[i, 0, 0]))
    near, m = np.empty(len(sd), np.int64), 0
    for a in range(len(sd)):
        dx, dy = xy[a, 0] - pose[0], xy[a, 1] - pose[1]
        reach = furthest + wide * (pose_sd + sd[a])
        if dx * dx + dy * dy > reach * reach:
            continue
        if may_be_seen(pose, pose_sd, heading_sd, xy[a, 0], xy[a, 1], sd[a], z, R, 2.0 * gate):
            near[m] = a
            m += 1
    return near[:m].copy()


@compiled
def carried(pose: Array, P: Array, motion: Array) -> tuple[float, float]:
    """Moves a pose (3,) and its covariance P (3, 3), in place, by `motion`: rows of dx, dy, dtheta and covariance.

    ArUco EKF SLAM, eqs (2), (3) and (6). Returns gx, gy: the Jacobian by the pose is [1, 0, gx; 0, 1, gy; 0, 0, 1].
    """
    x, y, turned = pose[0], pose[1], pose[2]
    pose[0], pose[1], pose[2] = moved(x, y, turned, motion[0, 0], motion[0, 1], motion[0, 2])
    gx, gy = y - pose[1], pose[0] - x
    spread_on(P, gx, gy, turned, motion)
    return gx, gy


@compiled
def spread_on(P: Array, gx: float, gy: float, turned: float, motion: Array) -> None:
    """Propagates a pose's covariance P (3, 3), in place, by a motion from heading `turned`."""
    for i in range(3):
        P[0, i] += gx * P[2, i]
        P[1, i] += gy * P[2, i]
    for i in range(3):
        P[i, 0] += gx * P[i, 2]
        P[i, 1] += gy * P[i, 2]
    c, s = cos(turned), sin(turned)
    qxx, qxy, qxt = motion[1, 0], motion[1, 1], motion[1, 2]
    qyy, qyt, qtt = motion[2, 1], motion[2, 2], motion[3, 2]
    P[0, 0] += c * c * qxx - 2 * c * s * qxy + s * s * qyy
    P[1, 1] += s * s * qxx + 2 * c * s * qxy + c * c * qyy
    P[2, 2] += qtt
    P[1, 0] += c * s * (qxx - qyy) + (c * c - s * s) * qxy
    P[2, 0] += c * qxt - s * qyt
    P[2, 1] += s * qxt + c * qyt
    P[0, 1], P[0, 2], P[1, 2] = P[1, 0], P[2, 0], P[2, 1]


@compiled
def after_motion(
    pose: Array, P: Array, at: Array, C: Array, L: Array, moves: bool, motion: Array, z: Array, R: Array, gate: float
) -> tuple[Ints, Array, Array]:
    """`jointly` for a joint Gaussian of pose and c landmarks as it was before a motion; nothing is changed."""
    x, Q, D = pose.copy(), P.copy(), C.copy()
    if moves:
        gx, gy = carried(x, Q, motion)
        for j in range(C.shape[1]):
            D[0, j] += gx * C[2, j]
            D[1, j] += gy * C[2, j]
    return jointly(x, Q, at, D, L, z, R, gate, x, at)


@compiled
def ahead(pose: Array, P: Array, moves: bool, motion: Array) -> tuple[Array, Array]:
    """Pose and covariance after a motion, as copies."""
    x, Q = pose.copy(), P.copy()
    if moves:
        carried(x, Q, motion)
    return x, Q
