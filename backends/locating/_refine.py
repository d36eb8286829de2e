"""A pose from places matched with landmarks, by generalised least squares, and its likelihood over chance."""

from math import cos, log, pi, sin, sqrt

import numpy as np

from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from ._hypotheses import MISS
from ._map_index import AREA, MapIndex, largest_variance, nearest
from ._places import SightedPlaces

ROUNDS = 3
"""Times that places are matched anew before only leaving out is allowed."""
WIDER = 2.5
"""The gate is wider by this before the last round: the first pose is off."""


@compiled
def invert(S: Array, n: int) -> float:
    """Inverts the first n rows and columns of S, symmetric and positive definite, in place; returns log |S|."""
    volume = 0.0
    for k in range(n):  # Gauss-Jordan without pivots, as all leading minors are positive
        pivot = S[k, k]
        if not pivot > 0:
            return np.nan
        volume += log(pivot)
        S[k, k] = 1.0
        for j in range(n):
            S[k, j] /= pivot
        for i in range(n):
            if i != k:
                f = S[i, k]
                S[i, k] = 0.0
                for j in range(n):
                    S[i, j] -= f * S[k, j]
    return volume


@compiled
def match(places: SightedPlaces, on: MapIndex, pose: Array, gate: float, to: Ints) -> int:
    """Finds the landmark nearest to each place within the gate, each once, `to` (k,), -1: none; returns how many."""
    c, s = cos(pose[2]), sin(pose[2])
    spots, seen, xy = places.xy, places.half, on.xy
    off, found, widest = np.empty(len(spots)), 0, largest_variance(on)
    for q in range(len(spots)):
        x, y = pose[0] + c * spots[q, 0] - s * spots[q, 1], pose[1] + s * spots[q, 0] + c * spots[q, 1]
        n = places.who[q]
        if n < 0:
            n = nearest(on, x, y, sqrt(gate * (seen[q, q] + widest)))
        to[q] = -1
        if n < 0:
            continue
        off[q] = ((xy[n, 0] - x) ** 2 + (xy[n, 1] - y) ** 2) / (seen[q, q] + on.half[n, n])
        if off[q] > gate:
            continue
        to[q] = n
        found += 1
        for p in range(q):
            if to[p] == n:
                to[p if off[p] > off[q] else q] = -1
                found -= 1
                break
    return found


@compiled
def joint(places: SightedPlaces, on: MapIndex, pose: Array, to: Ints, r: Array, G: Array, S: Array) -> int:
    """Computes the residuals r (2m,) of the m matched places, their Jacobian G (2m, 3) by the pose, covariance S."""
    c, s = cos(pose[2]), sin(pose[2])
    spots, cov, xy, map_cov, m = places.xy, places.cov, on.xy, on.cov, 0
    for q in range(len(spots)):
        if to[q] < 0:
            continue
        u, v = c * spots[q, 0] - s * spots[q, 1], s * spots[q, 0] + c * spots[q, 1]
        r[2 * m], r[2 * m + 1] = xy[to[q], 0] - pose[0] - u, xy[to[q], 1] - pose[1] - v
        G[2 * m, 0], G[2 * m, 1], G[2 * m, 2] = 1.0, 0.0, -v
        G[2 * m + 1, 0], G[2 * m + 1, 1], G[2 * m + 1, 2] = 0.0, 1.0, u
        n = 0
        for p in range(q + 1):
            if to[p] < 0:
                continue
            xx, xy_ = cov[2 * q, 2 * p], cov[2 * q, 2 * p + 1]
            yx, yy = cov[2 * q + 1, 2 * p], cov[2 * q + 1, 2 * p + 1]
            a, b = 2 * to[q], 2 * to[p]
            S[2 * m, 2 * n] = c * (c * xx - s * yx) - s * (c * xy_ - s * yy) + map_cov[a, b]
            S[2 * m, 2 * n + 1] = s * (c * xx - s * yx) + c * (c * xy_ - s * yy) + map_cov[a, b + 1]
            S[2 * m + 1, 2 * n] = c * (s * xx + c * yx) - s * (s * xy_ + c * yy) + map_cov[a + 1, b]
            S[2 * m + 1, 2 * n + 1] = s * (s * xx + c * yx) + c * (s * xy_ + c * yy) + map_cov[a + 1, b + 1]
            for g in range(2):
                for h in range(2):
                    S[2 * n + h, 2 * m + g] = S[2 * m + g, 2 * n + h]
            n += 1
        m += 1
    return m


