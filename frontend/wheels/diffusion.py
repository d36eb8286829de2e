"""White noise along an arc: what the errors of a motion's way and turn do to its end.

Between two readings a robot is taken to drive an arc, evenly: its body moves by (p, q), m in axes of its own, and turns
by a, rad. Errors of the way ahead and of the turn are white along it, with variances F and T over all of it. An error
made while the part v of the arc is still to come acts on this part alone. Seen from the end, in the body frame there,
that part began at C g(v), with C the matrix [[p, -q], [q, p]] and

    g(v) = (sin(a v), cos(a v) - 1) / a

so that the end is off by the turn's error times the perpendicular of C g, and by the way's error in the direction
(cos(a v), -sin(a v)). Integrals over v from 0 to 1, with S(x) = (1 - sin(x) / x) / x^2, are the closed forms below.
Straight ahead over s metres they are the textbook's: T s^2 / 3 sideways, and T s / 2 with the heading.

Motions in a row whose variances are in the proportion of their lengths compose to that of the whole, however it is cut.
"""

import numpy as np

from ...core.elementary import sinc, sincos
from ...core.se2 import Array
from ...core.small_matrices import propagated

SMALL = 0.25
"""rad, below which S is a series: its first term that is left out is 3e-16 of it, the quotient would lose 1e-14."""

_SERIES = (1 / 6, -1 / 120, 1 / 5040, -1 / 362880, 1 / 39916800)


def spread(delta: Array, forward: Array, turn: Array) -> Array:
    """(..., 3, 3) covariances of the motions `delta` (..., 3), in the body frame before them.

    `forward` (...,), m^2, and `turn` (...,), rad^2, are the variances of white errors of the way ahead and of the turn.
    `delta` turns by half a turn at most.
    """
    a = delta[..., 2]
    p, q = even(delta)
    half, whole = sinc(a / 2), sinc(a)
    one, two = _bend(a), _bend(2 * a)
    cov = np.zeros((*a.shape, 3, 3))
    # Of g g' turned by a right angle, and of its mean: along, across and with the heading.
    along, across, both = 2 * turn * (one - two), 2 * turn * two, turn * a * (half**2) ** 2 / 8
    cov[..., 0, 0] = p * p * along - 2 * p * q * both + q * q * across + forward * (1 - 2 * a**2 * two)
    cov[..., 1, 1] = q * q * along + 2 * p * q * both + p * p * across + forward * 2 * a**2 * two
    cov[..., 0, 1] = p * q * (along - across) + (p * p - q * q) * both - forward * a * whole**2 / 2
    mean = turn * a * one, turn * half**2 / 2
    cov[..., 0, 2] = p * mean[0] - q * mean[1]
    cov[..., 1, 2] = q * mean[0] + p * mean[1]
    cov[..., 2, 2] = turn
    for i, j in ((0, 1), (0, 2), (1, 2)):
        cov[..., j, i] = cov[..., i, j]
    s, c = sincos(a)
    to_start = np.zeros_like(cov)
    to_start[..., 0, 0] = to_start[..., 1, 1] = c
    to_start[..., 0, 1], to_start[..., 1, 0], to_start[..., 2, 2] = -s, s, 1.0
    return propagated(to_start, cov)


def even(delta: Array) -> tuple[Array, Array]:
    """m ahead and to the left, (...,) each, that a body moves in axes of its own along the arc to `delta` (..., 3)."""
    s, c = sincos(delta[..., 2] / 2)
    chord = sinc(delta[..., 2] / 2)
    return (c * delta[..., 0] + s * delta[..., 1]) / chord, (c * delta[..., 1] - s * delta[..., 0]) / chord


def along(delta: Array, share: Array) -> Array:
    """(..., 3) the motion over the first `share` (...,) of the arc to `delta` (..., 3)."""
    p, q = even(delta)
    turned = delta[..., 2] * share
    chord = share * sinc(turned / 2)
    s, c = sincos(turned / 2)
    return np.stack((chord * (c * p - s * q), chord * (s * p + c * q), turned), axis=-1)


def _bend(x: Array) -> Array:
    """(1 - sin(x) / x) / x^2."""
    small = np.abs(x) < SMALL
    square = np.where(small, x, 0.0) ** 2
    total = np.zeros_like(square)
    for term in reversed(_SERIES):
        total = total * square + term
    return np.where(small, total, (1 - sinc(x)) / np.where(small, 1.0, x) ** 2)
