"""Prepares a given map for places to be looked up on it."""

import numpy as np

from ...core.factors import Map
from ._map_index import MapIndex, fill, measure_pairs, measure_room

EDGE = 1.0
"""Metres by which the area of a map is larger than the landmarks' own, on one side: it is never zero."""


def indexed(known: Map) -> MapIndex:
    """Prepares a map with at least one landmark."""
    n = len(known.ids)
    xy = np.array(known.xy, np.float64, order="C")
    cov = np.zeros((2 * n, 2 * n)) if known.cov is None else np.array(known.cov, np.float64, order="C")
    sides = np.ptp(xy, axis=0) + EDGE
    area = float(np.prod(sides))
    cell = float(np.sqrt(area / n))
    columns, rows = (sides / cell).astype(np.int64) + 1
    m = n * (n - 1) // 2
    on = MapIndex(
        ids=np.array(known.ids, np.int64),
        xy=xy,
        cov=cov,
        half=0.5 * (cov[::2, ::2] + cov[1::2, 1::2]),
        room=np.empty(n),
        box=np.array((*xy.min(axis=0), cell, area)),
        first=np.zeros((rows, columns + 1), np.int64),
        members=np.full(n, -1),
        pair_a=np.empty(m, np.int64),
        pair_b=np.empty(m, np.int64),
        length=np.empty(m),
        variance=np.empty(m),
    )
    fill(on)
    measure_room(on, np.log(area / n))
    measure_pairs(on)
    order = np.argsort(on.length, kind="stable")
    for column in (on.pair_a, on.pair_b, on.length, on.variance):
        column[:] = column[order]
    return on
