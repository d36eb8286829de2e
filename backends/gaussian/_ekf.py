"""One frame of EKF-SLAM in one compiled call: ArUco EKF SLAM, eqs (5)-(20), on the given part of the state.

The covariance is in three pieces: the pose's (3, 3), the cross-covariance of the pose with the map (3, n), and the
map's own, a triangle (see `_triangle`). A sighting corrects it by -w' w, w = L^-1 H P (2, n) with H P H' + R = L L'.
These rows are deferred: they are collected in W, the next sighting forms its H P from the covariance and the rows
deferred so far, and one pass over the triangle at the end of the frame subtracts W' W. This is exact.

`transition` (3 + n, m) is transformed like the state: motions and corrections multiply it from the left, a new
landmark's rows derive from the pose's. The compressed filter needs it (see `_compressed`); else m is 0.

The linear Kalman filter (see `kf`) differs in that everything is linearised at dead reckoning's heading, without
corrections, and sightings are offsets along and across the line of sight, which are linear in the state.
"""

from math import cos, exp, sin, sqrt

import numpy as np

from ...core.kernels._blas import add_product, add_square
from ...core.kernels._planar import moved, propagate, wrap
from ...core.kernels.compiled import compiled
from ...core.se2 import Array
from .._models import placed, sighted
from ._beliefs import JointArrays, belief_at, frame_at
from ._triangle import REAL, add_square_of, put, take

OWED = 48
"""Deferred rows before they are applied; a frame of more than 24 sightings takes several passes."""

STANDARD, FIRST, IDEAL, ODOMETRY = 0, 1, 2, 3
"""Linearisation points: the mean, first estimates, ground truth, dead reckoning."""

ASTRAY = -1
"""In place of a count of agreements: the landmark is to be initialised again."""

POSE = -2
"""In place of a count of agreements: the pair is of kept poses, and no landmark."""

INDEFINITE, AT_ROBOT = 1, 2
"""Reasons why a frame could not be finished."""


@compiled
def advance(pose: Array, point: Array, motion: Array, truth: Array, where: int) -> tuple[float, float, float]:
    """Moves a pose's mean and its linearisation point, in place, by `motion`: rows of dx, dy, dtheta and covariance.

    Returns gx, gy and the heading that the motion is turned by. The Jacobian of eq. (3) is [1, 0, gx; 0, 1, gy; 0, 0,
    1] with gx = -(y' - y), gy = x' - x for a motion from (x, y) to (x', y'): from `point`, where the pose was
    linearised last, to its present place. With dead reckoning, the mean's deviation from it is transformed likewise,
    and no angle is wrapped.
    """
    x, y, turned = point[0], point[1], point[2] if where in (IDEAL, ODOMETRY) else pose[2]
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
            point[i] = truth[i] if where == IDEAL else pose[i]
    return y - point[1], point[0] - x, turned


@compiled
def predict(b: JointArrays, n: int, m: int, motion: Array, truth: Array, where: int) -> None:
    """Eqs (5)-(9) for the body-frame `motion`: rows of dx, dy, dtheta and of its covariance, (4, 3)."""
    cross, transition = b.cross, b.transition
    gx, gy, turned = advance(b.mean, b.points, motion, truth, where)
    for j in range(n):
        cross[0, j] += gx * cross[2, j]
        cross[1, j] += gy * cross[2, j]
    for j in range(m):
        transition[0, j] += gx * transition[2, j]
        transition[1, j] += gy * transition[2, j]
    propagate(b.pose, gx, gy, turned, motion)


@compiled
def settle(b: JointArrays, n: int, m: int, rank: int) -> None:
    """Applies deferred updates: subtracts W' W from the covariance and W' Y from the transition, adds Y' Y to Psi."""
    pose, cross, transition, Wp, Wm, Y = b.pose, b.cross, b.transition, b.owed_pose, b.owed_map, b.owed_transition
    dgemm, dsyrk = b.blas[0], b.blas[1]
    for q in range(rank):
        for i in range(3):
            a = Wp[q, i]
            for j in range(3):
                pose[i, j] -= a * Wp[q, j]
            for j in range(n):
                cross[i, j] -= a * Wm[q, j]
            for j in range(m):
                transition[i, j] -= a * Y[q, j]
    add_square_of(b.flat, n, -1.0, Wm, rank, dgemm, dsyrk)
    if m > 0:
        wide, out = Y.shape[1], transition.shape[1]
        below = transition.ctypes.data + REAL * 3 * out
        add_product(dgemm, m, n, rank, -1.0, Y.ctypes.data, wide, Wm.ctypes.data, Wm.shape[1], below, out)
        add_square(dsyrk, m, rank, 1.0, Y.ctypes.data, wide, b.information.ctypes.data, b.information.shape[1])


