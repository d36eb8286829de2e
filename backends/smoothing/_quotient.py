"""The quotient graph of an elimination: variables, and elements, which are sets of them (Amestoy, Davis, Duff 1996).

An element is a set of variables that will be in one front: a link, or the separators of a clique, old or new. An
eliminated variable absorbs its elements, and its clique is summed from them; so the order and the tree of cliques
result from one pass. Sightings are not elements: they are known to their pose alone, and a landmark waits until its
poses are eliminated. A factor must be absorbed by a clique that eliminates one of its variables, or it would be counted
again when that clique is opened.

The degree of a variable is bounded from above by the sum over its elements of their variables outside the front just
eliminated. A variable with none outside is eliminated with that front.
"""

from typing import NamedTuple

import numpy as np

from ...core.kernels.compiled import compiled
from ...core.se2 import Ints
from . import _graph
from ._graph import Graph

MOST = 2000
"""Scalars from which degrees are not distinguished, or three times the number of variables if that is more."""

# variables: NAME in the graph; MANY elements from FIRST on; landmarks from SEES up to the next one's; number of poses
# it waits for; its degree, and its links in the list of that degree; the RANK before which it is not eliminated
NAME, WIDTH, FIRST, MANY, SEES, WAITS, DEGREE, LISTED, BEFORE, AFTER, RANK, COLUMNS = range(12)
# LISTED: in a list, or merged with another
LISTED_NOW, MERGED = 1, 2
# elements: KIND, an old clique, a link or a new clique NAMED; in `pool`, COUNT variables from START on; their scalars,
# and how many of these are outside (BESIDE) the front of variable FOR
KIND, NAMED, START, COUNT, SIZE, ALIVE, BESIDE, FOR, FIELDS = range(9)
OLD, BINDING, NEW = range(3)


class Quotient(NamedTuple):
    """The graph; kept variables come first."""

    variables: Ints  # (n + 1, COLUMNS)
    elements: Ints  # (e, FIELDS)
    of: Ints  # the elements of variables
    seen: Ints  # the landmarks of variables
    heads: Ints  # lists by degree, the last of all from there on


@compiled
def longer(numbers: Ints, used: int, more: int) -> Ints:
    """`numbers` with room for `more` after those `used`."""
    if used + more <= len(numbers):
        return numbers
    bigger = np.empty(2 * (used + more), np.int64)
    for i in range(used):
        bigger[i] = numbers[i]
    return bigger


@compiled
def next_link(g: Graph, k: int, v: int) -> int:
    """The link after `k` in variable `v`'s list."""
    return g.links[k, _graph.NEXT_A] if g.links[k, _graph.A] == v else g.links[k, _graph.NEXT_B]


