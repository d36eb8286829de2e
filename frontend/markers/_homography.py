"""Homography of a pattern from the rays to its corners, and the inverse, compiled."""

import numpy as np

from ..compiled import compiled
from ..se2 import Array


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
