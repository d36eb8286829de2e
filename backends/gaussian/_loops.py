"""Kept poses and loop closures of the EKF, on the given part of the state: see `kept_poses`.

A kept pose has three entries of the state: x and y, which are a pair as a landmark's, and its heading, which is half of
another pair. So sightings and motions treat kept poses as any other part of the state.
"""

from math import cos, sin

import numpy as np

from ...core.kernels._planar import wrap
from ...core.kernels._small import cholesky
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from ._ekf import INDEFINITE, OWED, STANDARD, settle
from ._joint_arrays import belief_at
from ._triangle import put, put_row, take, take_row


@compiled
def keep(belief: int, n: int, m: int, at: int, turn: int) -> None:
    """Clones the pose into the entries `at`, `at` + 1 and `turn`, all below n: means, covariances, points, rows of Phi.

    What these entries were before is lost. `belief` is the address of `JointArrays`.
    """
    b = belief_at(belief)
    mean, points, pose, cross, flat, transition = b.mean, b.points, b.pose, b.cross, b.flat, b.transition
    rows = np.empty((2, n))
    for i in range(3):
        k = turn if i == 2 else at + i
        mean[3 + k], points[3 + k] = mean[i], points[i]
        for j in range(3):
            cross[j, k] = pose[j, i]
        for j in range(m):
            transition[3 + k, j] = transition[i, j]
    for j in range(n):
        rows[0, j], rows[1, j] = cross[0, j], cross[1, j]
    put(flat, at, n, rows)
    for j in range(n):
        rows[0, j] = cross[2, j]
    put_row(flat, turn, n, rows[0])


@compiled
def relative(pose: Array, x: float, y: float, heading: float, H: Array) -> tuple[float, float, float]:
    """The `pose` (3,) in the frame of the one at (x, y, heading); its Jacobian by both goes to H (3, 6).

    h = (R' d, turn), d = pose - (x, y), R = R(heading), and with v = R' d the Jacobian is

        [R' 0 | -R'  ( v_y, -v_x)]
        [0  1 |  0        -1     ]
    """
    c, s = cos(heading), sin(heading)
    dx, dy = pose[0] - x, pose[1] - y
    vx, vy = c * dx + s * dy, c * dy - s * dx
    for i in range(3):
        for j in range(6):
            H[i, j] = 0.0
    H[0, 0], H[0, 1], H[0, 3], H[0, 4], H[0, 5] = c, s, -c, -s, vy
    H[1, 0], H[1, 1], H[1, 3], H[1, 4], H[1, 5] = -s, c, s, -c, -vx
    H[2, 2], H[2, 5] = 1.0, -1.0
    return vx, vy, wrap(pose[2] - heading)


@compiled
def measure(H: Array, of_pose: Array, kept: Array, n: int, out: Array) -> None:
    """out (3, n) = H (3, 6) times the rows of the pose (3, n) and of the kept pose (3, n)."""
    for i in range(3):
        a, b, c, d, e, f = H[i, 0], H[i, 1], H[i, 2], H[i, 3], H[i, 4], H[i, 5]
        for j in range(n):
            out[i, j] = (
                a * of_pose[0, j]
                + b * of_pose[1, j]
                + c * of_pose[2, j]
                + d * kept[0, j]
                + e * kept[1, j]
                + f * kept[2, j]
            )


@compiled
def across(H: Array, i: int, of_pose: Array, of_rest: Array, q: int, at: int, turn: int) -> float:
    """Row i of H times row q of a covariance, given as the pose's columns (_, 3) and the rest's (_, n)."""
    return (
        H[i, 0] * of_pose[q, 0]
        + H[i, 1] * of_pose[q, 1]
        + H[i, 2] * of_pose[q, 2]
        + H[i, 3] * of_rest[q, at]
        + H[i, 4] * of_rest[q, at + 1]
        + H[i, 5] * of_rest[q, turn]
    )


@compiled
def whiten(L: Array, v: Array, n: int, out: Array, q: int) -> None:
    """L^-1 v, (3, n), into rows q to q + 2 of `out`."""
    for j in range(n):
        first = v[0, j] / L[0, 0]
        second = (v[1, j] - L[1, 0] * first) / L[1, 1]
        out[q, j], out[q + 1, j] = first, second
        out[q + 2, j] = (v[2, j] - L[2, 0] * first - L[2, 1] * second) / L[2, 2]


