"""Partial Cholesky factorisation of a front: its first rows become [R d], the others the Schur complement.

A front has m rows of w = m + 1 numbers, the upper triangle and the right-hand side. Rows are
eliminated four at a time, so that the rest is read and written once for four; wide fronts use BLAS for the rest.
"""

from math import sqrt

import numpy as np

from ..se2 import Array
from ._blas import add_upper_square
from .compiled import compiled

WIDE, PANEL = 96, 48
"""Scalars from which a front uses BLAS, and rows eliminated before each call."""

unsigned = np.uint64
"""Type of non-negative indices: loops over such ones become SIMD code."""

REAL = 8
"""Bytes of a number."""


@compiled
def pivot(F: Array, w: int, first: int, q: int) -> bool:
    """Turns row `q`, less its products with rows from `first` on, into R's; False where its pivot is not positive."""
    b = unsigned(q * w)
    for r in range(first, q):
        a, o = F[r * w + q], unsigned(r * w)
        for j in range(unsigned(q), unsigned(w)):
            F[b + j] -= a * F[o + j]
    d = F[q * w + q]
    if not d > 0.0:
        return False
    d = 1.0 / sqrt(d)
    for j in range(unsigned(q), unsigned(w)):
        F[b + j] *= d
    return True


@compiled
def rows(F: Array, m: int, first: int, last: int, end: int) -> bool:
    """Eliminates rows `first` to `last` from those up to `end`."""
    w = m + 1
    p = first
    while p < last:
        many = 4 if last - p >= 4 else (3 if last - p == 3 else 1)
        for q in range(p, p + many):
            if not pivot(F, w, p, q):
                return False
        o = p * w
        o0, o1, o2, o3 = unsigned(o), unsigned(o + w), unsigned(o + 2 * w), unsigned(o + 3 * w)
        for i in range(p + many, end):
            t = unsigned(i * w)
            if many == 4:
                a, b, c, d = F[o + i], F[o + w + i], F[o + 2 * w + i], F[o + 3 * w + i]
                for j in range(unsigned(i), unsigned(w)):
                    F[t + j] -= a * F[o0 + j] + b * F[o1 + j] + c * F[o2 + j] + d * F[o3 + j]
            elif many == 3:
                a, b, c = F[o + i], F[o + w + i], F[o + 2 * w + i]
                for j in range(unsigned(i), unsigned(w)):
                    F[t + j] -= a * F[o0 + j] + b * F[o1 + j] + c * F[o2 + j]
            else:
                a = F[o + i]
                for j in range(unsigned(i), unsigned(w)):
                    F[t + j] -= a * F[o0 + j]
        p += many
    return True


@compiled
def factor(F: Array, m: int, front: int, dsyrk: int) -> bool:
    """Eliminates the first `front` rows of F (m, m + 1); False where it is not positive definite there."""
    if m < WIDE or front < PANEL // 2:
        return rows(F, m, 0, front, m)
    w = m + 1
    p = 0
    while p < front:
        t = min(p + PANEL, front)
        if not rows(F, m, p, t, t):
            return False
        if t < m:
            at = F.ctypes.data
            add_upper_square(dsyrk, m - t, t - p, -1.0, at + REAL * (p * w + t), w, at + REAL * (t * w + t), w)
            for q in range(p, t):
                a = F[q * w + m]
                for i in range(t, m):
                    F[i * w + m] -= F[q * w + i] * a
        p = t
    return True
