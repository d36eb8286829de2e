"""Consecutive motions as one factor between two poses, in covariance form; and the poses in between.

Linearised about poses a and b, a motion states that b's offset is G times a's plus an offset plus noise, where

    G = [1, 0, -(yb - ya); 0, 1, xb - xa; 0, 0, 1]

depends on the two positions alone (Smith, Self and Cheeseman's compounding), so that products have the same form. The
noise's covariance is propagated forwards, as in dead reckoning, which loses no precision on long ways: in information
form every step would leave the difference of two nearly equal matrices.
"""

from math import cos, sin

import numpy as np

from ...core.kernels._planar import add_turned, information, levered, wrap
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


@compiled
def motion_offset(
    x: float, y: float, heading: float, x2: float, y2: float, heading2: float, dx: float, dy: float, turn: float
) -> tuple[float, float, float, float, float]:
    """Offset in the world of the motion's end, from one pose, to the other; cosine and sine of the first heading."""
    c, s = cos(heading), sin(heading)
    return x + c * dx - s * dy - x2, y + s * dx + c * dy - y2, wrap(heading + turn - heading2), c, s


@compiled
def carry(g: Graph, k: int, off: Array, S: Array) -> None:
    """Propagates offset `off` (3,) and covariance S (6,) of step k - 1 to step k."""
    p, q = g.steps[k - 1], g.steps[k]
    x, y, heading, x2, y2 = p[POINT], p[POINT + 1], p[POINT + 2], q[POINT], q[POINT + 1]
    e0, e1, e2, c, s = motion_offset(x, y, heading, x2, y2, q[POINT + 2], q[DELTA], q[DELTA + 1], q[DELTA + 2])
    gx, gy = y - y2, x2 - x
    off[0] += gx * off[2] + e0
    off[1] += gy * off[2] + e1
    off[2] += e2
    levered(S, gx, gy)
    add_turned(S, c, s, q, NOISE)


@compiled
def relink(g: Graph, k: int) -> bool:
    """Linearises link `k` at its poses, weighs a loop closure; False where the covariance is not positive definite."""
    first, last = g.variables[g.links[k, A], STEP], g.variables[g.links[k, B], STEP]
    L = g.linked[k]
    S = np.zeros(6)
    if g.links[k, LOOP] == TURN:
        return True
    if g.links[k, LOOP]:
        p, q = g.steps[first], g.steps[last]
        e0, e1, e2, c, s = motion_offset(
            p[POINT], p[POINT + 1], p[POINT + 2], q[POINT], q[POINT + 1], q[POINT + 2],
            L[MOTION], L[MOTION + 1], L[MOTION + 2],
        )  # fmt: skip
        L[OFFSET], L[OFFSET + 1], L[OFFSET + 2] = e0, e1, e2
        add_turned(S, c, s, L, COVARIANCE)
    else:
        off = np.zeros(3)
        for j in range(first + 1, last + 1):
            carry(g, j, off, S)
        L[OFFSET], L[OFFSET + 1], L[OFFSET + 2] = off[0], off[1], off[2]
    definite = information(S, 0, L, INFORMATION)
    if definite and g.links[k, LOOP]:
        weigh(L, g.settings[LOSS], g.settings[SCALE])
    return definite


@compiled
def weigh(L: Array, kind: float, scale: float) -> None:
    """Multiplies the information of a loop closure, L (19,), by its own weight and by that of the loss."""
    share = L[WEIGHT] * weight(kind, scale, square_of(L, INFORMATION, L[OFFSET], L[OFFSET + 1], L[OFFSET + 2]))
    for i in range(6):
        L[INFORMATION + i] *= share


