"""Elimination ordering: approximate minimum degree on the quotient graph (see `_quotient`)."""

import numpy as np

from ...core.kernels.compiled import compiled
from ...core.se2 import Ints
from ._dissection import ranks
from ._graph import STAMP, Graph, rounded, triangle
from ._opening import concerned, opened, staying
from ._quotient import (
    ALIVE,
    BINDING,
    DEGREE,
    FIRST,
    KIND,
    LISTED,
    MANY,
    MERGED,
    NAME,
    NAMED,
    NEW,
    RANK,
    WAITS,
    WIDTH,
    Quotient,
    absorb,
    begin,
    delist,
    enlist,
    enlist_rank,
    longer,
    measure,
    quotient,
    review,
)  # fmt: skip

HEAD = 6
"""Numbers of a clique in a plan, before its lists."""


@compiled
def write(Q: Quotient, p: int, front: Ints, gone: Ints, lost: int, out: Ints, at: int) -> tuple[int, int, int]:
    """Writes the new clique, which absorbs gone[:lost], to out[at:]: its counts, variables, links and children.

    Returns the end of that, and its frontal and all its scalars.
    """
    V, E = Q.variables, Q.elements
    frontals, bound, size, eliminated = 1, 0, V[p, WIDTH], V[p, WIDTH]
    for u in range(len(front)):
        i = front[u]
        size += V[i, WIDTH]
        if V[i, LISTED] == MERGED:
            frontals += 1
            eliminated += V[i, WIDTH]
    for t in range(lost):
        if E[gone[t], KIND] == BINDING:
            bound += 1
    out[at], out[at + 1], out[at + 2], out[at + 3] = frontals, 1 + len(front), bound, lost - bound
    out[at + 4], out[at + 5] = eliminated, size
    at += HEAD
    out[at] = V[p, NAME]
    a, b = at + 1, at + frontals
    for u in range(len(front)):
        i = front[u]
        if V[i, LISTED] == MERGED:
            out[a] = V[i, NAME]
            a += 1
        else:
            out[b] = V[i, NAME]
            b += 1
    a, c = b, b + bound
    for t in range(lost):
        e = gone[t]
        if E[e, KIND] == BINDING:
            out[a] = E[e, NAMED]
            a += 1
        else:
            out[c] = E[e, NAMED]
            c += 1
    return c, eliminated, size


@compiled
def plan(
    g: Graph, x: int, wanted: Ints, touched: Ints, everything: bool, dissected: bool
) -> tuple[Ints, Ints, int, Ints, Ints]:
    """Orders everything that must be opened for the root to become pose `x` and the landmarks `wanted`.

    Besides the wanted ones, the variables `touched` have new factors, or are new and are to be eliminated. Returns the
    cliques to open; the new ones, one after another: counts of frontals, variables, links and children, frontal scalars
    and all, then variables, links and children, of which -1 - i is the i-th new clique; their number; the root's
    children; and the room needed: integers, numbers, scalars of the widest, work.
    """
    open_ = opened(g, wanted, touched)
    if everything:
        open_ = open_[:0]
        g.state[STAMP] += 1
    names, kept = concerned(g, x, wanted, touched, open_, everything)
    order = ranks(g, names, kept) if everything and dissected else np.zeros(0, np.int64)
    Q, pool, top, count = quotient(g, names, kept, staying(g, open_, everything), order)
    V, E, n = Q.variables, Q.elements, len(names)
    near, gone, room = np.full(n, -1, np.int64), np.empty(len(E), np.int64), np.zeros(4, np.int64)
    out, at, made, least, left, rank = np.empty(16 * n + 64, np.int64), 0, 0, 0, n - kept, 0
    while left > 0:
        while Q.heads[least] < 0:
            least += 1
            if least == len(Q.heads):
                rank += 1
                enlist_rank(Q, rank, kept)
                least = 0
        p = Q.heads[least]
        delist(Q, p)
        pool = longer(pool, top, n)
        k, lost = absorb(Q, p, pool, top, near, gone)
        front = pool[top : top + k]
        measure(Q, p, front)
        lost = review(Q, p, front, near, kept, gone, lost)
        out = longer(out, at, HEAD + 1 + k + lost)
        end, eliminated, size = write(Q, p, front, gone, lost, out, at)
        room[0] += rounded(out[at + 1] + out[at + 2])[1]
        room[1] += rounded(eliminated * (size + 1))[1] + rounded(triangle(size - eliminated))[1]
        room[2] = max(room[2], size)
        room[3] += eliminated * size * size
        at = end
        rest = 0
        for u in range(k):
            i = front[u]
            if V[i, LISTED] == MERGED:
                left -= 1
                continue
            pool[top + rest] = i
            rest += 1
            Q.of[V[i, FIRST] + V[i, MANY]] = count
            V[i, MANY] += 1
            V[i, DEGREE] += size - eliminated - V[i, WIDTH]
            if i >= kept and V[i, WAITS] == 0 and V[i, RANK] <= rank:
                enlist(Q, i, V[i, DEGREE])
                least = min(least, V[i, DEGREE])
        begin(E, count, NEW, -1 - made, top, rest, size - eliminated)
        made += 1
        count += 1
        top += rest
        left -= 1
    lost = 0
    for e in range(count):
        if E[e, ALIVE]:
            gone[lost] = E[e, NAMED]
            lost += 1
    return open_, out[:at], made, gone[:lost], room
