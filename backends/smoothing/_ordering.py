"""In which order to eliminate: approximate minimum degree on a quotient graph (Amestoy, Davis and Duff, 1996).

An element of the quotient graph is a set of variables that will be in one front: a link, or what a clique that stays,
or one that is new, has left over. A variable that is eliminated absorbs the elements it is in, and they are what its
clique is summed from; so the order, and which clique is whose child, come out of one pass. Sightings are no elements:
they are known to their pose alone, and a landmark waits until its poses are gone. A factor must be absorbed by a clique
that eliminates one of its variables, or it would be counted again when that clique is opened.

The degree of a variable is bounded from above by the sum over its elements of what they have beside the front that was
just eliminated. A variable with none beside it goes with that front.
"""

from typing import NamedTuple

import numpy as np

from ...frontend.compiled import compiled
from ...frontend.se2 import Ints
from ._graph import (
    CHILD,
    CLIQUE,
    END,
    FAR,
    FIRST,
    FLAG,
    FRONT,
    FRONTALS,
    GIVEN,
    LANDMARK,
    LAST,
    LINK,
    LISTED,
    MARK,
    MEMBERS,
    NEAR,
    NEXT,
    NEXT_A,
    NEXT_B,
    PARENT,
    PLACE,
    ROOT,
    SIZE,
    STAMP,
    VARIABLES,
    WIDTH,
    A,
    B,
    Graph,
    rounded,
    triangle,
)  # fmt: skip

MOST = 2000
"""Scalars from which on degrees are not told apart."""

OLD, BINDING, NEW = range(3)
"""Kinds of elements: a clique that stays, a link, a new clique."""

LISTED_NOW, MERGED = 1, 2
"""Whether a variable is in the lists of degrees, or goes with another."""


class Variables(NamedTuple):
    """The n variables concerned; those that are kept come first."""

    name: Ints  # in the graph
    width: Ints
    first: Ints  # (n + 1,) where its elements are
    many: Ints  # how many they are
    elements: Ints
    sees: Ints  # (n + 1,) where a pose's landmarks are
    seen: Ints
    waits: Ints  # poses that a landmark waits for
    degree: Ints
    listed: Ints
    before: Ints
    after: Ints
    heads: Ints  # (MOST + 1,) lists by degree


class Elements(NamedTuple):
    """The elements: their kind and name, where their variables are, how many these are and of how many scalars."""

    kind: Ints
    name: Ints
    first: Ints
    many: Ints
    size: Ints
    alive: Ints
    beside: Ints  # scalars beside the front that was just eliminated
    stamp: Ints


@compiled
def longer(numbers: Ints, used: int, more: int) -> Ints:
    """`numbers` with room for `more` after those `used`."""
    if used + more <= len(numbers):
        return numbers
    bigger = np.empty(2 * (used + more), np.int64)
    bigger[:used] = numbers[:used]
    return bigger


@compiled
def opened(g: Graph, wanted: Ints, touched: Ints) -> Ints:
    """The cliques from those that eliminated these variables up to the root, flagged with a new stamp."""
    stamp = g.state[STAMP] + 1
    g.state[STAMP] = stamp
    out, n = np.empty(64, np.int64), 0
    for some in (wanted, touched):
        for t in range(len(some)):
            c = g.variables[some[t], CLIQUE]
            while c > 0 and g.cliques[c, FLAG] != stamp:
                g.cliques[c, FLAG] = stamp
                out = longer(out, n, 1)
                out[n] = c
                n += 1
                c = g.cliques[c, PARENT]
    return out[:n]


@compiled
def take(g: Graph, v: int, out: Ints, n: int) -> int:
    """Variable `v` is concerned, if it was not yet; how many are."""
    if g.variables[v, MARK] == g.state[STAMP]:
        return n
    g.variables[v, MARK], g.variables[v, PLACE] = g.state[STAMP], n
    out[n] = v
    return n + 1


