"""Inner loops of registration: the motion between two frames from matched points, by MSAC and Gauss-Newton.

A motion takes points q of the second frame to those of the first: p = R q + t. Its errors are small turns and shifts on
the left, p = exp(turn) (R q + t) + shift, in the order shift (m), turn (rad).
"""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from ...core.kernels._small import cholesky, cross, inverse, rodrigues, solve
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints

ITERATIONS = 12
"""Of Gauss-Newton, at most."""

SMALL = 1e-8
"""m and rad; Gauss-Newton ends when no part moves further."""

FLAT = 1e-9
"""m^2; three points on a line span less than that."""


@compiled
def axes_of(points: Array, rows: Ints, axes: Array) -> bool:
    """Writes three axes (3, 3), as rows, that three of `points` (n, 3) span; False where they lie on a line."""
    a, b, c = rows[0], rows[1], rows[2]
    length = 0.0
    for i in range(3):
        axes[0, i] = points[b, i] - points[a, i]
        axes[1, i] = points[c, i] - points[a, i]
        length += axes[0, i] ** 2
    if length < FLAT:
        return False
    for i in range(3):
        axes[0, i] /= sqrt(length)
    cross(axes[0], axes[1], axes[2])
    length = axes[2, 0] ** 2 + axes[2, 1] ** 2 + axes[2, 2] ** 2
    if length < FLAT:
        return False
    for i in range(3):
        axes[2, i] /= sqrt(length)
    cross(axes[2], axes[0], axes[1])
    return True


@compiled
def motion_of(p: Array, q: Array, rows: Ints, a: Array, b: Array, R: Array, t: Array) -> bool:
    """Writes the motion that lays the triangle of three rows of `q` (n, 3) on that of `p`; False for a line."""
    if not axes_of(p, rows, a) or not axes_of(q, rows, b):
        return False
    for i in range(3):
        for j in range(3):
            R[i, j] = a[0, i] * b[0, j] + a[1, i] * b[1, j] + a[2, i] * b[2, j]
    for i in range(3):
        total = 0.0
        for k in range(3):
            row = rows[k]
            total += p[row, i] - R[i, 0] * q[row, 0] - R[i, 1] * q[row, 1] - R[i, 2] * q[row, 2]
        t[i] = total / 3.0
    return True


@compiled
def misfit(p: Array, p_sd: Array, q: Array, q_sd: Array, R: Array, t: Array, gate: float, most: float) -> float:
    """The sum of squared errors, each `gate` at most, of rays and depths of `q` in the first frame; ends above `most`.

    MSAC: Torr and Zisserman, CVIU 2000. The columns of `p_sd` and `q_sd` (n, 2) are of depth (m) and ray.
    """
    total = 0.0
    for k in range(len(p)):
        x = R[0, 0] * q[k, 0] + R[0, 1] * q[k, 1] + R[0, 2] * q[k, 2] + t[0]
        y = R[1, 0] * q[k, 0] + R[1, 1] * q[k, 1] + R[1, 2] * q[k, 2] + t[1]
        z = R[2, 0] * q[k, 0] + R[2, 1] * q[k, 1] + R[2, 2] * q[k, 2] + t[2]
        error = gate
        if z > 0.1:
            du, dv = x / z - p[k, 0] / p[k, 2], y / z - p[k, 1] / p[k, 2]
            error = (du * du + dv * dv) / (p_sd[k, 1] ** 2 + q_sd[k, 1] ** 2)
            error += (z - p[k, 2]) ** 2 / (p_sd[k, 0] ** 2 + q_sd[k, 0] ** 2)
        total += min(error, gate)
        if total > most:
            break
    return total


@compiled
def msac(
    p: Array, p_sd: Array, q: Array, q_sd: Array, triples: Ints, gate: float, best_R: Array, best_t: Array
) -> float:
    """Improves the motion in `best_R` (3, 3) and `best_t` (3,) by those of `triples` (h, 3); returns its misfit."""
    R, t, a, b = np.empty((3, 3)), np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    best = misfit(p, p_sd, q, q_sd, best_R, best_t, gate, np.inf)
    for k in range(len(triples)):
        if not motion_of(p, q, triples[k], a, b, R, t):
            continue
        found = misfit(p, p_sd, q, q_sd, R, t, gate, best)
        if found < best:
            best = found
            for i in range(3):
                best_t[i] = t[i]
                for j in range(3):
                    best_R[i, j] = R[i, j]
    return best


@compiled
def cov_of(x: Array, sd: Array, out: Array) -> None:
    """Writes the covariance (3, 3) of a point `x` (3,) with `sd` (2,) of depth and ray."""
    z = x[2]
    for i in range(3):
        for j in range(3):
            out[i, j] = x[i] * x[j] / (z * z) * sd[0] ** 2
    out[0, 0] += (z * sd[1]) ** 2
    out[1, 1] += (z * sd[1]) ** 2


