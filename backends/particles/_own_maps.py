"""Landmarks of particles that number them by themselves: stored after a step, and copied to descendants.

Layout and names are those of `_choosing.py`.
"""

import numpy as np
from numpy.typing import NDArray

from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from ._particles import place


@compiled
def keep(
    poses: Array, z: Array, cov: Array, landmarks: Array, homes: Ints, rows: NDArray[np.int32], seen: Array
) -> None:
    """Stores the corrected landmarks `seen` (k, 5, M) in their `rows` (k, M), and places new ones, rows -1 - row."""
    fresh = np.empty((1, 5, rows.shape[1]))
    for i in range(len(rows)):
        if rows[i].min() < 0:
            place(poses, fresh, 0, z[i], cov[i])
        for m in range(rows.shape[1]):
            row, new = rows[i, m], rows[i, m] < 0
            if new:
                row = rows[i, m] = -1 - row
            for j in range(5):
                landmarks[homes[m], j, row] = fresh[0, j, m] if new else seen[i, j, m]


@compiled
def inherit(landmarks: Array, names: Ints, counts: Ints, homes: Ints, ancestors: Ints) -> Ints:
    """Gives each particle m the landmarks of particle ancestors[m]; returns the new `homes` (M,).

    `ancestors` are sorted. Of the copies of one the first takes over its home, the others copy its landmarks to homes
    of particles that have none.
    """
    M = len(homes)
    wanted, after = np.zeros(M, np.bool_), np.empty(M, np.int64)
    for m in range(M):
        wanted[ancestors[m]] = True
    free = 0
    for m in range(M):
        old = homes[ancestors[m]]
        if m == 0 or ancestors[m] != ancestors[m - 1]:
            after[m] = old
            continue
        while wanted[free]:
            free += 1
        new = after[m] = homes[free]
        free += 1
        counts[new] = count = counts[old]
        for row in range(count):
            names[new, row] = names[old, row]
            for j in range(5):
                landmarks[new, j, row] = landmarks[old, j, row]
    return after
