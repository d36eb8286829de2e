"""FastSLAM's loops over particles, written for SIMD code.

Particles are columns: `poses` (5, M) holds x, y, heading and the heading's cosine and sine, and `filters` (slots, 5, M)
every particle's mean x, y and covariance xx, xy, yy of the landmark that a slot belongs to. A loop runs over a BLOCK of
particles at a time, which keeps their poses in the first-level cache while sightings are processed one by one; inside
it there are no branches and no calls, only selections, or it would not become SIMD code.

A sighting z of covariance R is transformed to the world: seen from a pose (x, y, heading), a landmark at the offset d =
(dx, dy), r m away, has the Jacobian H of ArUco EKF SLAM, eq. (16), which is invertible, so the innovation is n = H^-1
(z - h), in metres, of covariance W = H^-1 R H^-T. With U = P + W the EKF of a landmark is

    m + P U^-1 n,    (|W| P + |P| W) / |U|,    -2 log-likelihood + constant = n' U^-1 n + log |U| / |W|

where the covariance is (P^-1 + W^-1)^-1 written for 2x2 matrices: a sum of positive definite ones, which stays so under
rounding, and which leaves a landmark of zero covariance unchanged.

A landmark at a particle's very position has no bearing: that particle's likelihood is zero, its map unchanged.
"""

from math import inf, pi, sqrt

import numpy as np

from ...core.kernels._planar import rotated, wrap
from ...core.kernels._small import factored
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints

BLOCK = 256
"""Particles at a time: the data of a sighting fits into 32 kB."""
LOGGED = 8
"""Likelihoods multiplied before a logarithm is taken, within a double's range."""


@compiled
def arctan2(y: float, x: float) -> float:
    """The angle (rad) of (x, y), to 5e-16: the rational approximation of Cephes' atan up to tan(pi / 8)."""
    across, along = abs(y), abs(x)
    low, high = min(across, along), max(across, along)
    steep = low > 0.41421356237309503 * high
    t = (low - high if steep else low) / (low + high if steep else high)
    v = t * t
    p = -8.750608600031904122785e-1 * v - 1.615753718733365076637e1
    p = ((p * v - 7.500855792314704667340e1) * v - 1.228866684490136173410e2) * v - 6.485021904942025371773e1
    q = ((v + 2.485846490142306297962e1) * v + 1.650270098316988542046e2) * v + 4.328810604912902668951e2
    q = (q * v + 4.853903996359136964868e2) * v + 1.945506571482613964425e2
    angle = t + t * v * p / q + (0.25 * pi if steep else 0.0)
    angle = 0.5 * pi - angle if across > along else angle
    angle = pi - angle if x < 0 else angle
    return -angle if y < 0 else angle


@compiled
def cosine_sine(angle: float) -> tuple[float, float]:
    """Cosine and sine of an `angle` (rad) of a few turns at most, to 3e-16: Cephes' polynomials up to pi / 4."""
    quarter = np.floor(angle * (2 / pi) + 0.5)
    t = ((angle - quarter * 1.5707963267341256) - quarter * 6.077100506303966e-11) - quarter * 2.0222662487959506e-21
    v = t * t
    c = -1.13585365213876817300e-11 * v + 2.08757008419747316778e-9
    c = ((c * v - 2.75573141792967388112e-7) * v + 2.48015872888517045348e-5) * v - 1.38888888888730564116e-3
    c = (c * v + 4.16666666666665929218e-2) * v * v - 0.5 * v + 1.0
    s = 1.58962301576546568060e-10 * v - 2.50507477628578072866e-8
    s = ((s * v + 2.75573136213857245213e-6) * v - 1.98412698295895385996e-4) * v + 8.33333333332211858878e-3
    s = (s * v - 1.66666666666666307295e-1) * v * t + t
    odd = quarter - 2 * np.floor(0.5 * quarter) > 0.5
    third = quarter - 4 * np.floor(0.25 * quarter)
    cosine, sine = (s if odd else c), (c if odd else s)
    return (-cosine if third == 1 or third == 2 else cosine), (-sine if third >= 2 else sine)


@compiled
def root(cov: Array) -> tuple[float, float, float, float, float, float]:
    """The Cholesky factor of a (3, 3) covariance, row by row; NaN where it is indefinite."""
    return factored(cov[0, 0], cov[1, 0], cov[1, 1], cov[2, 0], cov[2, 1], cov[2, 2])


