"""Elimination of cliques: a front is summed from factors and children, eliminated, and stored as [R d] and an update.

The root likewise, again at every step, with the last pose last: its offset and its covariance follow from the last
rows. The part of the root from cliques that do not contain the pose is stored summed (`rest`).
"""

import numpy as np

from ...core.kernels._cholesky import factor, row_of, unsigned
from ...core.kernels._lanes import LANES, load, plus, put
from ...core.kernels._planar import information, wrap
from ...core.kernels.compiled import compiled
from ...core.se2 import Array
from ._factors import add_fix, add_held, add_link, add_pose, add_range, add_sighting, add_submap, add_turn, add_walk
from ._graph import (
    BIAS,
    BOUND,
    CHILD,
    DAMPING,
    EFFORT,
    END,
    FACTOR,
    FAILED,
    FAR,
    FIRST,
    FIX,
    FRONT,
    FRONTALS,
    LANDMARK,
    LAST,
    LATEST,
    LISTED,
    LOOP,
    MEMBERS,
    NEAR,
    NEXT,
    PART,
    PLACE,
    PRIOR,
    RESUM,
    ROOT,
    SIZE,
    SUBMAP,
    TODO,
    TURN,
    UPDATE,
    WIDTH,
    WORK,
    A,
    B,
    Graph,
)  # fmt: skip
from ._links import motion_offset


@compiled
def places(g: Graph, c: int) -> int:
    """Writes the rows of clique `c`'s separators in its parent, by their variables' PLACE, to `spots`; their number.

    The second half of `spots` has for each scalar the end of the run of adjacent ones.
    """
    n = 0
    start, half = g.cliques[c, LISTED], len(g.spots) // 2
    for t in range(start + g.cliques[c, FRONTALS], start + g.cliques[c, MEMBERS]):
        v = g.ints[t]
        at = g.variables[v, PLACE]
        for i in range(g.variables[v, WIDTH]):
            g.spots[n] = at + i
            n += 1
    end = n
    for i in range(n - 1, -1, -1):
        if i + 1 < n and g.spots[i + 1] != g.spots[i] + 1:
            end = i + 1
        g.spots[half + i] = end
    return n


@compiled
def add_child(g: Graph, c: int, F: Array, w: int) -> None:
    """Adds clique `c`'s update matrix to front F, whose rows have `w` numbers."""
    n, half = places(g, c), len(g.spots) // 2
    o = g.cliques[c, UPDATE]
    spots, numbers = g.spots, g.reals
    for i in range(n):
        a = spots[i]
        row = unsigned(a * w)
        j = i
        while j < n:
            b, end = spots[j], spots[half + j]
            if a <= b:
                while j + LANES <= end:
                    to, of = row + unsigned(spots[j]), unsigned(o)
                    put(F, to, plus(load(F, to), load(numbers, of)))
                    j, o = j + LANES, o + LANES
                while j < end:  # by their places, as a loop for adjacent ones has a long beginning
                    F[row + unsigned(spots[j])] += numbers[o]
                    j, o = j + 1, o + 1
            else:
                while j < end:
                    F[spots[j] * w + a] += numbers[o]
                    j, o = j + 1, o + 1
        F[a * w + w - 1] += numbers[o]
        o += 1


@compiled
def add_sightings(g: Graph, pose: int, F: Array, w: int) -> None:
    """Adds the sightings from a pose, and its fixes, or its submap, to front F."""
    if g.variables[pose, SUBMAP] > 0:
        add_submap(g, pose, F, w)
        return
    ip = g.variables[pose, PLACE]
    for s in range(g.variables[pose, FIRST], g.variables[pose, END]):
        landmark = g.sightings[s, LANDMARK]
        if landmark >= 0:
            il, part = g.variables[landmark, PLACE] if g.variables[landmark, WIDTH] else -1, g.sightings[s, PART]
            if part >= 0 and g.seen[s, 4] > 0.0:
                add_walk(g, s, F, w, il, g.variables[part, PLACE])
            elif part >= 0:
                add_range(g, s, F, w, ip, il, g.variables[part, PLACE])
            elif part <= FIX:
                add_fix(g, s, F, w, ip, il)
            elif part == PRIOR:
                add_held(g, s, F, w, il)
            else:
                add_sighting(g, s, F, w, ip, il)


