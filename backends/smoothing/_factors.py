"""Linearises sightings, fixes, the prior and links and sums them into a front: J' W J and -J' W e, written out.

The residual of a motion is the plain difference of poses, between(a, b) - delta with its heading wrapped, in the frame
before the motion, and that of the prior pose - prior in the world: so the product has J (`bench/measure/misfit.py`).
GTSAM takes the logarithm of SE(2) instead: `graphs/graph.py` quantifies the difference. Offsets are of plain x, y and
heading, so covariances are in the world frame.

A front is a matrix (m, m + 1) in one row of numbers, `w` = m + 1 of them to a row: its upper triangle, and the
right-hand side in its last column.
"""

from math import atan2, cos, log, sin, sqrt

import numpy as np

from ...core.kernels._planar import wrap
from ...core.kernels.compiled import compiled
from ...core.se2 import Array
from ._graph import (
    BIAS,
    END,
    FIRST,
    FIX,
    INFORMATION,
    LANDMARK,
    LOSS,
    MOTION,
    OFFSET,
    PART,
    PLACE,
    POSE,
    SCALE,
    SUBMAP,
    A,
    B,
    Graph,
)

NONE, HUBER, CAUCHY, GEMAN_MCCLURE = range(4)
"""Robust losses of sightings and loop closures."""


@compiled
def weight(kind: float, scale: float, q: float) -> float:
    """The weight of a factor whose squared Mahalanobis distance is `q`: the loss's derivative by q / 2."""
    if kind == NONE:
        return 1.0
    if kind == HUBER:
        return 1.0 if q <= scale * scale else scale / sqrt(q)
    share = 1.0 / (1.0 + q / (scale * scale))
    return share if kind == CAUCHY else share * share


@compiled
def loss(kind: float, scale: float, q: float) -> float:
    """Twice the loss of a factor whose squared Mahalanobis distance is `q`: q itself without a loss."""
    square = scale * scale
    if kind == NONE or (kind == HUBER and q <= square):
        return q
    if kind == HUBER:
        return 2 * scale * sqrt(q) - square
    if kind == CAUCHY:
        return square * log(1.0 + q / square)
    return q / (1.0 + q / square)


@compiled
def distance(
    x: float, y: float, heading: float, mx: float, my: float, seen: Array, s: int
) -> tuple[float, float, float, float, float]:
    """dx, dy, residuals and squared Mahalanobis distance of sighting `s` from a pose to a landmark at (mx, my)."""
    dx, dy = mx - x, my - y
    e0 = sqrt(dx * dx + dy * dy) - seen[s, 0]
    e1 = wrap(atan2(dy, dx) - heading - seen[s, 1])
    return dx, dy, e0, e1, seen[s, 2] * e0 * e0 + 2 * seen[s, 3] * e0 * e1 + seen[s, 4] * e1 * e1


@compiled
def square_of(W: Array, k: int, e0: float, e1: float, e2: float) -> float:
    """e' W e, where W is six numbers from `k` on."""
    return (
        W[k] * e0 * e0 + W[k + 3] * e1 * e1 + W[k + 5] * e2 * e2
        + 2 * (W[k + 1] * e0 * e1 + W[k + 2] * e0 * e2 + W[k + 4] * e1 * e2)
    )  # fmt: skip


@compiled
def add_sighting(g: Graph, s: int, F: Array, w: int, ip: int, il: int) -> None:
    """Adds sighting `s` to front F: pose at row `ip`, landmark at row `il`, or at -1 where it is held fixed."""
    x, m = g.values[g.sightings[s, POSE]], g.values[g.sightings[s, LANDMARK]]
    add_seen(x[0], x[1], x[2], m[0], m[1], g.seen, s, g.settings, F, w, ip, il)


