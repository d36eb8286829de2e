"""A grid over landmarks, for the nearest one to a place, and their pairs by distance."""

from math import floor, inf, log, pi, sqrt

import numpy as np

from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints

AROUND = 4
"""Neighbours that tell the density of landmarks around one."""


@compiled
def fill(xy: Array, corner: Array, cell: float, first: Ints, members: Ints) -> None:
    """Sorts the landmarks (n, 2) into cells, row by row: those of cell k are members[first[k]:first[k + 1]].

    `first` (rows, columns + 1), zero before; the grid starts at `corner`.
    """
    rows, columns = first.shape[0], first.shape[1] - 1
    for i in range(len(xy)):
        row, column = int((xy[i, 1] - corner[1]) / cell), int((xy[i, 0] - corner[0]) / cell)
        first[row, column + 1] += 1
    total = 0
    for row in range(rows):
        first[row, 0] = total
        for column in range(columns):
            total += first[row, column + 1]
            first[row, column + 1] = total
    for i in range(len(xy) - 1, -1, -1):
        row, column = int((xy[i, 1] - corner[1]) / cell), int((xy[i, 0] - corner[0]) / cell)
        k = first[row, column]
        while members[k] >= 0:
            k += 1
        members[k] = i


@compiled
def nearest(x: float, y: float, reach: float, xy: Array, corner: Array, cell: float, first: Ints, members: Ints) -> int:
    """Finds the landmark nearest to (x, y) within `reach`; -1 where there is none."""
    rows, columns = first.shape[0], first.shape[1] - 1
    top = min(max(floor((y + reach - corner[1]) / cell), -1), rows - 1)
    low = max(min(floor((y - reach - corner[1]) / cell), rows), 0)
    right = min(max(floor((x + reach - corner[0]) / cell), -1), columns - 1)
    left = max(min(floor((x - reach - corner[0]) / cell), columns), 0)
    found, best = -1, reach * reach
    if right < left:
        return found
    for row in range(low, top + 1):
        for k in range(first[row, left], first[row, right + 1]):
            a = members[k]
            d2 = (xy[a, 0] - x) ** 2 + (xy[a, 1] - y) ** 2
            if d2 < best:
                found, best = a, d2
    return found


@compiled
def measure_pairs(xy: Array, half: Array, first: Ints, second: Ints, length: Array, variance: Array) -> None:
    """Lists the pairs of landmarks, their distance (m) and its variance, `half` (n, n) being half-traces."""
    k = 0
    for a in range(len(xy)):
        for b in range(a):
            first[k], second[k] = a, b
            length[k] = sqrt((xy[a, 0] - xy[b, 0]) ** 2 + (xy[a, 1] - xy[b, 1]) ** 2)
            variance[k] = half[a, a] + half[b, b] - 2 * half[a, b]
            k += 1


@compiled
def measure_room(xy: Array, most: float, room: Array) -> None:
    """Computes `room` (n,), the logarithm of the area (m^2) around each landmark for itself, `most` at the most.

    It is that of the disk to its AROUND-th neighbour over their number; landmarks nearer than 1 mm are one.
    """
    near = np.empty(AROUND)
    for a in range(len(xy)):
        near[:] = inf
        for b in range(len(xy)):
            d2 = (xy[a, 0] - xy[b, 0]) ** 2 + (xy[a, 1] - xy[b, 1]) ** 2
            if b == a or d2 >= near[AROUND - 1]:
                continue
            k = AROUND - 1
            while k > 0 and near[k - 1] > d2:
                near[k] = near[k - 1]
                k -= 1
            near[k] = d2
        room[a] = min(most, log(pi * max(near[AROUND - 1], 1e-6) / AROUND))