@compiled
def close(
    belief: int, n: int, m: int, entries: Ints, delta: Array, R: Array, where: int, joint: bool, gate: float
) -> tuple[int, int, float, int, int]:
    """Corrects by loop closures one by one: delta (k, 3), R (k, 3, 3), from the poses at `entries` (k, 2).

    As `_ekf.frame`, which comes before it, on the belief at an address: linearised at `points`; if `joint`, at the
    step's prediction, stored in `predicted`. A loop closure with an innovation beyond `gate` is rejected. Returns the
    one at which it failed and the reason (-1, 0: none), the NIS, its degrees of freedom and the number rejected.
    """
    g = belief_at(belief)
    mean, points, predicted, pose, cross = g.mean, g.points, g.predicted, g.pose, g.cross
    flat, transition, pull, Wp, Wm, Y = g.flat, g.transition, g.pull, g.owed_pose, g.owed_map, g.owed_transition
    expecting, at_points = mean, points
    if joint:
        expecting = predicted
        if where == STANDARD:
            at_points = predicted
    nis, dof, refused, rank = 0.0, 0, 0, 0
    H, S, e, f = np.empty((3, 6)), np.empty((3, 3)), np.empty(3), np.empty(3)
    kept, v, u = np.empty((3, n)), np.empty((3, n)), np.empty((3, 3))
    own, y, its = np.empty((3, 3)), np.empty((3, m)), np.empty((3, m))
    for i in range(len(entries)):
        at, turn = int(entries[i, 0]), int(entries[i, 1])
        z = relative(expecting[:3], expecting[3 + at], expecting[4 + at], expecting[3 + turn], H)
        e[0], e[1], e[2] = delta[i, 0] - z[0], delta[i, 1] - z[1], wrap(delta[i, 2] - z[2])
        relative(at_points[:3], at_points[3 + at], at_points[4 + at], at_points[3 + turn], H)
        if joint:  # less the effect of the corrections since the prediction
            for a in range(3):
                for b in range(3):
                    moved = mean[b] - predicted[b]
                    k = 3 + (turn if b == 2 else at + b)
                    e[a] -= H[a, b] * (wrap(moved) if b == 2 else moved) + H[a, 3 + b] * (mean[k] - predicted[k])
        take(flat, at, n, kept)
        take_row(flat, turn, n, kept[2])
        measure(H, cross, kept, n, v)
        for j in range(3):
            own[0, j], own[1, j], own[2, j] = cross[j, at], cross[j, at + 1], cross[j, turn]
        measure(H, pose, own, 3, u)
        for a in range(3):
            k = 3 + (turn if a == 2 else at + a)
            for j in range(m):
                its[a, j] = transition[k, j]
        measure(H, transition, its, m, y)
        for p in range(rank):
            for a in range(3):
                by = across(H, a, Wp, Wm, p, at, turn)
                for j in range(3):
                    u[a, j] -= by * Wp[p, j]
                for j in range(n):
                    v[a, j] -= by * Wm[p, j]
                for j in range(m):
                    y[a, j] -= by * Y[p, j]
        for a in range(3):
            for b in range(a + 1):
                S[a, b] = across(H, b, u, v, a, at, turn) + R[i, a, b]
        if not cholesky(S, S, 3, 0.0, 0.0):
            return i, INDEFINITE, nis, dof, refused
        f[0] = e[0] / S[0, 0]
        f[1] = (e[1] - S[1, 0] * f[0]) / S[1, 1]
        f[2] = (e[2] - S[2, 0] * f[0] - S[2, 1] * f[1]) / S[2, 2]
        distance = f[0] * f[0] + f[1] * f[1] + f[2] * f[2]
        if gate > 0.0 and not distance <= gate:
            refused += 1
            continue
        nis += distance
        dof += 3
        whiten(S, u, 3, Wp, rank)
        whiten(S, v, n, Wm, rank)
        whiten(S, y, m, Y, rank)
        for a in range(3):
            for j in range(3):
                mean[j] += Wp[rank + a, j] * f[a]
            for j in range(n):
                mean[3 + j] += Wm[rank + a, j] * f[a]
            for j in range(m):
                pull[j] += Y[rank + a, j] * f[a]
        mean[2] = wrap(mean[2])
        rank += 3
        if rank + 3 > OWED:
            settle(g, n, m, rank)
            rank = 0
    if rank:
        settle(g, n, m, rank)
    return -1, 0, nis, dof, refused
