"""The forest of cliques: additions by a plain step, and replacement of a part by a new ordering."""

import numpy as np

from ...core.kernels.compiled import compiled
from ...core.se2 import Ints
from ._amalgamation import HEAD, located
from ._graph import (
    BOUND,
    CHILD,
    CLIQUE,
    CLIQUES,
    EFFORT,
    END,
    FACTOR,
    FAR,
    FIRST,
    FLAG,
    FRONT,
    FRONTALS,
    GIVEN,
    GIVEN_INTS,
    GIVEN_REALS,
    INTS,
    LANDMARK,
    LAST,
    LINK,
    LISTED,
    LOOP,
    MARK,
    MEMBERS,
    NEAR,
    NEXT,
    NEXT_B,
    PARENT,
    PART,
    REALS,
    RESUM,
    ROOT,
    SIZE,
    SLOT,
    SPARE,
    STAMP,
    TODO,
    TURN,
    UPDATE,
    WIDEST,
    WIDTH,
    Graph,
    release_ints,
    release_reals,
    reserve_ints,
    reserve_reals,
    triangle,
)  # fmt: skip


@compiled
def new_clique(g: Graph, frontals: int, members: int, bound: int, front: int, size: int, effort: int) -> int:
    """Creates a clique of that many variables, links and scalars, and that work, with empty lists."""
    c = g.state[SPARE]
    if c > 0:
        g.state[SPARE] = g.cliques[c, NEXT]
    else:
        c = g.state[CLIQUES]
        g.state[CLIQUES] = c + 1
    q = g.cliques[c]
    q[PARENT], q[FRONTALS], q[MEMBERS], q[FRONT], q[SIZE], q[BOUND] = 0, frontals, members, front, size, bound
    q[CHILD], q[NEXT], q[FLAG], q[EFFORT] = 0, 0, 0, effort
    q[LISTED] = reserve_ints(g, members + bound)
    q[FACTOR] = reserve_reals(g, front * (size + 1))
    q[UPDATE] = reserve_reals(g, triangle(size - front))
    return c


@compiled
def drop_clique(g: Graph, c: int) -> None:
    """Removes clique `c`."""
    q = g.cliques[c]
    release_ints(g, q[LISTED], q[MEMBERS] + q[BOUND])
    release_reals(g, q[FACTOR], q[FRONT] * (q[SIZE] + 1))
    release_reals(g, q[UPDATE], triangle(q[SIZE] - q[FRONT]))
    q[NEXT] = g.state[SPARE]
    q[SIZE] = 0
    g.state[SPARE] = c


@compiled
def into_root(g: Graph, v: int) -> None:
    """Adds landmark `v` to the root."""
    t = g.state[ROOT]
    g.state[ROOT] = t + 1
    g.root[t] = v
    g.variables[v, SLOT], g.variables[v, CLIQUE] = t, 0
    wide = 2 * len(g.root) + 1
    for i in range(2 * t + 2):
        o = i * wide
        g.rest[o + 2 * t] = g.rest[o + 2 * t + 1] = 0.0
    g.rest[2 * t * wide + wide - 1] = g.rest[(2 * t + 1) * wide + wide - 1] = 0.0


@compiled
def advance(g: Graph, x: int) -> None:
    """Eliminates the last pose in favour of `x`, which sees landmarks of the root and new ones alone."""
    enter(g, x)
    a, stamp = g.state[LAST], g.state[STAMP] + 1
    g.state[STAMP] = stamp
    for s in range(g.variables[a, FIRST], g.variables[a, END]):
        v, part = g.sightings[s, LANDMARK], g.sightings[s, PART]
        if v >= 0:
            g.variables[v, MARK] = stamp
            if part >= 0:
                g.variables[part, MARK] = stamp
    child = g.state[NEAR]
    while child > 0:
        start = g.cliques[child, LISTED]
        for t in range(start + g.cliques[child, FRONTALS], start + g.cliques[child, MEMBERS]):
            g.variables[g.ints[t], MARK] = stamp
        child = g.cliques[child, NEXT]
    n = 0
    for t in range(g.state[ROOT]):
        if g.variables[g.root[t], MARK] == stamp:
            n += 1
    k = g.variables[x, LINK]
    bound = 2 if g.links[k, LOOP] == TURN else 1  # a gyro's turn is linked after the motion
    c = new_clique(g, 1, n + 2, bound, 3, 2 * n + 6, 3 * (2 * n + 6) ** 2)
    g.state[WIDEST] = max(g.state[WIDEST], 2 * n + 6)
    q = g.cliques[c]
    o = q[LISTED]
    g.ints[o] = a
    o += 1
    for t in range(g.state[ROOT]):
        if g.variables[g.root[t], MARK] == stamp:
            g.ints[o] = g.root[t]
            o += 1
    g.ints[o], g.ints[o + 1] = x, k
    if bound == 2:
        g.ints[o + 2] = g.links[k, NEXT_B]
    q[CHILD] = g.state[NEAR]
    child = q[CHILD]
    while child > 0:
        g.cliques[child, PARENT] = c
        child = g.cliques[child, NEXT]
    g.variables[a, CLIQUE] = c
    g.state[NEAR], g.state[LAST] = c, x
    g.todo[g.state[TODO]] = c
    g.state[TODO] += 1