# `fixed-lag` has poses and landmarks in other tables, so they are numbers: a view of a row costs a reference count.
@compiled
def add_seen(
    x: float, y: float, heading: float, mx: float, my: float,
    seen: Array, s: int, settings: Array, F: Array, w: int, ip: int, il: int,
) -> None:  # fmt: skip
    """Likewise for row `s` of `seen` (n, 5), sighted from a pose, and a landmark at (mx, my)."""
    dx, dy, e0, e1, q = distance(x, y, heading, mx, my, seen, s)
    scale = weight(settings[LOSS], settings[SCALE], q)
    z0, z1, z2 = scale * seen[s, 2], scale * seen[s, 3], scale * seen[s, 4]
    r2 = dx * dx + dy * dy
    r = sqrt(r2)
    a, b, c, d = dx / r, dy / r, -dy / r2, dx / r2  # by the landmark; by the position minus that, by the heading -1
    u0, u1 = z0 * e0 + z1 * e1, z1 * e0 + z2 * e1
    h0, h1 = a * u0 + c * u1, b * u0 + d * u1
    t0, t1 = a * z1 + c * z2, b * z1 + d * z2
    p0, p1, q0, q1 = z0 * a + z1 * c, z1 * a + z2 * c, z0 * b + z1 * d, z1 * b + z2 * d
    xx, xy, yy = a * p0 + c * p1, a * q0 + c * q1, b * q0 + d * q1
    o = ip * w + ip
    F[o] += xx
    F[o + 1] += xy
    F[o + 2] += t0
    F[o + w + 1] += yy
    F[o + w + 2] += t1
    F[o + 2 * w + 2] += z2
    o = ip * w + w - 1
    F[o] += h0
    F[o + w] += h1
    F[o + 2 * w] += u1
    if il < 0:
        return
    o = il * w + il
    F[o] += xx
    F[o + 1] += xy
    F[o + w + 1] += yy
    o = il * w + w - 1
    F[o] -= h0
    F[o + w] -= h1
    if ip < il:
        o = ip * w + il
        F[o] -= xx
        F[o + 1] -= xy
        F[o + w] -= xy
        F[o + w + 1] -= yy
        F[o + 2 * w] -= t0
        F[o + 2 * w + 1] -= t1
    else:
        o = il * w + ip
        F[o] -= xx
        F[o + 1] -= xy
        F[o + 2] -= t0
        F[o + w] -= xy
        F[o + w + 1] -= yy
        F[o + w + 2] -= t1


@compiled
def add_held(g: Graph, s: int, F: Array, w: int, il: int) -> None:
    """Adds row `s` of the sightings, the prior of a pair of constant errors, which are at row `il`."""
    values = g.values[g.sightings[s, LANDMARK]]
    add_known(values[0], values[1], g.seen, s, F, w, il)


@compiled
def add_known(first: float, second: float, seen: Array, s: int, F: Array, w: int, il: int) -> None:
    """Likewise for row `s` of `seen` and a pair with these values."""
    for i in range(2):
        W = seen[s, 2 + 2 * i]
        F[(il + i) * w + il + i] += W
        F[(il + i) * w + w - 1] += W * (seen[s, i] - (first if i == 0 else second))


@compiled
def range_off(
    x: float, y: float, mx: float, my: float, scale: float, offset: float, measured: float
) -> tuple[float, float, float, float]:
    """dx, dy and the distance from a position to a landmark at (mx, my), and the residual of a range between them.

    A range is (1 + scale) times the distance, plus the offset.
    """
    dx, dy = mx - x, my - y
    d = sqrt(dx * dx + dy * dy)
    return dx, dy, d, (1.0 + scale) * d + offset - measured


@compiled
def add_range(g: Graph, s: int, F: Array, w: int, ip: int, il: int, ie: int) -> None:
    """Adds sighting `s`, a range alone: pose at row `ip`, landmark at `il` or -1, scale and offset at `ie`."""
    x, m, errors = g.values[g.sightings[s, POSE]], g.values[g.sightings[s, LANDMARK]], g.values[g.sightings[s, PART]]
    add_ranged(x[0], x[1], m[0], m[1], errors[0], errors[1], g.seen, s, g.settings, F, w, ip, il, ie)


