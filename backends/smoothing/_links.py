"""Consecutive motions as one factor between two poses, in covariance form; and the poses in between.

Linearised about poses a and b, a motion states that b's offset is G times a's plus an offset plus noise, where

    G = [1, 0, -(yb - ya); 0, 1, xb - xa; 0, 0, 1]

depends on the two positions alone (Smith, Self and Cheeseman's compounding), so that products have the same form. The
noise's covariance is propagated forwards, as in dead reckoning, which loses no precision on long ways: in information
form every step would leave the difference of two nearly equal matrices.
"""

from math import cos, sin

from ...core.kernels._planar import Six, inverse, lever, turned, wrap
from ...core.kernels.compiled import compiled
from ...core.se2 import Array
from ._factors import square_of, weight
from ._graph import (
    COVARIANCE,
    DELTA,
    INFORMATION,
    LOOP,
    LOSS,
    MOTION,
    NOISE,
    OFFSET,
    POINT,
    SCALE,
    STEP,
    TURN,
    WEIGHT,
    A,
    B,
    Graph,
)  # fmt: skip

Row = tuple[float, float, float]


@compiled
def motion_offset(
    x: float, y: float, heading: float, x2: float, y2: float, heading2: float, dx: float, dy: float, turn: float
) -> tuple[float, float, float, float, float]:
    """Offset in the world of the motion's end, from one pose, to the other; cosine and sine of the first heading."""
    c, s = cos(heading), sin(heading)
    return x + c * dx - s * dy - x2, y + s * dx + c * dy - y2, wrap(heading + turn - heading2), c, s


@compiled
def offset_of(g: Graph, k: int) -> tuple[float, float, float, float, float]:
    """`motion_offset` of the motion to step `k`, at the linearisation points of its ends."""
    p, q = g.steps[k - 1], g.steps[k]
    return motion_offset(
        p[POINT], p[POINT + 1], p[POINT + 2], q[POINT], q[POINT + 1], q[POINT + 2], q[DELTA], q[DELTA + 1], q[DELTA + 2]
    )


# In numbers: arrays of a few are allocated at each call, which took half of the time.
@compiled
def carry(g: Graph, k: int, c: float, s: float, S: Six) -> Six:
    """Propagates a covariance of step k - 1, of whose heading these are cosine and sine, to step k."""
    p, q = g.steps[k - 1], g.steps[k]
    a = lever(S[0], S[1], S[2], S[3], S[4], S[5], p[POINT + 1] - q[POINT + 1], q[POINT] - p[POINT])
    b = turned(c, s, q, NOISE)
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]


@compiled
def relink(g: Graph, k: int) -> bool:
    """Linearises link `k` at its poses, weighs a loop closure; False where the covariance is not positive definite."""
    first, last = g.variables[g.links[k, A], STEP], g.variables[g.links[k, B], STEP]
    L = g.linked[k]
    spread = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if g.links[k, LOOP] == TURN:
        return True
    if g.links[k, LOOP]:
        p, q = g.steps[first], g.steps[last]
        o0, o1, o2, c, s = motion_offset(
            p[POINT], p[POINT + 1], p[POINT + 2], q[POINT], q[POINT + 1], q[POINT + 2],
            L[MOTION], L[MOTION + 1], L[MOTION + 2],
        )  # fmt: skip
        spread = turned(c, s, L, COVARIANCE)
    else:
        o0, o1, o2 = 0.0, 0.0, 0.0
        for j in range(first + 1, last + 1):
            e0, e1, e2, c, s = offset_of(g, j)
            gx, gy = g.steps[j - 1, POINT + 1] - g.steps[j, POINT + 1], g.steps[j, POINT] - g.steps[j - 1, POINT]
            o0, o1, o2 = o0 + (gx * o2 + e0), o1 + (gy * o2 + e1), o2 + e2
            spread = carry(g, j, c, s, spread)
    L[OFFSET], L[OFFSET + 1], L[OFFSET + 2] = o0, o1, o2
    definite, W = inverse(spread[0], spread[1], spread[2], spread[3], spread[4], spread[5])
    if definite:
        for i in range(6):
            L[INFORMATION + i] = W[i]
        if g.links[k, LOOP]:
            weigh(L, g.settings[LOSS], g.settings[SCALE])
    return definite


@compiled
def weigh(L: Array, kind: float, scale: float) -> None:
    """Multiplies the information of a loop closure, L (19,), by its own weight and by that of the loss."""
    share = L[WEIGHT] * weight(kind, scale, square_of(L, INFORMATION, L[OFFSET], L[OFFSET + 1], L[OFFSET + 2]))
    for i in range(6):
        L[INFORMATION + i] *= share


