"""Creates and enlarges the arrays of a smoother: each at least doubles."""

from typing import Any

import numpy as np

from ...core.factors import RangeBearing
from ...core.kernels._cholesky import row_of
from ...core.kernels._lanes import LANES
from ...core.se2 import Array
from ._graph import CLASSES, CLIQUES, RESUM, STATE, Graph

TOGETHER = {
    "variables": ("variables", "values"),
    "sightings": ("sightings", "seen"),
    "fixed": ("fixed",),
    "submaps": ("submaps",),
    "links": ("links", "linked"),
    "steps": ("steps", "at"),
    "cliques": ("cliques", "todo"),
    "ints": ("ints",),
    "reals": ("reals",),
}
"""Arrays with equal numbers of rows, by the name of the first."""


def made(loss: int, scale: float, enough: float = 0.0) -> Graph:
    """The arrays of an empty smoother, with a robust loss; `enough` is of `_relinearise`."""
    g = Graph(
        state=np.zeros(STATE, np.int64),
        variables=np.zeros((64, 10), np.int64),
        values=np.zeros((64, 3)),
        sightings=np.zeros((256, 3), np.int64),
        seen=np.zeros((256, 5)),
        fixed=np.zeros((0, 11)),
        submaps=np.zeros(1),
        links=np.zeros((64, 6), np.int64),
        linked=np.zeros((64, 19)),
        steps=np.zeros((64, 12)),
        at=np.zeros(64, np.int64),
        cliques=np.zeros((64, 13), np.int64),
        ints=np.zeros(4096, np.int64),
        reals=np.zeros(32768),
        free=np.full((2, CLASSES), -1, np.int64),
        root=np.zeros(0, np.int64),
        todo=np.zeros(64, np.int64),
        rest=np.zeros(0),
        work=np.zeros(0),
        spots=np.zeros(0, np.int64),
        settings=np.array((loss, scale, 0.0, 0.0, 0.0, 0.0, 0.0, enough, np.inf)),
    )
    g.state[CLIQUES] = 1
    return with_front(with_root(g, 32), 70)


def with_rows(g: Graph, table: str, rows: int) -> Graph:
    """`g` with at least that many rows in a table of `TOGETHER`."""
    have = len(getattr(g, table))
    if rows <= have:
        return g
    more = max(have, rows - have)
    return g.replaced(**{name: _longer(getattr(g, name), more) for name in TOGETHER[table]})


def with_root(g: Graph, landmarks: int) -> Graph:
    """`g` with room for that many landmarks in the root."""
    if landmarks <= len(g.root):
        return g
    room = max(2 * len(g.root), landmarks)
    g.state[RESUM] = 1
    root = _longer(g.root, room - len(g.root))
    return with_front(g.replaced(root=root, rest=np.zeros(2 * room * (2 * room + 1))), 2 * room + 3)


def with_front(g: Graph, size: int) -> Graph:
    """`g` with room for a front of that many scalars."""
    if 2 * size <= len(g.spots):
        return g
    return g.replaced(work=_aligned(size * row_of(size) + 4 * size), spots=np.zeros(2 * size, np.int64))


def as_rows(sightings: RangeBearing, into: Array) -> Array:
    """Copies sightings to the first rows of `into` (k, 6), or a longer one: range, bearing, and their covariance."""
    n = len(sightings.ids)
    if n > len(into):
        into = np.zeros((2 * n, 6))
    into[:n, :2] = sightings.z
    into[:n, 2:] = sightings.cov.reshape(n, 4)
    return into


def _aligned(n: int) -> Array:
    """Zeros that begin where a line of the cache does: eights of them (see `_lanes`) lie in one line each."""
    whole = np.zeros(n + LANES)
    first = -(whole.ctypes.data // whole.itemsize) % LANES
    return whole[first : first + n]


def _longer(array: Any, more: int) -> Any:
    out = np.zeros((len(array) + more, *array.shape[1:]), array.dtype)  # untouched pages cost nothing
    out[: len(array)] = array
    return out
