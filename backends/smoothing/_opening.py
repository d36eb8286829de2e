"""Selects what to reorder for a new root: its landmarks, the cliques to open, and those that stay."""

import numpy as np

from ...core.kernels.compiled import compiled
from ...core.se2 import Ints
from ._graph import (
    CHILD,
    CLIQUE,
    END,
    FAR,
    FIRST,
    FLAG,
    FRONTALS,
    GIVEN,
    LANDMARK,
    LAST,
    LISTED,
    MARK,
    NEAR,
    NEXT,
    PARENT,
    PART,
    PLACE,
    ROOT,
    STAMP,
    VARIABLES,
    WHOLE,
    WIDTH,
    Graph,
)
from ._quotient import longer


@compiled
def about(g: Graph, x: int, radius: float, most: int, some: Ints) -> Ints:
    """Landmarks `some`, then those within `radius` (m) of pose `x`, nearest first, up to `most` in all."""
    stamp = g.state[STAMP] + 1
    g.state[STAMP] = stamp
    n, room = len(some), max(most, len(some))
    out, far = np.empty(room, np.int64), np.empty(room)  # insertion sort: they are few
    for i in range(n):
        out[i] = some[i]
        g.variables[some[i], MARK] = stamp
    k = n
    for v in range(g.state[VARIABLES] if radius > 0.0 else 0):
        if g.variables[v, WIDTH] == 2 and g.variables[v, MARK] != stamp:
            d = (g.values[v, 0] - g.values[x, 0]) ** 2 + (g.values[v, 1] - g.values[x, 1]) ** 2
            if d < radius * radius and (k < room or (n < room and d < far[k - 1])):
                if k < room:
                    k += 1
                i = k - 1
                while i > n and far[i - 1] > d:
                    out[i], far[i] = out[i - 1], far[i - 1]
                    i -= 1
                out[i], far[i] = v, d
    return out[:k]


@compiled
def sighted(g: Graph, pose: int) -> Ints:
    """The variables among the landmarks sighted from a pose, and among the constant errors of these sightings."""
    out = np.empty(2 * (g.variables[pose, END] - g.variables[pose, FIRST]), np.int64)
    n = 0
    for s in range(g.variables[pose, FIRST], g.variables[pose, END]):
        v, part = g.sightings[s, LANDMARK], g.sightings[s, PART]
        if v >= 0 and g.variables[v, WIDTH] == 2 and (part == WHOLE or not listed(out, n, v)):
            out[n] = v
            n += 1
        if v >= 0 and part >= 0 and not listed(out, n, part):
            out[n] = part
            n += 1
    return out[:n]


@compiled
def listed(out: Ints, n: int, v: int) -> bool:
    """Tells if `v` is among the first `n` of `out`."""
    found = False
    for t in range(n):
        found = found or out[t] == v
    return found


@compiled
def opened(g: Graph, wanted: Ints, touched: Ints) -> Ints:
    """The cliques from those that eliminated these variables up to the root, flagged with a new stamp."""
    stamp = g.state[STAMP] + 1
    g.state[STAMP] = stamp
    out, n = np.empty(64, np.int64), 0
    for t in range(len(wanted) + len(touched)):
        c = g.variables[wanted[t] if t < len(wanted) else touched[t - len(wanted)], CLIQUE]
        while c > 0 and g.cliques[c, FLAG] != stamp:
            g.cliques[c, FLAG] = stamp
            out = longer(out, n, 1)
            out[n] = c
            n += 1
            c = g.cliques[c, PARENT]
    return out[:n]


@compiled
def take(g: Graph, v: int, out: Ints, n: int) -> int:
    """Appends variable `v` if it is not listed yet; returns the new count."""
    if g.variables[v, MARK] == g.state[STAMP]:
        return n
    g.variables[v, MARK], g.variables[v, PLACE] = g.state[STAMP], n
    out[n] = v
    return n + 1


@compiled
def concerned(g: Graph, x: int, wanted: Ints, touched: Ints, open_: Ints, everything: bool) -> tuple[Ints, int]:
    """The variables to order, kept ones first, `wanted` and `x`; and the number of these."""
    most = len(wanted) + len(touched) + 2 + g.state[ROOT]
    for t in range(len(open_)):
        most += g.cliques[open_[t], FRONTALS]
    if everything:
        most = g.state[VARIABLES] + 1
    out, n = np.empty(most, np.int64), 0
    for t in range(len(wanted)):
        n = take(g, wanted[t], out, n)
    n = take(g, x, out, n)
    kept = n
    if everything:
        for v in range(g.state[VARIABLES]):
            if g.variables[v, WIDTH]:
                n = take(g, v, out, n)
        return out[:n], kept
    n = take(g, g.state[LAST], out, n)
    for t in range(len(touched)):
        n = take(g, touched[t], out, n)
    for t in range(g.state[ROOT]):
        n = take(g, g.root[t], out, n)
    for t in range(len(open_)):
        start = g.cliques[open_[t], LISTED]
        for u in range(g.cliques[open_[t], FRONTALS]):
            n = take(g, int(g.ints[start + u]), out, n)
    return out[:n], kept


@compiled
def staying(g: Graph, open_: Ints, everything: bool) -> Ints:
    """The cliques that stay and lose their parents."""
    stamp = g.state[STAMP]
    out, n = np.empty(64, np.int64), 0
    if everything:
        n = g.state[GIVEN]
        out = longer(out, 0, n)
        for c in range(n):
            out[c] = 1 + c
        return out[:n]
    for t in range(-2, len(open_)):
        c = g.cliques[open_[t], CHILD] if t >= 0 else g.state[NEAR if t == -1 else FAR]
        while c > 0:
            if g.cliques[c, FLAG] != stamp:
                out = longer(out, n, 1)
                out[n] = c
                n += 1
            c = g.cliques[c, NEXT]
    return out[:n]
