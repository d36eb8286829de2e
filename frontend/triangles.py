"""Converts symmetric matrices to and from their upper triangles, row by row, as in files and records."""

import numpy as np

from .se2 import Array


def upper(cov: Array) -> Array:
    """Upper triangles (k (k + 1) / 2, m), row by row, of `cov` (m, k, k); the mean of both where halves differ."""
    i, j = np.triu_indices(cov.shape[-1])
    return ((cov[:, i, j] + cov[:, j, i]) / 2).T


def symmetric(triangles: Array) -> Array:
    """Symmetric matrices (m, k, k) from their upper triangles (m, k (k + 1) / 2), row by row."""
    k = {3: 2, 6: 3}[triangles.shape[1]]
    index = np.zeros((k, k), np.int64)
    index[np.triu_indices(k)] = np.arange(triangles.shape[1])
    return triangles[:, np.maximum(index, index.T)]
