"""Covariances of all poses from the factor alone: Takahashi's selected inverse, front by front from the root down.

A clique's part of the inverse follows from [R S] of its frontals and the covariance of its separators, which is a part
of its parent's: with T = R^-1 S, the frontals' is R^-1 R^-T + T C T', and their covariance with the separators -T C. It
is stored for the children in place of their update matrices, which are lost.

The joint marginal of the last pose and a few landmarks needs the cliques between them and the root alone. With the
whole problem's factor R, columns E that select some variables, and Y = R^-T E, their covariance is Y' Y. Rows of Y
differ from zero only on the way from a variable's own clique up to the root: forward substitution goes up from there,
each clique handing what is left on its separators to its parent.
"""

import numpy as np

from ...frontend.compiled import compiled
from ...frontend.se2 import Array, Ints
from ._front import places, solve_rows
from ._graph import (
    BOUND,
    CHILD,
    CLIQUE,
    FACTOR,
    FAR,
    FRONT,
    FRONTALS,
    LAST,
    LISTED,
    LOOP,
    MEMBERS,
    NEAR,
    NEXT,
    PARENT,
    PLACE,
    ROOT,
    SIZE,
    SLOT,
    STEP,
    STEPS,
    UPDATE,
    WIDTH,
    A,
    B,
    Graph,
    graph,
)  # fmt: skip
from ._links import add_turned, inner, moved_on
from ._log import covariance_of, six


@compiled
def invert(R: Array, o: int, w: int, n: int, C: Array) -> None:
    """The upper left of C becomes (R' R)^-1 (n, n); R is upper triangular, its rows of `w` numbers from `o` on."""
    for j in range(n):
        C[j, j] = 1.0 / R[o + j * w + j]
        for i in range(j - 1, -1, -1):
            a = 0.0
            for k in range(i + 1, j + 1):
                a += R[o + i * w + k] * C[k, j]
            C[i, j] = -a / R[o + i * w + i]
    for i in range(n):
        for j in range(i, n):
            a = 0.0
            for k in range(j, n):
                a += C[i, k] * C[j, k]
            C[i, j] = a
    for i in range(n):
        for j in range(i):
            C[i, j] = C[j, i]


@compiled
def hand_down(g: Graph, head: int, C: Array) -> None:
    """Copies the separators' covariances from C to the children from `head` on."""
    c = head
    while c > 0:
        n = places(g, c)
        o = g.cliques[c, UPDATE]
        for i in range(n):
            a = g.spots[i]
            for j in range(i, n):
                g.reals[o] = C[a, g.spots[j]]
                o += 1
            o += 1
        c = g.cliques[c, NEXT]


@compiled
def front_covariance(g: Graph, c: int, C: Array, T: Array) -> None:
    """C (m, m) of clique `c`'s variables; T is scratch."""
    m, f = g.cliques[c, SIZE], g.cliques[c, FRONT]
    s, w = m - f, m + 1
    R, o, u = g.reals, g.cliques[c, FACTOR], g.cliques[c, UPDATE]
    for i in range(f, m):
        for j in range(i, m):
            C[i, j] = C[j, i] = g.reals[u]
            u += 1
        u += 1
    for i in range(f - 1, -1, -1):
        b = o + i * w
        for j in range(s):
            T[i, j] = R[b + f + j]
        for k in range(i + 1, f):
            a = R[b + k]
            for j in range(s):
                T[i, j] -= a * T[k, j]
        a = 1.0 / R[b + i]
        for j in range(s):
            T[i, j] *= a
    for i in range(f):
        for j in range(s):
            C[i, f + j] = 0.0
        for k in range(s):
            a = T[i, k]
            for j in range(s):
                C[i, f + j] -= a * C[f + k, f + j]
        for j in range(s):
            C[f + j, i] = C[i, f + j]
    invert(R, o, w, f, C)
    for i in range(f):
        for j in range(i, f):
            a = C[i, j]
            for k in range(s):
                a -= C[i, f + k] * T[j, k]
            C[i, j] = C[j, i] = a


@compiled
def of_inner(g: Graph, k: int, C: Array, ia: int, ib: int, rows: Array, out: Array) -> None:
    """Covariances of the poses inside link `k`, from that of its two ends, at `ia` and `ib` in C."""
    first, last = g.variables[g.links[k, A], STEP], g.variables[g.links[k, B], STEP]
    inner(g, first, last, rows)
    H, E = np.empty((3, 6)), np.empty((6, 6))
    left = np.empty((3, 3))
    for i in range(6):
        a = ia + i if i < 3 else ib + i - 3
        for j in range(6):
            E[i, j] = C[a, ia + j if j < 3 else ib + j - 3]
    for n in range(last - first - 1):
        row = rows[n]
        for i in range(3):
            for j in range(3):
                H[i, j], H[i, 3 + j] = row[3 * i + j], row[9 + 3 * i + j]
        covariance_of(row, 21, left)
        for i in range(3):
            for j in range(i, 3):
                a = left[i, j]
                for r in range(6):
                    for q in range(6):
                        a += H[i, r] * E[r, q] * H[j, q]
                out[first + 1 + n, i, j] = out[first + 1 + n, j, i] = a