@compiled
def concerned(g: Graph, x: int, wanted: Ints, touched: Ints, open_: Ints, everything: bool) -> tuple[Ints, int]:
    """The variables to order: `wanted` and `x`, which are kept, first; how many these are."""
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
    if everything:
        return np.arange(1, 1 + g.state[GIVEN])
    stamp = g.state[STAMP]
    out, n = np.empty(64, np.int64), 0
    for t in range(-2, len(open_)):
        c = g.cliques[open_[t], CHILD] if t >= 0 else g.state[NEAR if t == -1 else FAR]
        while c > 0:
            if g.cliques[c, FLAG] != stamp:
                out = longer(out, n, 1)
                out[n] = c
                n += 1
            c = g.cliques[c, NEXT]
    return out[:n]


@compiled
def here(g: Graph, v: int) -> int:
    """The place of variable `v` among those concerned, or -1."""
    return g.variables[v, PLACE] if g.variables[v, MARK] == g.state[STAMP] else -1


@compiled
def next_link(g: Graph, k: int, v: int) -> int:
    """The link after `k` in variable `v`'s list."""
    return g.links[k, NEXT_A] if g.links[k, A] == v else g.links[k, NEXT_B]


@compiled
def quotient(g: Graph, names: Ints, kept: int, stay: Ints) -> tuple[Variables, Elements, Ints, int, int]:
    """The graph to begin with; the variables of its elements, how many numbers that is, and how many elements."""
    n = len(names)
    sees, waits = np.zeros(n + 1, np.int64), np.zeros(n, np.int64)
    count, width = np.zeros(n, np.int64), np.zeros(n, np.int64)
    numbers = bound = looks = 0
    for t in range(len(stay)):
        numbers += g.cliques[stay[t], MEMBERS] - g.cliques[stay[t], FRONTALS]
    for i in range(n):
        v = names[i]
        width[i] = g.variables[v, WIDTH]
        if width[i] == 3:
            looks += g.variables[v, END] - g.variables[v, FIRST]
            k = g.variables[v, LINK]
            while k >= 0:
                bound += 1
                k = next_link(g, k, v)
    most = len(stay) + bound + n
    pool = np.empty(numbers + 2 * bound + 16 * n + 64, np.int64)
    seen = np.empty(looks, np.int64)
    E = Elements(
        np.empty(most, np.int64), np.empty(most, np.int64), np.empty(most, np.int64), np.zeros(most, np.int64),
        np.zeros(most, np.int64), np.zeros(most, np.int64), np.zeros(most, np.int64), np.full(most, -1, np.int64),
    )  # fmt: skip
    e = top = 0
    for t in range(len(stay)):
        q = g.cliques[stay[t]]
        E.kind[e], E.name[e], E.first[e], E.alive[e] = OLD, stay[t], top, 1
        E.many[e], E.size[e] = q[MEMBERS] - q[FRONTALS], q[SIZE] - q[FRONT]
        for u in range(q[LISTED] + q[FRONTALS], q[LISTED] + q[MEMBERS]):
            pool[top] = g.variables[g.ints[u], PLACE]
            count[pool[top]] += 1
            top += 1
        e += 1
    looks = 0
    for i in range(n):
        sees[i] = looks
        v = names[i]
        if width[i] < 3:
            continue
        if i >= kept:
            for s in range(g.variables[v, FIRST], g.variables[v, END]):
                landmark = g.sightings[s, LANDMARK]
                if landmark >= 0 and g.variables[landmark, WIDTH]:
                    seen[looks] = g.variables[landmark, PLACE]
                    waits[seen[looks]] += 1
                    looks += 1
        k = g.variables[v, LINK]
        while k >= 0:
            j = here(g, g.links[k, B])
            if g.links[k, A] == v and j >= 0:
                E.kind[e], E.name[e], E.first[e], E.many[e], E.size[e], E.alive[e] = BINDING, k, top, 2, 6, 1
                pool[top], pool[top + 1] = i, j
                count[i] += 1
                count[j] += 1
                top += 2
                e += 1
            k = next_link(g, k, v)
    sees[n] = looks
    first = np.zeros(n + 1, np.int64)
    for i in range(n):
        first[i + 1] = first[i] + count[i] + waits[i] + 1
        count[i] = 0
    elements, degree = np.empty(first[n], np.int64), np.zeros(n, np.int64)
    for f in range(e):
        for t in range(E.first[f], E.first[f] + E.many[f]):
            i = pool[t]
            elements[first[i] + count[i]] = f
            count[i] += 1
            degree[i] += E.size[f] - width[i]
    V = Variables(
        names, width, first, count, elements, sees, seen, waits, degree, np.zeros(n, np.int64),
        np.full(n, -1, np.int64), np.full(n, -1, np.int64), np.full(MOST + 1, -1, np.int64),
    )  # fmt: skip
    for i in range(n - 1, kept - 1, -1):
        if waits[i] == 0:
            enlist(V, i, degree[i] + 2 * (sees[i + 1] - sees[i]))
    return V, E, pool, top, e


