"""Sightings that a joint Gaussian belief expects after a motion, in one compiled call that changes nothing of it."""

from math import sqrt

import numpy as np

from ...frontend.compiled import compiled
from ...frontend.se2 import Array, Ints
from .._expected import jointly, may_be_seen, near_ones, spread, spread_on
from .._models import moved
from ._ekf import ODOMETRY, POSE
from ._triangle import row


@compiled
def predicted(pose: Array, point: Array, P: Array, motion: Array, where: int) -> tuple[float, float]:
    """Moves copies of the pose's mean, its linearisation point and its covariance, in place, as `predict` does.

    Returns gx, gy: the Jacobian by the pose is [1, 0, gx; 0, 1, gy; 0, 0, 1].
    """
    x, y, turned = point[0], point[1], point[2] if where == ODOMETRY else pose[2]
    if where == ODOMETRY:
        off = pose[2] - turned
        point[0], point[1], _ = moved(x, y, turned, motion[0, 0], motion[0, 1], motion[0, 2])
        point[2] += motion[0, 2]
        pose[0] += point[0] - x - (point[1] - y) * off
        pose[1] += point[1] - y + (point[0] - x) * off
        pose[2] += motion[0, 2]
    else:
        pose[0], pose[1], pose[2] = moved(pose[0], pose[1], pose[2], motion[0, 0], motion[0, 1], motion[0, 2])
        for i in range(3):
            point[i] = pose[i]
    gx, gy = y - point[1], point[0] - x
    spread_on(P, gx, gy, turned, motion)
    return gx, gy


@compiled
def sds(flat: Array, landmarks: int) -> Array:
    """The largest standard deviation of each landmark in any direction, (landmarks,) m."""
    out = np.empty(landmarks)
    for a in range(landmarks):
        i = 2 * a
        upper, lower = row(i), row(i + 1)
        out[a] = spread(flat[upper + i], flat[lower + i], flat[lower + i + 1])
    return out


@compiled
def around(
    mean: Array,
    points: Array,
    pose: Array,
    moves: bool,
    motion: Array,
    where: int,
    xy: Array,
    sd: Array,
    z: Array,
    R: Array,
    gate: float,
) -> Ints:
    """`near_ones` after a motion, for landmarks that were at xy (n, 2) with standard deviations sd (n,)."""
    x, point, P = mean[:3].copy(), points[:3].copy(), pose.copy()
    if moves:
        predicted(x, point, P, motion, where)
    return near_ones(x, P, xy, sd, z, R, gate)


@compiled
def expect(
    mean: Array,
    points: Array,
    pose: Array,
    cross: Array,
    flat: Array,
    agreed: Ints,
    pairs: int,
    moves: bool,
    motion: Array,
    where: int,
    z: Array,
    R: Array,
    gate: float,
) -> tuple[Ints, Array, Array]:
    """Expected sightings, after the `motion`, of landmarks that one of the sightings z (k, 2), R (k, 2, 2) may be of.

    Pairs that `agreed` marks as of kept poses are passed over. Returns indices (m,), range and bearing (m, 2), and
    joint covariance (2m, 2m): see `_expected.jointly`.
    """
    x, point, P = mean[:3].copy(), points[:3].copy(), pose.copy()
    gx, gy = predicted(x, point, P, motion, where) if moves else (0.0, 0.0)
    pose_sd, heading_sd = spread(P[0, 0], P[1, 0], P[1, 1]), sqrt(P[2, 2])
    near, m, furthest = np.empty(pairs, np.int64), 0, 0.0
    for i in range(len(z)):
        furthest = max(furthest, z[i, 0] + sqrt(gate * R[i, 0, 0]) + sqrt(gate) * pose_sd)
    for a in range(pairs):
        i = 2 * a
        if agreed[a] == POSE:
            continue
        upper, lower = row(i), row(i + 1)
        dx, dy = mean[3 + i] - x[0], mean[4 + i] - x[1]
        beyond = sqrt(dx * dx + dy * dy) - furthest
        if beyond > 0.0 and beyond * beyond > gate * (flat[upper + i] + flat[lower + i + 1]):
            continue
        sd = spread(flat[upper + i], flat[lower + i], flat[lower + i + 1])
        if may_be_seen(x, pose_sd, heading_sd, mean[3 + i], mean[4 + i], sd, z, R, gate):
            near[m] = a
            m += 1
    at, spots, C, L = np.empty((m, 2)), np.empty((m, 2)), np.empty((3, 2 * m)), np.empty((2 * m, 2 * m))
    for p in range(m):
        i = 2 * near[p]
        for h in range(2):
            at[p, h], spots[p, h] = mean[3 + i + h], points[3 + i + h]
            C[0, 2 * p + h] = cross[0, i + h] + gx * cross[2, i + h]
            C[1, 2 * p + h] = cross[1, i + h] + gy * cross[2, i + h]
            C[2, 2 * p + h] = cross[2, i + h]
        first, second = row(i), row(i + 1)
        for q in range(p + 1):
            j = 2 * near[q]
            for g in range(2):
                if p == q and g == 1:
                    continue  # above the diagonal
                L[2 * p, 2 * q + g] = flat[first + j + g]
            for g in range(2):
                L[2 * p + 1, 2 * q + g] = flat[second + j + g]
    if where == ODOMETRY:  # its points are headings alone
        point, spots = x, at
    index, expected, cov = jointly(x, P, at, C, L, z, R, gate, point, spots)
    for p in range(len(index)):
        index[p] = near[index[p]]
    return index, expected, cov
