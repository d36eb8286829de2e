"""Places in the robot's frame: of sightings, after a motion, and which of them agree."""

from math import cos, sin

import numpy as np

from ...frontend.compiled import compiled
from ...frontend.se2 import Array, Ints
from .._expected import distance
from ._assignment import nearest


@compiled
def place_of(z: Array, R: Array, at: Array, cov: Array) -> None:
    """Position and covariance, in the robot's frame, of sightings z (k, 2), R (k, 2, 2): into at (k, 2), cov (k, 2, 2)."""
    for i in range(len(z)):
        r, c, s = z[i, 0], cos(z[i, 1]), sin(z[i, 1])
        at[i, 0], at[i, 1] = r * c, r * s
        a, b, d = R[i, 0, 0], r * R[i, 1, 0], r * r * R[i, 1, 1]
        cov[i, 0, 0] = c * c * a - 2.0 * c * s * b + s * s * d
        cov[i, 0, 1] = cov[i, 1, 0] = c * s * (a - d) + (c * c - s * s) * b
        cov[i, 1, 1] = s * s * a + 2.0 * c * s * b + c * c * d


@compiled
def carry(at: Array, cov: Array, delta: Array, Q: Array) -> None:
    """Moves places (m, 2) and their covariances (m, 2, 2) to the frame after a motion delta (3,), Q (3, 3).

    p' = R' (p - d) for a motion d with rotation R; its derivative by the motion is [-R', J p'] with J the rotation by
    minus a right angle.
    """
    c, s = cos(delta[2]), sin(delta[2])
    G, M, B = np.empty((2, 3)), np.empty((2, 2)), np.empty((2, 2))
    for i in range(len(at)):
        x, y = at[i, 0] - delta[0], at[i, 1] - delta[1]
        at[i, 0], at[i, 1] = c * x + s * y, -s * x + c * y
        M[0, 0], M[0, 1], M[1, 0], M[1, 1] = c, s, -s, c
        for h in range(2):
            G[h, 0], G[h, 1] = -M[h, 0], -M[h, 1]
        G[0, 2], G[1, 2] = at[i, 1], -at[i, 0]
        for h in range(2):
            for g in range(2):
                total = 0.0
                for p in range(2):
                    for q in range(2):
                        total += M[h, p] * cov[i, p, q] * M[g, q]
                for p in range(3):
                    for q in range(3):
                        total += G[h, p] * Q[p, q] * G[g, q]
                B[h, g] = total
        for h in range(2):
            for g in range(2):
                cov[i, h, g] = B[h, g]


@compiled
def nearest_of(at: Array, cov: Array, others: Array, covs: Array, gate: float) -> Ints:
    """Pairs places (k, 2) with others (m, 2), the closest first, each once; (k,) the other or -1."""
    k, m = len(at), len(others)
    d2, pair = np.empty((k, m)), np.empty(k, np.int64)
    for i in range(k):
        for a in range(m):
            d2[i, a] = distance(
                at[i, 0] - others[a, 0],
                at[i, 1] - others[a, 1],
                cov[i, 0, 0] + covs[a, 0, 0],
                cov[i, 1, 0] + covs[a, 1, 0],
                cov[i, 1, 1] + covs[a, 1, 1],
            )
    nearest(d2, gate, np.zeros(k, np.int64), pair)
    return pair
