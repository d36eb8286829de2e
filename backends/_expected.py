"""Expected sightings with their joint covariance, for any belief that can state a few joint covariances."""

from math import atan2, sqrt
from typing import NamedTuple

import numpy as np

from ..core.kernels._planar import moved, propagate, wrap
from ..core.kernels.compiled import compiled
from ..core.se2 import Array, Ints

LEAST_RANGE = 1e-6
"""m; a landmark that is closer to the robot has no bearing, and is not expected."""

ROUNDING = 1.0 + 1e-9
"""Factor on a bound that is compared with a gate, for rounding errors."""


class Gaussian(NamedTuple):
    """A joint Gaussian of the pose and c landmarks; models are linearised at its means."""

    pose: Array  # (3,)
    P: Array  # (3, 3) the pose's covariance
    at: Array  # (c, 2) m
    C: Array  # (3, 2c) covariance of the pose with the landmarks
    L: Array  # (2c, 2c) that of the landmarks, of which blocks on and below the diagonal are read


@compiled
def may_be_seen(
    pose: Array, pose_sd: float, heading_sd: float, x: float, y: float, sd: float, z: Array, R: Array, gate: float
) -> bool:
    """Tells if one of the sightings z (k, 2), R (k, 2, 2) can be within `gate` of a landmark at (x, y).

    `pose_sd` and `sd` bound the standard deviation, m, of the positions of robot and landmark in any direction: no
    correlation makes that of their difference larger than the sum. So no landmark within the gate is left out, and none
    that is thought to be where the robot is: its place may be an old one, or not known at all. One without a number as
    its deviation is out.
    """
    dx, dy = x - pose[0], y - pose[1]
    r = sqrt(dx * dx + dy * dy)
    both = pose_sd + sd
    if not r > LEAST_RANGE:
        return both >= 0.0
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


# It takes a belief by its pieces, as callers store it in three ways: as a matrix, as a triangle's rows, and by what
# is left of it after a motion.
@compiled
def within(
    pose: Array,
    P: Array,
    x: float,
    y: float,
    C: Array,
    L: Array,
    z: Array,
    R: Array,
    gate: float,
    dx: float,
    dy: float,
    h: Array,
    t: Array,
    expected: Array,
) -> bool:
    """Tells if one of the sightings z (k, 2), R (k, 2, 2) is within `gate` of a landmark at (x, y).

    P (3, 3), C (3, 2) and L (2, 2), of which the lower triangle is read, are the covariances of the pose, of it with
    the landmark, and the landmark's own; `dx` and `dy` are its offset from the pose where the model is linearised.
    Fills its Jacobian h (2, 2) by the landmark, the rows t (2, 3) of H times the columns of the pose, and `expected`
    (2,), range and bearing: ArUco EKF SLAM, eqs (13) and (15).
    """
    q = dx * dx + dy * dy
    if not q > LEAST_RANGE * LEAST_RANGE:
        return False
    r = sqrt(q)
    h[0, 0], h[0, 1], h[1, 0], h[1, 1] = dx / r, dy / r, -dy / q, dx / q
    for i in range(2):
        turn = -1.0 if i == 1 else 0.0
        for j in range(3):
            t[i, j] = h[i, 0] * (C[j, 0] - P[0, j]) + h[i, 1] * (C[j, 1] - P[1, j]) + turn * P[2, j]
    u00 = h[0, 0] * (L[0, 0] - C[0, 0]) + h[0, 1] * (L[1, 0] - C[1, 0])
    u01 = h[0, 0] * (L[1, 0] - C[0, 1]) + h[0, 1] * (L[1, 1] - C[1, 1])
    s00 = h[0, 0] * (u00 - t[0, 0]) + h[0, 1] * (u01 - t[0, 1])
    ox, oy = x - pose[0], y - pose[1]
    er, known, eb, s10, s11 = sqrt(ox * ox + oy * oy), False, 0.0, 0.0, 0.0
    for i in range(len(z)):
        off, least = z[i, 0] - er, s00 + R[i, 0, 0]
        if least > 0.0 and off * off > gate * least * ROUNDING:
            continue  # the range alone is beyond
        if not known:
            known, eb = True, wrap(atan2(oy, ox) - pose[2])
            u10 = h[1, 0] * (L[0, 0] - C[0, 0]) + h[1, 1] * (L[1, 0] - C[1, 0]) - C[2, 0]
            u11 = h[1, 0] * (L[1, 0] - C[0, 1]) + h[1, 1] * (L[1, 1] - C[1, 1]) - C[2, 1]
            s10 = h[0, 0] * (u10 - t[1, 0]) + h[0, 1] * (u11 - t[1, 1])
            s11 = h[1, 0] * (u10 - t[1, 0]) + h[1, 1] * (u11 - t[1, 1]) - t[1, 2]
        if distance(off, wrap(z[i, 1] - eb), least, s10 + R[i, 1, 0], s11 + R[i, 1, 1]) < gate:
            expected[0], expected[1] = er, eb
            return True
    return False


