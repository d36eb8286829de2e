"""Inner loop of levelling: the plane of the floor in a depth image."""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..se2 import Array

ROUNDS, WIDEST, NARROWER = 14, 0.08, 0.75
"""Of robust least squares; m, the width of the first one's loss, and of the next one's by this one's."""


@compiled
def floor_plane(
    depth: NDArray[np.float32],
    rays: Array,
    mounting: Array,
    every: int,
    near: float,
    far: float,
    constant_sd: float,
    sd: float,
    height: float,
    slope: float,
    least: int,
    plane: Array,
    cov: Array,
) -> int:
    """Fits z = a x + b y + c to the points of the floor in the robot's frame; the number of points, 0 for too few.

    `rays` (h, w, 2) and `mounting` (4, 4) lift every `every`-th pixel. Points further than `height` (m) and `slope`
    times their distance from z = 0 are of something else, and so are those far from the plane. Writes `plane` (3,) and
    its covariance `cov` (3, 3).
    """
    rows, columns = depth.shape
    most = ((rows + every - 1) // every) * ((columns + every - 1) // every)
    x, count = np.empty((most, 4)), 0
    for v in range(every // 2, rows, every):
        for u in range(every // 2, columns, every):
            z = float(depth[v, u])
            a, b = rays[v, u, 0], rays[v, u, 1]
            if not (z > near and z < far and a == a):
                continue
            for i in range(3):
                x[count, i] = (mounting[i, 0] * a + mounting[i, 1] * b + mounting[i, 2]) * z + mounting[i, 3]
            away = sqrt(x[count, 0] ** 2 + x[count, 1] ** 2)
            if abs(x[count, 2]) < height + slope * away:
                # along the ray; its part across the floor
                down = mounting[2, 0] * a + mounting[2, 1] * b + mounting[2, 2]
                x[count, 3] = (constant_sd + sd * z * z) * abs(down)
                count += 1
    plane[:] = 0.0
    A, g, inside, width = np.empty((3, 3)), np.empty(3), 0, WIDEST
    for turn in range(ROUNDS):
        A[:], g[:], inside = 0.0, 0.0, 0
        hard = turn >= ROUNDS - 3
        for k in range(count):
            off = x[k, 2] - plane[0] * x[k, 0] - plane[1] * x[k, 1] - plane[2]
            most_off = max(3.0 * x[k, 3], 0.01)
            if hard and abs(off) > most_off:
                continue
            inside += 1
            w = 1.0 / max(x[k, 3], 0.002) ** 2
            if not hard:
                w /= (1.0 + (off / max(width, most_off)) ** 2) ** 2
            row = (x[k, 0], x[k, 1], 1.0)
            for i in range(3):
                g[i] += w * row[i] * x[k, 2]
                for j in range(3):
                    A[i, j] += w * row[i] * row[j]
        if inside < least:
            return 0
        # held at first, as whatever stands on the floor is still among the points
        A[0, 0] += 1.0 / slope**2
        A[1, 1] += 1.0 / slope**2
        A[2, 2] += 1.0 / height**2
        if not inverse(A, cov):
            return 0
        width *= NARROWER
        for i in range(3):
            plane[i] = cov[i, 0] * g[0] + cov[i, 1] * g[1] + cov[i, 2] * g[2]
    return inside


@compiled
def inverse(S: Array, W: Array) -> bool:
    """Writes the inverse of a symmetric (3, 3); False where it has none."""
    a, b, c, d, e, f = S[0, 0], S[0, 1], S[0, 2], S[1, 1], S[1, 2], S[2, 2]
    W[0, 0], W[0, 1], W[0, 2] = d * f - e * e, c * e - b * f, b * e - c * d
    W[1, 1], W[1, 2], W[2, 2] = a * f - c * c, b * c - a * e, a * d - b * b
    det = a * W[0, 0] + b * W[0, 1] + c * W[0, 2]
    if not det > 0.0:
        return False
    for i in range(3):
        for j in range(i, 3):
            W[i, j] /= det
            W[j, i] = W[i, j]
    return True
