"""Covariances of all poses from the factor alone: Takahashi's selected inverse, front by front from the root down.

A clique's part of the inverse follows from [R S] of its frontals and the covariance of its separators, which is a part
of its parent's: with T = R^-1 S, the frontals' is R^-1 R^-T + T C T', and their covariance with the separators -T C. It
is stored for the children in place of their update matrices, which are lost.
"""

import numpy as np

from ...frontend.compiled import compiled
from ...frontend.se2 import Array, Ints
from ._front import places
from ._graph import (
    BOUND,
    CHILD,
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
    PLACE,
    ROOT,
    SIZE,
    STEP,
    STEPS,
    UPDATE,
    WIDTH,
    A,
    B,
    Graph,
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
