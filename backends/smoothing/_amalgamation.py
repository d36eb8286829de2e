"""Small cliques of a plan are joined with their parents, and the variables of each are sorted.

On a large map each clique eliminates one pose, and most of the time passes in writing and reading update matrices, each
hardly smaller than the next. Joined, two cliques have one, and some zeros in their front (relaxed supernodes: Ashcraft
and Grimes, ACM TOMS 15(4), 1989). Variables are in the order in which they are eliminated, so that the rows of an
update matrix are in the order of its parent's front, and long runs of them are adjacent there.

A plan is its cliques, one after another, children first: the counts of frontals, variables, links and children, the
scalars of the frontals and of all, the work of the cliques that it was joined of; then variables, links and children. A
child of -1 - i is the i-th clique of the plan.
"""

import numpy as np
from numpy.typing import NDArray

from ...core.kernels.compiled import compiled
from ...core.se2 import Ints
from ._graph import PLACE, Graph, rounded, triangle

HEAD = 7
"""Numbers of a clique in a plan, before its lists."""


@compiled
def located(plan: Ints, count: int) -> tuple[Ints, Ints]:
    """The begin of each clique of a plan, and its parent, -1 where that is the root."""
    begins, parent = np.empty(count, np.int64), np.full(count, -1, np.int64)
    at = 0
    for i in range(count):
        begins[i] = at
        first = at + HEAD + plan[at + 1] + plan[at + 2]
        at = first + plan[at + 3]
        for t in range(first, at):
            if plan[t] < 0:
                parent[-1 - plan[t]] = i
    return begins, parent


@compiled
def amalgamated(g: Graph, plan: Ints, count: int, left: Ints, x: int, turn: Ints, zeros: int) -> tuple[Ints, int]:
    """The plan with cliques joined where that makes up to so many `zeros`, and their number; -1: none is.

    `left`, the root's children, are renumbered. `turn` has when each variable is eliminated, by its PLACE. A clique
    next to pose `x` in the root is as it was: `_relinearise.recentre` needs it small.
    """
    begins, parent = located(plan, count)
    fronts, sizes, joined = np.empty(count, np.int64), np.empty(count, np.int64), np.zeros(count, np.bool_)
    for i in range(count):
        at = begins[i]
        fronts[i], sizes[i] = plan[at + 4], plan[at + 5]
        first = at + HEAD + plan[at + 1] + plan[at + 2]
        if parent[i] < 0 and names(plan, int(at), x):
            continue
        for t in range(first, first + plan[at + 3]):
            c = -1 - plan[t]
            if c >= 0 and fronts[c] * (sizes[i] - (sizes[c] - fronts[c])) <= zeros:
                joined[c] = True
                sizes[i] += fronts[c]
                fronts[i] += fronts[c]
    out, end, n = np.empty(len(plan), np.int64), 0, 0
    number, group = np.empty(count, np.int64), np.empty(count, np.int64)
    for i in range(count):
        if joined[i]:
            continue
        number[i] = n
        n += 1
        begin, end = end, write(plan, begins, joined, number, i, group, out, end)
        arrange(g, out, begin + HEAD, out[begin], turn)
        arrange(g, out, begin + HEAD + out[begin], out[begin + 1] - out[begin], turn)
    for t in range(len(left)):
        if left[t] < 0:
            left[t] = -1 - number[-1 - left[t]]
    return out[:end], n


@compiled
def names(plan: Ints, at: int, v: int) -> bool:
    """Tells if `v` is among the separators of the clique at plan[at:]."""
    found = False
    for t in range(at + HEAD + plan[at], at + HEAD + plan[at + 1]):
        found = found or plan[t] == v
    return found


@compiled
def write(
    plan: Ints, begins: Ints, joined: NDArray[np.bool], number: Ints, i: int, group: Ints, out: Ints, at: int
) -> int:
    """Writes clique `i`, with those that are joined with it, to out[at:]; returns its end. `group` is overwritten."""
    group[0], m, k = i, 1, 0
    frontals = bound = children = front = work = 0
    while k < m:
        b = begins[group[k]]
        frontals, bound, front, work = frontals + plan[b], bound + plan[b + 2], front + plan[b + 4], work + plan[b + 6]
        first = b + HEAD + plan[b + 1] + plan[b + 2]
        for t in range(first, first + plan[b + 3]):
            if plan[t] < 0 and joined[-1 - plan[t]]:
                group[m] = -1 - plan[t]
                m += 1
            else:
                children += 1
        k += 1
    b = begins[i]
    members = frontals + plan[b + 1] - plan[b]
    out[at], out[at + 1], out[at + 2], out[at + 3] = frontals, members, bound, children
    out[at + 4], out[at + 5], out[at + 6] = front, plan[b + 5] + front - plan[b + 4], work
    at += HEAD
    links, below = at + members, at + members + bound
    for t in range(b + HEAD + plan[b], b + HEAD + plan[b + 1]):
        out[at + frontals + t - b - HEAD - plan[b]] = plan[t]
    for k in range(m):
        b = begins[group[k]]
        first = b + HEAD
        for t in range(first, first + plan[b]):
            out[at] = plan[t]
            at += 1
        first += plan[b + 1]
        for t in range(first, first + plan[b + 2]):
            out[links] = plan[t]
            links += 1
        first += plan[b + 2]
        for t in range(first, first + plan[b + 3]):
            if plan[t] >= 0:
                out[below] = plan[t]
                below += 1
            elif not joined[-1 - plan[t]]:
                out[below] = -1 - number[-1 - plan[t]]
                below += 1
    return int(below)


@compiled
def arrange(g: Graph, out: Ints, first: int, many: int, turn: Ints) -> None:
    """Sorts `many` variables from out[first] on by their `turn`."""
    for t in range(first + 1, first + many):
        v = out[t]
        when, u = turn[g.variables[v, PLACE]], t
        while u > first and turn[g.variables[out[u - 1], PLACE]] > when:
            out[u] = out[u - 1]
            u -= 1
        out[u] = v


@compiled
def room_of(out: Ints, count: int, room: Ints) -> None:
    """Adds what the cliques of a plan need to `room`: integers, numbers, and the scalars of the widest."""
    at = 0
    for _ in range(count):
        front, size = out[at + 4], out[at + 5]
        room[0] += rounded(out[at + 1] + out[at + 2])[1]
        room[1] += rounded(front * (size + 1))[1] + rounded(triangle(size - front))[1]
        room[2] = max(room[2], size)
        at += HEAD + out[at + 1] + out[at + 2] + out[at + 3]
