"""A given map, prepared for places to be looked up on it: a grid of landmarks, and their pairs by distance."""

from typing import NamedTuple, Self

import numpy as np

from ...core.factors import Map
from ...core.se2 import Array, Ints
from ._landmark_grid import fill, measure_pairs, measure_room

EDGE = 1.0
"""Metres by which the area of a map is larger than the landmarks' own, on one side: it is never zero."""


class MapIndex(NamedTuple):
    """A map of n landmarks with m = n (n - 1) / 2 pairs, sorted by distance."""

    ids: Ints  # (n,)
    xy: Array  # (n, 2) m
    cov: Array  # (2n, 2n) zero where the map has none: it is exact
    half: Array  # (n, n) half-traces of the blocks of cov: variances of the places, were these circles
    area: float  # m^2 of the box around the landmarks
    room: Array  # (n,) logarithm of the area (m^2) around each landmark that has no other
    corner: Array  # (2,) of the grid
    cell: float  # m, such that a cell holds about one landmark
    first: Ints  # (rows, columns + 1) where each cell's landmarks begin and end in `members`
    members: Ints  # (n,)
    pair_a: Ints  # (m,)
    pair_b: Ints  # (m,)
    length: Array  # (m,) m, ascending
    variance: Array  # (m,) of the length

    @classmethod
    def of(cls, known: Map) -> Self:
        """Prepares a map with at least one landmark."""
        n = len(known.ids)
        xy = np.array(known.xy, np.float64)
        cov = np.zeros((2 * n, 2 * n)) if known.cov is None else np.array(known.cov, np.float64)
        half = 0.5 * (cov[::2, ::2] + cov[1::2, 1::2])
        corner, sides = xy.min(axis=0), np.ptp(xy, axis=0) + EDGE
        area = float(np.prod(sides))
        cell = float(np.sqrt(area / n))
        room = np.empty(n)
        measure_room(xy, np.log(area / n), room)
        columns, rows = (sides / cell).astype(np.int64) + 1
        first, members = np.zeros((rows, columns + 1), np.int64), np.full(n, -1)
        fill(xy, corner, cell, first, members)
        m = n * (n - 1) // 2
        a, b, length, variance = np.empty(m, np.int64), np.empty(m, np.int64), np.empty(m), np.empty(m)
        measure_pairs(xy, half, a, b, length, variance)
        order = np.argsort(length, kind="stable")
        pairs = a[order], b[order], length[order], variance[order]
        return cls(np.array(known.ids), xy, cov, half, area, room, corner, cell, first, members, *pairs)
