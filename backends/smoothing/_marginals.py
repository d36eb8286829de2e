"""The joint marginal of the last pose and of some landmarks, from the cliques between them and the root alone.

With the whole problem's factor R, columns E that select some variables, and Y = R^-T E, their covariance is Y' Y. Rows
of Y differ from zero only in the cliques on the way from a variable's own up to the root: forward substitution goes up
from there, each clique handing what is left on its separators to its parent.
"""

import numpy as np

from ...frontend.compiled import compiled
from ...frontend.se2 import Array, Ints
from ._front import places, solve_rows
from ._graph import (
    CLIQUE,
    FACTOR,
    FRONT,
    FRONTALS,
    LAST,
    LISTED,
    MEMBERS,
    PARENT,
    PLACE,
    ROOT,
    SIZE,
    SLOT,
    WIDTH,
    graph,
)  # fmt: skip


@compiled
def ways(cliques: Ints, first: Ints) -> Ints:
    """The cliques from those in `first` up to the root, children before their parents."""
    found, depth, n = np.empty(64, np.int64), np.empty(64, np.int64), 0
    seen = np.zeros(len(cliques), np.bool_)
    for start in first:
        levels, c = 0, start
        while c > 0:
            levels += 1
            c = cliques[c, PARENT]
        c = start
        while c > 0 and not seen[c]:
            if n == len(found):
                found, depth = np.concatenate((found, found)), np.concatenate((depth, depth))
            found[n], depth[n], seen[c] = c, levels, True
            n += 1
            levels -= 1
            c = cliques[c, PARENT]
    return found[:n][np.argsort(-depth[:n], kind="mergesort")]


@compiled
def substitute(R: Array, o: int, rows: int, size: int, y: Array, first: int) -> None:
    """Solves R' y = b in place for y[:rows]; b's other rows (size - rows) are reduced by it. Rows before `first` are 0.

    R's rows of size + 1 numbers begin at `o`; y is (size, columns).
    """
    columns = y.shape[1]
    for i in range(first, rows):
        b = o + i * (size + 1)
        scale = 1.0 / R[b + i]
        for k in range(columns):
            y[i, k] *= scale
        for j in range(i + 1, size):
            a = R[b + j]
            if a != 0.0:
                for k in range(columns):
                    y[j, k] -= a * y[i, k]


@compiled
def add_products(y: Array, rows: int, first: int, cov: Array) -> None:
    """Adds y' y of rows `first` to `rows` to the lower triangle of `cov`."""
    columns = y.shape[1]
    for i in range(first, rows):
        for k in range(columns):
            a = y[i, k]
            if a != 0.0:
                for j in range(k + 1):
                    cov[k, j] += a * y[i, j]


@compiled
def joint(address: int, landmarks: Ints, pose: Array, at: Array, cov: Array) -> None:
    """Estimates of the last pose that is a variable and of n landmark variables, and their joint covariance.

    Fills pose (3,), at (n, 2) and cov (2n + 3, 2n + 3), the pose last. Changes nothing but scratch.
    """
    g = graph(address)
    n, last = len(landmarks), g.state[LAST]
    columns = 2 * n + 3
    cov[:] = 0.0
    outside, apart = np.empty(n, np.int64), 0
    for t in range(n):
        if g.variables[landmarks[t], SLOT] < 0:
            outside[apart] = g.variables[landmarks[t], CLIQUE]
            apart += 1
    order = ways(g.cliques, outside[:apart])
    starts = np.zeros(len(order) + 1, np.int64)
    for p in range(len(order)):
        starts[p + 1] = starts[p] + g.cliques[order[p], SIZE]
    m = 2 * g.state[ROOT] + 3
    top, below = np.zeros((m, columns)), np.zeros((starts[len(order)], columns))
    spots = np.empty(starts[len(order)], np.int64)
    least = m - 3
    for t in range(n):
        slot = g.variables[landmarks[t], SLOT]
        if slot >= 0:
            top[2 * slot, 2 * t] = top[2 * slot + 1, 2 * t + 1] = 1.0
            least = min(least, 2 * slot)
    for i in range(3):
        top[m - 3 + i, 2 * n + i] = 1.0
    for p in range(len(order)):
        c = order[p]
        q = g.cliques[c]
        mine = below[starts[p] : starts[p + 1]]
        place = 0
        for t in range(q[LISTED], q[LISTED] + q[FRONTALS]):
            for k in range(n):
                if landmarks[k] == g.ints[t]:
                    mine[place, 2 * k] = mine[place + 1, 2 * k + 1] = 1.0
            place += g.variables[g.ints[t], WIDTH]
        substitute(g.reals, q[FACTOR], q[FRONT], q[SIZE], mine, 0)
        add_products(mine, q[FRONT], 0, cov)
        parent = q[PARENT]
        above, offset = top, 0
        if parent == 0:
            for t in range(g.state[ROOT]):
                g.variables[g.root[t], PLACE] = 2 * t
            g.variables[last, PLACE] = m - 3
        else:
            place = 0
            for t in range(g.cliques[parent, LISTED], g.cliques[parent, LISTED] + g.cliques[parent, MEMBERS]):
                g.variables[g.ints[t], PLACE] = place
                place += g.variables[g.ints[t], WIDTH]
            for r in range(p + 1, len(order)):
                if order[r] == parent:
                    offset = starts[r]
            above = below
        for i in range(places(g, c)):
            spot = g.spots[i] + offset
            spots[starts[p] + q[FRONT] + i] = spot
            if parent == 0:
                least = min(least, spot)
            for k in range(columns):
                above[spot, k] += mine[q[FRONT] + i, k]
    substitute(g.work, 0, m, m, top, least)
    add_products(top, m, least, cov)
    for i in range(columns):
        for j in range(i):
            cov[j, i] = cov[i, j]
    y = np.empty(m)
    solve_rows(g.work, 0, m, m, y)
    for i in range(3):
        pose[i] = g.values[last, i] + y[m - 3 + i]
    off = np.empty(starts[len(order)])
    for p in range(len(order) - 1, -1, -1):
        q = g.cliques[order[p]]
        own = off[starts[p] : starts[p + 1]]
        for i in range(q[FRONT], q[SIZE]):
            spot = spots[starts[p] + i]
            own[i] = y[spot] if q[PARENT] == 0 else off[spot]
        solve_rows(g.reals, q[FACTOR], q[FRONT], q[SIZE], own)
    for t in range(n):
        v = landmarks[t]
        slot = g.variables[v, SLOT]
        at[t, 0], at[t, 1] = g.values[v, 0], g.values[v, 1]
        if slot >= 0:
            at[t, 0] += y[2 * slot]
            at[t, 1] += y[2 * slot + 1]
            continue
        for p in range(len(order)):
            if order[p] != g.variables[v, CLIQUE]:
                continue
            place, start = 0, g.cliques[order[p], LISTED]
            for s in range(start, start + g.cliques[order[p], FRONTALS]):
                if g.ints[s] == v:
                    at[t, 0] += off[starts[p] + place]
                    at[t, 1] += off[starts[p] + place + 1]
                place += g.variables[g.ints[s], WIDTH]
