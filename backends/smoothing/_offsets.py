"""Solves for all offsets, and applies them to path and variables."""

import numpy as np

from ...core.kernels._cholesky import row_of
from ...core.kernels._planar import wrap
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from ._front import solve_rows
from ._graph import (
    CHILD,
    FACTOR,
    FAR,
    FRONT,
    FRONTALS,
    LAST,
    LINKS,
    LISTED,
    LOOP,
    MEMBERS,
    NEAR,
    NEXT,
    POINT,
    ROOT,
    SIZE,
    STEP,
    STEPS,
    VARIABLES,
    WIDTH,
    A,
    B,
    Graph,
)  # fmt: skip
from ._links import inner, motion_offset


@compiled
def top_down(g: Graph) -> Ints:
    """All cliques, parents before their children, and each with all below it at once: so they lie in the arenas."""
    out, waiting = np.empty(len(g.cliques), np.int64), np.empty(len(g.cliques), np.int64)
    n = m = 0
    for head in (g.state[FAR], g.state[NEAR]):
        c = head
        while c > 0:
            waiting[m] = c
            m += 1
            c = g.cliques[c, NEXT]
    while m > 0:
        m -= 1
        out[n] = waiting[m]
        c = g.cliques[waiting[m], CHILD]
        n += 1
        while c > 0:
            waiting[m] = c
            m += 1
            c = g.cliques[c, NEXT]
    return out[:n]


@compiled
def offsets(g: Graph, order: Ints, out: Array) -> None:
    """Offsets of all variables from their linearisation points, (V, 3); `order` has parents before their children."""
    m = 2 * g.state[ROOT] + 3
    y = np.empty(len(g.spots) + 3)
    solve_rows(g.work, 0, row_of(m), m, m, y)
    for t in range(g.state[ROOT]):
        out[g.root[t], 0], out[g.root[t], 1] = y[2 * t], y[2 * t + 1]
    for i in range(3):
        out[g.state[LAST], i] = y[m - 3 + i]
    for c in order:
        start, frontals, members = g.cliques[c, LISTED], g.cliques[c, FRONTALS], g.cliques[c, MEMBERS]
        if frontals == 0:
            continue
        k = g.cliques[c, FRONT]
        for t in range(start + frontals, start + members):
            v = g.ints[t]
            for i in range(g.variables[v, WIDTH]):
                y[k] = out[v, i]
                k += 1
        size = g.cliques[c, SIZE]
        solve_rows(g.reals, g.cliques[c, FACTOR], size + 1, g.cliques[c, FRONT], size, y)
        k = 0
        for t in range(start, start + frontals):
            v = g.ints[t]
            for i in range(g.variables[v, WIDTH]):
                out[v, i] = y[k]
                k += 1


@compiled
def predicted_fall(g: Graph, order: Ints) -> float:
    """The decrease of J by all offsets if its residuals were linear: the sum of squares of d in all [R d]."""
    m, total = 2 * int(g.state[ROOT]) + 3, 0.0
    w = row_of(m)
    for i in range(m):
        total += float(g.work[i * w + w - 1]) ** 2
    for c in order:
        if g.cliques[c, FRONTALS] > 0:
            size, at = g.cliques[c, SIZE], g.cliques[c, FACTOR]
            for i in range(g.cliques[c, FRONT]):
                total += float(g.reals[at + i * (size + 1) + size]) ** 2
    return total


@compiled
def inner_offsets(g: Graph, off: Array, threshold: float, out: Array) -> bool:
    """Likewise of the steps, (T, 3), initially zero: of variables, and between two if one is off by a threshold.

    False where the motions between two have no covariance.
    """
    rows = np.empty((64, 27))
    for v in range(g.state[VARIABLES]):
        if g.variables[v, WIDTH] == 3:
            for i in range(3):
                out[g.variables[v, STEP], i] = off[v, i]
    for k in range(g.state[LINKS]):
        if g.links[k, LOOP]:
            continue
        a, b = g.links[k, A], g.links[k, B]
        first, last = g.variables[a, STEP], g.variables[b, STEP]
        n = last - first - 1
        far = 0.0
        for i in range(3):
            far = max(far, abs(off[a, i]), abs(off[b, i]))
        if n == 0 or far <= threshold:
            continue
        if n > len(rows):
            rows = np.empty((2 * n, 27))
        if not inner(g, first, last, rows):
            return False
        for i in range(n):
            for j in range(3):
                t = rows[i, 18 + j]
                for i2 in range(3):
                    t += rows[i, 3 * j + i2] * off[a, i2] + rows[i, 9 + 3 * j + i2] * off[b, i2]
                out[first + 1 + i, j] = t
    return True


@compiled
def candidate(
    g: Graph, off: Array, steps_off: Array, share: float, threshold: float, path: Array, values: Array
) -> tuple[float, float]:
    """Path (T, 3) and values (V, 3) moved by a `share` of their offsets; returns the largest offsets.

    These are the largest of all (m, rad) and the largest of a heading.
    """
    most = turn = 0.0
    n = g.variables[g.state[LAST], STEP] + 1
    for k in range(n):
        far = max(abs(steps_off[k, 0]), abs(steps_off[k, 1]), abs(steps_off[k, 2]))
        most, turn = max(most, far), max(turn, abs(steps_off[k, 2]))
        go = share if far > threshold else 0.0
        for i in range(3):
            path[k, i] = g.steps[k, POINT + i] + go * steps_off[k, i]
        path[k, 2] = wrap(path[k, 2])
    for k in range(n, g.state[STEPS]):  # after the last variable: propagated by the motions
        p, q, d = path[k - 1], path[k], g.steps[k]
        e = motion_offset(p[0], p[1], p[2], 0.0, 0.0, 0.0, d[0], d[1], d[2])
        q[0], q[1], q[2] = e[0], e[1], e[2]
    for v in range(g.state[VARIABLES]):
        width = g.variables[v, WIDTH]
        if width == 3:
            k = g.variables[v, STEP]
            values[v, 0], values[v, 1], values[v, 2] = path[k, 0], path[k, 1], path[k, 2]
            continue
        far = max(abs(off[v, 0]), abs(off[v, 1])) if width == 2 else 0.0
        most = max(most, far)
        go = share if far > threshold else 0.0
        values[v, 0], values[v, 1] = g.values[v, 0] + go * off[v, 0], g.values[v, 1] + go * off[v, 1]
    return most, turn
