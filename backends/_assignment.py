"""Pairs of sightings and landmarks within a gate: greedy, and of least total cost."""

import numpy as np

from ..core.kernels.compiled import compiled
from ..core.se2 import Array, Ints


@compiled
def nearest(d2: Array, gate: float, of: Ints, pair: Ints) -> None:
    """Pairs the closest ones first, a landmark once per step: nearest neighbour with exclusion.

    d2 (k, c) are squared distances; sightings of the same step `of` (k,), without gaps from 0, are of different
    landmarks. Fills `pair` (k,) with a landmark or -1.
    """
    k, c = d2.shape
    pair[:] = -1
    taken = np.zeros((c, k), np.bool_)
    while True:
        best, at, landmark = gate, -1, -1
        for i in range(k):
            if pair[i] >= 0:
                continue
            for a in range(c):
                if d2[i, a] < best and not taken[a, of[i]]:
                    best, at, landmark = d2[i, a], i, a
        if at < 0:
            return
        pair[at] = landmark
        taken[landmark, of[at]] = True


@compiled
def cheapest(cost: Array, column: Ints) -> None:
    """Assigns each row of `cost` (k, c), k <= c, to a column of its own so that the sum is least.

    Shortest augmenting paths with potentials (Jonker and Volgenant, Computing 38, 1987). Costs are finite. Fills
    `column` (k,).
    """
    k, c = cost.shape
    u, v = np.zeros(k + 1), np.zeros(c + 1)
    row_of, way = np.zeros(c + 1, np.int64), np.zeros(c + 1, np.int64)  # rows and columns count from 1; 0: none
    slack, done = np.empty(c + 1), np.empty(c + 1, np.bool_)
    for i in range(1, k + 1):
        row_of[0] = i
        j0 = 0
        slack[:] = np.inf
        done[:] = False
        while True:
            done[j0] = True
            i0, least, j1 = row_of[j0], np.inf, 0
            for j in range(1, c + 1):
                if done[j]:
                    continue
                reduced = cost[i0 - 1, j - 1] - u[i0] - v[j]
                if reduced < slack[j]:
                    slack[j], way[j] = reduced, j0
                if slack[j] < least:
                    least, j1 = slack[j], j
            for j in range(c + 1):
                if done[j]:
                    u[row_of[j]] += least
                    v[j] -= least
                else:
                    slack[j] -= least
            j0 = j1
            if row_of[j0] == 0:
                break
        while j0 != 0:
            j1 = way[j0]
            row_of[j0] = row_of[j1]
            j0 = j1
    for j in range(1, c + 1):
        if row_of[j] > 0:
            column[row_of[j] - 1] = j - 1