@compiled
def take_out(C: Array, place: int, out: Array) -> None:
    """Copies the 3 rows and columns of C from `place` on to `out`."""
    for i in range(3):
        for j in range(3):
            out[i, j] = C[place + i, place + j]


@compiled
def pose_covariances(g: Graph, order: Ints, widest: int, out: Array) -> None:
    """Covariances of all steps' poses into `out` (T, 3, 3); the root must be factored. Update matrices are lost."""
    m = 2 * g.state[ROOT] + 3
    C, T = np.empty((max(m, widest), max(m, widest))), np.empty((widest, widest))
    rows = np.empty((g.state[STEPS], 27))
    invert(g.work, 0, m + 1, m, C)
    last = g.variables[g.state[LAST], STEP]
    take_out(C, m - 3, out[last])
    for t in range(g.state[ROOT]):
        g.variables[g.root[t], PLACE] = 2 * t
    g.variables[g.state[LAST], PLACE] = m - 3
    hand_down(g, g.state[NEAR], C)
    hand_down(g, g.state[FAR], C)
    for c in order:
        if g.cliques[c, FRONTALS] == 0:
            continue
        front_covariance(g, c, C, T)
        start, members = g.cliques[c, LISTED], g.cliques[c, MEMBERS]
        place = 0
        for t in range(members):
            v = g.ints[start + t]
            g.variables[v, PLACE] = place
            if t < g.cliques[c, FRONTALS] and g.variables[v, WIDTH] == 3:
                take_out(C, place, out[g.variables[v, STEP]])
            place += g.variables[v, WIDTH]
        for t in range(start + members, start + members + g.cliques[c, BOUND]):
            k = g.ints[t]
            a, b = g.links[k, A], g.links[k, B]
            if not g.links[k, LOOP] and g.variables[b, STEP] - g.variables[a, STEP] > 1:
                of_inner(g, k, C, g.variables[a, PLACE], g.variables[b, PLACE], rows, out)
        hand_down(g, g.cliques[c, CHILD], C)
    S = np.empty(6)
    for k in range(last + 1, g.state[STEPS]):  # after the last variable: propagated by the motions
        p, q = g.steps[k - 1], g.steps[k]
        six(out[k - 1], 0, S, 0)
        moved_on(S, p[10] - q[10], q[9] - p[9])
        add_turned(S, np.cos(p[11]), np.sin(p[11]), q, 3)
        covariance_of(S, 0, out[k])


@compiled
def ways(cliques: Ints, first: Ints) -> Ints:
    """The cliques from those in `first` up to the root, children before their parents."""
    found, depth, n = np.empty(64, np.int64), np.empty(64, np.int64), 0
    seen = np.zeros(len(cliques), np.bool_)
    for start in first:
        levels, c = 0, start
        while c > 0:
            levels += 1
            c = cliques[c, PARENT]
        c = start
        while c > 0 and not seen[c]:
            if n == len(found):
                found, depth = np.concatenate((found, found)), np.concatenate((depth, depth))
            found[n], depth[n], seen[c] = c, levels, True
            n += 1
            levels -= 1
            c = cliques[c, PARENT]
    return found[:n][np.argsort(-depth[:n], kind="mergesort")]


@compiled
def substitute(R: Array, o: int, rows: int, size: int, y: Array, first: int) -> None:
    """Solves R' y = b in place for y[:rows]; b's other rows (size - rows) are reduced by it. Rows before `first` are 0.

    R's rows of size + 1 numbers begin at `o`; y is (size, columns).
    """
    columns = y.shape[1]
    for i in range(first, rows):
        b = o + i * (size + 1)
        scale = 1.0 / R[b + i]
        for k in range(columns):
            y[i, k] *= scale
        for j in range(i + 1, size):
            a = R[b + j]
            if a != 0.0:
                for k in range(columns):
                    y[j, k] -= a * y[i, k]


@compiled
def add_products(y: Array, rows: int, first: int, cov: Array) -> None:
    """Adds y' y of rows `first` to `rows` to the lower triangle of `cov`."""
    columns = y.shape[1]
    for i in range(first, rows):
        for k in range(columns):
            a = y[i, k]
            if a != 0.0:
                for j in range(k + 1):
                    cov[k, j] += a * y[i, j]


