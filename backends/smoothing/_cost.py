"""J of a path and of variables."""

import numpy as np

from ...core.kernels._planar import information, wrap
from ...core.kernels.compiled import compiled
from ...core.se2 import Array
from ._factors import distance, fix_off, loss, range_off, square_of, submap_cost, turn_off
from ._graph import (
    BIAS,
    COVARIANCE,
    CUT,
    DELTA,
    END,
    FACTOR,
    FIRST,
    FIX,
    GIVEN,
    LANDMARK,
    LINKS,
    LISTED,
    LOOP,
    LOSS,
    MEMBERS,
    MOTION,
    NOISE,
    PART,
    PRIOR,
    SCALE,
    STEP,
    STEPS,
    SUBMAP,
    TURN,
    UPDATE,
    VARIABLES,
    WEIGHT,
    WIDTH,
    A,
    B,
    Graph,
)  # fmt: skip
from ._links import motion_offset


@compiled
def motion_cost(p: Array, q: Array, motion: Array, k: int, covariance: int, W: Array) -> float:
    """The squared Mahalanobis distance of poses p and q from motion[k : k + 3], its covariance from `covariance` on.

    W (6,) is overwritten.
    """
    e0, e1, e2, c, s = motion_offset(p[0], p[1], p[2], q[0], q[1], q[2], motion[k], motion[k + 1], motion[k + 2])
    if not information(motion, covariance, W, 0):
        return np.inf
    return square_of(W, 0, c * e0 + s * e1, c * e1 - s * e0, e2)


@compiled
def cost(g: Graph, path: Array, values: Array) -> float:
    """J of a path (T, 3) and of variables at `values` (V, 3)."""
    p = g.steps[0]
    W = np.empty(6)
    if not information(p, NOISE, W, 0):
        return np.inf
    total = square_of(W, 0, path[0, 0] - p[0], path[0, 1] - p[1], wrap(path[0, 2] - p[2]))
    for k in range(1, g.state[STEPS]):
        if g.steps[k, NOISE] != CUT:
            total += motion_cost(path[k - 1], path[k], g.steps[k], DELTA, NOISE, W)
    for k in range(g.state[LINKS]):
        if g.links[k, LOOP]:
            first, last = g.variables[g.links[k, A], STEP], g.variables[g.links[k, B], STEP]
            L = g.linked[k]
            if g.links[k, LOOP] == TURN:
                total += L[MOTION + 2] * turn_off(path[first, 2], path[last, 2], values[g.links[k, BIAS], 0], L) ** 2
                continue
            q = motion_cost(path[first], path[last], L, MOTION, COVARIANCE, W)
            total += L[WEIGHT] * loss(g.settings[LOSS], g.settings[SCALE], q)
    for v in range(g.state[VARIABLES]):
        if g.variables[v, WIDTH] != 3:
            continue
        x = path[g.variables[v, STEP]]
        if g.variables[v, SUBMAP] > 0:
            total += submap_cost(g, v, x, values)
            continue
        for s in range(g.variables[v, FIRST], g.variables[v, END]):
            landmark = g.sightings[s, LANDMARK]
            part = g.sightings[s, PART]
            if landmark < 0:
                continue
            if part <= FIX:
                e = fix_off(x[0], x[1], x[2], values[landmark, 0], g.fixed, FIX - part)
                total += square_of(g.fixed[FIX - part], 3, e[0], e[1], e[2])
                continue
            m = values[landmark]
            if part == PRIOR:
                for i in range(2):
                    total += g.seen[s, 2 + 2 * i] * (m[i] - g.seen[s, i]) ** 2
                continue
            if part >= 0 and g.seen[s, 4] > 0.0:
                total += g.seen[s, 4] * (m[0] - values[part, 0]) ** 2
                continue
            if part >= 0:
                off = range_off(x[0], x[1], m[0], m[1], values[part, 0], values[part, 1], g.seen[s, 0])[3]
                q = g.seen[s, 2] * off * off
            else:
                q = distance(x[0], x[1], x[2], m[0], m[1], g.seen, s)[4]
            total += loss(g.settings[LOSS], g.settings[SCALE], q)
    for c in range(1, 1 + g.state[GIVEN]):
        total += given_cost(g, c, values)
    return total


@compiled
def given_cost(g: Graph, c: int, values: Array) -> float:
    """Contribution of a part of a given map to J."""
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