# In numbers, as `add_seen`.
@compiled
def add_ranged(
    x: float, y: float, mx: float, my: float, scale: float, offset: float,
    seen: Array, s: int, settings: Array, F: Array, w: int, ip: int, il: int, ie: int,
) -> None:  # fmt: skip
    """Likewise for row `s` of `seen`, from a position to a landmark at (mx, my)."""
    dx, dy, d, e = range_off(x, y, mx, my, scale, offset, seen[s, 0])
    W = seen[s, 2] * weight(settings[LOSS], settings[SCALE], seen[s, 2] * e * e)
    a, b = (1.0 + scale) * dx / d, (1.0 + scale) * dy / d
    rows, J = (ip, ip + 1, ie, ie + 1, il, il + 1), (-a, -b, d, 1.0, a, b)
    n = 4 if il < 0 else 6
    for i in range(n):
        F[rows[i] * w + w - 1] -= W * J[i] * e
        for j in range(i, n):
            F[min(rows[i], rows[j]) * w + max(rows[i], rows[j])] += W * J[i] * J[j]


@compiled
def fix_off(
    x: float, y: float, heading: float, turn: float, fixed: Array, k: int
) -> tuple[float, float, float, float, float]:
    """Residuals of the fix in row `k` of `fixed` from a pose, its heading `turn` too large; the antenna's way (2)."""
    c, s, ax, ay = cos(heading), sin(heading), fixed[k, 9], fixed[k, 10]
    east, north = c * ax - s * ay, s * ax + c * ay
    e2 = wrap(heading + turn - fixed[k, 2])
    return x + east - fixed[k, 0], y + north - fixed[k, 1], e2, east, north


@compiled
def add_fix(g: Graph, s: int, F: Array, w: int, ip: int, ih: int) -> None:
    """Adds row `s` of the sightings, a fix: pose at row `ip`, the heading's error at `ih`, -1 without one."""
    x, turn = g.values[g.sightings[s, POSE]], g.values[g.sightings[s, LANDMARK], 0]
    add_fixed(x[0], x[1], x[2], turn, g.fixed, FIX - g.sightings[s, PART], F, w, ip, ih)


@compiled
def add_fixed(
    x: float, y: float, heading: float, turn: float, fixed: Array, k: int, F: Array, w: int, ip: int, ih: int
) -> None:
    """Likewise for row `k` of `fixed`, of a pose."""
    e0, e1, e2, east, north = fix_off(x, y, heading, turn, fixed, k)
    W = fixed[k]
    rows, n = (ip, ip + 1, ip + 2, ih), 3 if ih < 0 else 4
    J = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (-north, east, 1.0), (0.0, 0.0, 1.0))
    for i in range(n):
        a, b, c = J[i]
        u = a * W[3] + b * W[4] + c * W[5]
        v = a * W[4] + b * W[6] + c * W[7]
        t = a * W[5] + b * W[7] + c * W[8]
        F[rows[i] * w + w - 1] -= u * e0 + v * e1 + t * e2
        for j in range(i, n):
            o = min(rows[i], rows[j]) * w + max(rows[i], rows[j])
            F[o] += u * J[j][0] + v * J[j][1] + t * J[j][2]


@compiled
def add_pose(W: Array, k: int, e0: float, e1: float, e2: float, F: Array, w: int, ip: int) -> None:
    """Adds information W[k : k + 6] (xx, xy, xt, yy, yt, tt) about a pose of measured offset (e0, e1, e2)."""
    xx, xy, xt, yy, yt, tt = W[k], W[k + 1], W[k + 2], W[k + 3], W[k + 4], W[k + 5]
    o = ip * w + ip
    F[o] += xx
    F[o + 1] += xy
    F[o + 2] += xt
    F[o + w + 1] += yy
    F[o + w + 2] += yt
    F[o + 2 * w + 2] += tt
    o = ip * w + w - 1
    F[o] += xx * e0 + xy * e1 + xt * e2
    F[o + w] += xy * e0 + yy * e1 + yt * e2
    F[o + 2 * w] += xt * e0 + yt * e1 + tt * e2


@compiled
def add_link(g: Graph, k: int, F: Array, w: int, ia: int, ib: int) -> None:
    """Adds link `k` to front F, its poses' scalars from rows `ia` and `ib` on.

    The link is b = G a + offset, G = [1, 0, gx; 0, 1, gy; 0, 0, 1], with its information W: see `_links`.
    """
    before, after = g.links[k, A], g.links[k, B]
    gx = g.values[before, 1] - g.values[after, 1]
    gy = g.values[after, 0] - g.values[before, 0]
    add_linked(g.linked[k], gx, gy, F, w, ia, ib)


