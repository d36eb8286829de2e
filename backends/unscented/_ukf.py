"""Inner loops of `ukf.py`: the unscented transform of the three models, and the belief's update.

The belief: mean (3 + n,), pose first; the pose's covariance (3, 3), its cross-covariance with the map (3, n), and the
map's own, a triangle (see `_triangle`). Each model is approximated by a line A over the few coordinates x that it
depends on, and a residual covariance (see `_unscented`); A replaces the Jacobian.

A sighting corrects the covariance by -w' w, w = L^-1 A P_x (2, 3 + n), where A P_xx A' + rest + R = L L'. The pose's
rows are corrected at once; for the map's triangle the rows are collected, and one product at the end of the frame
subtracts all of them. This is exact, as in the EKF (see `_ekf`).
"""

from math import sqrt

import numpy as np

from ...core.kernels._planar import moved, wrap
from ...core.kernels._small import cholesky
from ...core.kernels._turns import conditioned
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from .._models import placed, sighted
from ..gaussian._beliefs import JointArrays, belief_at
from ..gaussian._partial import correct as measure
from ..gaussian._triangle import add_square_of, put, row, take_less, take_row
from ._transform import ROUNDING, add_outer, regress, unroot

WRONG = ("nothing", "the predicted pose", "an innovation", "a new landmark")
"""The covariance that is not positive definite, by the number that `frame` returns."""


@compiled
def carry(b: JointArrays, delta: Array, root: Array, scaling: Array) -> Array:
    """Moves the pose and its covariance by `delta` (3,), where root (6, 6) is of the joint covariance of both.

    Returns the slope (3, 6) by the six coordinates of that root. `scaling` is as in `move`.
    """
    mean, pose = b.mean, b.pose
    spread = scaling[0] * (6.0 + scaling[1])
    x, y, heading = moved(mean[0], mean[1], mean[2], delta[0], delta[1], delta[2])
    away, p, d = np.empty((2, 6, 3)), np.empty(3), np.empty(3)
    for side in range(2):
        far = sqrt(spread) if side == 0 else -sqrt(spread)
        for k in range(6):
            for i in range(3):
                p[i] = mean[i] + far * root[i, k]
                d[i] = delta[i] + far * root[3 + i, k]
            u, v, turned = moved(p[0], p[1], p[2], d[0], d[1], d[2])
            away[side, k, 0], away[side, k, 1], away[side, k, 2] = u - x, v - y, wrap(turned - heading)
    slope, shift, rest = regress(away[0], away[1], 6, 3, spread, scaling[2])
    mean[0], mean[1], mean[2] = x + shift[0], y + shift[1], wrap(heading + shift[2])
    add_outer(slope, rest, 3, 0, 6)
    for i in range(3):
        for j in range(3):
            pose[i, j] = rest[i, j]
    return slope


@compiled
def move(b: JointArrays, n: int, motion: Array, scaling: Array) -> bool:
    """Predicts with `motion` (4, 3), rows of dx, dy, dtheta and of its covariance; False if a covariance is indefinite.

    `scaling` holds alpha^2, kappa and beta - alpha^2.
    """
    cross, root, noise, both = b.cross, np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((6, 6))
    if not (cholesky(b.pose, root, 3, 0.0, ROUNDING) and cholesky(motion[1:], noise, 3, 0.0, 0.0)):
        return False
    for i in range(3):
        for j in range(i + 1):
            both[i, j], both[3 + i, 3 + j] = root[i, j], noise[i, j]
    slope = carry(b, motion[0], both, scaling)
    unroot(slope, root, 3, 3)
    for j in range(n):
        x, y, turn = cross[0, j], cross[1, j], cross[2, j]
        for i in range(3):
            cross[i, j] = slope[i, 0] * x + slope[i, 1] * y + slope[i, 2] * turn
    return cholesky(b.pose, root, 3, 0.0, ROUNDING)


@compiled
def move_by_gyro(
    belief: int, n: int, motion: Array, entry: int, turn: float, var: float, dt: float, walk: float, scaling: Array
) -> bool:
    """Predicts with a `motion` (4, 3) by the wheels and a gyro's turn, whose bias is the map's `entry`: `core.gyro`.

    Given the bias the motion is `slope` times that, and noise, so that it depends on pose and map: the sigma points are
    those of the joint of pose and motion. False as in `move`.
    """
    b, by = belief_at(belief), np.empty(3)
    b.flat[row(entry) + entry] += walk
    told, told_var = conditioned(motion, turn, var, dt, by)
    H, off, R, entries = np.full((1, 1), dt), np.empty(1), np.full((1, 1), told_var), np.full(1, entry)
    off[0] = wrap(told - dt * b.mean[3 + entry])
    measure(b, n, entries, H, off, R, 0.0)
    cov, root, bias = np.zeros((6, 6)), np.zeros((6, 6)), np.empty(n)
    take_row(b.flat, entry, n, bias)
    for i in range(3):
        motion[0, i] += by[i] * b.mean[3 + entry]
        for j in range(3):
            cov[i, j] = b.pose[i, j]
            cov[3 + i, j] = by[i] * b.cross[j, entry]
            cov[3 + i, 3 + j] = motion[1 + i, j] + by[i] * by[j] * bias[entry]
    if not cholesky(cov, root, 6, 0.0, ROUNDING):
        return False
    slope, cross = carry(b, motion[0], root, scaling), b.cross
    unroot(slope, root, 3, 6)
    for j in range(n):
        before = cross[0, j], cross[1, j], cross[2, j]
        for i in range(3):
            cross[i, j] = (slope[i, 3] * by[0] + slope[i, 4] * by[1] + slope[i, 5] * by[2]) * bias[j]
            for k in range(3):
                cross[i, j] += slope[i, k] * before[k]
    return cholesky(b.pose, root, 3, 0.0, ROUNDING)


