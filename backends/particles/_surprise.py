"""How badly sightings and landmarks of particles fit.

With n, U and W of `_particles.py` the surprise of a sighting, if it is of a landmark, is n' U^-1 n + log |U| / |W|: -2
log-likelihood, up to what all landmarks have in common. `work` is that of `_proposal.py`, U that of its poses and
landmarks.
"""

from math import inf, log, sqrt

from ...core.kernels._planar import wrap
from ...core.kernels.compiled import compiled
from ...core.se2 import Array
from ._particles import BLOCK, arctan2


@compiled
def weigh(work: Array, begin: int, end: int, z: Array, cov: Array) -> None:
    """Fills row 17 of `work`, columns `begin` to `end`, with the surprise of a sighting z (2,) of their landmarks.

    These are rows 12 to 16. It is infinite where the landmark is at the very pose.
    """
    range_, bearing = z[0], z[1]
    rr, rb, bb = cov[0, 0], cov[0, 1], cov[1, 1]
    det_r = rr * bb - rb * rb
    for m in range(begin, end):
        dx, dy = work[12 * BLOCK + m] - work[m], work[13 * BLOCK + m] - work[BLOCK + m]
        q = dx * dx + dy * dy
        apart = q > 0
        dx, q = (dx if apart else 1.0), (q if apart else 1.0)
        r = sqrt(q)
        nr = range_ - r
        nb = wrap(bearing - arctan2(dy, dx) + work[2 * BLOCK + m])
        c, s = dx / r, dy / r
        nx, ny = c * nr - dy * nb, s * nr + dx * nb
        i, j, o = work[9 * BLOCK + m], work[10 * BLOCK + m], work[11 * BLOCK + m]
        f1, f2, f3 = dy * i - work[3 * BLOCK + m], dy * j - work[4 * BLOCK + m], dy * o - work[5 * BLOCK + m]
        g1, g2, g3 = -dx * i - work[6 * BLOCK + m], -dx * j - work[7 * BLOCK + m], -dx * o - work[8 * BLOCK + m]
        uxx = work[14 * BLOCK + m] + c * c * rr - 2 * c * dy * rb + dy * dy * bb + f1 * f1 + f2 * f2 + f3 * f3
        uxy = work[15 * BLOCK + m] + c * s * rr + (c * dx - s * dy) * rb - dx * dy * bb + f1 * g1 + f2 * g2 + f3 * g3
        uyy = work[16 * BLOCK + m] + s * s * rr + 2 * s * dx * rb + dx * dx * bb + g1 * g1 + g2 * g2 + g3 * g3
        det_w = det_r * q
        det_u = max(uxx * uyy - uxy * uxy, det_w)
        distance = (uyy * nx * nx - 2 * uxy * nx * ny + uxx * ny * ny) / det_u
        work[17 * BLOCK + m] = distance if apart else inf
        work[18 * BLOCK + m] = det_u / det_w
    for m in range(begin, end):
        work[17 * BLOCK + m] += log(work[18 * BLOCK + m])


@compiled
def spread(work: Array, m: int) -> tuple[float, float]:
    """Bounds the variances of a pose: of its position in any direction, and of its heading."""
    square = 0.0
    for j in range(3, 9):
        square += work[j * BLOCK + m] * work[j * BLOCK + m]
    i, j, o = work[9 * BLOCK + m], work[10 * BLOCK + m], work[11 * BLOCK + m]
    return square, i * i + j * j + o * o


@compiled
def load(work: Array, m: int, landmarks: Array, home: int, row: int) -> None:
    """Copies a landmark to column m of `work`. A row below 0 is none: one at the pose, which it leaves as it is."""
    for j in range(5):
        work[(12 + j) * BLOCK + m] = landmarks[home, j, row] if row >= 0 else (work[j * BLOCK + m] if j < 2 else 0.0)