@compiled
def enlist(V: Variables, i: int, degree: int) -> None:
    """Variable `i` is first in the list of its degree."""
    d = min(degree, MOST)
    V.degree[i], V.listed[i], V.before[i], V.after[i] = d, LISTED_NOW, -1, V.heads[d]
    if V.heads[d] >= 0:
        V.before[V.heads[d]] = i
    V.heads[d] = i


@compiled
def delist(V: Variables, i: int) -> None:
    """Variable `i` is in no list."""
    if V.before[i] >= 0:
        V.after[V.before[i]] = V.after[i]
    else:
        V.heads[V.degree[i]] = V.after[i]
    if V.after[i] >= 0:
        V.before[V.after[i]] = V.before[i]
    V.listed[i] = 0


@compiled
def absorb(V: Variables, E: Elements, p: int, pool: Ints, top: int, near: Ints, gone: Ints) -> tuple[int, int]:
    """Variable `p`'s elements are no more: their other variables, into pool[top:], have `near` = p.

    Returns how many those are, and how many elements `gone` has.
    """
    k = n = 0
    near[p] = p
    for t in range(V.first[p], V.first[p] + V.many[p]):
        e = V.elements[t]
        if E.alive[e] == 0:
            continue
        E.alive[e] = 0
        gone[n] = e
        n += 1
        for u in range(E.first[e], E.first[e] + E.many[e]):
            i = pool[u]
            if near[i] != p:
                near[i] = p
                pool[top + k] = i
                k += 1
    for t in range(V.sees[p], V.sees[p + 1]):
        i = V.seen[t]
        V.waits[i] -= 1
        if near[i] != p:
            near[i] = p
            pool[top + k] = i
            k += 1
    return k, n


@compiled
def measure(V: Variables, E: Elements, p: int, front: Ints) -> None:
    """How many scalars each element of the front's variables has beside it."""
    for u in range(len(front)):
        i = front[u]
        for t in range(V.first[i], V.first[i] + V.many[i]):
            e = V.elements[t]
            if E.alive[e]:
                if E.stamp[e] != p:
                    E.stamp[e], E.beside[e] = p, E.size[e]
                E.beside[e] -= V.width[i]


@compiled
def review(V: Variables, E: Elements, p: int, front: Ints, near: Ints, kept: int, gone: Ints, n: int) -> int:
    """The degrees of the front's variables beside it; a clique that has nothing beside it is absorbed, too."""
    for u in range(len(front)):
        i = front[u]
        left = degree = 0
        for t in range(V.first[i], V.first[i] + V.many[i]):
            e = V.elements[t]
            if E.alive[e] == 0:
                continue
            if E.beside[e] == 0 and E.kind[e] != BINDING:
                E.alive[e] = 0
                gone[n] = e
                n += 1
                continue
            V.elements[V.first[i] + left] = e
            left += 1
            degree += E.beside[e]
        V.many[i] = left
        for t in range(V.sees[i], V.sees[i + 1]):
            if near[V.seen[t]] != p:
                degree += 2
        if V.listed[i] == LISTED_NOW:
            delist(V, i)
        V.degree[i] = degree
    for u in range(len(front)):
        i = front[u]
        if V.degree[i] == 0 and i >= kept and V.waits[i] == 0:
            V.listed[i] = MERGED
            for t in range(V.first[i], V.first[i] + V.many[i]):
                e = V.elements[t]
                if E.alive[e]:
                    E.alive[e] = 0
                    gone[n] = e
                    n += 1
            for t in range(V.sees[i], V.sees[i + 1]):
                V.waits[V.seen[t]] -= 1
    return n