@compiled
def marginal(pose: Array, cross: Array, rows: Array, at: int) -> Array:
    """The joint covariance (5, 5) of the pose and the landmark at `at`, with covariance `rows`; its lower triangle."""
    cov = np.empty((5, 5))
    for i in range(3):
        for j in range(i + 1):
            cov[i, j] = pose[i, j]
        cov[3, i], cov[4, i] = cross[i, at], cross[i, at + 1]
    cov[3, 3], cov[4, 3], cov[4, 4] = rows[0, at], rows[1, at], rows[1, at + 1]
    return cov


@compiled
def expect(
    mean: Array, x: float, y: float, root: Array, dims: int, scaling: Array
) -> tuple[float, float, Array, Array]:
    """The expected sighting of a landmark at (x, y): range, bearing, slope (2, 5), residual covariance (2, 2)."""
    spread = scaling[0] * (5.0 + scaling[1])
    r, bearing = sighted(mean[0], mean[1], mean[2], x, y)
    away = np.zeros((2, 5, 2))
    for side in range(2):
        far = sqrt(spread) if side == 0 else -sqrt(spread)
        for k in range(dims):
            s, b = sighted(
                mean[0] + far * root[0, k],
                mean[1] + far * root[1, k],
                mean[2] + far * root[2, k],
                x + far * root[3, k],
                y + far * root[4, k],
            )
            away[side, k, 0], away[side, k, 1] = s - r, wrap(b - bearing)
    slope, shift, rest = regress(away[0], away[1], 5, 2, spread, scaling[2])
    return r + shift[0], bearing + shift[1], slope, rest


@compiled
def correct(
    b: JointArrays, rows: Array, n: int, at: int, x: float, y: float, z: Array, R: Array, scaling: Array
) -> float:
    """Corrects by a sighting z (2,), R (2, 2) of the landmark at (x, y) with covariance rows (2, n).

    `at` is its place in the map, -1 for one held fixed, whose rows are zero. The mean, the pose's covariance and its
    rows are corrected at once; `rows` is replaced by w, the map's correction being -w' w. Returns the normalised
    innovation squared, or -1 where its covariance is not positive definite.
    """
    mean, pose, cross = b.mean, b.pose, b.cross
    dims = 5 if at >= 0 else 3
    root, noise = np.zeros((5, 5)), np.empty((2, 2))
    if not cholesky(marginal(pose, cross, rows, at) if at >= 0 else pose, root, dims, 0.0, ROUNDING):
        return -1.0
    r, bearing, slope, rest = expect(mean, x, y, root, dims, scaling)
    for i in range(2):
        for j in range(2):
            rest[i, j] += R[i, j]
    add_outer(slope, rest, 2, 0, dims)
    if not cholesky(rest, noise, 2, 0.0, 0.0):
        return -1.0
    f0 = (z[0] - r) / noise[0, 0]
    f1 = (wrap(z[1] - bearing) - noise[1, 0] * f0) / noise[1, 1]
    unroot(slope, root, 2, dims)
    for k in range(5):  # L^-1 A
        slope[0, k] /= noise[0, 0]
        slope[1, k] = (slope[1, k] - noise[1, 0] * slope[0, k]) / noise[1, 1]
    apply(mean, pose, cross, rows, n, at, slope, f0, f1)
    return f0 * f0 + f1 * f1


@compiled
def apply(
    mean: Array, pose: Array, cross: Array, rows: Array, n: int, at: int, by: Array, f0: float, f1: float
) -> None:
    """Corrects by the whitened innovation (f0, f1), where w = by P_x and `by` (2, 5) is L^-1 A: see `correct`."""
    own = np.zeros((2, 3))  # the pose's part of w
    for h in range(2):
        for i in range(3):
            own[h, i] = by[h, 0] * pose[0, i] + by[h, 1] * pose[1, i] + by[h, 2] * pose[2, i]
            if at >= 0:
                own[h, i] += by[h, 3] * cross[i, at] + by[h, 4] * cross[i, at + 1]
    (a0, a1, a2, a3, a4), (b0, b1, b2, b3, b4) = by[0], by[1]
    (u0, u1, u2), (v0, v1, v2) = own[0], own[1]
    x, y, turn, first, second = cross[0], cross[1], cross[2], rows[0], rows[1]
    for j in range(n):
        u = a0 * x[j] + a1 * y[j] + a2 * turn[j] + a3 * first[j] + a4 * second[j]
        v = b0 * x[j] + b1 * y[j] + b2 * turn[j] + b3 * first[j] + b4 * second[j]
        x[j] -= u0 * u + v0 * v
        y[j] -= u1 * u + v1 * v
        turn[j] -= u2 * u + v2 * v
        mean[3 + j] += f0 * u + f1 * v
        first[j], second[j] = u, v
    for i in range(3):
        mean[i] += f0 * own[0, i] + f1 * own[1, i]
        for j in range(3):
            pose[i, j] -= own[0, i] * own[0, j] + own[1, i] * own[1, j]
    mean[2] = wrap(mean[2])


