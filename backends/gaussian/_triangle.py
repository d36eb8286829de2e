"""A symmetric matrix stored as its lower triangle, in one flat array that grows at its end only.

Panel b holds the rows [b B, (b + 1) B), B = PANEL, each from its first column to the end of the diagonal block, in C
order: rows of (b + 1) B entries. Appending a row therefore copies nothing, a matrix of n rows takes little more than
n^2 / 2 entries, and a low-rank update is a product (BLAS 3) and a square per panel. Entries above the diagonal in a
diagonal block are undefined.
"""

import numpy as np

from ...core.kernels._blas import add_product, add_square
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints

PANEL = 1016
"""Rows per panel: even, so that no landmark is split, and an odd number of cache lines, so that rows do not collide."""

REAL = 8
"""Bytes of a float64."""

LARGE = 32 << 20
"""Entries of a matrix (256 MB) above which another panel must not cost a second copy of it."""


@compiled
def space(n: int) -> int:
    """Entries that a matrix of n rows takes: whole panels."""
    panels = (n + PANEL - 1) // PANEL
    return PANEL * PANEL * panels * (panels + 1) // 2


@compiled
def row(i: int) -> int:
    """Index at which row i begins."""
    b = i // PANEL
    return PANEL * PANEL * b * (b + 1) // 2 + (i - b * PANEL) * (b + 1) * PANEL


def grown(flat: Array, n: int) -> Array:
    """The matrix with space for at least n rows, new ones zero: `flat` itself, or its replacement."""
    entries = space(n)
    if entries > max(LARGE, len(flat)):
        flat.resize(entries, refcheck=False)  # in place: the system moves pages, and copies nothing
    elif entries > len(flat):  # numpy asks for large pages when it allocates, but not when it resizes
        before, flat = flat, np.zeros(entries)
        flat[: len(before)] = before
    return flat


@compiled
def take(flat: Array, i: int, n: int, out: Array) -> None:
    """Rows i and i + 1 (i even) of the symmetric matrix of n rows, into out (2, n)."""
    upper, lower = row(i), row(i + 1)
    for j in range(i + 1):
        out[0, j] = flat[upper + j]
        out[1, j] = flat[lower + j]
    out[0, i + 1] = out[1, i]
    out[1, i + 1] = flat[lower + i + 1]
    j = i + 2
    while j < n:
        end = min(n, (j // PANEL + 1) * PANEL)
        at, stride = row(j) + i, (j // PANEL + 1) * PANEL
        for k in range(j, end):
            out[0, k] = flat[at]
            out[1, k] = flat[at + 1]
            at += stride
        j = end


@compiled
def take_less(flat: Array, i: int, n: int, owed: Array, rank: int, out: Array) -> None:
    """The same rows of the matrix minus W' W, into out (2, n); W (rank, _) are `owed`'s first rows."""
    take(flat, i, n, out)
    first, second = out[0], out[1]
    for m in range(0, rank - 1, 2):
        a, b, w = owed[m, i], owed[m, i + 1], owed[m]
        c, d, v = owed[m + 1, i], owed[m + 1, i + 1], owed[m + 1]
        for j in range(n):
            first[j] -= a * w[j] + c * v[j]
            second[j] -= b * w[j] + d * v[j]
    if rank % 2 == 1:
        a, b, w = owed[rank - 1, i], owed[rank - 1, i + 1], owed[rank - 1]
        for j in range(n):
            first[j] -= a * w[j]
            second[j] -= b * w[j]


@compiled
def put(flat: Array, i: int, n: int, rows: Array) -> None:
    """Sets rows and columns i and i + 1 (i even) to rows (2, n); only the lower triangle of their own block is used."""
    upper, lower = row(i), row(i + 1)
    for j in range(i + 1):
        flat[upper + j] = rows[0, j]
        flat[lower + j] = rows[1, j]
    flat[lower + i + 1] = rows[1, i + 1]
    for j in range(i + 2, n):
        at = row(j) + i
        flat[at] = rows[0, j]
        flat[at + 1] = rows[1, j]


@compiled
def entry(flat: Array, i: int, j: int) -> float:
    """The entry (i, j)."""
    return flat[row(i) + j] if j <= i else flat[row(j) + i]


@compiled
def take_row(flat: Array, i: int, n: int, out: Array) -> None:
    """Row i of the symmetric matrix of n rows, into out (n,)."""
    own = row(i)
    for j in range(i + 1):
        out[j] = flat[own + j]
    for j in range(i + 1, n):
        out[j] = flat[row(j) + i]


@compiled
def put_row(flat: Array, i: int, n: int, values: Array) -> None:
    """Sets row and column i to values (n,)."""
    own = row(i)
    for j in range(i + 1):
        flat[own + j] = values[j]
    for j in range(i + 1, n):
        flat[row(j) + i] = values[j]


@compiled
def submatrix(flat: Array, entries: Ints, out: Array) -> None:
    """The rows and columns of `entries` (k,), into out (k, k)."""
    for i in range(len(entries)):
        for j in range(i + 1):
            out[i, j] = out[j, i] = entry(flat, entries[i], entries[j])


@compiled
def add_square_of(flat: Array, n: int, sign: float, W: Array, rank: int, dgemm: int, dsyrk: int) -> None:
    """P += sign W' W for the first `rank` rows of W (_, >= n)."""
    first, out = W.ctypes.data, flat.ctypes.data
    width = W.shape[1]
    for top in range(0, n, PANEL):
        rows, stride = min(PANEL, n - top), top + PANEL
        panel = out + REAL * row(top)
        if top > 0:
            add_product(dgemm, top, rows, rank, sign, first, width, first + REAL * top, width, panel, stride)
        add_square(dsyrk, rows, rank, sign, first + REAL * top, width, panel + REAL * top, stride)


@compiled
def subtract_product(flat: Array, n: int, M: Array, T: Array, dgemm: int) -> None:
    """P -= M' T, a symmetric product, for M and T (rank, n)."""
    left, right, out = M.ctypes.data, T.ctypes.data, flat.ctypes.data
    for top in range(0, n, PANEL):
        rows, stride = min(PANEL, n - top), top + PANEL
        panel = out + REAL * row(top)
        add_product(dgemm, top + rows, rows, M.shape[0], -1.0, left, n, right + REAL * top, n, panel, stride)


@compiled
def whole(flat: Array, n: int, out: Array) -> None:
    """Both triangles, into out (n, n)."""
    for i in range(n):
        at = row(i)
        for j in range(i + 1):
            out[i, j] = flat[at + j]
            out[j, i] = flat[at + j]


@compiled
def store(flat: Array, P: Array) -> None:
    """The lower triangle of P (n, n), into an array with space for it."""
    for i in range(P.shape[0]):
        at = row(i)
        for j in range(i + 1):
            flat[at + j] = P[i, j]