@compiled
def quotient(g: Graph, names: Ints, kept: int, stay: Ints, ranks: Ints) -> tuple[Quotient, Ints, int, int]:
    """The initial graph; the variables of its elements, the size of these, and the number of elements.

    `ranks` has those of the variables `names`, if there are any.
    """
    n, stamp = len(names), g.state[_graph.STAMP]
    V = np.zeros((n + 1, COLUMNS), np.int64)
    numbers = bound = looks = 0
    for t in range(len(stay)):
        numbers += g.cliques[stay[t], _graph.MEMBERS] - g.cliques[stay[t], _graph.FRONTALS]
    for i in range(n):
        v = names[i]
        V[i, NAME], V[i, WIDTH], V[i, BEFORE], V[i, AFTER] = v, g.variables[v, _graph.WIDTH], -1, -1
        V[i, RANK] = ranks[i] if len(ranks) else 0
        if V[i, WIDTH] == 3:
            looks += g.variables[v, _graph.END] - g.variables[v, _graph.FIRST]
            k = g.variables[v, _graph.LINK]
            while k >= 0:
                bound += 1
                k = next_link(g, k, v)
    E = np.zeros((len(stay) + bound + n, FIELDS), np.int64)
    pool, seen = np.empty(numbers + 2 * bound + 16 * n + 64, np.int64), np.empty(2 * looks, np.int64)
    e = top = 0
    for t in range(len(stay)):
        q = g.cliques[stay[t]]
        members, frontals = q[_graph.MEMBERS], q[_graph.FRONTALS]
        begin(E, e, OLD, stay[t], top, members - frontals, q[_graph.SIZE] - q[_graph.FRONT])
        for u in range(q[_graph.LISTED] + frontals, q[_graph.LISTED] + members):
            i = g.variables[g.ints[u], _graph.PLACE]
            pool[top] = i
            V[i, MANY] += 1
            top += 1
        e += 1
    looks = 0
    for i in range(n):
        V[i, SEES] = looks
        v = names[i]
        if V[i, WIDTH] < 3:
            continue
        if i >= kept:
            for s in range(g.variables[v, _graph.FIRST], g.variables[v, _graph.END]):
                landmark = g.sightings[s, _graph.LANDMARK]
                if landmark >= 0 and g.variables[landmark, _graph.WIDTH]:
                    seen[looks] = g.variables[landmark, _graph.PLACE]
                    V[seen[looks], WAITS] += 1
                    looks += 1
                if landmark >= 0 and g.sightings[s, _graph.PART] >= 0:
                    seen[looks] = g.variables[g.sightings[s, _graph.PART], _graph.PLACE]
                    V[seen[looks], WAITS] += 1
                    looks += 1
        k = g.variables[v, _graph.LINK]
        while k >= 0:
            other = g.links[k, _graph.B]
            if g.links[k, _graph.A] == v and g.variables[other, _graph.MARK] == stamp:
                j = g.variables[other, _graph.PLACE]
                begin(E, e, BINDING, k, top, 2, 6)
                pool[top], pool[top + 1] = i, j
                V[i, MANY] += 1
                V[j, MANY] += 1
                top += 2
                e += 1
            k = next_link(g, k, v)
    V[n, SEES] = looks
    for i in range(n):
        V[i + 1, FIRST] = V[i, FIRST] + V[i, MANY] + V[i, WAITS] + 1
        V[i, MANY] = 0
    Q = Quotient(V, E, np.empty(V[n, FIRST], np.int64), seen, np.full(max(MOST, 3 * n) + 1, -1, np.int64))
    for f in range(e):
        for t in range(E[f, START], E[f, START] + E[f, COUNT]):
            i = pool[t]
            Q.of[V[i, FIRST] + V[i, MANY]] = f
            V[i, MANY] += 1
            V[i, DEGREE] += E[f, SIZE] - V[i, WIDTH]
    for i in range(n - 1, kept - 1, -1):
        V[i, DEGREE] += 2 * (V[i + 1, SEES] - V[i, SEES])
    enlist_rank(Q, 0, kept)
    return Q, pool, top, e


@compiled
def enlist_rank(Q: Quotient, rank: int, kept: int) -> None:
    """Lists the variables of a rank that wait for nothing else, by the degrees they have."""
    V = Q.variables
    for i in range(len(V) - 2, kept - 1, -1):
        if V[i, RANK] == rank and V[i, WAITS] == 0 and V[i, LISTED] == 0:
            enlist(Q, i, V[i, DEGREE])


@compiled
def begin(E: Ints, e: int, kind: int, named: int, start: int, count: int, size: int) -> None:
    """Initialises element `e`."""
    E[e, KIND], E[e, NAMED], E[e, START], E[e, COUNT], E[e, SIZE], E[e, ALIVE] = kind, named, start, count, size, 1
    E[e, FOR] = -1