@compiled
def add(b: JointArrays, n: int, z: Array, R: Array, scaling: Array) -> bool:
    """Adds the landmark that the pose sees at `z` (2,), after the n entries of the map; False as in `move`."""
    mean, pose, cross = b.mean, b.pose, b.cross
    spread = scaling[0] * (5.0 + scaling[1])
    root, noise = np.zeros((3, 3)), np.zeros((2, 2))
    if not (cholesky(pose, root, 3, 0.0, ROUNDING) and cholesky(R, noise, 2, 0.0, 0.0)):
        return False
    x, y = placed(mean[0], mean[1], mean[2], z[0], z[1])
    away, p, m = np.empty((2, 5, 2)), np.empty(3), np.empty(2)
    for side in range(2):
        far = sqrt(spread) if side == 0 else -sqrt(spread)
        for k in range(5):
            for i in range(3):
                p[i] = mean[i] + (far * root[i, k] if k < 3 else 0.0)
            for i in range(2):
                m[i] = z[i] + (far * noise[i, k - 3] if k >= 3 else 0.0)
            u, v = placed(p[0], p[1], p[2], m[0], m[1])
            away[side, k, 0], away[side, k, 1] = u - x, v - y
    slope, shift, rest = regress(away[0], away[1], 5, 2, spread, scaling[2])
    mean[3 + n], mean[4 + n] = x + shift[0], y + shift[1]
    add_outer(slope, rest, 2, 0, 5)
    if not cholesky(rest, noise, 2, 0.0, 0.0):
        return False
    unroot(slope, root, 2, 3)
    rows = np.empty((2, n + 2))
    for h in range(2):
        by_x, by_y, by_turn = slope[h, 0], slope[h, 1], slope[h, 2]
        for j in range(n):
            rows[h, j] = by_x * cross[0, j] + by_y * cross[1, j] + by_turn * cross[2, j]
        for i in range(3):
            cross[i, n + h] = by_x * pose[0, i] + by_y * pose[1, i] + by_turn * pose[2, i]
    rows[0, n], rows[1, n], rows[1, n + 1] = rest[0, 0], rest[1, 0], rest[1, 1]
    put(b.flat, n, n + 2, rows)
    return True


@compiled
def frame(
    belief: int, n: int, known: Array, moves: bool, motion: Array, slots: Ints, z: Array, R: Array, scaling: Array
) -> tuple[int, float, int]:
    """Predicts if it `moves`, then processes k sightings in their order: z (k, 2), R (k, 2, 2).

    `belief` is the address of `JointArrays`, with space for 2k more entries.
    slots[i] is the landmark's number, a new one from n / 2 on, -1 - j for number j of those in `known` (., 2), held
    fixed. Returns an index into WRONG, the NIS and its degrees of freedom.
    """
    b, nis, dof, rank = belief_at(belief), 0.0, 0, 0
    mean, flat, owed = b.mean, b.flat, b.owed_map
    if moves and not move(b, n, motion, scaling):
        return 1, nis, dof
    for i in range(len(slots)):
        at = 2 * slots[i] if slots[i] >= 0 else -1
        if at >= n:
            if not add(b, n, z[i], R[i], scaling):
                return 3, nis, dof
            for q in range(rank):  # new landmarks have no deferred updates
                owed[q, n], owed[q, n + 1] = 0.0, 0.0
            n += 2
            continue
        if at >= 0:
            take_less(flat, at, n, owed, rank, owed[rank : rank + 2])
            x, y = mean[3 + at], mean[4 + at]
        else:
            x, y = known[-1 - slots[i], 0], known[-1 - slots[i], 1]
            for j in range(n):
                owed[rank, j], owed[rank + 1, j] = 0.0, 0.0
        distance = correct(b, owed[rank : rank + 2], n, at, x, y, z[i], R[i], scaling)
        if not distance >= 0.0:
            return 2, nis, dof
        nis += distance
        dof += 2
        rank += 2
        if rank == len(owed):
            add_square_of(flat, n, -1.0, owed, rank, b.blas[0], b.blas[1])
            rank = 0
    if rank:
        add_square_of(flat, n, -1.0, owed, rank, b.blas[0], b.blas[1])
    return 0, nis, dof
