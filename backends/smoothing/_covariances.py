"""Covariances of all poses from the factor alone: Takahashi's selected inverse, front by front from the root down.

A clique's part of the inverse follows from [R S] of its frontals and the covariance of its separators, which is a part
of its parent's: with T = R^-1 S, the frontals' is R^-1 R^-T + T C T', and their covariance with the separators -T C. It
is stored for the children in place of their update matrices, which are lost.

The joint marginal of the last pose and a few landmarks needs the cliques between them and the root alone. With the
whole problem's factor R, columns E that select some variables, and Y = R^-T E, their covariance is Y' Y. Rows of Y
differ from zero only on the way from a variable's own clique up to the root: forward substitution goes up from there,
each clique handing what is left on its separators to its parent. The offsets of these variables are Y' d.
"""

import numpy as np

from ...core.kernels._cholesky import row_of, unsigned
from ...core.kernels._planar import add_turned, levered
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from ._front import places
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
from ._links import inner
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
def of_inner(g: Graph, k: int, C: Array, ia: int, ib: int, rows: Array, out: Array) -> bool:
    """Covariances of the poses inside link `k`, from that of its two ends, at `ia` and `ib` in C.

    False where its motions have no covariance.
    """
    first, last = g.variables[g.links[k, A], STEP], g.variables[g.links[k, B], STEP]
    if not inner(g, first, last, rows):
        return False
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
    return True


@compiled
def take_out(C: Array, place: int, out: Array) -> None:
    """Copies the 3 rows and columns of C from `place` on to `out`."""
    for i in range(3):
        for j in range(3):
            out[i, j] = C[place + i, place + j]


@compiled
def pose_covariances(g: Graph, order: Ints, widest: int, out: Array) -> bool:
    """Covariances of all steps' poses into `out` (T, 3, 3); the root must be factored. Update matrices are lost.

    False where the motions between two have no covariance.
    """
    m = 2 * g.state[ROOT] + 3
    C, T = np.empty((max(m, widest), max(m, widest))), np.empty((widest, widest))
    rows = np.empty((g.state[STEPS], 27))
    invert(g.work, 0, row_of(m), m, C)
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
            if g.links[k, LOOP] or g.variables[b, STEP] - g.variables[a, STEP] == 1:
                continue
            if not of_inner(g, k, C, g.variables[a, PLACE], g.variables[b, PLACE], rows, out):
                return False
        hand_down(g, g.cliques[c, CHILD], C)
    S = np.empty(6)
    for k in range(last + 1, g.state[STEPS]):  # after the last variable: propagated by the motions
        p, q = g.steps[k - 1], g.steps[k]
        six(out[k - 1], 0, S, 0)
        levered(S, p[10] - q[10], q[9] - p[9])
        add_turned(S, np.cos(p[11]), np.sin(p[11]), q, 3)
        covariance_of(S, 0, out[k])
    return True


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
def substitute(R: Array, o: int, rows: int, size: int, y: Array) -> None:
    """Solves R' y = b in place for y[:rows]; b's other rows (size - rows) are reduced by it.

    R's rows of size + 1 numbers begin at `o`; y is (size, columns).
    """
    columns = y.shape[1]
    for i in range(rows):
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
def add_products(y: Array, R: Array, o: int, rows: int, size: int, off: Array, cov: Array) -> None:
    """Adds y' y of the first `rows` of y (size, columns) to the lower triangle of `cov`, and y' d to `off`.

    d is the last column of R's rows of size + 1 numbers, which begin at `o`.
    """
    columns = y.shape[1]
    for i in range(rows):
        d = R[o + i * (size + 1) + size]
        for k in range(columns):
            a = y[i, k]
            if a != 0.0:
                off[k] += a * d
                for j in range(k + 1):
                    cov[k, j] += a * y[i, j]


@compiled
def substitute_two(R: Array, m: int, y: Array, z: Array, first: int) -> None:
    """Solves R' y = b and R' z = c in place for y and z (m,), which are zero before `first`; R is a factored front.

    Four rows of R at a time, so that the rest of y and z is read and written once for four.
    """
    w, i = row_of(m), first
    while i < m:
        last = min(i + 4, m)
        for r in range(i, last):
            b = r * w
            for j in range(i, r):
                y[r] -= y[j] * R[j * w + r]
                z[r] -= z[j] * R[j * w + r]
            scale = 1.0 / R[b + r]
            y[r] *= scale
            z[r] *= scale
        if last < m:
            o = unsigned(i * w)
            o1, o2, o3 = o + unsigned(w), o + unsigned(2 * w), o + unsigned(3 * w)
            a0, a1, a2, a3, b0, b1, b2, b3 = y[i], y[i + 1], y[i + 2], y[i + 3], z[i], z[i + 1], z[i + 2], z[i + 3]
            for j in range(unsigned(last), unsigned(m)):
                y[j] -= a0 * R[o + j] + a1 * R[o1 + j] + a2 * R[o2 + j] + a3 * R[o3 + j]
                z[j] -= b0 * R[o + j] + b1 * R[o1 + j] + b2 * R[o2 + j] + b3 * R[o3 + j]
        i = last


