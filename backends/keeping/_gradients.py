"""Gauss-Newton on motions and loop closures of a whole log, by conjugate gradients.

Their preconditioner is what the motions say, a chain of blocks, with what loop closures say of each of their ends if
the other is known. Each product is linear in the length of the log, and so is all memory.
"""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from ...core.kernels._planar import inverse, turned
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from ..smoothing._factors import square_of, weight
from ..smoothing._links import motion_offset

Which = NDArray[np.bool]

MOST = 300  # iterations

TINY = 1e-300
"""In place of the information of a factor that a robust loss leaves out."""


@compiled
def linearise(
    path: Array, a: Ints, b: Ints, motions: Array, loops: int, settings: Array, e: Array, g: Array, W: Array
) -> bool:
    """Linearises m factors, each a motion (m, 9) and its covariance from step a to step b, at a path (n, 3).

    Fills the offsets e (m, 3), the levers g (m, 2) and the information W (m, 6) of b = G a + e, where G is
    [1, 0, gx; 0, 1, gy; 0, 0, 1]. The last `loops` of them have a robust loss: kind and scale are the first two of
    `settings`. False where a covariance is not positive definite.
    """
    for k in range(len(a)):
        p, q = path[a[k]], path[b[k]]
        e0, e1, e2, c, s = motion_offset(
            p[0], p[1], p[2], q[0], q[1], q[2], motions[k, 0], motions[k, 1], motions[k, 2]
        )
        S = turned(c, s, motions[k], 3)
        definite, found = inverse(S[0], S[1], S[2], S[3], S[4], S[5])
        if not definite:
            return False
        e[k, 0], e[k, 1], e[k, 2] = e0, e1, e2
        g[k, 0], g[k, 1] = p[1] - q[1], q[0] - p[0]
        for i in range(6):
            W[k, i] = found[i]
        if k >= len(a) - loops:
            share = weight(settings[0], settings[1], square_of(W[k], 0, e0, e1, e2))
            for i in range(6):
                W[k, i] *= share
    return True


@compiled
def product(a: Ints, b: Ints, g: Array, W: Array, free: Which, x: Array, out: Array) -> None:
    """The information of all factors times x (n, 3), whose rows are zero where a step is not `free` (n,)."""
    out[:] = 0.0
    for k in range(len(a)):
        i, j = a[k], b[k]
        r2 = x[j, 2] - x[i, 2]
        r0, r1 = x[j, 0] - x[i, 0] - g[k, 0] * x[i, 2], x[j, 1] - x[i, 1] - g[k, 1] * x[i, 2]
        add_to_ends(i, j, g, W, k, r0, r1, r2, free, out)


@compiled
def add_transposed(i: int, j: int, g: Array, k: int, u0: float, u1: float, u2: float, free: Which, out: Array) -> None:
    """Adds (u0, u1, u2) to row j of `out`, and takes G' of it off row i."""
    if free[j]:
        out[j, 0] += u0
        out[j, 1] += u1
        out[j, 2] += u2
    if free[i]:
        out[i, 0] -= u0
        out[i, 1] -= u1
        out[i, 2] -= u2 + g[k, 0] * u0 + g[k, 1] * u1


@compiled
def add_to_ends(
    i: int, j: int, g: Array, W: Array, k: int, r0: float, r1: float, r2: float, free: Which, out: Array
) -> None:
    """Adds W (r0, r1, r2) to row j of `out`, and takes G' of it off row i."""
    u0 = W[k, 0] * r0 + W[k, 1] * r1 + W[k, 2] * r2
    u1 = W[k, 1] * r0 + W[k, 3] * r1 + W[k, 4] * r2
    u2 = W[k, 2] * r0 + W[k, 4] * r1 + W[k, 5] * r2
    add_transposed(i, j, g, k, u0, u1, u2, free, out)


@compiled
def chain(a: Ints, b: Ints, g: Array, W: Array, free: Which, D: Array, E: Array) -> bool:
    """Factors the preconditioner: the inverses of its pivots D (n, 3, 3), and E (n, 3, 3) by the step before.

    False where it is not positive definite.
    """
    D[:], E[:] = 0.0, 0.0
    G, V, T = np.eye(3), np.empty((3, 3)), np.empty((3, 3))
    for k in range(len(a)):
        i, j = a[k], b[k]
        G[0, 2], G[1, 2] = g[k, 0], g[k, 1]
        V[0, 0], V[0, 1], V[0, 2], V[1, 1], V[1, 2], V[2, 2] = W[k, 0], W[k, 1], W[k, 2], W[k, 3], W[k, 4], W[k, 5]
        V[1, 0], V[2, 0], V[2, 1] = V[0, 1], V[0, 2], V[1, 2]
        times(V, G, T)
        for r in range(3):
            for s in range(3):
                if free[j]:
                    D[j, r, s] += V[r, s]
                if free[i]:
                    D[i, r, s] += G[0, r] * T[0, s] + G[1, r] * T[1, s] + G[2, r] * T[2, s]
                if j == i + 1 and free[i] and free[j]:
                    E[j, r, s] -= T[r, s]
    for k in range(len(D)):
        if not free[k]:
            continue
        if k > 0 and free[k - 1]:
            times(E[k], D[k - 1], T)
            for r in range(3):
                for s in range(3):
                    D[k, r, s] -= T[r, 0] * E[k, s, 0] + T[r, 1] * E[k, s, 1] + T[r, 2] * E[k, s, 2]
        definite, C = inverse(D[k, 0, 0], D[k, 0, 1], D[k, 0, 2], D[k, 1, 1], D[k, 1, 2], D[k, 2, 2])
        if not definite:
            return False
        D[k, 0, 0], D[k, 0, 1], D[k, 0, 2], D[k, 1, 1], D[k, 1, 2], D[k, 2, 2] = C
        D[k, 1, 0], D[k, 2, 0], D[k, 2, 1] = C[1], C[2], C[4]
    return True


