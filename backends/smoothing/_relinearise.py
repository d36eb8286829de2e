"""Solving for all offsets, moving linearisation points there, and finding what has to be eliminated anew."""

import numpy as np
from numpy.typing import NDArray

from ...frontend.compiled import compiled
from ...frontend.se2 import Array, Ints
from .._models import wrap
from ._factors import distance, loss
from ._front import solve_rows
from ._graph import (
    BOUND,
    CHILD,
    COVARIANCE,
    DELTA,
    END,
    FACTOR,
    FAR,
    FIRST,
    FLAG,
    FRONT,
    FRONTALS,
    GIVEN,
    LANDMARK,
    LAST,
    LINKS,
    LISTED,
    LOOP,
    LOSS,
    MARK,
    MEMBERS,
    MOTION,
    NEAR,
    NEXT,
    NOISE,
    PARENT,
    POINT,
    RESUM,
    ROOT,
    SCALE,
    SIZE,
    STAMP,
    STEP,
    STEPS,
    TODO,
    UPDATE,
    VARIABLES,
    WIDTH,
    A,
    B,
    Graph,
)  # fmt: skip
from ._links import inner, inverse, motion_offset, relink


@compiled
def top_down(g: Graph) -> Ints:
    """All cliques, parents before their children."""
    out = np.empty(len(g.cliques), np.int64)
    n = 0
    for head in (g.state[NEAR], g.state[FAR]):
        c = head
        while c > 0:
            out[n] = c
            n += 1
            c = g.cliques[c, NEXT]
    i = 0
    while i < n:
        c = g.cliques[out[i], CHILD]
        while c > 0:
            out[n] = c
            n += 1
            c = g.cliques[c, NEXT]
        i += 1
    return out[:n]


@compiled
def offsets(g: Graph, order: Ints, out: Array) -> None:
    """What all variables are off from where they are linearised, (V, 3); `order` has parents before their children."""
    m = 2 * g.state[ROOT] + 3
    y = np.empty(len(g.spots) + 3)
    solve_rows(g.work, 0, m, m, y)
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
        solve_rows(g.reals, g.cliques[c, FACTOR], g.cliques[c, FRONT], g.cliques[c, SIZE], y)
        k = 0
        for t in range(start, start + frontals):
            v = g.ints[t]
            for i in range(g.variables[v, WIDTH]):
                out[v, i] = y[k]
                k += 1


@compiled
def inner_offsets(g: Graph, off: Array, threshold: float, out: Array) -> None:
    """The same of the steps, (T, 3), zeros so far: of variables, and between two of which one is off by a threshold."""
    rows = np.empty((64, 27))
    for v in range(g.state[VARIABLES]):
        if g.variables[v, WIDTH] == 3:
            out[g.variables[v, STEP]] = off[v]
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
        inner(g, first, last, rows)
        for i in range(n):
            row = rows[i]
            for j in range(3):
                t = row[18 + j]
                for i2 in range(3):
                    t += row[3 * j + i2] * off[a, i2] + row[9 + 3 * j + i2] * off[b, i2]
                out[first + 1 + i, j] = t


@compiled
def square_of(W: Array, k: int, e0: float, e1: float, e2: float) -> float:
    """e' W e, W having six numbers from `k` on."""
    return (
        W[k] * e0 * e0 + W[k + 3] * e1 * e1 + W[k + 5] * e2 * e2
        + 2 * (W[k + 1] * e0 * e1 + W[k + 2] * e0 * e2 + W[k + 4] * e1 * e2)
    )  # fmt: skip


@compiled
def motion_cost(p: Array, q: Array, motion: Array, k: int, covariance: int) -> float:
    """The squared Mahalanobis distance of poses p and q from motion[k : k + 3], its covariance from `covariance` on."""
    e0, e1, e2, c, s = motion_offset(p[0], p[1], p[2], q[0], q[1], q[2], motion[k], motion[k + 1], motion[k + 2])
    W = np.empty(6)
    if not inverse(motion, covariance, W, 0):
        return np.inf
    return square_of(W, 0, c * e0 + s * e1, c * e1 - s * e0, e2)