@compiled
def enlist(Q: Quotient, i: int, degree: int) -> None:
    """Puts variable `i` first in the list of its degree."""
    V, d = Q.variables, min(degree, len(Q.heads) - 1)
    V[i, DEGREE], V[i, LISTED], V[i, BEFORE], V[i, AFTER] = d, LISTED_NOW, -1, Q.heads[d]
    if Q.heads[d] >= 0:
        V[Q.heads[d], BEFORE] = i
    Q.heads[d] = i


@compiled
def delist(Q: Quotient, i: int) -> None:
    """Removes variable `i` from its list."""
    V = Q.variables
    before, after = V[i, BEFORE], V[i, AFTER]
    if before >= 0:
        V[before, AFTER] = after
    else:
        Q.heads[V[i, DEGREE]] = after
    if after >= 0:
        V[after, BEFORE] = before
    V[i, LISTED] = 0


@compiled
def absorb(Q: Quotient, p: int, pool: Ints, top: int, near: Ints, gone: Ints) -> tuple[int, int]:
    """Absorbs variable `p`'s elements: their other variables, into pool[top:], have `near` = p.

    Returns their number, and the number of elements in `gone`.
    """
    V, E = Q.variables, Q.elements
    k = n = 0
    near[p] = p
    for t in range(V[p, FIRST], V[p, FIRST] + V[p, MANY]):
        e = Q.of[t]
        if E[e, ALIVE] == 0:
            continue
        E[e, ALIVE] = 0
        gone[n] = e
        n += 1
        for u in range(E[e, START], E[e, START] + E[e, COUNT]):
            i = pool[u]
            if near[i] != p:
                near[i] = p
                pool[top + k] = i
                k += 1
    for t in range(V[p, SEES], V[p + 1, SEES]):
        i = Q.seen[t]
        V[i, WAITS] -= 1
        if near[i] != p:
            near[i] = p
            pool[top + k] = i
            k += 1
    return k, n


@compiled
def measure(Q: Quotient, p: int, front: Ints) -> None:
    """Counts the scalars of each element of the front's variables outside the front."""
    V, E = Q.variables, Q.elements
    for u in range(len(front)):
        i = front[u]
        for t in range(V[i, FIRST], V[i, FIRST] + V[i, MANY]):
            e = Q.of[t]
            if E[e, ALIVE]:
                if E[e, FOR] != p:
                    E[e, FOR], E[e, BESIDE] = p, E[e, SIZE]
                E[e, BESIDE] -= V[i, WIDTH]


@compiled
def review(Q: Quotient, p: int, front: Ints, near: Ints, kept: int, gone: Ints, n: int) -> int:
    """Updates the degrees of the front's variables; a clique with nothing outside the front is absorbed, too."""
    V, E = Q.variables, Q.elements
    for u in range(len(front)):
        i = front[u]
        left = degree = 0
        for t in range(V[i, FIRST], V[i, FIRST] + V[i, MANY]):
            e = Q.of[t]
            if E[e, ALIVE] == 0:
                continue
            if E[e, BESIDE] == 0 and E[e, KIND] != BINDING:
                E[e, ALIVE] = 0
                gone[n] = e
                n += 1
                continue
            Q.of[V[i, FIRST] + left] = e
            left += 1
            degree += E[e, BESIDE]
        V[i, MANY] = left
        for t in range(V[i, SEES], V[i + 1, SEES]):
            if near[Q.seen[t]] != p:
                degree += 2
        if V[i, LISTED] == LISTED_NOW:
            delist(Q, i)
        V[i, DEGREE] = degree
    for u in range(len(front)):
        i = front[u]
        if V[i, DEGREE] == 0 and i >= kept and V[i, WAITS] == 0:
            V[i, LISTED] = MERGED
            for t in range(V[i, FIRST], V[i, FIRST] + V[i, MANY]):
                e = Q.of[t]
                if E[e, ALIVE]:
                    E[e, ALIVE] = 0
                    gone[n] = e
                    n += 1
            for t in range(V[i, SEES], V[i + 1, SEES]):
                V[Q.seen[t], WAITS] -= 1
    return n
