"""Elimination ordering: approximate minimum degree on the quotient graph (see `_quotient`), and nested dissection.

Minimum degree, which looks at one variable at a time, finds good orders of small graphs. On a large map that is driven
over many times its widest fronts are several times as wide as need be. So the map is cut by place, half of its
variables on each side; those that keep factors from reaching across are the separator, which is eliminated last, and
the halves are cut again (George, "Nested dissection of a regular finite element mesh", SIAM J. Numer. Anal. 10(2),
1973). Within the last parts, and within separators, minimum degree orders.
"""

import numpy as np

from ...core.kernels._arrays import lent
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from . import _graph
from ._amalgamation import HEAD, amalgamated, room_of
from ._graph import STAMP, VARIABLES, Graph
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
    next_link,
    quotient,
    review,
)  # fmt: skip

ZEROS = 36
"""Entries of [R d] that are zero for want of a factor, at most, where a clique is joined with its parent."""

LARGE = 4000
"""Variables beyond which a graph is large: there, small cliques are joined, and all is ordered anew less often."""

SMALLEST = 200
"""Variables of a part that is not cut again."""

DEPTH = 12
"""Most cuts, one inside the other."""

CUTS, EDGE = 64, 0.3
"""Cuts that are tried across each axis, and the share of a part's variables that each of its halves gets at least."""