@compiled
def normal_equations(
    p: Array,
    p_sd: Array,
    q: Array,
    q_sd: Array,
    R: Array,
    t: Array,
    gate: float,
    inside: NDArray[np.bool_],
    A: Array,
    g: Array,
) -> float:
    """Sums up A (6, 6) and g (6,) over the points within `gate`, marks them, and returns their squared distance.

    A residual r = p - (R q + t) has the covariance Cp + R Cq R'.
    """
    Cp, Cq, S, W, w, r, J, WJ = (
        np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty(3), np.empty(3),
        np.zeros((3, 6)), np.empty((3, 6)),
    )  # fmt: skip
    A[:], g[:] = 0.0, 0.0
    J[0, 0], J[1, 1], J[2, 2] = 1.0, 1.0, 1.0
    total = 0.0
    for k in range(len(p)):
        for i in range(3):
            w[i] = R[i, 0] * q[k, 0] + R[i, 1] * q[k, 1] + R[i, 2] * q[k, 2] + t[i]
            r[i] = p[k, i] - w[i]
        cov_of(p[k], p_sd[k], Cp)
        cov_of(q[k], q_sd[k], Cq)
        for i in range(3):
            for j in range(3):
                turned = 0.0
                for m in range(3):
                    for n in range(3):
                        turned += R[i, m] * Cq[m, n] * R[j, n]
                S[i, j] = Cp[i, j] + turned
        inside[k] = inverse(S, W)
        if not inside[k]:
            continue
        squared = 0.0
        for i in range(3):
            for j in range(3):
                squared += r[i] * W[i, j] * r[j]
        inside[k] = squared < gate
        if not inside[k]:
            continue
        total += squared
        J[0, 4], J[0, 5], J[1, 3], J[1, 5], J[2, 3], J[2, 4] = w[2], -w[1], -w[2], w[0], w[1], -w[0]
        for i in range(3):
            for j in range(6):
                WJ[i, j] = W[i, 0] * J[0, j] + W[i, 1] * J[1, j] + W[i, 2] * J[2, j]
        for i in range(6):
            for j in range(i, 6):
                A[i, j] += J[0, i] * WJ[0, j] + J[1, i] * WJ[1, j] + J[2, i] * WJ[2, j]
                A[j, i] = A[i, j]
            g[i] += WJ[0, i] * r[0] + WJ[1, i] * r[1] + WJ[2, i] * r[2]
    return total


@compiled
def turn_by(x: Array, R: Array, t: Array) -> None:
    """Moves a motion by the twist x (6,), shift and turn: the exponential of SE(3) from the left.

    A large turn about a far line of features takes the camera along an arc: turned and then shifted, it would leave it
    by half the distance times the turn squared.
    """
    E, old = np.empty((3, 3)), np.empty((3, 4))
    one, two, three = rodrigues(x[3:], E)
    along = (x[3] * x[0] + x[4] * x[1] + x[5] * x[2]) * three
    for i in range(3):
        old[i, 3] = t[i]
        for j in range(3):
            old[i, j] = R[i, j]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        shift = one * x[i] + along * x[3 + i] + two * (x[3 + j] * x[k] - x[3 + k] * x[j])
        t[i] = E[i, 0] * old[0, 3] + E[i, 1] * old[1, 3] + E[i, 2] * old[2, 3] + shift
        for j in range(3):
            R[i, j] = E[i, 0] * old[0, j] + E[i, 1] * old[1, j] + E[i, 2] * old[2, j]


@compiled
def refined(
    p: Array,
    p_sd: Array,
    q: Array,
    q_sd: Array,
    R: Array,
    t: Array,
    gate: float,
    least: int,
    inside: NDArray[np.bool_],
    cov: Array,
) -> float:
    """Moves the motion `R`, `t` to the optimum of its inliers by Gauss-Newton, and writes these and its covariance.

    Returns their squared distance; negative where fewer than `least` are inliers or where they leave a direction open.
    """
    A, g, L, x = np.empty((6, 6)), np.empty(6), np.zeros((6, 6)), np.empty(6)
    total = -1.0
    for _ in range(ITERATIONS):
        total = normal_equations(p, p_sd, q, q_sd, R, t, gate, inside, A, g)
        count = 0
        for k in range(len(p)):
            count += inside[k]
        if count < least or not cholesky(A, L, 6, 1e-10, 0.0):
            return -1.0
        solve(L, g, x, 6)
        turn_by(x, R, t)
        furthest = 0.0
        for i in range(6):
            furthest = max(furthest, abs(x[i]))
        if furthest < SMALL:
            break
    for j in range(6):
        for i in range(6):
            g[i] = 1.0 if i == j else 0.0
        solve(L, g, x, 6)
        for i in range(6):
            cov[i, j] = x[i]
    return total