@compiled
def write(V: Variables, E: Elements, p: int, front: Ints, gone: Ints, out: Ints, at: int) -> tuple[int, int, int]:
    """Write the new clique to out[at:]: its counts, variables, links and children.

    Returns where that ends, and its frontal and all its scalars.
    """
    frontals, bound, size, eliminated = 1, 0, V.width[p], V.width[p]
    for i in front:
        size += V.width[i]
        if V.listed[i] == MERGED:
            frontals += 1
            eliminated += V.width[i]
    for e in gone:
        if E.kind[e] == BINDING:
            bound += 1
    out[at], out[at + 1], out[at + 2], out[at + 3] = frontals, 1 + len(front), bound, len(gone) - bound
    out[at + 4], out[at + 5] = eliminated, size
    at += 6
    out[at] = V.name[p]
    a, b = at + 1, at + frontals
    for i in front:
        if V.listed[i] == MERGED:
            out[a] = V.name[i]
            a += 1
        else:
            out[b] = V.name[i]
            b += 1
    a, c = b, b + bound
    for e in gone:
        if E.kind[e] == BINDING:
            out[a] = E.name[e]
            a += 1
        else:
            out[c] = E.name[e]
            c += 1
    return c, eliminated, size


@compiled
def plan(g: Graph, x: int, wanted: Ints, touched: Ints, everything: bool) -> tuple[Ints, Ints, int, Ints, Ints]:
    """Order what has to be opened for the root to become pose `x` and the landmarks `wanted`.

    Besides the wanted ones, the variables `touched` have new factors, or are new and are to be eliminated. Returns the
    cliques to open; the new ones, one after another: counts of frontals, variables, links and children, frontal
    scalars and all, then variables, links and children, of which -1 - i is the i-th new clique; how many they are; the
    root's children; and what room they need: integers, numbers, scalars of the widest, work.
    """
    open_ = opened(g, wanted, touched) if not everything else np.zeros(0, np.int64)
    if everything:
        g.state[STAMP] += 1
    names, kept = concerned(g, x, wanted, touched, open_, everything)
    V, E, pool, top, count = quotient(g, names, kept, staying(g, open_, everything))
    n = len(names)
    near, gone, room = np.full(n, -1, np.int64), np.empty(len(E.kind), np.int64), np.zeros(4, np.int64)
    out, at, made, least, left = np.empty(16 * n + 64, np.int64), 0, 0, 0, n - kept
    while left > 0:
        while V.heads[least] < 0:
            least += 1
        p = V.heads[least]
        delist(V, p)
        pool = longer(pool, top, n)
        k, lost = absorb(V, E, p, pool, top, near, gone)
        front = pool[top : top + k]
        measure(V, E, p, front)
        lost = review(V, E, p, front, near, kept, gone, lost)
        out = longer(out, at, 7 + k + lost)
        end, eliminated, size = write(V, E, p, front, gone[:lost], out, at)
        room[0] += rounded(out[at + 1] + out[at + 2])[1]
        room[1] += rounded(eliminated * (size + 1))[1] + rounded(triangle(size - eliminated))[1]
        room[2] = max(room[2], size)
        room[3] += eliminated * size * size
        at = end
        rest = 0
        for u in range(k):
            i = front[u]
            if V.listed[i] == MERGED:
                left -= 1
                continue
            pool[top + rest] = i
            rest += 1
            V.elements[V.first[i] + V.many[i]] = count
            V.many[i] += 1
            if i >= kept and V.waits[i] == 0:
                enlist(V, i, int(size - eliminated - V.width[i] + V.degree[i]))
                least = min(least, V.degree[i])
        E.kind[count], E.name[count], E.first[count], E.alive[count] = NEW, -1 - made, top, 1
        E.many[count], E.size[count] = rest, size - eliminated
        made += 1
        count += 1
        top += rest
        left -= 1
    lost = 0
    for e in range(count):
        if E.alive[e]:
            gone[lost] = E.name[e]
            lost += 1
    return open_, out[:at], made, gone[:lost], room
