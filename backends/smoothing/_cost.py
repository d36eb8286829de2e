"""J of a path and of variables."""

import numpy as np

from ...core.kernels._planar import information, inverse, wrap
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


# Entries of a path, not rows of it: a view of a row costs a reference count.
@compiled
def motion_cost(path: Array, i: int, j: int, motion: Array, k: int, covariance: int) -> float:
    """The squared Mahalanobis distance of the way from path[i] to path[j] from motion[k : k + 3].

    Its covariance is from `covariance` on.
    """
    e0, e1, e2, c, s = motion_offset(
        path[i, 0], path[i, 1], path[i, 2], path[j, 0], path[j, 1], path[j, 2],
        motion[k], motion[k + 1], motion[k + 2],
    )  # fmt: skip
    f = covariance
    definite, W = inverse(motion[f], motion[f + 1], motion[f + 2], motion[f + 3], motion[f + 4], motion[f + 5])
    if not definite:
        return np.inf
    e0, e1 = c * e0 + s * e1, c * e1 - s * e0
    return W[0] * e0 * e0 + W[3] * e1 * e1 + W[5] * e2 * e2 + 2 * (W[1] * e0 * e1 + W[2] * e0 * e2 + W[4] * e1 * e2)


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
            total += motion_cost(path, k - 1, k, g.steps[k], DELTA, NOISE)
    for k in range(g.state[LINKS]):
        if g.links[k, LOOP]:
            first, last = g.variables[g.links[k, A], STEP], g.variables[g.links[k, B], STEP]
            L = g.linked[k]
            if g.links[k, LOOP] == TURN:
                total += L[MOTION + 2] * turn_off(path[first, 2], path[last, 2], values[g.links[k, BIAS], 0], L) ** 2
                continue
            q = motion_cost(path, first, last, L, MOTION, COVARIANCE)
            total += L[WEIGHT] * loss(g.settings[LOSS], g.settings[SCALE], q)
    for v in range(g.state[VARIABLES]):
        if g.variables[v, WIDTH] != 3:
            continue
        k = g.variables[v, STEP]
        if g.variables[v, SUBMAP] > 0:
            total += submap_cost(g, v, path[k], values)
            continue
        x, y, heading = path[k, 0], path[k, 1], path[k, 2]
        for s in range(g.variables[v, FIRST], g.variables[v, END]):
            landmark = g.sightings[s, LANDMARK]
            part = g.sightings[s, PART]
            if landmark < 0:
                continue
            if part <= FIX:
                e = fix_off(x, y, heading, values[landmark, 0], g.fixed, FIX - part)
                total += square_of(g.fixed[FIX - part], 3, e[0], e[1], e[2])
                continue
            mx, my = values[landmark, 0], values[landmark, 1]
            if part == PRIOR:
                total += g.seen[s, 2] * (mx - g.seen[s, 0]) ** 2
                total += g.seen[s, 4] * (my - g.seen[s, 1]) ** 2
                continue
            if part >= 0 and g.seen[s, 4] > 0.0:
                total += g.seen[s, 4] * (mx - values[part, 0]) ** 2
                continue
            if part >= 0:
                off = range_off(x, y, mx, my, values[part, 0], values[part, 1], g.seen[s, 0])[3]
                q = g.seen[s, 2] * off * off
            else:
                q = distance(x, y, heading, mx, my, g.seen, s)[4]
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