BOTH = 3  # a landmark that is seen from both sides: the sum of 1 and 2, one for each


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
    out[at + 4], out[at + 5], out[at + 6] = eliminated, size, eliminated * size * size
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
    cliques to open; the new ones, as `_amalgamation` says; their number; the root's children; and the room needed:
    integers, numbers, scalars of the widest, work.
    """
    open_ = opened(g, wanted, touched)
    if everything:
        open_ = open_[:0]
        g.state[STAMP] += 1
    names, kept = concerned(g, x, wanted, touched, open_, everything)
    order = ranks(g, names, kept) if everything and dissected else np.zeros(0, np.int64)
    owner, pool, top, count = quotient(g, names, kept, staying(g, open_, everything), order)
    Q = Quotient(
        lent(owner.variables), lent(owner.elements), lent(owner.of), lent(owner.seen), lent(owner.heads)
    )  # counting references took a third of the time
    V, E, n = Q.variables, Q.elements, len(names)
    turn, turns = np.arange(n) + 2 * n, 0  # when each is eliminated, the kept ones last
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
        room[3] += eliminated * size * size
        at = end
        rest = 0
        turn[p] = turns
        turns += 1
        for u in range(k):
            i = front[u]
            if V[i, LISTED] == MERGED:
                left -= 1
                turn[i] = turns
                turns += 1
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
        if owner.elements[e, ALIVE]:
            gone[lost] = owner.elements[e, NAMED]
            lost += 1
    zeros = ZEROS if g.state[VARIABLES] > LARGE else -1
    out, made = amalgamated(g, out, made, gone[:lost], x, turn, zeros)
    room_of(out, made, room)
    return open_, out, made, gone[:lost], room


@compiled
def ranks(g: Graph, names: Ints, kept: int) -> Ints:
    """The rank (n,) of each of the variables `names`: lower ones are eliminated first.

    It is 0 in the last parts; then come the separators, the innermost first. `names` are all variables there are, and
    the PLACE of each is its row there. The first `kept` are not ordered. All ranks are 0 where there are constant
    errors, which have factors everywhere.
    """
    n = len(names)
    out, part, side, order = np.zeros(n, np.int64), np.zeros(n, np.int64), np.zeros(n, np.int64), np.arange(n)
    if reaches_everywhere(g):
        return out
    part[:kept] = -1
    seen, span = np.zeros(n, np.int64), np.empty((n, 2))
    most = 2 << DEPTH
    begins, ends, depths = np.empty(most, np.int64), np.empty(most, np.int64), np.zeros(most, np.int64)
    begins[0], ends[0], count, p = kept, n, 1, 0
    while p < count:
        a, b, depth = begins[p], ends[p], depths[p]
        if b - a > SMALLEST and depth < DEPTH:
            some = order[a:b]
            halve(g, names, some, p, part, side, span)
            separate(g, names, some, p, DEPTH - depth, part, side, seen, out)
            middle, end = gather(some, p, count, part, side)
            begins[count], ends[count], depths[count] = a, a + middle, depth + 1
            begins[count + 1], ends[count + 1], depths[count + 1] = a + middle, a + end, depth + 1
            if middle == 0 or middle == end:  # all in one place: there is nothing to cut
                depths[count] = depths[count + 1] = DEPTH
            count += 2
        p += 1
    return out


@compiled
def reaches_everywhere(g: Graph) -> bool:
    """Tells if there are constant errors, of sightings or of a gyro."""
    found = False
    for s in range(g.state[_graph.SIGHTINGS]):
        found = found or g.sightings[s, _graph.PART] >= 0
    for k in range(g.state[_graph.LINKS]):
        found = found or g.links[k, _graph.LOOP] == _graph.TURN
    return found


@compiled
def halve(g: Graph, names: Ints, some: Ints, p: int, part: Ints, side: Ints, span: Array) -> None:
    """Sets the side, 0 or 1, of the variables of part `p`, rows `some`: by the cheapest cut across either axis.

    `span` (n, 2) is overwritten.
    """
    m, least, best, at = len(some), np.inf, 0.0, 0
    along = np.empty(m)
    for axis in range(2):
        for t in range(m):
            along[t] = g.values[names[some[t]], axis]
        along.sort()
        first, last = along[int(EDGE * m)], along[int((1.0 - EDGE) * m)]
        step = (last - first) / CUTS
        if not step > 0.0:
            continue
        crossed = crossing(g, names, some, p, part, axis, first, step, span)
        for c in range(CUTS):
            if crossed[c] < least:
                least, best, at = crossed[c], first + c * step, axis
    for i in some:
        side[i] = 1 if g.values[names[i], at] > best else 0


@compiled
def crossing(
    g: Graph, names: Ints, some: Ints, p: int, part: Ints, axis: int, first: float, step: float, span: Array
) -> Array:
    """The scalars, about, of the separator of each cut: at `first`, and others a `step` apart (m) across the axis."""
    out = np.zeros(CUTS + 1)
    for i in some:
        span[i, 0], span[i, 1] = np.inf, -np.inf
    for i in some:
        v = names[i]
        if g.variables[v, _graph.WIDTH] != 3:
            continue
        x = g.values[v, axis]
        k = g.variables[v, _graph.LINK]
        while k >= 0:
            if g.links[k, _graph.A] == v and part[g.variables[g.links[k, _graph.B], _graph.PLACE]] == p:
                spread(out, x, g.values[g.links[k, _graph.B], axis], first, step, 3.0)
            k = next_link(g, k, int(v))
        for s in range(g.variables[v, _graph.FIRST], g.variables[v, _graph.END]):
            landmark = g.sightings[s, _graph.LANDMARK]
            if landmark >= 0 and g.variables[landmark, _graph.WIDTH]:
                j = g.variables[landmark, _graph.PLACE]
                span[j, 0], span[j, 1] = min(span[j, 0], x), max(span[j, 1], x)
    for i in some:
        if span[i, 0] < span[i, 1]:
            spread(out, span[i, 0], span[i, 1], first, step, 2.0)
    for c in range(CUTS):
        out[c + 1] += out[c]
    return out[:CUTS]


@compiled
def spread(out: Array, x: float, y: float, first: float, step: float, scalars: float) -> None:
    """Adds what lies between x and y to the first cut between them, and subtracts it from the first beyond."""
    out[beyond(min(x, y), first, step)] += scalars
    out[beyond(max(x, y), first, step)] -= scalars


@compiled
def beyond(x: float, first: float, step: float) -> int:
    """The first cut that is not before x, CUTS if there is none; 0 where x is not a number."""
    t = np.ceil((x - first) / step)
    return int(min(t, float(CUTS))) if t > 0.0 else 0


@compiled
def separate(
    g: Graph, names: Ints, some: Ints, p: int, rank: int, part: Ints, side: Ints, seen: Ints, out: Ints
) -> None:
    """Gives a rank, and no part, to what keeps the sides of part `p`, rows `some`, from having factors in common.

    One pose of each link across, the landmarks it sees, and those seen from both sides. Others move to the side they
    are seen from. `seen` (n,) is overwritten.
    """
    for i in some:
        v, seen[i] = names[i], 0
        k = g.variables[v, _graph.LINK] if g.variables[v, _graph.WIDTH] == 3 else -1
        while k >= 0:
            j = g.variables[g.links[k, _graph.B] if g.links[k, _graph.A] == v else g.links[k, _graph.A], _graph.PLACE]
            if part[i] == p and part[j] == p and side[i] == 0 and side[j] == 1:
                part[i], out[i] = -1, rank
            k = next_link(g, k, int(v))
    for i in some:
        v = names[i]
        if g.variables[v, _graph.WIDTH] != 3:
            continue
        for s in range(g.variables[v, _graph.FIRST], g.variables[v, _graph.END]):
            landmark = g.sightings[s, _graph.LANDMARK]
            if landmark >= 0 and g.variables[landmark, _graph.WIDTH]:
                seen[g.variables[landmark, _graph.PLACE]] |= BOTH if part[i] < 0 else 1 + side[i]
    for i in some:
        if g.variables[names[i], _graph.WIDTH] != 3:
            if seen[i] == BOTH:
                part[i], out[i] = -1, rank
            elif seen[i] > 0:
                side[i] = seen[i] - 1


@compiled
def gather(some: Ints, p: int, count: int, part: Ints, side: Ints) -> tuple[int, int]:
    """Sorts what is left of part `p` by sides, which become the parts `count` and the next one; the ends of both."""
    rows, n, middle = some.copy(), 0, 0
    for half in range(2):
        for i in rows:
            if part[i] == p and side[i] == half:
                some[n], part[i] = i, count + half
                n += 1
        if half == 0:
            middle = n
    return middle, n
