"""Vectors and matrices of a few rows in compiled code."""

from math import cos, sin, sqrt

import numpy as np

from ..se2 import Array
from .compiled import compiled


@compiled
def dot(a: Array, b: Array) -> float:
    """The sum of products of two vectors (n,)."""
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@compiled
def cross(a: Array, b: Array, out: Array) -> None:
    """Writes the cross product of `a` and `b` (3,) to `out` (3,), which may be one of them."""
    x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    out[0], out[1], out[2] = x, y, z


@compiled
def rodrigues(turn: Array, R: Array) -> tuple[float, float, float]:
    """Writes the rotation R (3, 3) by the vector `turn` (3,), rad: its angle a about its direction.

    Returns sin a / a, (1 - cos a) / a² and (a - sin a) / a³, as the exponential of SE(3) needs them.
    """
    a = sqrt(turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2)
    one = 1.0 - a * a / 6.0 if a < 1e-4 else sin(a) / a
    two = 0.5 - a * a / 24.0 if a < 1e-4 else (1.0 - cos(a)) / (a * a)
    three = 1.0 / 6.0 - a * a / 120.0 if a < 1e-2 else (a - sin(a)) / (a * a * a)
    for i in range(3):
        for j in range(3):
            R[i, j] = two * turn[i] * turn[j]
        R[i, i] += 1.0 - two * a * a
    R[0, 1] -= one * turn[2]
    R[0, 2] += one * turn[1]
    R[1, 0] += one * turn[2]
    R[1, 2] -= one * turn[0]
    R[2, 0] -= one * turn[1]
    R[2, 1] += one * turn[0]
    return one, two, three


@compiled
def cholesky(A: Array, L: Array, n: int, least: float, floor: float) -> bool:
    """Writes the lower triangle of L, L L' = A, of which the first n rows of the lower triangle are read; L may be A.

    Returns False where A is not positive definite, or not finite: where a pivot is not above `least` times its
    diagonal entry. No pivot is taken below `floor` times that.
    """
    for i in range(n):
        for j in range(i + 1):
            rest = A[i, j]
            for k in range(j):
                rest -= L[i, k] * L[j, k]
            if i > j:
                L[i, j] = rest / L[j, j]
                continue
            if rest < floor * A[i, i]:
                rest = floor * A[i, i]
            if not (rest > least * A[i, i] and 0.0 < rest < np.inf):
                return False
            L[i, i] = sqrt(rest)
    return True


@compiled
def solve(L: Array, b: Array, x: Array, n: int) -> None:
    """Writes the solution x (n,) of L L' x = b for a lower triangular L; x may be b."""
    for i in range(n):
        total = b[i]
        for k in range(i):
            total -= L[i, k] * x[k]
        x[i] = total / L[i, i]
    for i in range(n - 1, -1, -1):
        total = x[i]
        for k in range(i + 1, n):
            total -= L[k, i] * x[k]
        x[i] = total / L[i, i]


@compiled
def factored(
    a00: float, a10: float, a11: float, a20: float, a21: float, a22: float
) -> tuple[float, float, float, float, float, float]:
    """The lower Cholesky factor of a matrix (3, 3), both as their lower rows: 00, 10, 11, 20, 21, 22.

    NaN where it is not positive definite. It has no branch, so that loops over it become SIMD code.
    """
    l00 = sqrt(a00)
    l10, l20 = a10 / l00, a20 / l00
    l11 = sqrt(a11 - l10 * l10)
    l21 = (a21 - l20 * l10) / l11
    return l00, l10, l11, l20, l21, sqrt(a22 - l20 * l20 - l21 * l21)


@compiled
def inverse(S: Array, W: Array) -> bool:
    """Writes the inverse W of a symmetric S (3, 3); False where its determinant is not positive and finite."""
    a, b, c, d, e, f = S[0, 0], S[0, 1], S[0, 2], S[1, 1], S[1, 2], S[2, 2]
    W[0, 0], W[0, 1], W[0, 2] = d * f - e * e, c * e - b * f, b * e - c * d
    W[1, 1], W[1, 2], W[2, 2] = a * f - c * c, b * c - a * e, a * d - b * b
    det = a * W[0, 0] + b * W[0, 1] + c * W[0, 2]
    if not 0.0 < det < np.inf:
        return False
    for i in range(3):
        for j in range(i, 3):
            W[i, j] /= det
            W[j, i] = W[i, j]
    return True
