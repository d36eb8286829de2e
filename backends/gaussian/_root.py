"""A covariance kept as its triangular root: what a square-root filter does to one, compiled.

P = L L' with L lower triangular. L's rows are packed: LANES rows stand side by side, column after column, so that a
matrix grows at its end without a copy of what is there, and a loop over rows runs over neighbours in memory.

A measurement of unit variance whose row in terms of the root is f' = h' L leaves the root L G, where G G' is
I - f f' / (1 + f' f) and lower triangular (Carlson, Fast Triangular Formulation of the Square Root Filter, AIAA J.
11(9), 1973; his root is upper triangular, so here the columns are taken from the last to the first). Multiplying a row
by G is a scan over the row: three factors a column, and the sum of row times f so far.
"""

from math import sqrt

import numpy as np

from ...frontend.compiled import compiled
from ...frontend.se2 import Array

LANES = 16
"""Rows of a root that stand side by side."""
OWED = 16
"""Scans that may be owed to a root before they are made, a multiple of four."""


@compiled
def first(block: int) -> int:
    """Where the packed rows from LANES * block on begin; before them stand that many whole blocks."""
    return LANES * LANES * (block * (block + 1) // 2)


@compiled
def entry(row: int, column: int) -> int:
    """Where the packed root keeps L[row, column]; column is at most the last of the row's block."""
    block = row // LANES
    return first(block) + LANES * column + row - LANES * block


@compiled
def cholesky(A: Array, root: Array, n: int) -> bool:
    """The lower root (n, n) of A (n, n), of which the lower triangle is read; False where A has none."""
    for i in range(n):
        for j in range(i + 1):
            rest = A[i, j]
            for k in range(j):
                rest -= root[i, k] * root[j, k]
            if i > j:
                root[i, j] = rest / root[j, j]
            elif 0.0 < rest < np.inf:
                root[i, i] = sqrt(rest)
            else:
                return False
        for j in range(i + 1, n):
            root[i, j] = 0.0
    return True


@compiled
def dot(a: Array, b: Array) -> float:
    """The sum of a b, in four sums that need not wait for one another."""
    s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0
    whole = len(a) // 4 * 4
    for j in range(0, whole, 4):
        s0 += a[j] * b[j]
        s1 += a[j + 1] * b[j + 1]
        s2 += a[j + 2] * b[j + 2]
        s3 += a[j + 3] * b[j + 3]
    for j in range(whole, len(a)):
        s0 += a[j] * b[j]
    return (s0 + s1) + (s2 + s3)


@compiled
def triangularise(rows: Array, count: int, width: int, scale: Array, root: Array) -> None:
    """rows (count, width) = root Q by Householder's reflections; root (count, count) is lower triangular.

    Of Q, reflection i stays behind in rows[i, i + 1:] and scale[i]. A row of zeros is one of the root, too.
    """
    for i in range(count):
        row, tail = rows[i], rows[i, i + 1 : width]
        beyond = dot(tail, tail)
        diagonal, scale[i] = row[i], 0.0
        if beyond > 0.0:
            length = sqrt(diagonal * diagonal + beyond)
            diagonal = -length if row[i] >= 0.0 else length
            scale[i] = (diagonal - row[i]) / diagonal
            by = 1.0 / (row[i] - diagonal)
            for j in range(len(tail)):
                tail[j] *= by
        for k in range(i + 1, count):
            reflect(rows[k, i:width], tail, scale[i])
        for k in range(i):
            root[i, k] = row[k]
        root[i, i] = diagonal
        for k in range(i + 1, count):
            root[i, k] = 0.0


@compiled
def reflect(row: Array, mirror: Array, scale: float) -> None:
    """`row` times the reflection whose vector is 1, then `mirror`."""
    if scale == 0.0:
        return
    tail = row[1:]
    along = scale * (row[0] + dot(tail, mirror))
    row[0] -= along
    for j in range(len(tail)):
        tail[j] -= along * mirror[j]


@compiled
def unturn(row: Array, rows: Array, count: int, width: int, scale: Array) -> None:
    """`row` times the Q that `triangularise` left in `rows`; only its first `count` entries are looked at."""
    for j in range(count, width):
        row[j] = 0.0
    for i in range(count - 1, -1, -1):
        reflect(row[i:width], rows[i, i + 1 : width], scale[i])


@compiled
def plan(f: Array, width: int, scans: Array, m: int) -> float:
    """Write the scan of a measurement of unit variance, f (width,), to scans[:, m]; returns its variance 1 + f' f.

    Of each column: how much of the old entry stays, how much of the sum is taken off, and f, with which the entry
    enters the sum.
    """
    before = 1.0
    for j in range(width - 1, -1, -1):
        after = before + f[j] * f[j]
        scans[j, m, 0] = sqrt(before / after)
        scans[j, m, 1] = f[j] / sqrt(before * after)
        scans[j, m, 2] = f[j]
        before = after
    return before


@compiled
def scan(row: Array, width: int, scans: Array, m: int) -> float:
    """Multiply a row (width,) of the root by scan m's G; returns the row's product with f before that."""
    total = 0.0
    for j in range(width - 1, -1, -1):
        old = row[j]
        row[j] = scans[j, m, 0] * old - scans[j, m, 1] * total
        total += scans[j, m, 2] * old
    return total


@compiled
def fold(packed: Array, mean: Array, n: int, scans: Array, gains: Array, owed: int) -> None:
    """Make all that is owed: multiply the packed root's n rows by every G, and correct the mean (n,) by every gain.

    Four scans go over a block of rows at once, each behind the one before, so that an entry is read once for four.
    """
    if owed == 0:
        return
    for m in range(owed, (owed + 3) // 4 * 4):
        for j in range(n):
            scans[j, m, 0], scans[j, m, 1], scans[j, m, 2] = 1.0, 0.0, 0.0
        gains[m] = 0.0
    sums = np.empty((OWED, LANES))
    columns = packed.reshape((-1, LANES))
    for block in range((n + LANES - 1) // LANES):
        width = min(LANES * (block + 1), n)
        at = first(block) // LANES
        for m in range(OWED):
            for lane in range(LANES):
                sums[m, lane] = 0.0
        for j in range(width - 1, -1, -1):
            for m in range(0, owed, 4):
                four(columns[at + j], sums[m : m + 4], scans[j, m : m + 4])
        for m in range(owed):
            for lane in range(width - LANES * block):
                mean[LANES * block + lane] += sums[m, lane] * gains[m]


@compiled
def four(column: Array, sums: Array, scans: Array) -> None:
    """A step of four scans over LANES rows; written out, for the compiler to see that they are the same for each."""
    for lane in range(LANES):
        old = column[lane]
        s0, s1, s2, s3 = sums[0, lane], sums[1, lane], sums[2, lane], sums[3, lane]
        new = scans[0, 0] * old - scans[0, 1] * s0
        sums[0, lane] = s0 + scans[0, 2] * old
        old = scans[1, 0] * new - scans[1, 1] * s1
        sums[1, lane] = s1 + scans[1, 2] * new
        new = scans[2, 0] * old - scans[2, 1] * s2
        sums[2, lane] = s2 + scans[2, 2] * old
        column[lane] = scans[3, 0] * new - scans[3, 1] * s3
        sums[3, lane] = s3 + scans[3, 2] * new