@compiled
def combine(by_pose: Array, by_landmark: Array, of_pose: Array, of_landmark: Array, at: int, n: int, v: Array) -> None:
    """v (2, n) = by_pose (2, 3) of_pose (3, n) + by_landmark (2, 2) of_landmark[at : at + 2] (2, n)."""
    a, b, c, d, e = by_pose[0, 0], by_pose[0, 1], by_pose[0, 2], by_landmark[0, 0], by_landmark[0, 1]
    for j in range(n):
        v[0, j] = (
            a * of_pose[0, j]
            + b * of_pose[1, j]
            + c * of_pose[2, j]
            + d * of_landmark[at, j]
            + e * of_landmark[at + 1, j]
        )
    a, b, c, d, e = by_pose[1, 0], by_pose[1, 1], by_pose[1, 2], by_landmark[1, 0], by_landmark[1, 1]
    for j in range(n):
        v[1, j] = (
            a * of_pose[0, j]
            + b * of_pose[1, j]
            + c * of_pose[2, j]
            + d * of_landmark[at, j]
            + e * of_landmark[at + 1, j]
        )


@compiled
def pay(v: Array, owed: Array, q: int, a: float, b: float, c: float, d: float, n: int) -> None:
    """v (2, n) -= [a b; c d] times the deferred rows q and q + 1."""
    for j in range(n):
        v[0, j] -= a * owed[q, j] + b * owed[q + 1, j]
        v[1, j] -= c * owed[q, j] + d * owed[q + 1, j]


@compiled
def whiten(v: Array, n: int, l00: float, l10: float, l11: float, out: Array, q: int) -> None:
    """L^-1 v into rows q and q + 1 of `out`."""
    a, c = 1 / l00, 1 / l11
    b = -l10 * a * c
    for j in range(n):
        out[q, j] = a * v[0, j]
        out[q + 1, j] = b * v[0, j] + c * v[1, j]


@compiled
def offset(heading: float, z: Array, R: Array) -> tuple[float, float, float, float, float, float, float]:
    """A sighting z (2,), R (4,) as an offset in the world, its direction, and its covariance along and across that.

    The mean over the arc of possible positions, E exp(i b) = exp(-v / 2) for a bearing of variance v, lies inside the
    arc, and the arc's points scatter inwards of it by (r v)^2 / 2.
    """
    r, v = z[0], R[3]
    ux, uy = cos(heading + z[1]), sin(heading + z[1])
    middle = r * exp(-v / 2)
    return middle * ux, middle * uy, ux, uy, R[0] + (r * v) ** 2 / 2, r * R[2], r * r * v


@compiled
def add(b: JointArrays, at: int, n: int, m: int, rank: int, z: Array, R: Array, where: int, rows: Array) -> None:
    """Eqs (17)-(20): initialises the landmark at map entry `at` from one sighting, with all covariances.

    G_p is [1, 0, -dy; 0, 1, dx] for a landmark at (dx, dy) from the pose, and G_z the inverse of the sighting's
    Jacobian by the landmark; both are evaluated at the linearisation points. G_z is [ux, ax; uy, ay].
    """
    mean, points, pose, cross, transition = b.mean, b.points, b.pose, b.cross, b.transition
    Wp, Wm = b.owed_pose, b.owed_map
    rr, rb, bb = R[0], R[2], R[3]
    if where == ODOMETRY:
        dx, dy, ux, uy, rr, rb, bb = offset(points[2], z, R)
        off = mean[2] - points[2]
        mean[3 + at], mean[4 + at] = mean[0] + dx - dy * off, mean[1] + dy + dx * off
        ax, ay = -uy, ux
    else:
        mean[3 + at], mean[4 + at] = placed(mean[0], mean[1], mean[2], z[0], z[1])
        if where != IDEAL:
            points[3 + at], points[4 + at] = mean[3 + at], mean[4 + at]
        dx, dy = points[3 + at] - points[0], points[4 + at] - points[1]
        r = sqrt(dx * dx + dy * dy)
        ux, uy = cos(mean[2] + z[1]), sin(mean[2] + z[1])  # for a landmark at zero distance
        if r > 0.0:
            ux, uy = dx / r, dy / r
        ax, ay = -dy, dx
    for j in range(n):
        rows[0, j] = cross[0, j] - dy * cross[2, j]
        rows[1, j] = cross[1, j] + dx * cross[2, j]
    for j in range(m):
        transition[3 + at, j] = transition[0, j] - dy * transition[2, j]
        transition[4 + at, j] = transition[1, j] + dx * transition[2, j]
    for q in range(rank):
        Wm[q, at] = Wp[q, 0] - dy * Wp[q, 2]
        Wm[q, at + 1] = Wp[q, 1] + dx * Wp[q, 2]
    for i in range(3):
        cross[i, at] = pose[0, i] - dy * pose[2, i]
        cross[i, at + 1] = pose[1, i] + dx * pose[2, i]
    rows[0, at] = cross[0, at] - dy * cross[2, at] + ux * ux * rr + 2 * ux * ax * rb + ax * ax * bb
    rows[1, at] = cross[1, at] + dx * cross[2, at] + ux * uy * rr + (ux * ay + uy * ax) * rb + ax * ay * bb
    rows[1, at + 1] = cross[1, at + 1] + dx * cross[2, at + 1] + uy * uy * rr + 2 * uy * ay * rb + ay * ay * bb
    put(b.flat, at, max(n, at + 2), rows)


