"""FastSLAM 2.0's proposal: each particle's pose given its odometry and its sightings of its own map.

Montemerlo, Thrun, Koller, Wegbreit (IJCAI 2003), eqs (6) to (15), one sighting after another as in Montemerlo's thesis
(2003), section 4.3: the pose after the motion is a Gaussian of mean (x, y, heading) and covariance A A', which every
sighting of a known landmark corrects like an EKF, the landmark's own uncertainty counted as noise. The product of the
sightings' marginal likelihoods is the particle's importance factor. A, not A A', is propagated (Andrews 1968): however
sharp the sightings against the odometry, no covariance can become indefinite.

Layout, blocks and the notation n, W, U are those of `_particles.py`. In the world the Jacobian by the pose is G = [-1 0
dy; 0 -1 -dx], so with F = A' G' and V = P + W the innovation's covariance is U = F' F + V.
"""

from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from ...core.kernels._planar import wrap
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from ._particles import BLOCK, LOGGED, arctan2, cosine_sine, root

ROWS = 19
"""Rows of `work`: see `fold`."""


class Motion(NamedTuple):
    """A motion in the body frame, and the random numbers by which poses after it are drawn."""

    delta: Array  # (3,) dx, dy (m), dtheta (rad)
    cov: Array  # (3, 3)
    noise: Array  # (3, M) standard normal


@compiled
def fold(work: Array, count: int, z: Array, cov: Array) -> None:
    """Corrects `count` proposals by one sighting z (2,) of covariance (2, 2): mean and A, rows of `work` as below.

    Rows 0 to 2 hold the mean, 3 to 11 A, 12 to 16 the landmark; rows 17 and 18 receive n' U^-1 n and |U| / |W|. It is
    one flat array because the compiler must know that its rows do not overlap.
    """
    range_, bearing = z[0], z[1]
    rr, rb, bb = cov[0, 0], cov[0, 1], cov[1, 1]
    det_r = rr * bb - rb * rb
    for m in range(count):
        dx, dy = work[12 * BLOCK + m] - work[m], work[13 * BLOCK + m] - work[BLOCK + m]
        q = dx * dx + dy * dy
        apart = q > 0
        used = 1.0 if apart else 0.0
        dx, q = (dx if apart else 1.0), (q if apart else 1.0)
        per_r = 1 / sqrt(q)
        nr = range_ - q * per_r
        nb = wrap(bearing - arctan2(dy, dx) + work[2 * BLOCK + m])
        c, s = dx * per_r, dy * per_r
        nx, ny = c * nr - dy * nb, s * nr + dx * nb
        vxx = work[14 * BLOCK + m] + c * c * rr - 2 * c * dy * rb + dy * dy * bb
        vxy = work[15 * BLOCK + m] + c * s * rr + (c * dx - s * dy) * rb - dx * dy * bb
        vyy = work[16 * BLOCK + m] + s * s * rr + 2 * s * dx * rb + dx * dx * bb
        a, b, e = work[3 * BLOCK + m], work[4 * BLOCK + m], work[5 * BLOCK + m]
        f, g, h = work[6 * BLOCK + m], work[7 * BLOCK + m], work[8 * BLOCK + m]
        i, j, o = work[9 * BLOCK + m], work[10 * BLOCK + m], work[11 * BLOCK + m]
        f1, f2, f3 = dy * i - a, dy * j - b, dy * o - e
        g1, g2, g3 = -dx * i - f, -dx * j - g, -dx * o - h
        uxx = vxx + f1 * f1 + f2 * f2 + f3 * f3
        uxy = vxy + f1 * g1 + f2 * g2 + f3 * g3
        uyy = vyy + g1 * g1 + g2 * g2 + g3 * g3
        det_w = det_r * q
        det_v = max(vxx * vyy - vxy * vxy, det_w)
        det_u = max(uxx * uyy - uxy * uxy, det_v)
        v11, u11 = sqrt(vxx), sqrt(uxx)  # Cholesky factors of V and U
        per_u11 = 1 / u11
        per_v11 = 1 / v11
        u22, v22 = sqrt(det_u) * per_u11, sqrt(det_v) * per_v11
        per_u22, u21 = 1 / u22, uxy * per_u11
        per_s11, per_s22 = 1 / (u11 + v11), 1 / (u22 + v22)
        s21 = (u21 + vxy * per_v11) * per_s11
        n1 = nx * per_u11
        n2 = (ny - u21 * n1) * per_u22
        p1, p2 = (a * f1 + b * f2 + e * f3) * per_u11 * used, a * g1 + b * g2 + e * g3
        q1, q2 = (f * f1 + g * f2 + h * f3) * per_u11 * used, f * g1 + g * g2 + h * g3
        t1, t2 = (i * f1 + j * f2 + o * f3) * per_u11 * used, i * g1 + j * g2 + o * g3
        p2, q2, t2 = (
            (p2 - u21 * p1) * per_u22 * used,
            (q2 - u21 * q1) * per_u22 * used,
            (t2 - u21 * t1) * per_u22 * used,
        )
        work[m] += p1 * n1 + p2 * n2  # (p, q, t): A F U^-T/2
        work[BLOCK + m] += q1 * n1 + q2 * n2
        work[2 * BLOCK + m] += t1 * n1 + t2 * n2
        p2, q2, t2 = p2 * per_s22, q2 * per_s22, t2 * per_s22  # now times (U^1/2 + V^1/2)^-1
        p1, q1, t1 = p1 * per_s11 - p2 * s21, q1 * per_s11 - q2 * s21, t1 * per_s11 - t2 * s21
        work[3 * BLOCK + m] = a - p1 * f1 - p2 * g1
        work[4 * BLOCK + m] = b - p1 * f2 - p2 * g2
        work[5 * BLOCK + m] = e - p1 * f3 - p2 * g3
        work[6 * BLOCK + m] = f - q1 * f1 - q2 * g1
        work[7 * BLOCK + m] = g - q1 * f2 - q2 * g2
        work[8 * BLOCK + m] = h - q1 * f3 - q2 * g3
        work[9 * BLOCK + m] = i - t1 * f1 - t2 * g1
        work[10 * BLOCK + m] = j - t1 * f2 - t2 * g2
        work[11 * BLOCK + m] = o - t1 * f3 - t2 * g3
        work[17 * BLOCK + m] = n1 * n1 + n2 * n2 if apart else inf
        work[18 * BLOCK + m] = det_u / det_w