@compiled
def cost(g: Graph, path: Array, values: Array) -> float:
    """J of a path (T, 3) and of variables at `values` (V, 3)."""
    p = g.steps[0]
    W = np.empty(6)
    if not inverse(p, NOISE, W, 0):
        return np.inf
    total = square_of(W, 0, path[0, 0] - p[0], path[0, 1] - p[1], wrap(path[0, 2] - p[2]))
    for k in range(1, g.state[STEPS]):
        total += motion_cost(path[k - 1], path[k], g.steps[k], DELTA, NOISE)
    for k in range(g.state[LINKS]):
        if g.links[k, LOOP]:
            first, last = g.variables[g.links[k, A], STEP], g.variables[g.links[k, B], STEP]
            L = g.linked[k]
            total += motion_cost(path[first], path[last], L, MOTION, COVARIANCE)
    for v in range(g.state[VARIABLES]):
        if g.variables[v, WIDTH] != 3:
            continue
        x = path[g.variables[v, STEP]]
        for s in range(g.variables[v, FIRST], g.variables[v, END]):
            landmark = g.sightings[s, LANDMARK]
            if landmark >= 0:
                q = distance(x[0], x[1], x[2], values[landmark, 0], values[landmark, 1], g.seen, s)[4]
                total += loss(g.settings[LOSS], g.settings[SCALE], q)
    for c in range(1, 1 + g.state[GIVEN]):
        total += given_cost(g, c, values)
    return total


