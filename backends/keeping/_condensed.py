"""Marginalises the poses of a stretch: what its motions and sightings tell of its landmarks, relative to each other."""

from math import nan

import numpy as np

from ...core.kernels._cholesky import factor, row_of
from ...core.kernels._planar import add_turned, information
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from ..smoothing._factors import add_linked, add_sighting, distance, loss, square_of
from ..smoothing._graph import (
    DELTA,
    END,
    FIRST,
    FIX,
    INFORMATION,
    LANDMARK,
    LOSS,
    NOISE,
    OFFSET,
    PART,
    PLACE,
    POINT,
    SCALE,
    Graph,
)  # fmt: skip
from ..smoothing._links import motion_offset
from ..smoothing._log import covariance_of
from ._located import add_loops


@compiled
def add_motion(g: Graph, k: int, F: Array, w: int) -> float:
    """Adds the motion to step `k` to front F, from the pose in its first rows to that in the next; its share of J.

    It is not a number where the motion's covariance is not positive definite.
    """
    p, q, L, S = g.steps[k - 1], g.steps[k], np.empty(9), np.zeros(6)
    e0, e1, e2, c, s = motion_offset(
        p[POINT], p[POINT + 1], p[POINT + 2], q[POINT], q[POINT + 1], q[POINT + 2],
        q[DELTA], q[DELTA + 1], q[DELTA + 2],
    )  # fmt: skip
    add_turned(S, c, s, q, NOISE)
    if not information(S, 0, L, INFORMATION):
        return nan
    L[OFFSET], L[OFFSET + 1], L[OFFSET + 2] = e0, e1, e2
    add_linked(L, p[POINT + 1] - q[POINT + 1], q[POINT] - p[POINT], F, w, 0, 3)
    return square_of(L, INFORMATION, e0, e1, e2)


@compiled
def add_looks(g: Graph, pose: int, F: Array, w: int) -> float:
    """Adds the sightings from a pose, which is in the first rows of front F; their share of J.

    With a robust loss, each has the weight that it has at the linearisation points.
    """
    x, total = g.values[pose], 0.0
    for s in range(g.variables[pose, FIRST], g.variables[pose, END]):
        landmark = g.sightings[s, LANDMARK]
        if landmark >= 0 and g.sightings[s, PART] > FIX:
            m = g.values[landmark]
            add_sighting(g, s, F, w, 0, g.variables[landmark, PLACE])
            q = distance(x[0], x[1], x[2], m[0], m[1], g.seen, s)[4]
            total += loss(g.settings[LOSS], g.settings[SCALE], q)
    return total


@compiled
def advance(F: Array, w: int) -> None:
    """Makes the second pose of front F the first one, after that is eliminated."""
    for i in range(3):
        a, b = i * w, (3 + i) * w
        for j in range(3):
            F[a + j] = F[b + 3 + j]
        F[a + 3 : a + 6] = 0.0
        F[a + 6 : a + w] = F[b + 6 : b + w]
        F[b : b + w] = 0.0


@compiled
def condense(
    g: Graph, first: int, last: int, landmarks: Ints, frame: bool, loops: bool, W: Array, h: Array, left: Array
) -> float:
    """Eliminates the poses of steps `first` to `last`, at the linearisation points, without the motion to the first.

    Fills W (2m, 2m), the information about the offsets of these landmarks, and h (2m,), the right-hand side. Where the
    last pose is a `frame`, it is held fixed and not eliminated. Fills `left` (n, 3, 3), the covariance of each pose
    given the landmarks and, with `loops`, the other ends of its loop closures: then W and h are of no use. Returns the
    constant that is left of J; not a number where something is indefinite.
    """
    n = 6 + 2 * len(landmarks)
    w, total, many = row_of(n), 0.0, last - first + 1
    for t in range(len(landmarks)):
        g.variables[landmarks[t], PLACE] = 6 + 2 * t
    F, R, own, S = np.zeros(n * w), np.empty((many, 3, 6)), np.empty(6), np.empty(6)
    for k in range(first, last + 1):
        if g.at[k] >= 0:
            total += add_looks(g, g.at[k], F, w)
            if loops:
                add_loops(g, g.at[k], first, last, F, w)
        if k < last:
            total += add_motion(g, k + 1, F, w)
        else:
            own[0], own[1], own[2], own[3], own[4], own[5] = F[0], F[1], F[2], F[w + 1], F[w + 2], F[2 * w + 2]
            if frame:
                break
        if not factor(F, n, 3):
            return nan
        for i in range(3):
            total -= F[i * w + w - 1] ** 2
            for j in range(6):
                R[k - first, i, j] = F[i * w + j]
        if k < last:
            advance(F, w)
    for i in range(n - 6):
        h[i] = F[(6 + i) * w + w - 1]
        for j in range(i, n - 6):
            W[i, j] = W[j, i] = F[(6 + i) * w + 6 + j]
    if not information(own, 0, S, 0):
        return nan
    covariance_of(S, 0, left[many - 1])
    for k in range(many - 2, -1, -1):
        before(R[k], left[k + 1], left[k])
    return total


@compiled
def before(R: Array, after: Array, out: Array) -> None:
    """The covariance (3, 3) of a pose from that `after` it; R (3, 6) has its rows of the factor."""
    T, K, C = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3))
    for j in range(3):
        T[j, j] = 1.0 / R[j, j]
        for i in range(j - 1, -1, -1):
            a = 0.0
            for k in range(i + 1, j + 1):
                a += R[i, k] * T[k, j]
            T[i, j] = -a / R[i, i]
    for i in range(3):
        for j in range(3):
            for k in range(3):
                K[i, j] += T[i, k] * R[k, 3 + j]
    for i in range(3):
        for j in range(3):
            for k in range(3):
                C[i, j] += K[i, k] * after[k, j]
    for i in range(3):
        for j in range(3):
            a = 0.0
            for k in range(3):
                a += T[i, k] * T[j, k] + C[i, k] * K[j, k]
            out[i, j] = a
