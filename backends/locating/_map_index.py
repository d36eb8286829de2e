"""A given map, prepared for places to be looked up on it: a grid of landmarks, and their pairs by distance."""

from math import floor, inf, log, pi, sqrt

import numpy as np

from ...core.kernels._arrays import Arrays, Integers, IntegerTable, Numbers, Table
from ...core.kernels.compiled import compiled

AROUND = 4
"""Neighbours that tell the density of landmarks around one."""

LEFT, BELOW, CELL, AREA = range(4)
"""Entries of `box`: its lower left corner, where the grid starts, m; the side of a cell, m; its area, m^2."""


class MapIndex(Arrays):
    """A map of n landmarks with m = n (n - 1) / 2 pairs, sorted by distance."""

    ids: Integers  # (n,)
    xy: Table  # (n, 2) m
    cov: Table  # (2n, 2n) zero where the map has none: it is exact
    half: Table  # (n, n) half-traces of the blocks of cov: variances of the places, were these circles
    room: Numbers  # (n,) logarithm of the area (m^2) around each landmark that has no other
    box: Numbers  # (4,) around the landmarks, in cells that hold about one each
    first: IntegerTable  # (rows, columns + 1) where each cell's landmarks begin and end in `members`
    members: Integers  # (n,)
    pair_a: Integers  # (m,)
    pair_b: Integers  # (m,)
    length: Numbers  # (m,) m, ascending
    variance: Numbers  # (m,) of the length

    @property
    def cell(self) -> float:
        """Side of a cell, m."""
        return float(self.box[CELL])


@compiled
def fill(on: MapIndex) -> None:
    """Sorts the landmarks into cells, row by row: those of cell k are members[first[k]:first[k + 1]].

    `first` is zero before, `members` -1.
    """
    first, members = on.first, on.members
    rows, columns = first.shape[0], first.shape[1] - 1
    left, below, cell = on.box[LEFT], on.box[BELOW], on.box[CELL]
    for i in range(len(on.xy)):
        row, column = int((on.xy[i, 1] - below) / cell), int((on.xy[i, 0] - left) / cell)
        first[row, column + 1] += 1
    total = 0
    for row in range(rows):
        first[row, 0] = total
        for column in range(columns):
            total += first[row, column + 1]
            first[row, column + 1] = total
    for i in range(len(on.xy) - 1, -1, -1):
        row, column = int((on.xy[i, 1] - below) / cell), int((on.xy[i, 0] - left) / cell)
        k = first[row, column]
        while members[k] >= 0:
            k += 1
        members[k] = i


@compiled
def nearest(on: MapIndex, x: float, y: float, reach: float) -> int:
    """Finds the landmark nearest to (x, y) within `reach`; -1 where there is none."""
    xy, first, members = on.xy, on.first, on.members
    rows, columns = first.shape[0], first.shape[1] - 1
    begin, below, cell = on.box[LEFT], on.box[BELOW], on.box[CELL]
    top = min(max(floor((y + reach - below) / cell), -1), rows - 1)
    low = max(min(floor((y - reach - below) / cell), rows), 0)
    right = min(max(floor((x + reach - begin) / cell), -1), columns - 1)
    left = max(min(floor((x - reach - begin) / cell), columns), 0)
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
def largest_variance(on: MapIndex) -> float:
    """Finds the largest variance of a landmark, m^2."""
    found = 0.0
    for n in range(len(on.xy)):
        found = max(found, on.half[n, n])
    return found


@compiled
def measure_pairs(on: MapIndex) -> None:
    """Lists the pairs of landmarks, their distance (m) and its variance."""
    xy, half, k = on.xy, on.half, 0
    for a in range(len(xy)):
        for b in range(a):
            on.pair_a[k], on.pair_b[k] = a, b
            on.length[k] = sqrt((xy[a, 0] - xy[b, 0]) ** 2 + (xy[a, 1] - xy[b, 1]) ** 2)
            on.variance[k] = half[a, a] + half[b, b] - 2 * half[a, b]
            k += 1


@compiled
def measure_room(on: MapIndex, most: float) -> None:
    """Computes the room of each landmark, `most` at the most.

    It is that of the disk to its AROUND-th neighbour over their number; landmarks nearer than 1 mm are one.
    """
    xy, near = on.xy, np.empty(AROUND)
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
        on.room[a] = min(most, log(pi * max(near[AROUND - 1], 1e-6) / AROUND))
