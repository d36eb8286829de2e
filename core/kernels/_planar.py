"""Planar motions in compiled code: angles, composition, and the propagation of covariances.

A covariance of (x, y, heading) is a matrix (3, 3), or six numbers in the order xx, xy, xt, yy, yt, tt.
"""

from math import cos, pi, sin, sqrt

import numpy as np

from ..se2 import Array
from .compiled import compiled


@compiled
def wrap(angle: float) -> float:
    """Wraps an angle (rad) to (-pi, pi]; one already there is returned bit for bit.

    It has no branch around a costly operation, so that loops over it become SIMD code.
    """
    turned = angle - 2 * pi * np.floor((angle + pi) / (2 * pi))
    return angle if -pi < angle <= pi else (pi if turned <= -pi or turned > pi else turned)


@compiled
def moved(x: float, y: float, heading: float, dx: float, dy: float, turn: float) -> tuple[float, float, float]:
    """The pose after a motion in its body frame: ArUco EKF SLAM, eq. (2)."""
    c, s = cos(heading), sin(heading)
    return x + c * dx - s * dy, y + s * dx + c * dy, wrap(heading + turn)


@compiled
def rotated(c: float, s: float, xx: float, xy: float, yy: float) -> tuple[float, float, float]:
    """A covariance xx, xy, yy of a point, rotated by the angle of cosine `c` and sine `s`."""
    return (
        c * c * xx - 2 * c * s * xy + s * s * yy,
        c * s * (xx - yy) + (c * c - s * s) * xy,
        s * s * xx + 2 * c * s * xy + c * c * yy,
    )


@compiled
def add_rotated(P: Array, c: float, s: float, motion: Array) -> None:
    """Adds the covariance of a motion, from a heading of cosine `c` and sine `s`, to a pose's P (3, 3), kept symmetric.

    Row 0 of `motion` (4, 3) is the motion itself, which is not used, the others are its covariance.
    """
    xt, yt = motion[1, 2], motion[2, 2]
    xx, xy, yy = rotated(c, s, motion[1, 0], motion[1, 1], motion[2, 1])
    P[0, 0] += xx
    P[1, 1] += yy
    P[2, 2] += motion[3, 2]
    P[1, 0] += xy
    P[2, 0] += c * xt - s * yt
    P[2, 1] += s * xt + c * yt
    P[0, 1], P[0, 2], P[1, 2] = P[1, 0], P[2, 0], P[2, 1]


@compiled
def propagate(P: Array, gx: float, gy: float, heading: float, motion: Array) -> None:
    """Propagates a pose's covariance P (3, 3), in place, by a motion from `heading`: ArUco EKF SLAM, eq. (6).

    The Jacobian by the pose is [1, 0, gx; 0, 1, gy; 0, 0, 1]; `motion` is as in `add_rotated`.
    """
    for i in range(3):
        P[0, i] += gx * P[2, i]
        P[1, i] += gy * P[2, i]
    for i in range(3):
        P[i, 0] += gx * P[i, 2]
        P[i, 1] += gy * P[i, 2]
    add_rotated(P, cos(heading), sin(heading), motion)


Six = tuple[float, float, float, float, float, float]
"""A covariance or an information in compiled code that allocates nothing."""


@compiled
def lever(xx: float, xy: float, xt: float, yy: float, yt: float, tt: float, gx: float, gy: float) -> Six:
    """G S G' for a covariance S and G = [1, 0, gx; 0, 1, gy; 0, 0, 1]."""
    return (
        xx + (2 * gx * xt + gx * gx * tt),
        xy + (gx * yt + gy * xt + gx * gy * tt),
        xt + gx * tt,
        yy + (2 * gy * yt + gy * gy * tt),
        yt + gy * tt,
        tt,
    )


@compiled
def levered(S: Array, gx: float, gy: float) -> None:
    """S = G S G' for a covariance S (6,)."""
    S[0], S[1], S[2], S[3], S[4], S[5] = lever(S[0], S[1], S[2], S[3], S[4], S[5], gx, gy)


@compiled
def turned(c: float, s: float, Q: Array, k: int) -> Six:
    """R Q R' for a covariance Q[k : k + 6], R the rotation of cosine `c` and sine `s`."""
    xx, xy, yy = rotated(c, s, Q[k], Q[k + 1], Q[k + 3])
    xt, yt = Q[k + 2], Q[k + 4]
    return xx, xy, c * xt - s * yt, yy, s * xt + c * yt, Q[k + 5]


@compiled
def add_turned(S: Array, c: float, s: float, Q: Array, k: int) -> None:
    """S += R Q R' for a covariance S (6,)."""
    xx, xy, xt, yy, yt, tt = turned(c, s, Q, k)
    S[0] += xx
    S[1] += xy
    S[2] += xt
    S[3] += yy
    S[4] += yt
    S[5] += tt


@compiled
def inverse(xx: float, xy: float, xt: float, yy: float, yt: float, tt: float) -> tuple[bool, Six]:
    """True and its inverse if a covariance is positive definite, else False.

    By the Cholesky factor and its reciprocals: variances along a long way differ by many orders of magnitude.
    """
    none = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if not xx > 0.0:
        return False, none
    a = 1.0 / sqrt(xx)
    l10, l20 = xy * a, xt * a
    d = yy - l10 * l10
    if not d > 0.0:
        return False, none
    b = 1.0 / sqrt(d)
    l21 = (yt - l20 * l10) * b
    d = tt - l20 * l20 - l21 * l21
    if not d > 0.0:
        return False, none
    c = 1.0 / sqrt(d)
    i10 = -l10 * a * b
    i21 = -l21 * b * c
    i20 = -(l20 * a + l21 * i10) * c
    return True, (a * a + i10 * i10 + i20 * i20, i10 * b + i20 * i21, i20 * c, b * b + i21 * i21, i21 * c, c * c)


@compiled
def information(S: Array, i: int, W: Array, k: int) -> bool:
    """W[k : k + 6] = S^-1 for a covariance S[i : i + 6]; False where it is not positive definite."""
    definite, found = inverse(S[i], S[i + 1], S[i + 2], S[i + 3], S[i + 4], S[i + 5])
    if definite:
        W[k], W[k + 1], W[k + 2], W[k + 3], W[k + 4], W[k + 5] = found
    return definite