@compiled
def add_linked(W: Array, gx: float, gy: float, F: Array, w: int, ia: int, ib: int) -> None:
    """Likewise of W, the offset and the information of a link."""
    e0, e1, e2 = W[OFFSET], W[OFFSET + 1], W[OFFSET + 2]
    add_pose(W, INFORMATION, e0, e1, e2, F, w, ib)
    xx, xy, xt = W[INFORMATION], W[INFORMATION + 1], W[INFORMATION + 2]
    yy, yt, tt = W[INFORMATION + 3], W[INFORMATION + 4], W[INFORMATION + 5]
    sx, sy, st = gx * xx + gy * xy + xt, gx * xy + gy * yy + yt, gx * xt + gy * yt + tt  # the last row of G' W
    o = ia * w + ia
    F[o] += xx
    F[o + 1] += xy
    F[o + 2] += sx
    F[o + w + 1] += yy
    F[o + w + 2] += sy
    F[o + 2 * w + 2] += gx * sx + gy * sy + st
    o = ia * w + w - 1
    F[o] -= xx * e0 + xy * e1 + xt * e2
    F[o + w] -= xy * e0 + yy * e1 + yt * e2
    F[o + 2 * w] -= sx * e0 + sy * e1 + st * e2
    if ia < ib:
        o, down, right = ia * w + ib, w, 1
    else:
        o, down, right = ib * w + ia, 1, w
    F[o] -= xx
    F[o + right] -= xy
    F[o + 2 * right] -= xt
    F[o + down] -= xy
    F[o + down + right] -= yy
    F[o + down + 2 * right] -= yt
    F[o + 2 * down] -= sx
    F[o + 2 * down + right] -= sy
    F[o + 2 * down + 2 * right] -= st


@compiled
def turn_off(heading: float, heading2: float, bias: float, L: Array) -> float:
    """The residual of a gyro's turn between two headings; L is its row of `linked`."""
    return wrap(heading2 - heading + L[MOTION + 1] * bias - L[MOTION])


@compiled
def add_turn(g: Graph, k: int, F: Array, w: int, ia: int, ib: int, il: int) -> None:
    """Adds link `k`, a gyro's turn: headings at rows `ia` and `ib`, the bias at `il`."""
    L = g.linked[k]
    e = turn_off(g.values[g.links[k, A], 2], g.values[g.links[k, B], 2], g.values[g.links[k, BIAS], 0], L)
    W = L[MOTION + 2]
    rows, J = (ia, ib, il), (-1.0, 1.0, L[MOTION + 1])
    for i in range(3):
        F[rows[i] * w + w - 1] -= W * J[i] * e
        for j in range(i, 3):
            F[min(rows[i], rows[j]) * w + max(rows[i], rows[j])] += W * J[i] * J[j]


@compiled
def add_walk(g: Graph, s: int, F: Array, w: int, il: int, ie: int) -> None:
    """Adds row `s` of the sightings, the walk of a gyro's bias at row `il` since the one at row `ie`."""
    e = g.values[g.sightings[s, LANDMARK], 0] - g.values[g.sightings[s, PART], 0]
    add_walked(e, g.seen[s, 4], F, w, il, ie)


@compiled
def add_walked(e: float, W: float, F: Array, w: int, il: int, ie: int) -> None:
    """Likewise of a walk by `e` so far, of information W."""
    F[il * w + il] += W
    F[ie * w + ie] += W
    F[min(il, ie) * w + max(il, ie)] -= W
    F[il * w + w - 1] -= W * e
    F[ie * w + w - 1] += W * e


@compiled
def in_frame(g: Graph, pose: int, at: Array, values: Array, X: Array, y: Array) -> None:
    """The coordinates X (2m,) of a submap's landmarks in the frame of its pose, and y, how far they are from stated.

    The pose is at `at` (3,), the variables at `values` (V, 3).
    """
    first, o, c, s = g.variables[pose, FIRST], g.variables[pose, SUBMAP] + 1, cos(at[2]), sin(at[2])
    for i in range(g.variables[pose, END] - first):
        v = g.sightings[first + i, LANDMARK]
        dx, dy = values[v, 0] - at[0], values[v, 1] - at[1]
        X[2 * i], X[2 * i + 1] = c * dx + s * dy, c * dy - s * dx
        y[2 * i], y[2 * i + 1] = X[2 * i] - g.submaps[o + 2 * i], X[2 * i + 1] - g.submaps[o + 2 * i + 1]