@compiled
def adjust(pose: Array, r: Array, G: Array, S: Array, m: int, cov: Array) -> float:
    """Moves the pose to the least squares r' S^-1 r of m matches; inverts S, sets `cov` (3, 3); returns log |S|.

    `r` is then what remains, to first order.
    """
    volume = invert(S, 2 * m)
    g = np.zeros(3)
    cov[:] = 0.0
    for i in range(2 * m):
        for j in range(2 * m):
            for a in range(3):
                w = G[i, a] * S[i, j]
                g[a] += w * r[j]
                for b in range(3):
                    cov[a, b] += w * G[j, b]
    if not invert(cov, 3) > -np.inf:
        return np.nan
    d = np.zeros(3)
    for a in range(3):
        for b in range(3):
            d[a] += cov[a, b] * g[b]
    for i in range(2 * m):
        r[i] -= G[i, 0] * d[0] + G[i, 1] * d[1] + G[i, 2] * d[2]
    pose += d
    return volume


@compiled
def determinant(a: Array) -> float:
    """Computes the determinant of a covariance (3, 3), by its Cholesky factor."""
    x = a[0, 0]
    y = a[1, 1] - a[0, 1] * a[0, 1] / x
    f = a[1, 2] - a[0, 1] * a[0, 2] / x
    return x * y * (a[2, 2] - a[0, 2] * a[0, 2] / x - f * f / y)


@compiled
def worst(r: Array, inverse: Array, m: int, room: Array) -> tuple[int, float]:
    """Finds the match that adds least to the likelihood, given the others, `room` (m,): its number, what it adds."""
    which, least = -1, np.inf
    for i in range(m):
        x = y = 0.0
        for j in range(2 * m):
            x += inverse[2 * i, j] * r[j]
            y += inverse[2 * i + 1, j] * r[j]
        xx, xy, yy = inverse[2 * i, 2 * i], inverse[2 * i, 2 * i + 1], inverse[2 * i + 1, 2 * i + 1]
        d = xx * yy - xy * xy
        gain = room[i] - log(2 * pi) + 0.5 * log(d) - 0.5 * (yy * x * x - 2 * xy * x * y + xx * y * y) / d
        if gain < least:
            which, least = i, gain
    return which, least


@compiled
def refine(
    places: SightedPlaces, on: MapIndex, pose: Array, pose_cov: Array, to: Ints, gate: float, least: int
) -> float:
    """Refines `pose` (3,) of covariance `pose_cov` (3, 3), with the landmark `to` (k,) of each place, -1: none.

    Leaves out the places that lower the likelihood. Returns its logarithm over chance, integrated over all poses whose
    place is in the area of the map; -inf with under `least` matches.
    """
    k, room = len(places.xy), on.room
    r, G, S = np.empty(2 * k), np.empty((2 * k, 3)), np.empty((2 * k, 2 * k))
    for turn in range(ROUNDS + k):
        if turn < ROUNDS:
            wide = gate * (WIDER if turn < ROUNDS - 1 else 1.0)
            match(places, on, pose, wide, to)
        m = joint(places, on, pose, to, r, G, S)
        if m < least:
            return -np.inf
        volume = adjust(pose, r, G, S, m, pose_cov)
        if not volume > -np.inf:
            return -np.inf
        if turn < ROUNDS - 1:
            continue
        which, gain = worst(r, S, m, room[to[to >= 0]])
        if gain >= -MISS:
            total = room[to[to >= 0]].sum() - m * log(2 * pi) - 0.5 * volume - MISS * (k - m)
            for i in range(2 * m):
                for j in range(2 * m):
                    total -= 0.5 * r[i] * S[i, j] * r[j]
            root = sqrt(determinant(pose_cov))
            return total + log(root * (2 * pi) ** 1.5) - log(2 * pi * on.box[AREA])
        for q in range(k):
            if to[q] >= 0:
                which -= 1
                if which < 0:
                    to[q] = -1
                    break
    return -np.inf
