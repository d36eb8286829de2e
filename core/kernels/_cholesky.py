"""Partial Cholesky factorisation of a front: its first rows become [R d], the others the Schur complement.

A front has m rows of `row_of(m)` numbers: the upper triangle, zeros, and the right-hand side, which is last. Rows begin
at multiples of eight, and are passed by eights from there (see `_lanes`): what is left of the diagonal is of no use
afterwards. They are eliminated four at a time from two others, so that the rest is read and written once for four, and
the four once for two.
"""

from math import sqrt

import numpy as np

from ..se2 import Array
from ._lanes import LANES, eightfold, load, minus, plus, put, times
from .compiled import compiled

PANEL = 64
"""Rows that are eliminated from one another before all others are passed."""

unsigned = np.uint64
"""Type of non-negative indices: loops over such ones become SIMD code."""

EIGHT = np.uint64(LANES)


@compiled
def row_of(m: int) -> int:
    """Numbers in a row of a front of `m` scalars: a multiple of eight."""
    return (m + LANES) // LANES * LANES


@compiled
def begin(i: int) -> int:
    """The column, at most `i`, at which eights of row i begin."""
    return i // LANES * LANES


@compiled
def pivot(F: Array, w: int, first: int, q: int) -> bool:
    """Turns row `q`, less its products with rows from `first` on, into R's; False where its pivot is not positive."""
    b, start, end = unsigned(q * w), unsigned(begin(q)), unsigned(w)
    for r in range(first, q):
        a, o = eightfold(F[r * w + q]), unsigned(r * w)
        j = start
        while j < end:
            put(F, b + j, minus(load(F, b + j), times(a, load(F, o + j))))
            j += EIGHT
    d = F[q * w + q]
    if not d > 0.0:
        return False
    a, j = eightfold(1.0 / sqrt(d)), start
    while j < end:
        put(F, b + j, times(load(F, b + j), a))
        j += EIGHT
    return True


@compiled
def less_four(F: Array, w: int, p: int, i: int, two: bool) -> None:
    """Eliminates rows `p` to p + 3 from row `i`, and from the next one if `two`."""
    o, one, end = p * w, unsigned(w), unsigned(w)
    o0, o1, o2, o3 = unsigned(o), unsigned(o + w), unsigned(o + 2 * w), unsigned(o + 3 * w)
    a, b, c, d = eightfold(F[o + i]), eightfold(F[o + w + i]), eightfold(F[o + 2 * w + i]), eightfold(F[o + 3 * w + i])
    t, j = unsigned(i * w), unsigned(begin(i))
    if not two:
        while j < end:
            x, y = times(a, load(F, o0 + j)), times(b, load(F, o1 + j))
            x = plus(plus(plus(x, y), times(c, load(F, o2 + j))), times(d, load(F, o3 + j)))
            put(F, t + j, minus(load(F, t + j), x))
            j += EIGHT
        return
    o += i + 1
    e, f, g, h = eightfold(F[o]), eightfold(F[o + w]), eightfold(F[o + 2 * w]), eightfold(F[o + 3 * w])
    while j < end:
        p0, p1, p2, p3 = load(F, o0 + j), load(F, o1 + j), load(F, o2 + j), load(F, o3 + j)
        x = plus(plus(plus(times(a, p0), times(b, p1)), times(c, p2)), times(d, p3))
        y = plus(plus(plus(times(e, p0), times(f, p1)), times(g, p2)), times(h, p3))
        put(F, t + j, minus(load(F, t + j), x))
        put(F, t + one + j, minus(load(F, t + one + j), y))
        j += EIGHT


@compiled
def less_three(F: Array, w: int, p: int, i: int, two: bool) -> None:
    """Likewise of rows `p` to p + 2."""
    o, one, end = p * w, unsigned(w), unsigned(w)
    o0, o1, o2 = unsigned(o), unsigned(o + w), unsigned(o + 2 * w)
    a, b, c = eightfold(F[o + i]), eightfold(F[o + w + i]), eightfold(F[o + 2 * w + i])
    t, j = unsigned(i * w), unsigned(begin(i))
    if not two:
        while j < end:
            x = plus(plus(times(a, load(F, o0 + j)), times(b, load(F, o1 + j))), times(c, load(F, o2 + j)))
            put(F, t + j, minus(load(F, t + j), x))
            j += EIGHT
        return
    o += i + 1
    e, f, g = eightfold(F[o]), eightfold(F[o + w]), eightfold(F[o + 2 * w])
    while j < end:
        p0, p1, p2 = load(F, o0 + j), load(F, o1 + j), load(F, o2 + j)
        x = plus(plus(times(a, p0), times(b, p1)), times(c, p2))
        y = plus(plus(times(e, p0), times(f, p1)), times(g, p2))
        put(F, t + j, minus(load(F, t + j), x))
        put(F, t + one + j, minus(load(F, t + one + j), y))
        j += EIGHT


@compiled
def less_one(F: Array, w: int, p: int, i: int) -> None:
    """Likewise of row `p` alone, from row `i`."""
    a, o, t = eightfold(F[p * w + i]), unsigned(p * w), unsigned(i * w)
    j = unsigned(begin(i))
    while j < unsigned(w):
        put(F, t + j, minus(load(F, t + j), times(a, load(F, o + j))))
        j += EIGHT


@compiled
def less(F: Array, w: int, p: int, many: int, first: int, end: int) -> None:
    """Eliminates `many` rows from row `p` on, one, three or four, from rows `first` to `end`."""
    for i in range(first, end, 1 if many == 1 else 2):
        if many == 4:
            less_four(F, w, p, i, i + 1 < end)
        elif many == 3:
            less_three(F, w, p, i, i + 1 < end)
        else:
            less_one(F, w, p, i)


@compiled
def factor(F: Array, m: int, front: int) -> bool:
    """Eliminates the first `front` rows of F (m, row_of(m)); False where it is not positive definite there.

    Where they are more than `PANEL`, that many at a time: the rest is passed once for all of these.
    """
    w, p = row_of(m), 0
    while p < front:
        first, last = p, min(p + PANEL, front)
        end = last if front > PANEL else m
        while p < last:
            many = 4 if last - p >= 4 else (3 if last - p == 3 else 1)
            for q in range(p, p + many):
                if not pivot(F, w, p, q):
                    return False
            less(F, w, p, many, p + many, end)
            p += many
        for i in range(end, m, 2):
            q = first
            while q < last:
                many = 4 if last - q >= 4 else (3 if last - q == 3 else 1)
                less(F, w, q, many, i, min(i + 2, m))
                q += many
    return True
