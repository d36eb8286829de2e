"""Partial Cholesky factorisation of a front: its first rows become [R d], the rest what is left over for the others.

A front is as in `_factors`: m rows of w = m + 1 numbers, the upper triangle and the right-hand side. Rows are
eliminated four at a time, so that the rest is read and written once for four; wide fronts leave the rest to BLAS.
"""

from math import sqrt

from ...frontend.compiled import compiled
from ...frontend.se2 import Array
from .._blas import add_upper_square

WIDE, PANEL = 96, 48
"""Scalars from which on a front is left to BLAS, and rows that are eliminated before each call."""

REAL = 8
"""Bytes of a number."""


@compiled
def pivot(F: Array, w: int, first: int, q: int) -> bool:
    """Row `q`, less what rows from `first` on take from it, becomes R's; False where its pivot is not positive."""
    b = q * w
    for r in range(first, q):
        a = F[r * w + q]
        for j in range(q, w):
            F[b + j] -= a * F[r * w + j]
    d = F[b + q]
    if not d > 0.0:
        return False
    d = 1.0 / sqrt(d)
    for j in range(q, w):
        F[b + j] *= d
    return True


@compiled
def rows(F: Array, m: int, first: int, last: int, end: int) -> bool:
    """Eliminate rows `first` to `last` from those up to `end`."""
    w = m + 1
    p = first
    while p < last:
        many = 4 if last - p >= 4 else (3 if last - p == 3 else 1)
        for q in range(p, p + many):
            if not pivot(F, w, p, q):
                return False
        o = p * w
        if many == 4:
            for i in range(p + 4, end):
                a, b, c, d = F[o + i], F[o + w + i], F[o + 2 * w + i], F[o + 3 * w + i]
                t = i * w
                for j in range(i, w):
                    F[t + j] -= a * F[o + j] + b * F[o + w + j] + c * F[o + 2 * w + j] + d * F[o + 3 * w + j]
        elif many == 3:
            for i in range(p + 3, end):
                a, b, c = F[o + i], F[o + w + i], F[o + 2 * w + i]
                t = i * w
                for j in range(i, w):
                    F[t + j] -= a * F[o + j] + b * F[o + w + j] + c * F[o + 2 * w + j]
        else:
            for i in range(p + 1, end):
                a = F[o + i]
                t = i * w
                for j in range(i, w):
                    F[t + j] -= a * F[o + j]
        p += many
    return True


@compiled
def factor(F: Array, m: int, front: int, dsyrk: int) -> bool:
    """Eliminate the first `front` rows of F (m, m + 1); False where it is not positive definite there."""
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