@compiled
def frame(
    belief: int, seen: int, n: int, m: int, k: int, moves: bool, where: int, joint: bool, gate: float, confirm: int
) -> tuple[int, int, float, int, int]:
    """Predicts, then processes `k` sightings of the landmarks in `slots`, of which those from n / 2 on are new.

    `belief` and `seen` are addresses of `JointArrays` and a `Frame`; `m` columns of the transition are in use, and
    without `moves` there is no motion. Jacobians are evaluated at `points`, which may be `mean` itself; `joint`
    evaluates all expected sightings at the prediction, stored in `predicted`. A sighting with an innovation beyond
    `gate` is rejected or, if fewer than `confirm` have agreed with its landmark, replaces all that the landmark was
    made from. Returns the sighting at which it failed and the reason (-1, 0: none), the NIS, its degrees of freedom and
    the number of rejected sightings.
    """
    b, f = belief_at(belief), frame_at(seen)
    mean, points, predicted, agreed, pose, cross = b.mean, b.points, b.predicted, b.agreed, b.pose, b.cross
    flat, transition, pull, Wp, Wm, Y = b.flat, b.transition, b.pull, b.owed_pose, b.owed_map, b.owed_transition
    slots, z, R = f.slots, f.z, f.cov
    if moves:
        predict(b, n, m, f.motion, f.truth, where)
    elif where == IDEAL:
        points[0], points[1], points[2] = f.truth[0], f.truth[1], f.truth[2]
    expecting, at_points = mean, points
    if joint:
        for j in range(3 + n):
            predicted[j] = mean[j]
        expecting = predicted
        if where == STANDARD:
            at_points = predicted
    by_pose, by_landmark = np.zeros((2, 3)), np.empty((2, 2))
    by_pose[1, 2] = -1.0
    rows, v, y, u = np.empty((2, n + 2 * k)), np.empty((2, n + 2 * k)), np.empty((2, m)), np.empty((2, 3))
    nis, dof, refused, rank = 0.0, 0, 0, 0
    for i in range(k):
        at = 2 * int(slots[i])
        if at >= n:
            if joint:
                continue
            add(b, at, n, m, rank, z[i], R[i], where, rows)
            agreed[slots[i]] = 0
            n += 2
            continue
        rr, rb, bb = R[i, 0], R[i, 2], R[i, 3]
        if where == ODOMETRY:
            dx, dy, ux, uy, rr, rb, bb = offset(points[2], z[i], R[i])
            by_landmark[0, 0], by_landmark[0, 1] = ux, uy
            by_landmark[1, 0], by_landmark[1, 1] = -uy, ux
            by_pose[1, 2] = -(ux * dx + uy * dy)
        else:
            dx, dy = at_points[3 + at] - at_points[0], at_points[4 + at] - at_points[1]
            q = dx * dx + dy * dy
            if not q > 0.0:
                return i, AT_ROBOT, nis, dof, refused
            r = sqrt(q)
            # eq. (13)
            by_landmark[0, 0], by_landmark[0, 1] = dx / r, dy / r
            by_landmark[1, 0], by_landmark[1, 1] = -dy / q, dx / q
        for h in range(2):
            by_pose[h, 0], by_pose[h, 1] = -by_landmark[h, 0], -by_landmark[h, 1]
        # H P, eq. (15), from the covariance, less deferred updates
        take(flat, at, n, rows)
        combine(by_pose, by_landmark, cross, rows, 0, n, v)
        for j in range(3):
            for h in range(2):
                u[h, j] = (
                    by_pose[h, 0] * pose[0, j]
                    + by_pose[h, 1] * pose[1, j]
                    + by_pose[h, 2] * pose[2, j]
                    + by_landmark[h, 0] * cross[j, at]
                    + by_landmark[h, 1] * cross[j, at + 1]
                )
        combine(by_pose, by_landmark, transition, transition, 3 + at, m, y)
        for p in range(0, rank, 2):
            c00 = project(by_pose, by_landmark, Wp, Wm, at, 0, p)
            c01 = project(by_pose, by_landmark, Wp, Wm, at, 0, p + 1)
            c10 = project(by_pose, by_landmark, Wp, Wm, at, 1, p)
            c11 = project(by_pose, by_landmark, Wp, Wm, at, 1, p + 1)
            pay(u, Wp, p, c00, c01, c10, c11, 3)
            pay(v, Wm, p, c00, c01, c10, c11, n)
            pay(y, Y, p, c00, c01, c10, c11, m)
        s00 = project(by_pose, by_landmark, u, v, at, 0, 0) + rr
        s10 = project(by_pose, by_landmark, u, v, at, 0, 1) + rb
        s11 = project(by_pose, by_landmark, u, v, at, 1, 1) + bb
        if not s00 > 0.0:
            return i, INDEFINITE, nis, dof, refused
        l00 = sqrt(s00)
        l10 = s10 / l00
        rest = s11 - l10 * l10
        if not rest > 0.0:
            return i, INDEFINITE, nis, dof, refused
        l11 = sqrt(rest)
        # the innovation, eq. (16), whitened
        if where == ODOMETRY:
            ex, ey = dx - (mean[3 + at] - mean[0]), dy - (mean[4 + at] - mean[1])
            dr = by_landmark[0, 0] * ex + by_landmark[0, 1] * ey
            db = by_landmark[1, 0] * ex + by_landmark[1, 1] * ey - by_pose[1, 2] * (mean[2] - points[2])
        else:
            er, eb = sighted(expecting[0], expecting[1], expecting[2], expecting[3 + at], expecting[4 + at])
            dr, db = z[i, 0] - er, wrap(z[i, 1] - eb)
        if joint:  # less the effect of the corrections since the prediction
            turned = wrap(mean[2] - predicted[2])
            ex, ey = mean[0] - predicted[0], mean[1] - predicted[1]
            mx, my = mean[3 + at] - predicted[3 + at], mean[4 + at] - predicted[4 + at]
            dr -= by_landmark[0, 0] * (mx - ex) + by_landmark[0, 1] * (my - ey)
            db -= by_landmark[1, 0] * (mx - ex) + by_landmark[1, 1] * (my - ey) - turned
        f0 = dr / l00
        f1 = (db - l10 * f0) / l11
        distance = f0 * f0 + f1 * f1
        if gate > 0.0 and not distance <= gate:
            if agreed[slots[i]] >= confirm:
                refused += 1
            elif joint:
                agreed[slots[i]] = ASTRAY
            else:
                add(b, at, n, m, rank, z[i], R[i], where, rows)
                agreed[slots[i]] = 0
            continue
        agreed[slots[i]] += 1
        nis += distance
        dof += 2
        whiten(u, 3, l00, l10, l11, Wp, rank)
        whiten(v, n, l00, l10, l11, Wm, rank)
        whiten(y, m, l00, l10, l11, Y, rank)
        for j in range(3):
            mean[j] += Wp[rank, j] * f0 + Wp[rank + 1, j] * f1
        if where != ODOMETRY:
            mean[2] = wrap(mean[2])
        for j in range(n):
            mean[3 + j] += Wm[rank, j] * f0 + Wm[rank + 1, j] * f1
        for j in range(m):
            pull[j] += Y[rank, j] * f0 + Y[rank + 1, j] * f1
        rank += 2
        if rank == OWED:
            settle(b, n, m, rank)
            rank = 0
    for i in range(k if joint else 0):  # new landmarks are added after a joint update
        at = 2 * int(slots[i])
        if at >= n or agreed[slots[i]] == ASTRAY:
            add(b, at, n, m, rank, z[i], R[i], where, rows)
            agreed[slots[i]] = 0
            n = max(n, at + 2)
    if rank:
        settle(b, n, m, rank)
    return -1, 0, nis, dof, refused


@compiled
def project(by_pose: Array, by_landmark: Array, of_pose: Array, of_map: Array, at: int, h: int, q: int) -> float:
    """Row h of H times row q of a covariance, given as the pose's columns (_, 3) and the map's (_, n)."""
    return (
        by_pose[h, 0] * of_pose[q, 0]
        + by_pose[h, 1] * of_pose[q, 1]
        + by_pose[h, 2] * of_pose[q, 2]
        + by_landmark[h, 0] * of_map[q, at]
        + by_landmark[h, 1] * of_map[q, at + 1]
    )
