"""The place of a landmark by its partial sightings from known poses: a robust fit from several starts.

One range leaves a ring and one bearing a ray, so the squared error has several minima until the robot has moved enough:
two mirrored ones while it drives straight, by ranges. A fit starts at points of the ring of the last range, and along
the ray of the last bearing; the best minimum is the place, and the best one elsewhere tells how sure that is.
"""

from math import atan2, cos, log, pi, sin, sqrt

import numpy as np

from ...core.kernels._planar import wrap
from ...core.kernels.compiled import compiled
from ...core.partial import RANGE
from ...core.se2 import Array, Ints

STARTS = 16
"""Points of a ring, or of a ray, that a fit starts at."""

ITERATIONS = 30
"""Most iterations of a fit."""

SCALE = 2.3849
"""Of the Cauchy loss, in standard deviations, 95 % efficient."""

WIDE = 0.1
"""Standard deviation of a range, in the largest distance, and of a bearing, rad, that a fit begins with.

It is a quarter of what lies between two starts on a ring: precise sightings alone attract a fit from nearby only, and
of two mirrored places one would be missed.
"""

APART = 9.0
"""Squared Mahalanobis distance from the best minimum beyond which another one is another place."""


@compiled
def seen_from(poses: Array, kind: Ints, z: Array, var: Array, mx: float, my: float, J: Array) -> float:
    """Twice the loss of a place (mx, my); J (5,) becomes the information xx, xy, yy and the gradient."""
    total = 0.0
    for i in range(5):
        J[i] = 0.0
    for i in range(len(z)):
        dx, dy = mx - poses[i, 0], my - poses[i, 1]
        q = dx * dx + dy * dy
        r = sqrt(q)
        if not r > 1e-9:
            continue
        if kind[i] == RANGE:
            e, a, b = r - z[i], dx / r, dy / r
        else:
            e, a, b = wrap(atan2(dy, dx) - poses[i, 2] - z[i]), -dy / q, dx / q
        d = e * e / var[i]
        total += SCALE * SCALE * log(1.0 + d / (SCALE * SCALE))
        w = 1.0 / (1.0 + d / (SCALE * SCALE)) / var[i]
        J[0] += w * a * a
        J[1] += w * a * b
        J[2] += w * b * b
        J[3] += w * a * e
        J[4] += w * b * e
    return total


@compiled
def fit(poses: Array, kind: Ints, z: Array, var: Array, at: Array, J: Array) -> float:
    """Moves `at` (2,) to a minimum of the loss by Levenberg and Marquardt's method; J (5,) as in `seen_from`."""
    cost = seen_from(poses, kind, z, var, at[0], at[1], J)
    damping, trial = 1e-3, np.empty(5)
    for _ in range(ITERATIONS):
        xx, xy, yy = J[0] * (1.0 + damping), J[1], J[2] * (1.0 + damping)
        det = xx * yy - xy * xy
        if not det > 0.0:
            return cost
        dx, dy = -(yy * J[3] - xy * J[4]) / det, -(xx * J[4] - xy * J[3]) / det
        other = seen_from(poses, kind, z, var, at[0] + dx, at[1] + dy, trial)
        if other <= cost:
            at[0] += dx
            at[1] += dy
            small = cost - other < 1e-9 * (1.0 + cost)
            cost, damping = other, max(damping / 10.0, 1e-9)
            J[:] = trial
            if small:
                return cost
        else:
            damping *= 10.0
            if damping > 1e9:
                return cost
    return cost


@compiled
def starts(poses: Array, kind: Ints, z: Array, out: Array) -> tuple[int, float]:
    """Fills out (2 STARTS, 2) with points of the last ring and of the last ray.

    Returns their number, and the largest distance (m).
    """
    n, k = 0, len(z)
    ring, ray, size = -1, -1, 0.0
    for i in range(k):
        if kind[i] == RANGE:
            ring = i
            size = max(size, z[i])
        else:
            ray = i
        dx, dy = poses[i, 0] - poses[k - 1, 0], poses[i, 1] - poses[k - 1, 1]
        size = max(size, sqrt(dx * dx + dy * dy))
    if ring >= 0:
        for i in range(STARTS):
            angle = 2.0 * pi * i / STARTS + 0.1
            out[n, 0] = poses[ring, 0] + z[ring] * cos(angle)
            out[n, 1] = poses[ring, 1] + z[ring] * sin(angle)
            n += 1
    if ray >= 0:
        angle = poses[ray, 2] + z[ray]
        far = size / 16.0
        for _ in range(STARTS // 2):
            out[n, 0] = poses[ray, 0] + far * cos(angle)
            out[n, 1] = poses[ray, 1] + far * sin(angle)
            far *= 2.0
            n += 1
    return n, size


@compiled
def minima(poses: Array, kind: Ints, z: Array, var: Array, points: Array, losses: Array, J: Array) -> int:
    """Moves the starts, points (2 STARTS, 2), to minima of the loss; returns their number.

    Fills their losses (2 STARTS,) and J (2 STARTS, 5). A fit begins wide: precise ones do not lead on from far off.
    """
    n, size = starts(poses, kind, z, points)
    wide = np.empty(len(z))
    for i in range(len(z)):
        sd = WIDE * size if kind[i] == RANGE else WIDE
        wide[i] = var[i] + sd * sd
    for i in range(n):
        fit(poses, kind, z, wide, points[i], J[i])
        losses[i] = fit(poses, kind, z, var, points[i], J[i])
    return n


@compiled
def best(poses: Array, kind: Ints, z: Array, var: Array, at: Array, cov: Array) -> tuple[bool, float]:
    """Writes the best place to `at` (2,) and its covariance to `cov` (2, 2).

    Returns False where the sightings determine none, and by how much the loss of the best one elsewhere is larger.
    """
    points, losses, J = np.empty((2 * STARTS, 2)), np.empty(2 * STARTS), np.empty((2 * STARTS, 5))
    n = minima(poses, kind, z, var, points, losses, J)
    least, first = np.inf, -1
    for i in range(n):
        if losses[i] < least and J[i, 0] * J[i, 2] - J[i, 1] * J[i, 1] > 1e-12 * J[i, 0] * J[i, 2]:
            least, first = losses[i], i
    if first < 0:
        return False, 0.0
    own = J[first]
    at[0], at[1] = points[first, 0], points[first, 1]
    det = own[0] * own[2] - own[1] * own[1]
    cov[0, 0], cov[0, 1], cov[1, 0], cov[1, 1] = own[2] / det, -own[1] / det, -own[1] / det, own[0] / det
    second = np.inf
    for i in range(n):
        dx, dy = points[i, 0] - at[0], points[i, 1] - at[1]
        if own[0] * dx * dx + 2.0 * own[1] * dx * dy + own[2] * dy * dy > APART:
            second = min(second, losses[i])
    return True, second - least
