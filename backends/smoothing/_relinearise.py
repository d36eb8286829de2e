"""Moves linearisation points: of all variables that are off by too much, and of the last pose before its elimination.

That pose was initialised by the motion from the estimate of that time, and moved since by its sightings. All factors of
a variable have to be linearised at one point: with two, information appears along unobservable directions, as in an EKF
(Huang, Mourikis and Roumeliotis, IJRR 29(5), 2010). So the clique of the pose before, which has the motion between the
two, is eliminated once more.
"""

import numpy as np
from numpy.typing import NDArray

from ...core.kernels._planar import wrap
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from ._graph import (
    BOUND,
    CHILD,
    EFFORT,
    END,
    ENOUGH,
    FIRST,
    FLAG,
    FRONT,
    FRONTALS,
    LANDMARK,
    LAST,
    LATEST,
    LINK,
    LINKS,
    LISTED,
    LOOP,
    MARK,
    MEMBERS,
    NEAR,
    NEXT,
    NEXT_A,
    NEXT_B,
    PARENT,
    PART,
    POINT,
    RESUM,
    STAMP,
    STEP,
    STEPS,
    TODO,
    VARIABLES,
    WIDTH,
    A,
    B,
    Graph,
)  # fmt: skip
from ._links import relink


@compiled
def settle(g: Graph, order: Ints, path: Array, values: Array) -> tuple[int, int]:
    """Linearises at `path` and `values`; lists what to eliminate again. Returns the work of that, and of everything.

    A link that is no longer positive definite is detected in the factorisation.
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
        work = q[EFFORT]
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
    """Flags the cliques whose own factors have changed: those of variables marked `stamp`, and `shifted` links."""
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
                part = g.sightings[s, PART]
                if landmark >= 0 and part >= 0 and g.variables[part, MARK] == stamp:
                    changed = True
        for t in range(start + members, start + members + g.cliques[c, BOUND]):
            changed = changed or shifted[g.ints[t]]
        if changed:
            g.cliques[c, FLAG] = -1


@compiled
def knows(g: Graph, c: int, v: int) -> bool:
    """Tells if variable `v` is a separator of clique `c`."""
    q = g.cliques[c]
    found = False
    for t in range(q[LISTED] + q[FRONTALS], q[LISTED] + q[MEMBERS]):
        found = found or g.ints[t] == v
    return found


@compiled
def recentre(g: Graph) -> bool:
    """Linearises the last pose at its estimate, if it is off by enough and in the separator of one small clique only.

    False where a link's covariance is not positive definite.
    """
    v, c = g.state[LAST], g.state[NEAR]
    off = 0.0
    for i in range(3):
        d = g.settings[LATEST + i] - g.values[v, i]
        off = max(off, abs(d if i < 2 else wrap(d)))
    if off <= g.settings[ENOUGH]:
        return True
    if c == 0 or g.cliques[c, NEXT] > 0 or g.cliques[c, FRONT] > 3:
        return True
    child = g.cliques[c, CHILD]
    while child > 0:
        if knows(g, child, v):
            return True
        child = g.cliques[child, NEXT]
    for i in range(3):
        g.values[v, i] = g.steps[g.variables[v, STEP], POINT + i] = g.settings[LATEST + i]
    k = g.variables[v, LINK]
    while k >= 0:
        if not relink(g, k):
            return False
        k = g.links[k, NEXT_A] if g.links[k, A] == v else g.links[k, NEXT_B]
    g.todo[g.state[TODO]] = c
    g.state[TODO] += 1
    return True