@compiled
def move(poses: Array, delta: Array, cov: Array, noise: Array) -> None:
    """Samples every particle's motion: `delta` (3,) in its body frame, plus the root of `cov` times `noise` (3, M)."""
    ra, rb, rc, rd, re, rf = root(cov)
    for start in range(0, poses.shape[1], BLOCK):
        part = slice(start, start + BLOCK)
        x, y, heading, cos, sin = poses[0, part], poses[1, part], poses[2, part], poses[3, part], poses[4, part]
        first, second, third = noise[0, part], noise[1, part], noise[2, part]
        for m in range(len(x)):
            dx = delta[0] + ra * first[m]
            dy = delta[1] + rb * first[m] + rc * second[m]
            turn = delta[2] + rd * first[m] + re * second[m] + rf * third[m]
            x[m] += cos[m] * dx - sin[m] * dy
            y[m] += sin[m] * dx + cos[m] * dy
            heading[m] = wrap(heading[m] + turn)
            cos[m], sin[m] = cosine_sine(heading[m])


@compiled
def correct(poses: Array, filters: Array, slots: Ints, z: Array, cov: Array, distance: Array, volume: Array) -> None:
    """Corrects the landmarks in `slots` (k,), which are up to date, by the sightings z (k, 2) of covariance (k, 2, 2).

    Adds n' U^-1 n of each to `distance` (M,), and multiplies `volume` (ceil(k / LOGGED), M), row i // LOGGED, by |U| /
    |W| of the i-th.
    """
    for start in range(0, poses.shape[1], BLOCK):
        part = slice(start, start + BLOCK)
        x, y, heading, off = poses[0, part], poses[1, part], poses[2, part], distance[part]
        for k in range(len(slots)):
            slot = slots[k]
            mx, my = filters[slot, 0, part], filters[slot, 1, part]
            pxx, pxy, pyy = filters[slot, 2, part], filters[slot, 3, part], filters[slot, 4, part]
            spread = volume[k // LOGGED, part]
            range_, bearing = z[k, 0], z[k, 1]
            rr, rb, bb = cov[k, 0, 0], cov[k, 0, 1], cov[k, 1, 1]
            det_r = rr * bb - rb * rb
            for m in range(len(x)):
                dx, dy = mx[m] - x[m], my[m] - y[m]
                q = dx * dx + dy * dy
                apart = q > 0
                dx, q = (dx if apart else 1.0), (q if apart else 1.0)
                per_r = 1 / sqrt(q)
                nr = range_ - q * per_r
                nb = wrap(bearing - arctan2(dy, dx) + heading[m])
                c, s = dx * per_r, dy * per_r
                nx, ny = c * nr - dy * nb, s * nr + dx * nb
                wxx = c * c * rr - 2 * c * dy * rb + dy * dy * bb
                wxy = c * s * rr + (c * dx - s * dy) * rb - dx * dy * bb
                wyy = s * s * rr + 2 * s * dx * rb + dx * dx * bb
                a, b, d = pxx[m], pxy[m], pyy[m]
                uxx, uxy, uyy = a + wxx, b + wxy, d + wyy
                det_w = det_r * q
                det_u = max(uxx * uyy - uxy * uxy, det_w)
                per_u = 1 / det_u
                gx, gy = (uyy * nx - uxy * ny) * per_u, (uxx * ny - uxy * nx) * per_u
                of_p, of_w = det_w * per_u, max(a * d - b * b, 0.0) * per_u
                off[m] += nx * gx + ny * gy if apart else inf
                spread[m] *= det_u * per_r * per_r / det_r
                mx[m] += a * gx + b * gy if apart else 0.0
                my[m] += b * gx + d * gy if apart else 0.0
                pxx[m] = of_p * a + of_w * wxx if apart else a
                pxy[m] = of_p * b + of_w * wxy if apart else b
                pyy[m] = of_p * d + of_w * wyy if apart else d


@compiled
def place(poses: Array, filters: Array, slot: int, z: Array, cov: Array) -> None:
    """Initialises a landmark in each particle from z (2,), covariance (2, 2): ArUco EKF SLAM, eqs (17) and (20)."""
    x, y, cos, sin = poses[0], poses[1], poses[3], poses[4]
    mx, my, pxx, pxy, pyy = filters[slot, 0], filters[slot, 1], filters[slot, 2], filters[slot, 3], filters[slot, 4]
    cz, sz = cosine_sine(z[1])
    rr, rb, bb = cov[0, 0], cov[0, 1] * z[0], cov[1, 1] * z[0] * z[0]
    for m in range(len(x)):
        c, s = cos[m] * cz - sin[m] * sz, sin[m] * cz + cos[m] * sz
        mx[m], my[m] = x[m] + z[0] * c, y[m] + z[0] * s
        pxx[m], pxy[m], pyy[m] = rotated(c, s, rr, rb, bb)
