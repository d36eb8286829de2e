"""Products, factors, inverses and triangles of batches of small matrices, with the same bits on every machine.

BLAS and LAPACK choose code by the processor, and with it the order of sums. Here the order is the textbook's.
"""

from math import sqrt

import numpy as np

from .se2 import Array

TINY, HUGE = 1e-200, 1e200
"""Pivots between which a single matrix is inverted number by number: nothing overflows there."""


def product(a: Array, b: Array) -> Array:
    """a @ b of (..., i, j) and (..., j, k), leading axes broadcast."""
    total = a[..., :, :1] * b[..., :1, :]
    for j in range(1, a.shape[-1]):
        total = total + a[..., :, j : j + 1] * b[..., j : j + 1, :]
    return total


def propagated(jacobian: Array, cov: Array) -> Array:
    """J C J', (..., k, k), of `jacobian` (..., k, j) and `cov` (..., j, j)."""
    return product(product(jacobian, cov), jacobian.swapaxes(-1, -2))


def cholesky(cov: Array) -> Array:
    """The lower triangular L (..., k, k) with L L' = `cov`; NaN where `cov` is not positive definite."""
    lower = np.zeros_like(cov)
    with np.errstate(invalid="ignore", divide="ignore"):
        for j in range(cov.shape[-1]):
            for i in range(j, cov.shape[-1]):
                rest = cov[..., i, j]
                for k in range(j):
                    rest = rest - lower[..., i, k] * lower[..., j, k]
                lower[..., i, j] = np.sqrt(rest) if i == j else rest / lower[..., j, j]
    return lower


def inverse(cov: Array) -> Array:
    """The inverse of `cov` (..., k, k) by its Cholesky factor; NaN where `cov` is not positive definite."""
    if cov.shape == (3, 3):
        found = _inverse_of_one(cov.tolist())
        if found is not None:
            return found
    lower = cholesky(cov)
    root = np.zeros_like(lower)  # of the inverse: L^-1
    with np.errstate(invalid="ignore", divide="ignore"):
        for j in range(cov.shape[-1]):
            root[..., j, j] = 1 / lower[..., j, j]
            for i in range(j + 1, cov.shape[-1]):
                total = lower[..., i, j] * root[..., j, j]
                for k in range(j + 1, i):
                    total = total + lower[..., i, k] * root[..., k, j]
                root[..., i, j] = -total / lower[..., i, i]
    return product(root.swapaxes(-1, -2), root)


def _inverse_of_one(cov: list[list[float]]) -> Array | None:
    """The same bits for one matrix (3, 3) in a fiftieth of the time; None if a pivot is not within TINY and HUGE."""
    (a, _, _), (b, d, _), (c, e, f) = cov
    if not TINY < a < HUGE:
        return None
    l00 = sqrt(a)
    l10, l20 = b / l00, c / l00
    rest = d - l10 * l10
    if not TINY < rest < HUGE:
        return None
    l11 = sqrt(rest)
    l21 = (e - l20 * l10) / l11
    rest = f - l20 * l20 - l21 * l21
    if not TINY < rest < HUGE:
        return None
    l22 = sqrt(rest)
    r00, r11, r22 = 1 / l00, 1 / l11, 1 / l22
    r10, r21 = -(l10 * r00) / l11, -(l21 * r11) / l22
    r20 = -(l20 * r00 + l21 * r10) / l22
    xx, xy, yy = r00 * r00 + r10 * r10 + r20 * r20, 0.0 + r10 * r11 + r20 * r21, r11 * r11 + r21 * r21
    xt, yt = 0.0 + r20 * r22, 0.0 + r21 * r22  # products with zeros come first: no negative zero
    return np.array(((xx, xy, xt), (xy, yy, yt), (xt, yt, r22 * r22)))


def upper(cov: Array) -> Array:
    """Upper triangles (k (k + 1) / 2, m), row by row, of `cov` (m, k, k); the mean of both where halves differ."""
    i, j = np.triu_indices(cov.shape[-1])
    return ((cov[:, i, j] + cov[:, j, i]) / 2).T


def symmetric(triangles: Array) -> Array:
    """Symmetric matrices (m, k, k) from their upper triangles (m, k (k + 1) / 2), row by row."""
    k = {3: 2, 6: 3, 21: 6}[triangles.shape[1]]
    index = np.zeros((k, k), np.int64)
    index[np.triu_indices(k)] = np.arange(triangles.shape[1])
    return triangles[:, np.maximum(index, index.T)]