@compiled
def submap_cost(g: Graph, pose: int, at: Array, values: Array) -> float:
    """Contribution of the submap of a pose, which is at `at` (3,), to J."""
    n = 2 * (g.variables[pose, END] - g.variables[pose, FIRST])
    o, M = g.variables[pose, SUBMAP], g.submaps
    X, y = np.empty(n), np.empty(n)
    in_frame(g, pose, at, values, X, y)
    total, b = float(M[o]), o + 1 + 2 * n
    for i in range(n):
        a = -2.0 * float(M[o + 1 + n + i])
        for j in range(n):
            a += float(M[b + i * n + j] * y[j])
        total += a * float(y[i])
    return total


@compiled
def add_submap(g: Graph, pose: int, F: Array, w: int) -> None:
    """Adds the submap of a pose to front F: y' W y - 2 h' y + constant, a part of J.

    y are the coordinates of its m landmarks in the frame of the pose, less the stated ones. From SUBMAP on, `submaps`
    has the constant, the stated coordinates (2m), h (2m) and W (2m, 2m). These do not change when all moves together,
    so nothing is linearised but the frame.
    """
    first, o = g.variables[pose, FIRST], g.variables[pose, SUBMAP]
    m, at, M = g.variables[pose, END] - first, g.values[pose], g.submaps
    n, ip, c, s = 2 * m, g.variables[pose, PLACE], cos(at[2]), sin(at[2])
    X, u, P, b = np.empty(n), np.empty(n), np.zeros((n, 3)), o + 1 + 4 * m
    in_frame(g, pose, at, g.values, X, u)
    y = u.copy()
    for i in range(n):
        u[i] = M[o + 1 + n + i]
        for j in range(m):
            W0, W1 = M[b + i * n + 2 * j], M[b + i * n + 2 * j + 1]
            u[i] -= W0 * y[2 * j] + W1 * y[2 * j + 1]
            P[i, 0] += s * W1 - c * W0
            P[i, 1] -= s * W0 + c * W1
            P[i, 2] += W0 * X[2 * j + 1] - W1 * X[2 * j]
    for i in range(m):
        il = g.variables[g.sightings[first + i, LANDMARK], PLACE]
        k = 2 * i
        for q in range(3):
            p0, p1 = P[k, q], P[k + 1, q]
            left = (-c * p0 + s * p1, -s * p0 - c * p1, X[k + 1] * p0 - X[k] * p1)
            for r in range(q + 1):
                F[(ip + r) * w + ip + q] += left[r]
            for r in range(2):
                F[min(il + r, ip + q) * w + max(il + r, ip + q)] -= left[r]
        F[ip * w + w - 1] += s * u[k + 1] - c * u[k]
        F[(ip + 1) * w + w - 1] -= s * u[k] + c * u[k + 1]
        F[(ip + 2) * w + w - 1] += X[k + 1] * u[k] - X[k] * u[k + 1]
        F[il * w + w - 1] += c * u[k] - s * u[k + 1]
        F[(il + 1) * w + w - 1] += s * u[k] + c * u[k + 1]
        for j in range(m):
            jl = g.variables[g.sightings[first + j, LANDMARK], PLACE]
            if jl < il:
                continue
            t = b + k * n + 2 * j
            a00, a01 = c * M[t] - s * M[t + n], c * M[t + 1] - s * M[t + n + 1]
            a10, a11 = s * M[t] + c * M[t + n], s * M[t + 1] + c * M[t + n + 1]
            F[il * w + jl] += a00 * c - a01 * s
            F[il * w + jl + 1] += a00 * s + a01 * c
            if jl > il:
                F[(il + 1) * w + jl] += a10 * c - a11 * s
            F[(il + 1) * w + jl + 1] += a10 * s + a11 * c