@compiled
def predict(work: Array, poses: Array, start: int, count: int, motion: Motion) -> None:
    """Fills mean and A in `work` for `count` particles from `start` on: poses after a motion, before sightings."""
    (ra, rb, rc, rd, re, rf), delta = root(motion.cov), motion.delta
    part = slice(start, start + count)
    x, y, heading, cos, sin = poses[0, part], poses[1, part], poses[2, part], poses[3, part], poses[4, part]
    for m in range(count):
        c, s = cos[m], sin[m]
        work[m] = x[m] + c * delta[0] - s * delta[1]
        work[BLOCK + m] = y[m] + s * delta[0] + c * delta[1]
        work[2 * BLOCK + m] = heading[m] + delta[2]
        work[3 * BLOCK + m], work[4 * BLOCK + m], work[5 * BLOCK + m] = c * ra - s * rb, -s * rc, 0.0
        work[6 * BLOCK + m], work[7 * BLOCK + m], work[8 * BLOCK + m] = s * ra + c * rb, c * rc, 0.0
        work[9 * BLOCK + m], work[10 * BLOCK + m], work[11 * BLOCK + m] = rd, re, rf


@compiled
def draw(work: Array, poses: Array, start: int, count: int, noise: Array) -> None:
    """Samples the poses of `count` particles from `start` on: mean plus the Cholesky factor of A A' times `noise`."""
    part = slice(start, start + count)
    x, y, heading, cos, sin = poses[0, part], poses[1, part], poses[2, part], poses[3, part], poses[4, part]
    first, second, third = noise[0, part], noise[1, part], noise[2, part]
    for m in range(count):
        # orthogonalise the rows of A one after another: its Cholesky factor, without a difference of squares
        a, b, e = work[3 * BLOCK + m], work[4 * BLOCK + m], work[5 * BLOCK + m]
        l11 = sqrt(a * a + b * b + e * e)
        a, b, e = a / l11, b / l11, e / l11
        f, g, h = work[6 * BLOCK + m], work[7 * BLOCK + m], work[8 * BLOCK + m]
        l21 = a * f + b * g + e * h
        f, g, h = f - l21 * a, g - l21 * b, h - l21 * e
        l22 = sqrt(f * f + g * g + h * h)
        f, g, h = f / l22, g / l22, h / l22
        i, j, o = work[9 * BLOCK + m], work[10 * BLOCK + m], work[11 * BLOCK + m]
        l31 = a * i + b * j + e * o
        l32 = f * i + g * j + h * o
        i, j, o = i - l31 * a - l32 * f, j - l31 * b - l32 * g, o - l31 * e - l32 * h
        l33 = sqrt(i * i + j * j + o * o)
        x[m] = work[m] + l11 * first[m]
        y[m] = work[BLOCK + m] + l21 * first[m] + l22 * second[m]
        heading[m] = wrap(work[2 * BLOCK + m] + l31 * first[m] + l32 * second[m] + l33 * third[m])
        cos[m], sin[m] = cosine_sine(heading[m])


@compiled
def fold_all(
    work: Array, count: int, filters: Array, slots: Ints, z: Array, cov: Array, part: slice, off: Array, volume: Array
) -> None:  # fmt: skip
    """Corrects the proposals of the `count` particles in `part` by sightings (k,); `off` (count,) is their distance."""
    for k in range(len(slots)):
        for i in range(5):
            work[(12 + i) * BLOCK : (12 + i) * BLOCK + count] = filters[slots[k], i, part]
        fold(work, count, z[k], cov[k])
        spread = volume[k // LOGGED, part]
        for m in range(count):
            off[m] += work[17 * BLOCK + m]
            spread[m] *= work[18 * BLOCK + m]


@compiled
def propose(
    poses: Array,
    motion: Motion,
    filters: Array,
    slots: Ints,
    z: Array,
    cov: Array,
    distance: Array,
    volume: Array,
) -> None:
    """Samples every particle's pose after the motion from its proposal.

    The pose is the proposal's mean plus the Cholesky factor of its covariance, in the world frame, times the noise.
    `filters`, `slots`, `z`, `cov`, `distance` and `volume` are those of `correct`; the filters are only read.
    """
    for start in range(0, poses.shape[1], BLOCK):
        part = slice(start, start + BLOCK)
        off = distance[part]
        count = len(off)
        work = np.empty(ROWS * BLOCK)
        predict(work, poses, start, count, motion)
        fold_all(work, count, filters, slots, z, cov, part, off, volume)
        draw(work, poses, start, count, motion.noise)
