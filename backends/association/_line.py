"""Sightings of steps that wait in line, by their places in the frame of the first one's pose."""

from math import atan2, sqrt

import numpy as np

from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from .._expected import distance

NEAREST = 1e-3
"""m; least distance of a place whose bearing is computed."""


@compiled
def polar(xy: Array, cov: Array) -> tuple[Array, Array, Array]:
    """Range and bearing (k, 2) of places xy (k, 2), their joint covariance (2k, 2k), and its blocks (k, 2, 2)."""
    k = len(xy)
    z, J = np.empty((k, 2)), np.empty((k, 2, 2))
    for i in range(k):
        x, y = xy[i, 0], xy[i, 1]
        r = max(sqrt(x * x + y * y), NEAREST)
        z[i, 0], z[i, 1] = r, atan2(y, x)
        J[i, 0, 0], J[i, 0, 1], J[i, 1, 0], J[i, 1, 1] = x / r, y / r, -y / (r * r), x / (r * r)
    noise, blocks, half = np.empty((2 * k, 2 * k)), np.empty((k, 2, 2)), np.empty((2, 2))
    for i in range(k):
        for j in range(i + 1):
            for h in range(2):
                for g in range(2):
                    half[h, g] = J[i, h, 0] * cov[2 * i, 2 * j + g] + J[i, h, 1] * cov[2 * i + 1, 2 * j + g]
            for h in range(2):
                for g in range(2):
                    value = half[h, 0] * J[j, g, 0] + half[h, 1] * J[j, g, 1]
                    noise[2 * i + h, 2 * j + g] = noise[2 * j + g, 2 * i + h] = value
        for h in range(2):
            for g in range(2):
                blocks[i, h, g] = noise[2 * i + h, 2 * i + g]
    return z, noise, blocks


@compiled
def apart(xy: Array, cov: Array, i: int, j: int) -> float:
    """Squared Mahalanobis distance of places i and j of xy (k, 2), of joint covariance (2k, 2k)."""
    a, b = 2 * i, 2 * j
    return distance(
        xy[i, 0] - xy[j, 0],
        xy[i, 1] - xy[j, 1],
        cov[a, a] + cov[b, b] - 2.0 * cov[a, b],
        cov[a + 1, a] + cov[b + 1, b] - cov[a + 1, b] - cov[b + 1, a],
        cov[a + 1, a + 1] + cov[b + 1, b + 1] - 2.0 * cov[a + 1, b + 1],
    )


@compiled
def agreeing(xy: Array, cov: Array, of: Ints, rows: Ints, gate: float, nearest: bool) -> Ints:
    """Counts the steps after the first one with a place within `gate` of that of each of `rows` (m,).

    xy (k, 2) are places with joint covariance (2k, 2k), `of` (k,) their steps, ascending. With `nearest`, a place
    agrees only with the nearest of the first step's: else the sightings of a landmark agree with clutter beside it.
    """
    out = np.zeros(len(rows), np.int64)
    for m in range(len(rows)):
        i, last = rows[m], 0
        for j in range(len(xy)):
            if of[j] == last:
                continue
            near = apart(xy, cov, i, j)
            agrees, k = near < gate, 0
            while nearest and agrees and of[k] == 0:
                agrees = k == i or apart(xy, cov, k, j) > near
                k += 1
            if agrees:
                out[m] += 1
                last = of[j]
    return out