@compiled
def enter(g: Graph, x: int) -> None:
    """Adds the landmarks sighted from pose `x`, and constant errors of these sightings, to the root."""
    for s in range(g.variables[x, FIRST], g.variables[x, END]):
        v, part = g.sightings[s, LANDMARK], g.sightings[s, PART]
        if v >= 0 and g.variables[v, WIDTH] and g.variables[v, SLOT] < 0:
            into_root(g, v)
        if v >= 0 and part >= 0 and g.variables[part, SLOT] < 0:
            into_root(g, part)


@compiled
def clear(g: Graph) -> None:
    """Removes all cliques except a given map's."""
    g.state[CLIQUES], g.state[SPARE] = 1 + g.state[GIVEN], 0
    g.state[INTS], g.state[REALS] = g.state[GIVEN_INTS], g.state[GIVEN_REALS]
    g.free[:] = -1
    g.state[NEAR] = g.state[FAR] = 0
    for c in range(g.state[GIVEN]):
        g.todo[c] = 1 + c
    g.state[TODO] = g.state[GIVEN]


@compiled
def forget_dropped(g: Graph) -> None:
    """Removes deleted cliques from those to be eliminated."""
    n = 0
    for t in range(g.state[TODO]):
        if g.cliques[g.todo[t], SIZE] > 0:
            g.todo[n] = g.todo[t]
            n += 1
    g.state[TODO] = n


@compiled
def rebuild(g: Graph, x: int, wanted: Ints, opened: Ints, plan: Ints, count: int, left: Ints, everything: bool) -> None:
    """Replaces the cliques `opened` by the `count` cliques of `plan`: see `_amalgamation` for its format.

    The root becomes pose `x` and the landmarks `wanted`, with the cliques `left` as its children.
    """
    for t in range(g.state[ROOT]):
        g.variables[g.root[t], SLOT] = -1
    if everything:
        clear(g)
    else:
        for t in range(len(opened)):
            drop_clique(g, opened[t])
        forget_dropped(g)
    made = np.empty(count, np.int64)
    begins, order = neighbourly(plan, count)
    for n in range(count):
        i = order[n]
        at = int(begins[i])
        frontals, members, bound, children = plan[at], plan[at + 1], plan[at + 2], plan[at + 3]
        front, size, effort = plan[at + 4], plan[at + 5], plan[at + 6]
        at += HEAD
        c = new_clique(g, frontals, members, bound, front, size, effort)
        made[i] = c
        o = g.cliques[c, LISTED]
        for t in range(members + bound):
            g.ints[o + t] = plan[at + t]
        for t in range(frontals):
            g.variables[plan[at + t], CLIQUE] = c
        at += members + bound
        for t in range(children):
            child = plan[at + t]
            if child < 0:
                child = made[-1 - child]
            g.cliques[child, PARENT] = c
            g.cliques[child, NEXT] = g.cliques[c, CHILD]
            g.cliques[c, CHILD] = child
        g.todo[g.state[TODO]] = c
        g.state[TODO] += 1
    g.state[ROOT] = g.state[NEAR] = g.state[FAR] = 0
    for t in range(len(wanted)):
        into_root(g, wanted[t])
    g.state[LAST], g.variables[x, CLIQUE] = x, 0
    for t in range(len(left)):
        c = left[t] if left[t] >= 0 else made[-1 - left[t]]
        q = g.cliques[c]
        q[PARENT] = 0
        near = False
        for u in range(q[LISTED] + q[FRONTALS], q[LISTED] + q[MEMBERS]):
            near = near or g.ints[u] == x
        to = NEAR if near else FAR
        q[NEXT] = g.state[to]
        g.state[to] = c
    g.state[RESUM] = 1


@compiled
def neighbourly(plan: Ints, count: int) -> tuple[Ints, Ints]:
    """The begin of each clique of a plan; and their order, each after its children, all below it just before.

    Then what a substitution or an elimination passes one after the other is adjacent in memory.
    """
    begins, parent = located(plan, count)
    below, beside = np.full(count, -1, np.int64), np.empty(count, np.int64)
    order, waiting = np.empty(count, np.int64), np.empty(count, np.int64)
    m, n = 0, count
    for i in range(count):
        if parent[i] < 0:
            waiting[m] = i
            m += 1
        else:
            beside[i], below[parent[i]] = below[parent[i]], i
    while m > 0:
        m -= 1
        n -= 1
        order[n] = waiting[m]
        child = below[order[n]]
        while child >= 0:
            waiting[m] = child
            m += 1
            child = beside[child]
    return begins, order