@compiled
def gain(S: Six, N: Six) -> tuple[bool, Row, Row, Row]:
    """The rows of K = S (S + N)^-1 for covariances S and N; whether their sum is positive definite."""
    definite, W = inverse(S[0] + N[0], S[1] + N[1], S[2] + N[2], S[3] + N[3], S[4] + N[4], S[5] + N[5])
    rows = product(S[0], S[1], S[2], W), product(S[1], S[3], S[4], W), product(S[2], S[4], S[5], W)
    return definite, rows[0], rows[1], rows[2]


@compiled
def product(a: float, b: float, c: float, W: Six) -> Row:
    """(a, b, c) W, W being symmetric."""
    return (
        a * W[0] + b * W[1] + c * W[2],
        a * W[1] + b * W[3] + c * W[4],
        a * W[2] + b * W[4] + c * W[5],
    )


@compiled
def inner(g: Graph, first: int, last: int, out: Array) -> bool:
    """Interpolation of the poses between steps `first` and `last`: rows of `out` (last - first - 1, 27).

    False where the covariance of their motions is not positive definite.

    The offset of the pose in row i is Ga a + Gb b + h, a and b being those of the two, with a covariance C left: a row
    has Ga (9), Gb (9), h (3) and C (6). The way to the pose and the way from it are weighted by their covariances S and
    N: the gain is K = S (S + N)^-1, and C = K N.
    """
    n = last - first - 1
    ahead, o0, o1, o2 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0
    e0, e1, e2, c, s = offset_of(g, first + 1)
    for i in range(n):
        j = first + 1 + i
        gx, gy = g.steps[j - 1, POINT + 1] - g.steps[j, POINT + 1], g.steps[j, POINT] - g.steps[j - 1, POINT]
        o0, o1, o2 = o0 + (gx * o2 + e0), o1 + (gy * o2 + e1), o2 + e2
        ahead = carry(g, j, c, s, ahead)
        for u in range(6):
            out[i, u] = ahead[u]
        out[i, 18], out[i, 19], out[i, 20] = o0, o1, o2
        e0, e1, e2, c, s = offset_of(g, j + 1)
        out[i, 6], out[i, 7], out[i, 8], out[i, 9], out[i, 10] = e0, e1, e2, c, s  # until the way back has come by
    behind, b0, b1, b2 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0  # of the pose relative to `last`
    ax, ay = g.steps[first, POINT], g.steps[first, POINT + 1]
    bx, by = g.steps[last, POINT], g.steps[last, POINT + 1]
    for i in range(n - 1, -1, -1):
        p, q = g.steps[first + 1 + i], g.steps[first + 2 + i]
        x, y, x2, y2 = p[POINT], p[POINT + 1], q[POINT], q[POINT + 1]
        T = turned(out[i, 9], out[i, 10], q, NOISE)
        gx, gy = y2 - y, x - x2  # back along the motion
        behind = lever(
            behind[0] + T[0],
            behind[1] + T[1],
            behind[2] + T[2],
            behind[3] + T[3],
            behind[4] + T[4],
            behind[5] + T[5],
            gx,
            gy,
        )
        b2 -= out[i, 8]
        b0, b1 = b0 - out[i, 6] + gx * b2, b1 - out[i, 7] + gy * b2
        f0, f1, f2 = out[i, 18], out[i, 19], out[i, 20]
        definite, K0, K1, K2 = gain((out[i, 0], out[i, 1], out[i, 2], out[i, 3], out[i, 4], out[i, 5]), behind)
        if not definite:
            return False
        ux, uy = ay - y, x - ax  # from first to here
        vx, vy = by - y, x - bx  # from last back to here
        for r in range(3):
            k0, k1, k2 = K0 if r == 0 else (K1 if r == 1 else K2)
            i0, i1, i2 = (1.0 if r == 0 else 0.0) - k0, (1.0 if r == 1 else 0.0) - k1, (1.0 if r == 2 else 0.0) - k2
            out[i, 3 * r], out[i, 3 * r + 1], out[i, 3 * r + 2] = i0, i1, i0 * ux + i1 * uy + i2
            out[i, 9 + 3 * r], out[i, 10 + 3 * r], out[i, 11 + 3 * r] = k0, k1, k0 * vx + k1 * vy + k2
            out[i, 18 + r] = i0 * f0 + i1 * f1 + i2 * f2 + k0 * b0 + k1 * b1 + k2 * b2
        out[i, 21], out[i, 22], out[i, 23] = product(K0[0], K0[1], K0[2], behind)
        out[i, 24], out[i, 25] = product(K1[0], K1[1], K1[2], behind)[1:]
        out[i, 26] = product(K2[0], K2[1], K2[2], behind)[2]
    return True