# By its pieces, as `within`.
@compiled
def cross_block(
    h: Array, t: Array, C: Array, l00: float, l01: float, l10: float, l11: float, g: Array, i: int, j: int, cov: Array
) -> None:
    """Covariance of the expected sightings of two landmarks, at entries i and j of `cov` and transposed.

    h (2, 2) and t (2, 3) of the first, g (2, 2) of the second, as `within` has them; C (3, 2) is the covariance of the
    pose with the second, [l00, l01; l10, l11] that of the two.
    """
    for a in range(2):
        turn = -1.0 if a == 1 else 0.0
        x = h[a, 0] * (l00 - C[0, 0]) + h[a, 1] * (l10 - C[1, 0]) + turn * C[2, 0] - t[a, 0]
        y = h[a, 0] * (l01 - C[0, 1]) + h[a, 1] * (l11 - C[1, 1]) + turn * C[2, 1] - t[a, 1]
        first, second = g[0, 0] * x + g[0, 1] * y, g[1, 0] * x + g[1, 1] * y - t[a, 2]
        cov[i + a, j], cov[j, i + a] = first, first
        cov[i + a, j + 1], cov[j + 1, i + a] = second, second


@compiled
def jointly(belief: Gaussian, z: Array, R: Array, gate: float, index: Ints, expected: Array, joint: Array) -> int:
    """Expected sightings of those of c landmarks that are within `gate` of one of the sightings z (k, 2), R (k, 2, 2).

    Returns their number m and fills, from the front, their indices (c,), range and bearing (c, 2), and with 4m^2
    numbers the joint covariance (2m, 2m) of those without the noise of the sensor: ArUco EKF SLAM, H P H'.
    """
    pose, P, at, C, L = belief
    c = len(at)
    T, H, m = np.empty((c, 2, 3)), np.empty((c, 2, 2)), 0
    for a in range(c):
        i, dx, dy = 2 * a, at[a, 0] - pose[0], at[a, 1] - pose[1]
        own, pair = L[i : i + 2, i : i + 2], C[:, i : i + 2]
        if within(pose, P, at[a, 0], at[a, 1], pair, own, z, R, gate, dx, dy, H[m], T[m], expected[m]):
            index[m] = a
            m += 1
    cov = joint[: 4 * m * m].reshape((2 * m, 2 * m))
    for p in range(m):
        a = 2 * int(index[p])
        for q in range(p + 1):
            b = 2 * int(index[q])
            l01 = L[a + 1, b] if p == q else L[a, b + 1]
            cross_block(
                H[p], T[p], C[:, b : b + 2], L[a, b], l01, L[a + 1, b], L[a + 1, b + 1], H[q], 2 * p, 2 * q, cov
            )  # fmt: skip
    return m


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
    propagate(P, gx, gy, turned, motion)
    return gx, gy


@compiled
def after_motion(
    belief: Gaussian, moves: bool, motion: Array, z: Array, R: Array, gate: float
) -> tuple[Ints, Array, Array]:
    """`jointly` for a belief as it was before a motion; nothing is changed."""
    pose, P, at, C, L = belief
    x, Q, D = pose.copy(), P.copy(), C.copy()
    if moves:
        gx, gy = carried(x, Q, motion)
        for j in range(C.shape[1]):
            D[0, j] += gx * C[2, j]
            D[1, j] += gy * C[2, j]
    c = len(at)
    index, expected, joint = np.empty(c, np.int64), np.empty((c, 2)), np.empty(4 * c * c)
    m = jointly(Gaussian(x, Q, at, D, L), z, R, gate, index, expected, joint)
    return index[:m].copy(), expected[:m].copy(), joint[: 4 * m * m].copy().reshape((2 * m, 2 * m))