@compiled
def add_prior(g: Graph, F: Array, w: int) -> None:
    """Adds the prior at step 0, stored as a motion and its covariance, to front F."""
    p = g.steps[0]
    e = motion_offset(0.0, 0.0, 0.0, p[9], p[10], p[11], p[0], p[1], p[2])
    W = np.empty(6)
    if information(p, 3, W, 0):
        add_pose(W, 0, e[0], e[1], e[2], F, w, g.variables[0, PLACE])
    else:
        g.state[FAILED] = 1


@compiled
def refresh_given(g: Graph, c: int) -> None:
    """Updates the right-hand side of a given map's information to its landmarks' present positions."""
    start, n = g.cliques[c, LISTED], g.cliques[c, MEMBERS]
    o, f = g.cliques[c, UPDATE], g.cliques[c, FACTOR]
    m = 2 * n
    off = g.work  # the root's front is rebuilt after this
    for i in range(m):
        off[i] = g.reals[f + i] - g.values[g.ints[start + i // 2], i % 2]
        off[m + i] = 0.0
    at = o
    for i in range(m):
        for j in range(i, m):
            a = g.reals[at]
            off[m + i] += a * off[j]
            if j > i:
                off[m + j] += a * off[i]
            at += 1
        at += 1
    at = o
    for i in range(m):
        at += m - i
        g.reals[at] = off[m + i]
        at += 1


@compiled
def damp(g: Graph, F: Array, w: int, n: int) -> None:
    """Adds Levenberg's damping to the diagonal of front F's first `n` rows, which are eliminated."""
    for i in range(n):
        F[i * w + i] += g.settings[DAMPING]


@compiled
def eliminate(g: Graph, c: int) -> None:
    """Sums clique `c`'s front and eliminates it."""
    q = g.cliques[c]
    if q[FRONTALS] == 0:
        refresh_given(g, c)
        return
    start, m, front = q[LISTED], q[SIZE], q[FRONT]
    w = row_of(m)
    F = g.work
    F[: m * w] = 0.0
    place = 0
    for t in range(start, start + q[MEMBERS]):
        g.variables[g.ints[t], PLACE] = place
        place += g.variables[g.ints[t], WIDTH]
    for t in range(start, start + q[FRONTALS]):
        v = g.ints[t]
        if g.variables[v, WIDTH] == 3:
            add_sightings(g, v, F, w)
            if v == 0:
                add_prior(g, F, w)
    for t in range(start + q[MEMBERS], start + q[MEMBERS] + q[BOUND]):
        k = g.ints[t]
        ia, ib = g.variables[g.links[k, A], PLACE], g.variables[g.links[k, B], PLACE]
        if g.links[k, LOOP] == TURN:
            add_turn(g, k, F, w, ia + 2, ib + 2, g.variables[g.links[k, BIAS], PLACE])
        else:
            add_link(g, k, F, w, ia, ib)
    child = q[CHILD]
    while child > 0:
        add_child(g, child, F, w)
        child = g.cliques[child, NEXT]
    damp(g, F, w, front)
    g.state[WORK] += q[EFFORT]
    if not factor(F, m, front):
        g.state[FAILED] = 1
        return
    store(g, F, 0, front, m, False, q[FACTOR])
    store(g, F, front, m, m, True, q[UPDATE])


@compiled
def store(g: Graph, F: Array, first: int, last: int, m: int, upper: bool, o: int) -> None:
    """Writes rows `first` to `last` of a front of `m` scalars to `reals` from `o` on, from the diagonal if `upper`."""
    w, numbers = row_of(m), g.reals
    for i in range(first, last):
        many = m - i if upper else m
        a, b = unsigned(o), unsigned(i * w + m - many)
        for j in range(unsigned(many)):
            numbers[a + j] = F[b + j]
        numbers[o + many] = F[i * w + w - 1]
        o += many + 1


@compiled
def sum_rest(g: Graph, w: int) -> None:
    """Sums the root's part from cliques that do not contain its pose; `w` numbers per row."""
    n = 2 * g.state[ROOT]
    for i in range(n):
        g.rest[i * w + i : i * w + n] = 0.0
        g.rest[i * w + w - 1] = 0.0
    for t in range(g.state[ROOT]):
        g.variables[g.root[t], PLACE] = 2 * t
    child = g.state[FAR]
    while child > 0:
        add_child(g, child, g.rest, w)
        child = g.cliques[child, NEXT]


@compiled
def factor_root(g: Graph) -> int:
    """Computes the root's [R d] in `work`, the pose last; returns its number of scalars."""
    n = 2 * g.state[ROOT]
    pose = g.state[LAST]
    m = n + 3
    w = row_of(m)
    wide = 2 * len(g.root) + 1
    F = g.work
    F[: m * w] = 0.0
    for i in range(n):
        a, b = unsigned(i * w), unsigned(i * wide)
        for j in range(unsigned(i), unsigned(n)):
            F[a + j] = g.rest[b + j]
        F[i * w + w - 1] = g.rest[i * wide + wide - 1]
    for t in range(g.state[ROOT]):
        g.variables[g.root[t], PLACE] = 2 * t
    g.variables[pose, PLACE] = n
    child = g.state[NEAR]
    while child > 0:
        add_child(g, child, F, w)
        child = g.cliques[child, NEXT]
    add_sightings(g, pose, F, w)
    if pose == 0:
        add_prior(g, F, w)
    damp(g, F, w, m)
    if not factor(F, m, m):
        g.state[FAILED] = 1
    return m


@compiled
def solve_rows(R: Array, o: int, w: int, rows: int, m: int, y: Array) -> None:
    """Solves R y = d for y[:rows], the rest of y (m,) being known; R's rows of `w` numbers, d last, begin at `o`."""
    one, two, three, four = unsigned(1), unsigned(2), unsigned(3), unsigned(4)
    for i in range(rows - 1, -1, -1):
        b, k, many = o + i * w, unsigned(i + 1), m - 1 - i
        a, fours = unsigned(b) + k, unsigned(many // 4)
        s0 = s1 = s2 = s3 = 0.0  # four sums at a time: a single one waits for each addition
        for t in range(fours):
            j = four * t
            s0 += R[a + j] * y[k + j]
            s1 += R[a + j + one] * y[k + j + one]
            s2 += R[a + j + two] * y[k + j + two]
            s3 += R[a + j + three] * y[k + j + three]
        for j in range(four * fours, unsigned(many)):
            s0 += R[a + j] * y[k + j]
        y[i] = (R[b + w - 1] - (s0 + s1) - (s2 + s3)) / R[b + i]


@compiled
def last_pose(g: Graph, m: int, pose: Array, cov: Array) -> None:
    """The last pose (3,) and its covariance (3, 3), from the root's last rows."""
    last_three(g.work, m, pose, cov)
    v = g.values[g.state[LAST]]
    pose[0], pose[1], pose[2] = v[0] + pose[0], v[1] + pose[1], wrap(v[2] + pose[2])
    for i in range(3):
        g.settings[LATEST + i] = pose[i]


@compiled
def last_three(F: Array, m: int, off: Array, cov: Array) -> None:
    """The last three of `m` scalars, off (3,), and their covariance (3, 3), from [R d]."""
    w = row_of(m)
    o, right = (m - 3) * w + m - 3, (m - 2) * w - 1
    a, b, c, d = F[o], F[o + 1], F[o + 2], F[right]
    e, f, h = F[o + w + 1], F[o + w + 2], F[right + w]
    k, n = F[o + 2 * w + 2], F[right + 2 * w]
    y2 = n / k
    y1 = (h - f * y2) / e
    y0 = (d - b * y1 - c * y2) / a
    off[0], off[1], off[2] = y0, y1, y2
    i0, i1, i2 = 1.0 / a, 1.0 / e, 1.0 / k
    i01, i12 = -b * i0 * i1, -f * i1 * i2
    i02 = -(c * i2 + b * i12) * i0
    cov[0, 0] = i0 * i0 + i01 * i01 + i02 * i02
    cov[1, 1] = i1 * i1 + i12 * i12
    cov[2, 2] = i2 * i2
    cov[0, 1] = cov[1, 0] = i01 * i1 + i02 * i12
    cov[0, 2] = cov[2, 0] = i02 * i2
    cov[1, 2] = cov[2, 1] = i12 * i2


@compiled
def solve(g: Graph, pose: Array, cov: Array) -> bool:
    """Eliminates pending cliques and the root; writes the last pose and its covariance. False where J is flat."""
    for t in range(g.state[TODO]):
        eliminate(g, g.todo[t])
        if g.state[FAILED]:
            return False
    g.state[TODO] = 0
    if g.state[RESUM]:
        sum_rest(g, 2 * len(g.root) + 1)
        g.state[RESUM] = 0
    m = factor_root(g)
    if g.state[FAILED]:
        return False
    last_pose(g, m, pose, cov)
    return True