@compiled
def times(A: Array, B: Array, out: Array) -> None:
    """A B, all (3, 3)."""
    for i in range(3):
        for j in range(3):
            out[i, j] = A[i, 0] * B[0, j] + A[i, 1] * B[1, j] + A[i, 2] * B[2, j]


@compiled
def solved(D: Array, E: Array, free: Which, r: Array, z: Array) -> None:
    """Solves the chain for a right-hand side r (n, 3)."""
    n, y = len(r), np.zeros(3)
    for k in range(n):
        for i in range(3):
            y[i] = r[k, i]
            if k > 0 and free[k] and free[k - 1]:
                y[i] -= E[k, i, 0] * z[k - 1, 0] + E[k, i, 1] * z[k - 1, 1] + E[k, i, 2] * z[k - 1, 2]
        for i in range(3):
            z[k, i] = D[k, i, 0] * y[0] + D[k, i, 1] * y[1] + D[k, i, 2] * y[2] if free[k] else 0.0
    for k in range(n - 2, -1, -1):
        if free[k] and free[k + 1]:
            for i in range(3):
                y[i] = E[k + 1, 0, i] * z[k + 1, 0] + E[k + 1, 1, i] * z[k + 1, 1] + E[k + 1, 2, i] * z[k + 1, 2]
            for i in range(3):
                z[k, i] -= D[k, i, 0] * y[0] + D[k, i, 1] * y[1] + D[k, i, 2] * y[2]


@compiled
def pulled(a: Ints, b: Ints, e: Array, g: Array, W: Array, free: Which, r: Array) -> None:
    """The right-hand side r (n, 3) of all factors."""
    r[:] = 0.0
    for k in range(len(a)):
        add_to_ends(a[k], b[k], g, W, k, e[k, 0], e[k, 1], e[k, 2], free, r)


@compiled
def drawn(a: Ints, b: Ints, g: Array, W: Array, free: Which, noise: Array, r: Array) -> None:
    """A random right-hand side r (n, 3), whose covariance is the information of all factors.

    `noise` (m, 3) are standard normal numbers. Its solution has the covariance of the offsets.
    """
    r[:] = 0.0
    for k in range(len(a)):
        l00 = sqrt(max(W[k, 0], TINY))
        l10, l20 = W[k, 1] / l00, W[k, 2] / l00
        l11 = sqrt(max(W[k, 3] - l10 * l10, TINY))
        l21 = (W[k, 4] - l20 * l10) / l11
        l22 = sqrt(max(W[k, 5] - l20 * l20 - l21 * l21, 0.0))
        u0 = l00 * noise[k, 0]
        u1 = l10 * noise[k, 0] + l11 * noise[k, 1]
        u2 = l20 * noise[k, 0] + l21 * noise[k, 1] + l22 * noise[k, 2]
        add_transposed(a[k], b[k], g, k, u0, u1, u2, free, r)


@compiled
def add_squares(x: Array, covs: Array) -> None:
    """Adds x x' to the covariance (3, 3) of each step."""
    for k in range(len(x)):
        for i in range(3):
            for j in range(3):
                covs[k, i, j] += x[k, i] * x[k, j]


@compiled
def offsets(
    a: Ints, b: Ints, g: Array, W: Array, free: Which, D: Array, E: Array, r: Array, enough: float, x: Array
) -> int:
    """Conjugate gradients for the offsets x (n, 3) of all steps; returns how many iterations.

    `r` (n, 3), the right-hand side, is what is left of it at the end. D and E are those of `chain`. They end after
    MOST, or when what is left of J is that share of what there was.
    """
    n = len(x)
    z, p, q = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3))
    solved(D, E, free, r, z)
    p[:] = z
    x[:] = 0.0
    left = first = (r * z).sum()
    for t in range(MOST):
        if not left > enough * first:
            return t
        product(a, b, g, W, free, p, q)
        share = left / (p * q).sum()
        x += share * p
        r -= share * q
        solved(D, E, free, r, z)
        before, left = left, (r * z).sum()
        p[:] = z + (left / before) * p
    return MOST