@compiled
def product(y: Array, z: Array, first: int) -> float:
    """The product of y and z (m,) from `first` on."""
    s0 = s1 = s2 = s3 = 0.0  # four sums at a time: a single one waits for each addition
    i, m = first, len(y)
    while i + 3 < m:
        s0 += y[i] * z[i]
        s1 += y[i + 1] * z[i + 1]
        s2 += y[i + 2] * z[i + 2]
        s3 += y[i + 3] * z[i + 3]
        i += 4
    while i < m:
        s0 += y[i] * z[i]
        i += 1
    return (s0 + s1) + (s2 + s3)


@compiled
def below_root(g: Graph, landmarks: Ints, top: Array, first: Ints, off: Array, cov: Array) -> None:
    """The part of the cliques below the root in `joint`: adds to `off` (columns,) and `cov`, and fills `top`.

    `top` (columns + 1, m) gets what is left on the root's variables, `first` the first of these for each column.
    """
    n, outside, apart = len(landmarks), np.empty(len(landmarks), np.int64), 0
    for t in range(n):
        if g.variables[landmarks[t], SLOT] < 0:
            outside[apart] = g.variables[landmarks[t], CLIQUE]
            apart += 1
    if apart == 0:
        return
    order, columns = ways(g.cliques, outside[:apart]), len(off)
    starts = np.zeros(len(order) + 1, np.int64)
    for p in range(len(order)):
        starts[p + 1] = starts[p] + g.cliques[order[p], SIZE]
    below = np.zeros((starts[len(order)], columns))
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
        substitute(g.reals, q[FACTOR], q[FRONT], q[SIZE], mine)
        add_products(mine, g.reals, q[FACTOR], q[FRONT], q[SIZE], off, cov)
        parent = q[PARENT]
        if parent == 0:
            for t in range(g.state[ROOT]):
                g.variables[g.root[t], PLACE] = 2 * t
            g.variables[g.state[LAST], PLACE] = top.shape[1] - 3
            for i in range(places(g, c)):
                spot = g.spots[i]
                for k in range(columns):
                    left = mine[q[FRONT] + i, k]
                    if left != 0.0:
                        top[k, spot] += left
                        first[k] = min(first[k], spot)
            continue
        place, offset = 0, 0
        for t in range(g.cliques[parent, LISTED], g.cliques[parent, LISTED] + g.cliques[parent, MEMBERS]):
            g.variables[g.ints[t], PLACE] = place
            place += g.variables[g.ints[t], WIDTH]
        for r in range(p + 1, len(order)):
            if order[r] == parent:
                offset = starts[r]
        for i in range(places(g, c)):
            for k in range(columns):
                below[g.spots[i] + offset, k] += mine[q[FRONT] + i, k]


@compiled
def joint(address: int, landmarks: Ints, latest: Array, latest_cov: Array, at: Array, cov: Array) -> None:
    """Estimates of n landmark variables, and their joint covariance with the latest pose.

    Fills `at` (n, 2) and `cov` (2n + 3, 2n + 3), the pose last. `latest` (3,) and its covariance (3, 3) follow from the
    last pose that is a variable by motions. Changes nothing but scratch.
    """
    g = graph(address)
    n, m, last = len(landmarks), 2 * g.state[ROOT] + 3, g.state[LAST]
    columns, w = 2 * n + 3, row_of(m)
    cov[:] = 0.0
    top, first, off = np.zeros((columns + 1, m)), np.full(columns + 1, m - 3), np.zeros(columns)
    for t in range(n):
        slot = g.variables[landmarks[t], SLOT]
        if slot >= 0:
            top[2 * t, 2 * slot] = top[2 * t + 1, 2 * slot + 1] = 1.0
            first[2 * t] = first[2 * t + 1] = 2 * slot
    for i in range(3):
        top[2 * n + i, m - 3 + i] = 1.0
    below_root(g, landmarks, top, first, off, cov)
    for k in range(0, columns, 2):
        first[k] = first[k + 1] = min(first[k], first[k + 1])
        substitute_two(g.work, m, top[k], top[k + 1], first[k])
    for k in range(columns):
        for j in range(k + 1):
            cov[k, j] += product(top[k], top[j], max(first[k], first[j]))
        for i in range(first[k], m):
            off[k] += top[k, i] * g.work[i * w + w - 1]
    for t in range(n):
        for i in range(2):
            at[t, i] = g.values[landmarks[t], i] + off[2 * t + i]
    pose = 2 * n
    gx = g.values[last, 1] + off[pose + 1] - latest[1]
    gy = latest[0] - g.values[last, 0] - off[pose]
    for j in range(pose):
        cov[pose, j] += gx * cov[pose + 2, j]
        cov[pose + 1, j] += gy * cov[pose + 2, j]
    for i in range(3):
        for j in range(i + 1):
            cov[pose + i, pose + j] = latest_cov[i, j]
    for i in range(columns):
        for j in range(i):
            cov[j, i] = cov[i, j]
