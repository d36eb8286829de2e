"""The corners of a square: homographies from and to their rays, their pixels, and its centre, compiled."""

import math

import numpy as np

from ...core.kernels.compiled import compiled
from ...core.se2 import Array

STEP = 1e-5
"""Of a ray, for the derivative of its pixel."""


@compiled
def homography(rays: Array, modules: int) -> Array:
    """(3, 3) from rays (x, y, 1) to the pattern's (u, v, 1), in modules; LinAlgError for degenerate corners."""
    rows = np.zeros((8, 8))
    places = np.zeros(8)
    for k in range(4):
        x, y = rays[k]
        u, v = (modules if k in (1, 2) else 0.0), (modules if k > 1 else 0.0)
        places[2 * k], places[2 * k + 1] = u, v
        rows[2 * k, 0], rows[2 * k, 1], rows[2 * k, 2], rows[2 * k, 6], rows[2 * k, 7] = x, y, 1.0, -u * x, -u * y
        rows[2 * k + 1, 3], rows[2 * k + 1, 4], rows[2 * k + 1, 5] = x, y, 1.0
        rows[2 * k + 1, 6], rows[2 * k + 1, 7] = -v * x, -v * y
    solution = np.linalg.solve(rows, places)
    # The sign for which the pattern is in front: positive at its corners.
    ahead = rays @ solution[6:]
    sign = 1.0
    for k in range(4):
        if not ahead[k] + 1 > 0:
            sign = -1.0
    G = np.empty((3, 3))
    G[2, 2] = sign
    for k in range(8):
        G[k // 3, k % 3] = sign * solution[k]
    return G


@compiled
def corner_rays(G: Array, modules: int, change_cov: Array) -> tuple[Array, Array]:
    """The corners' rays (4, 2) and their covariance (8, 8), from that of the homography's change, (8, 8)."""
    inverse = np.linalg.inv(G)
    by_change = np.zeros((8, 8))
    rays = np.zeros((4, 2))
    for k in range(4):
        p, q = (0.5 if k in (1, 2) else -0.5), (0.5 if k > 1 else -0.5)
        x, y, w = inverse @ np.array([modules * (p + 0.5), modules * (q + 0.5), 1.0])
        rays[k, 0], rays[k, 1] = x / w, y / w
        for row in range(2):
            # A change that moves the pattern's coordinates moves its corners the opposite way.
            by_u = -(inverse[row, 0] - rays[k, row] * inverse[2, 0]) / w
            by_v = -(inverse[row, 1] - rays[k, row] * inverse[2, 1]) / w
            line = by_change[2 * k + row]
            line[0], line[1], line[2] = by_u, by_u * p, by_u * q
            line[3], line[4], line[5] = by_v, by_v * p, by_v * q
            line[6] = (by_u * p + by_v * q) * p
            line[7] = (by_u * p + by_v * q) * q
    return rays, by_change @ change_cov @ by_change.T


@compiled
def to_project(rays: Array, outline: Array, pose: Array) -> Array:
    """(20 + n, 3) points whose pixels `slopes` and `judge` take.

    Those on the plane z = 1 with the `rays` (4, 2), these with more x, more y, less x and less y, and the `outline` (n,
    3) at the `pose` (4, 4).
    """
    points = np.empty((20 + len(outline), 3))
    for k in range(20):
        points[k, 0], points[k, 1], points[k, 2] = rays[k % 4, 0], rays[k % 4, 1], 1.0
    for k in range(4):
        points[4 + k, 0] += STEP
        points[8 + k, 1] += STEP
        points[12 + k, 0] -= STEP
        points[16 + k, 1] -= STEP
    for k in range(len(outline)):
        for i in range(3):
            points[20 + k, i] = pose[i, 3]
            for j in range(3):
                points[20 + k, i] += pose[i, j] * outline[k, j]
    return points


@compiled
def slopes(pixels: Array) -> Array:
    """(4, 2, 2) d pixel / d ray of each corner, from the `pixels` (20 + n, 2) of `to_project`."""
    found = np.empty((4, 2, 2))
    for k in range(4):
        for i in range(2):
            for j in range(2):
                found[k, i, j] = (pixels[4 + 4 * j + k, i] - pixels[12 + 4 * j + k, i]) / (2 * STEP)
    return found


@compiled
def judge(pixels: Array, cov: Array) -> tuple[Array, float]:
    """The corners' covariance (8, 8), px^2, from that of their rays, and their RMS distance from the outline, px.

    From the `pixels` (24, 2) of `to_project`.
    """
    by_ray = slopes(pixels)
    there = np.zeros((8, 8))
    for row in range(8):
        by_row = by_ray[row // 2, row % 2]
        for column in range(8):
            by_column = by_ray[column // 2, column % 2]
            for i in range(2):
                for j in range(2):
                    there[row, column] += by_row[i] * cov[row // 2 * 2 + i, column // 2 * 2 + j] * by_column[j]
    total = 0.0
    for k in range(4):
        total += (pixels[20 + k, 0] - pixels[k, 0]) ** 2 + (pixels[20 + k, 1] - pixels[k, 1]) ** 2
    return there, math.sqrt(total / 4)


@compiled
def mixture(offsets: Array, covs: Array, squares: Array) -> tuple[Array, Array]:
    """Mean (3,) of the centre, and the mean square (6, 6) about it and about no turn.

    Of poses whose centres and turns from the first are `offsets` (n, 6), with `covs` (n, 6, 6), by chi-square (n,).
    """
    weights = np.exp((squares.min() - squares) / 2)
    weights /= weights.sum()
    mean = np.zeros(6)  # of the turn 0: the mean of two poses that project alike is none of a marker
    for k in range(len(weights)):
        for i in range(3):
            mean[i] += weights[k] * offsets[k, i]
    cov = np.zeros((6, 6))
    for k in range(len(weights)):
        for i in range(6):
            for j in range(6):
                cov[i, j] += weights[k] * (covs[k, i, j] + (offsets[k, i] - mean[i]) * (offsets[k, j] - mean[j]))
    return mean[:3].copy(), cov