@compiled
def given_cost(g: Graph, c: int, values: Array) -> float:
    """What a part of a given map adds to J."""
    start, m, at, f = g.cliques[c, LISTED], 2 * g.cliques[c, MEMBERS], g.cliques[c, UPDATE], g.cliques[c, FACTOR]
    total = 0.0
    for i in range(m):
        a = values[g.ints[start + i // 2], i % 2] - g.reals[f + i]
        for j in range(i, m):
            b = values[g.ints[start + j // 2], j % 2] - g.reals[f + j]
            total += (1.0 if i == j else 2.0) * a * g.reals[at] * b
            at += 1
        at += 1
    return total


@compiled
def candidate(
    g: Graph, off: Array, steps_off: Array, share: float, threshold: float, path: Array, values: Array
) -> tuple[float, float]:
    """Path (T, 3) and values (V, 3) a `share` of the way to where they should be; how far the furthest has to go.

    That is the largest offset (m, rad) and the largest of a heading.
    """
    most = turn = 0.0
    n = g.variables[g.state[LAST], STEP] + 1
    for k in range(n):
        o = steps_off[k]
        far = max(abs(o[0]), abs(o[1]), abs(o[2]))
        most, turn = max(most, far), max(turn, abs(o[2]))
        go = share if far > threshold else 0.0
        for i in range(3):
            path[k, i] = g.steps[k, POINT + i] + go * o[i]
        path[k, 2] = wrap(path[k, 2])
    for k in range(n, g.state[STEPS]):  # after the last variable: as the motions have it
        p, q, d = path[k - 1], path[k], g.steps[k]
        e = motion_offset(p[0], p[1], p[2], 0.0, 0.0, 0.0, d[0], d[1], d[2])
        q[0], q[1], q[2] = e[0], e[1], e[2]
    for v in range(g.state[VARIABLES]):
        width = g.variables[v, WIDTH]
        if width == 3:
            k = g.variables[v, STEP]
            values[v, 0], values[v, 1], values[v, 2] = path[k, 0], path[k, 1], path[k, 2]
            continue
        o = off[v]
        far = max(abs(o[0]), abs(o[1])) if width == 2 else 0.0
        most = max(most, far)
        go = share if far > threshold else 0.0
        values[v, 0], values[v, 1] = g.values[v, 0] + go * o[0], g.values[v, 1] + go * o[1]
    return most, turn


@compiled
def settle(g: Graph, order: Ints, path: Array, values: Array) -> tuple[int, int]:
    """Linearise at `path` and `values`; list what is to be eliminated anew. The work of that, and of all there is.

    Raises nothing: a link that is no more positive definite shows in the factorisation.
    """
    stamp = g.state[STAMP] + 1
    g.state[STAMP] = stamp
    for v in range(g.state[VARIABLES]):
        moved = False
        for i in range(3 if g.variables[v, WIDTH] == 3 else 2):
            moved = moved or g.values[v, i] != values[v, i]
            g.values[v, i] = values[v, i]
        if moved:
            g.variables[v, MARK] = stamp
    shifted = np.zeros(g.state[LINKS], np.bool_)
    for k in range(g.state[LINKS]):
        a, b = g.links[k, A], g.links[k, B]
        go = g.variables[a, MARK] == stamp or g.variables[b, MARK] == stamp
        if not go and not g.links[k, LOOP]:
            for j in range(g.variables[a, STEP] + 1, g.variables[b, STEP]):
                for i in range(3):
                    go = go or g.steps[j, POINT + i] != path[j, i]
        shifted[k] = go
    for k in range(g.state[STEPS]):
        for i in range(3):
            g.steps[k, POINT + i] = path[k, i]
    for k in range(g.state[LINKS]):
        if shifted[k]:
            relink(g, k)
    flag(g, order, stamp, shifted)
    again = total = n = 0
    for t in range(len(order) - 1, -1, -1):
        c = order[t]
        q = g.cliques[c]
        work = q[FRONT] * q[SIZE] * q[SIZE]
        total += work
        if q[FLAG] == -1:
            q[FLAG] = 0
            again += work
            g.todo[n] = c
            n += 1
            if q[PARENT] > 0:
                g.cliques[q[PARENT], FLAG] = -1
            else:
                g.state[RESUM] = 1
    g.state[TODO] = n
    return again, total


@compiled
def flag(g: Graph, order: Ints, stamp: int, shifted: NDArray[np.bool]) -> None:
    """Flag the cliques whose own factors have changed: those of variables marked `stamp`, and `shifted` links."""
    for c in order:
        start, frontals, members = g.cliques[c, LISTED], g.cliques[c, FRONTALS], g.cliques[c, MEMBERS]
        changed = False
        if frontals == 0:
            for t in range(start, start + members):
                changed = changed or g.variables[g.ints[t], MARK] == stamp
        for t in range(start, start + frontals):
            v = g.ints[t]
            if g.variables[v, WIDTH] < 3:
                continue
            changed = changed or g.variables[v, MARK] == stamp
            for s in range(g.variables[v, FIRST], g.variables[v, END]):
                landmark = g.sightings[s, LANDMARK]
                if landmark >= 0 and g.variables[landmark, MARK] == stamp:
                    changed = True
        for t in range(start + members, start + members + g.cliques[c, BOUND]):
            changed = changed or shifted[g.ints[t]]
        if changed:
            g.cliques[c, FLAG] = -1


@compiled
def about(g: Graph, x: int, radius: float, most: int, some: Ints) -> Ints:
    """Landmarks `some`, then those within `radius` (m) of pose `x`, the nearest first, up to `most` in all."""
    stamp = g.state[STAMP] + 1
    g.state[STAMP] = stamp
    n = len(some)
    for i in range(n):
        g.variables[some[i], MARK] = stamp
    near, far = np.empty(g.state[VARIABLES], np.int64), np.empty(g.state[VARIABLES])
    k = 0
    for v in range(g.state[VARIABLES]):
        if g.variables[v, WIDTH] == 2 and g.variables[v, MARK] != stamp:
            d = (g.values[v, 0] - g.values[x, 0]) ** 2 + (g.values[v, 1] - g.values[x, 1]) ** 2
            if d < radius * radius:
                near[k], far[k] = v, d
                k += 1
    room = min(max(most - n, 0), k)
    out = np.empty(n + room, np.int64)
    out[:n] = some
    if room < k:
        order = np.argsort(far[:k])
        for t in range(room):
            out[n + t] = near[order[t]]
    else:
        out[n:] = near[:k]
    return out


@compiled
def sighted(g: Graph, pose: int) -> Ints:
    """The landmarks sighted from a pose that are variables."""
    out = np.empty(g.variables[pose, END] - g.variables[pose, FIRST], np.int64)
    n = 0
    for s in range(g.variables[pose, FIRST], g.variables[pose, END]):
        v = g.sightings[s, LANDMARK]
        if v >= 0 and g.variables[v, WIDTH] == 2:
            out[n] = v
            n += 1
    return out[:n]