@compiled
def joint(address: int, landmarks: Ints, pose: Array, at: Array, cov: Array) -> None:
    """Estimates of the last pose that is a variable and of n landmark variables, and their joint covariance.

    Fills pose (3,), at (n, 2) and cov (2n + 3, 2n + 3), the pose last. Changes nothing but scratch.
    """
    g = graph(address)
    n, last = len(landmarks), g.state[LAST]
    columns = 2 * n + 3
    cov[:] = 0.0
    outside, apart = np.empty(n, np.int64), 0
    for t in range(n):
        if g.variables[landmarks[t], SLOT] < 0:
            outside[apart] = g.variables[landmarks[t], CLIQUE]
            apart += 1
    order = ways(g.cliques, outside[:apart])
    starts = np.zeros(len(order) + 1, np.int64)
    for p in range(len(order)):
        starts[p + 1] = starts[p] + g.cliques[order[p], SIZE]
    m = 2 * g.state[ROOT] + 3
    top, below = np.zeros((m, columns)), np.zeros((starts[len(order)], columns))
    spots = np.empty(starts[len(order)], np.int64)
    least = m - 3
    for t in range(n):
        slot = g.variables[landmarks[t], SLOT]
        if slot >= 0:
            top[2 * slot, 2 * t] = top[2 * slot + 1, 2 * t + 1] = 1.0
            least = min(least, 2 * slot)
    for i in range(3):
        top[m - 3 + i, 2 * n + i] = 1.0
    for p in range(len(order)):
        c = order[p]
        q = g.cliques[c]
        mine = below[starts[p] : starts[p + 1]]
        place = 0
        for t in range(q[LISTED], q[LISTED] + q[FRONTALS]):
            for k in range(n):
                if landmarks[k] == g.ints[t]:
                    mine[place, 2 * k] = mine[place + 1, 2 * k + 1] = 1.0
            place += g.variables[g.ints[t], WIDTH]
        substitute(g.reals, q[FACTOR], q[FRONT], q[SIZE], mine, 0)
        add_products(mine, q[FRONT], 0, cov)
        parent = q[PARENT]
        above, offset = top, 0
        if parent == 0:
            for t in range(g.state[ROOT]):
                g.variables[g.root[t], PLACE] = 2 * t
            g.variables[last, PLACE] = m - 3
        else:
            place = 0
            for t in range(g.cliques[parent, LISTED], g.cliques[parent, LISTED] + g.cliques[parent, MEMBERS]):
                g.variables[g.ints[t], PLACE] = place
                place += g.variables[g.ints[t], WIDTH]
            for r in range(p + 1, len(order)):
                if order[r] == parent:
                    offset = starts[r]
            above = below
        for i in range(places(g, c)):
            spot = g.spots[i] + offset
            spots[starts[p] + q[FRONT] + i] = spot
            if parent == 0:
                least = min(least, spot)
            for k in range(columns):
                above[spot, k] += mine[q[FRONT] + i, k]
    substitute(g.work, 0, m, m, top, least)
    add_products(top, m, least, cov)
    for i in range(columns):
        for j in range(i):
            cov[j, i] = cov[i, j]
    y = np.empty(m)
    solve_rows(g.work, 0, m, m, y)
    for i in range(3):
        pose[i] = g.values[last, i] + y[m - 3 + i]
    off = np.empty(starts[len(order)])
    for p in range(len(order) - 1, -1, -1):
        q = g.cliques[order[p]]
        own = off[starts[p] : starts[p + 1]]
        for i in range(q[FRONT], q[SIZE]):
            spot = spots[starts[p] + i]
            own[i] = y[spot] if q[PARENT] == 0 else off[spot]
        solve_rows(g.reals, q[FACTOR], q[FRONT], q[SIZE], own)
    for t in range(n):
        v = landmarks[t]
        slot = g.variables[v, SLOT]
        at[t, 0], at[t, 1] = g.values[v, 0], g.values[v, 1]
        if slot >= 0:
            at[t, 0] += y[2 * slot]
            at[t, 1] += y[2 * slot + 1]
            continue
        for p in range(len(order)):
            if order[p] != g.variables[v, CLIQUE]:
                continue
            place, start = 0, g.cliques[order[p], LISTED]
            for s in range(start, start + g.cliques[order[p], FRONTALS]):
                if g.ints[s] == v:
                    at[t, 0] += off[starts[p] + place]
                    at[t, 1] += off[starts[p] + place + 1]
                place += g.variables[g.ints[s], WIDTH]