@compiled
def gain(S: Array, N: Array, K: Array) -> bool:
    """K (3, 3) = S (S + N)^-1 for covariances S, N (6,)."""
    T, W = np.empty(6), np.empty(6)
    for i in range(6):
        T[i] = S[i] + N[i]
    if not information(T, 0, W, 0):
        return False
    for i in range(3):
        s0, s1, s2 = S[i], S[i + 1 if i == 0 else (3 if i == 1 else 4)], S[2 if i == 0 else (4 if i == 1 else 5)]
        K[i, 0] = s0 * W[0] + s1 * W[1] + s2 * W[2]
        K[i, 1] = s0 * W[1] + s1 * W[3] + s2 * W[4]
        K[i, 2] = s0 * W[2] + s1 * W[4] + s2 * W[5]
    return True


@compiled
def inner(g: Graph, first: int, last: int, out: Array) -> bool:
    """Interpolation of the poses between steps `first` and `last`: rows of `out` (last - first - 1, 27).

    False where the covariance of their motions is not positive definite.

    The offset of the pose in row i is Ga a + Gb b + h, a and b being those of the two, with a covariance C left: a row
    has Ga (9), Gb (9), h (3) and C (6). The way to the pose and the way from it are weighted by their covariances S and
    N: the gain is K = S (S + N)^-1, and C = K N.
    """
    n = last - first - 1
    S, off, K = np.zeros(6), np.zeros(3), np.empty((3, 3))
    for i in range(n):
        carry(g, first + 1 + i, off, S)
        for j in range(6):
            out[i, j] = S[j]
        for j in range(3):
            out[i, 18 + j] = off[j]
    N, back = np.zeros(6), np.zeros(3)  # of the pose relative to `last`
    ax, ay = g.steps[first, POINT], g.steps[first, POINT + 1]
    bx, by = g.steps[last, POINT], g.steps[last, POINT + 1]
    for i in range(n - 1, -1, -1):
        p, q = g.steps[first + 1 + i], g.steps[first + 2 + i]
        x, y, x2, y2 = p[POINT], p[POINT + 1], q[POINT], q[POINT + 1]
        e0, e1, e2, c, s = motion_offset(x, y, p[POINT + 2], x2, y2, q[POINT + 2], q[DELTA], q[DELTA + 1], q[DELTA + 2])
        add_turned(N, c, s, q, NOISE)
        gx, gy = y2 - y, x - x2  # back along the motion
        levered(N, gx, gy)
        for j, e in ((0, e0), (1, e1), (2, e2)):
            back[j] -= e
        back[0] += gx * back[2]
        back[1] += gy * back[2]
        row = out[i]
        way = row[0:6].copy()
        f0, f1, f2 = row[18], row[19], row[20]
        if not gain(way, N, K):
            return False
        ux, uy = ay - y, x - ax  # from first to here
        vx, vy = by - y, x - bx  # from last back to here
        for r in range(3):
            k0, k1, k2 = K[r, 0], K[r, 1], K[r, 2]
            i0, i1, i2 = (1.0 if r == 0 else 0.0) - k0, (1.0 if r == 1 else 0.0) - k1, (1.0 if r == 2 else 0.0) - k2
            row[3 * r], row[3 * r + 1], row[3 * r + 2] = i0, i1, i0 * ux + i1 * uy + i2
            row[9 + 3 * r], row[10 + 3 * r], row[11 + 3 * r] = k0, k1, k0 * vx + k1 * vy + k2
            row[18 + r] = i0 * f0 + i1 * f1 + i2 * f2 + k0 * back[0] + k1 * back[1] + k2 * back[2]
        row[21] = K[0, 0] * N[0] + K[0, 1] * N[1] + K[0, 2] * N[2]
        row[22] = K[0, 0] * N[1] + K[0, 1] * N[3] + K[0, 2] * N[4]
        row[23] = K[0, 0] * N[2] + K[0, 1] * N[4] + K[0, 2] * N[5]
        row[24] = K[1, 0] * N[1] + K[1, 1] * N[3] + K[1, 2] * N[4]
        row[25] = K[1, 0] * N[2] + K[1, 1] * N[4] + K[1, 2] * N[5]
        row[26] = K[2, 0] * N[2] + K[2, 1] * N[4] + K[2, 2] * N[5]
    return True
