"""Landmarks of particles that number them by themselves: stored after a step, and copied to descendants.

Filters are laid out as those of `_particles.py`.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.factors import RangeBearing
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from ._particles import place

Rows = NDArray[np.int32]


class Landmarks(NamedTuple):
    """Up to N landmarks in each of M homes. Particle m has those of home homes[m]."""

    filters: Array  # (M, 5, N) mean x, y (m), covariance xx, xy, yy (m^2)
    names: Ints  # (M, N) their ids
    counts: Ints  # (M,) their number
    homes: Ints  # (M,)


class Decisions(NamedTuple):
    """Each particle's landmark for each of k sightings."""

    rows: Rows  # (k, M) the landmark, -1 - row of a new one
    seen: Array  # (k, 5, M) its filter as it was
    surprise: Array  # (M,) of all sightings


@compiled
def keep(poses: Array, sightings: RangeBearing, own: Landmarks, decisions: Decisions) -> None:
    """Stores the landmarks seen, which are corrected, in their rows, and places new ones."""
    rows, seen, landmarks, homes = decisions.rows, decisions.seen, own.filters, own.homes
    z, cov = sightings.z, sightings.cov
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
def inherit(own: Landmarks, ancestors: Ints) -> Ints:
    """Gives each particle m the landmarks of particle ancestors[m]; returns the new homes (M,).

    `ancestors` are sorted. Of the copies of one the first takes over its home, the others copy its landmarks to homes
    of particles that have none.
    """
    landmarks, names, counts, homes = own
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
