"""Nested dissection by place: what parts a map into halves, the halves into theirs, and so on, is eliminated last.

Minimum degree, which looks at one variable at a time, finds good orders of small graphs. On a large map that is driven
over many times its widest fronts are several times as wide as need be. So the map is cut across its longer side, half
of its variables on each; those that keep factors from reaching across are the separator, and the halves are cut again
(George, "Nested dissection of a regular finite element mesh", SIAM J. Numer. Anal. 10(2), 1973). Within the last parts,
and within separators, minimum degree orders.
"""

import numpy as np

from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from ._graph import END, FIRST, LANDMARK, LINK, LINKS, LOOP, PART, PLACE, SIGHTINGS, TURN, WIDTH, A, B, Graph
from ._quotient import next_link

SMALLEST = 200
"""Variables of a part that is not cut again."""

DEPTH = 12
"""Most cuts, one inside the other."""

CUTS, EDGE = 64, 0.3
"""Cuts that are tried across each axis, and the share of a part's variables that each of its halves gets at least."""

BOTH = 3  # a landmark that is seen from both sides: the sum of 1 and 2, one for each


@compiled
def ranks(g: Graph, names: Ints, kept: int) -> Ints:
    """The rank (n,) of each of the variables `names`, all there are, whose PLACE is its row: lower ones come first.

    It is 0 in the last parts; then come the separators, the innermost first. The first `kept` variables are not
    ordered. All ranks are 0 where there are constant errors, which have factors everywhere.
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
    for s in range(g.state[SIGHTINGS]):
        found = found or g.sightings[s, PART] >= 0
    for k in range(g.state[LINKS]):
        found = found or g.links[k, LOOP] == TURN
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
        if step <= 0.0:
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
        if g.variables[v, WIDTH] != 3:
            continue
        x = g.values[v, axis]
        k = g.variables[v, LINK]
        while k >= 0:
            if g.links[k, A] == v and part[g.variables[g.links[k, B], PLACE]] == p:
                enter(out, x, g.values[g.links[k, B], axis], first, step, 3.0)
            k = next_link(g, k, v)
        for s in range(g.variables[v, FIRST], g.variables[v, END]):
            landmark = g.sightings[s, LANDMARK]
            if landmark >= 0 and g.variables[landmark, WIDTH]:
                j = g.variables[landmark, PLACE]
                span[j, 0], span[j, 1] = min(span[j, 0], x), max(span[j, 1], x)
    for i in some:
        if span[i, 0] < span[i, 1]:
            enter(out, span[i, 0], span[i, 1], first, step, 2.0)
    for c in range(CUTS):
        out[c + 1] += out[c]
    return out[:CUTS]


@compiled
def enter(out: Array, x: float, y: float, first: float, step: float, scalars: float) -> None:
    """Adds what lies between x and y to the first cut between them, and subtracts it from the first beyond."""
    a = min(max(np.ceil((min(x, y) - first) / step), 0.0), float(CUTS))
    b = min(max(np.ceil((max(x, y) - first) / step), 0.0), float(CUTS))
    out[int(a)] += scalars
    out[int(b)] -= scalars


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
        k = g.variables[v, LINK] if g.variables[v, WIDTH] == 3 else -1
        while k >= 0:
            j = g.variables[g.links[k, B] if g.links[k, A] == v else g.links[k, A], PLACE]
            if part[i] == p and part[j] == p and side[i] == 0 and side[j] == 1:
                part[i], out[i] = -1, rank
            k = next_link(g, k, v)
    for i in some:
        v = names[i]
        if g.variables[v, WIDTH] != 3:
            continue
        for s in range(g.variables[v, FIRST], g.variables[v, END]):
            landmark = g.sightings[s, LANDMARK]
            if landmark >= 0 and g.variables[landmark, WIDTH]:
                seen[g.variables[landmark, PLACE]] |= BOTH if part[i] < 0 else 1 + side[i]
    for i in some:
        if g.variables[names[i], WIDTH] != 3:
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
