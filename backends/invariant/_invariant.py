"""Inner loops of `invariant_ekf.py`.

The belief, in the right-invariant error (x, y, heading, x and y of each landmark): pose (3,) and landmarks' mean (n,);
the pose's three rows of the covariance in full, strip (3, 3 + n); and the landmarks' block, a triangle (see
`_triangle`). Updates of that whole block are low-rank: they are collected as rows w (n,) of `owed`, up to RANK of them,
and then applied at once. The first owing[0] rows are from sightings, each -w' w, and the last owing[1] from turns, each
w' w. New landmarks have no pending updates: from column n on, `owed` is zero.
"""

from math import cos, sin, sqrt

import numpy as np

from ...core.kernels._planar import moved, rotated, wrap
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from .._models import placed, sighted
from ..gaussian._triangle import add_square_of, put, take_less, take_row
from ._arrays import GroupArrays, group_at
from ._group import retract, retract_all

RANK = 48
"""Most deferred updates."""
WRONG = (
    "nothing",
    "an innovation's covariance is not positive definite",
    "a landmark's estimate lies at the robot's own position, where its bearing is undefined",
)
"""Error messages, by the number that `observe` returns."""


@compiled
def fold(g: GroupArrays, n: int) -> None:
    """Applies the deferred updates to the landmarks' block."""
    flat, owed, owing, dgemm, dsyrk = g.flat, g.owed, g.owing, g.blas[0], g.blas[1]
    add_square_of(flat, n, -1.0, owed, owing[0], dgemm, dsyrk)
    add_square_of(flat, n, 1.0, owed[RANK - owing[1] :], owing[1], dgemm, dsyrk)
    owing[:] = 0


@compiled
def move(belief: int, n: int, kept: Ints, delta: Array, cov: Array) -> None:
    """Predicts with the body-frame motion `delta` (3,), noise `cov` (3, 3).

    `belief` is the address of `GroupArrays`. The error itself is unchanged, F = I. The turn's noise acts on everything
    about the origin, a rank-1 update of the whole, but for the `kept` poses (k, 2), which stay; the independent rest of
    the translation's noise affects the position alone.
    """
    g = group_at(belief)
    pose, mean, strip, owed, owing = g.pose, g.mean, g.strip, g.owed, g.owing
    if owing[0] + owing[1] == RANK:
        fold(g, n)
    owing[1] += 1
    c, s = cos(pose[2]), sin(pose[2])
    pose[0], pose[1], pose[2] = moved(pose[0], pose[1], pose[2], delta[0], delta[1], delta[2])
    turn = sqrt(cov[2, 2])
    u, v = cov[0, 2] / turn, cov[1, 2] / turn
    w = owed[RANK - owing[1]]
    for j in range(0, n, 2):
        w[j], w[j + 1] = turn * mean[j + 1], -turn * mean[j]
    for k in range(len(kept)):
        w[kept[k, 0]] = w[kept[k, 0] + 1] = w[kept[k, 1]] = 0.0
    own = (c * u - s * v + turn * pose[1], s * u + c * v - turn * pose[0], turn)
    for i in range(3):
        for j in range(3):
            strip[i, j] += own[i] * own[j]
        for j in range(n):
            strip[i, 3 + j] += own[i] * w[j]
    uu, uv, vv = cov[0, 0] - u * u, cov[0, 1] - u * v, cov[1, 1] - v * v
    xx, xy, yy = rotated(c, s, uu, uv, vv)
    strip[0, 0] += xx
    strip[0, 1] += xy
    strip[1, 0] += xy
    strip[1, 1] += yy


@compiled
def gather(g: GroupArrays, n: int, at: int, rows: Array) -> None:
    """The block's rows of the landmark at `at`, with deferred updates applied, to rows (2, n)."""
    owed, owing = g.owed, g.owing
    take_less(g.flat, at, n, owed, owing[0], rows)
    first, second = rows[0], rows[1]
    for m in range(RANK - owing[1], RANK):
        a, b, w = owed[m, at], owed[m, at + 1], owed[m]
        for j in range(n):
            first[j] += a * w[j]
            second[j] += b * w[j]


@compiled
def gather_row(g: GroupArrays, n: int, i: int, out: Array) -> None:
    """The block's row i, with deferred updates applied, to out (n,)."""
    owed, owing = g.owed, g.owing
    take_row(g.flat, i, n, out)
    for m in range(RANK):
        if m < owing[0] or m >= RANK - owing[1]:
            a, w = owed[m, i] if m >= owing[0] else -owed[m, i], owed[m]
            for j in range(n):
                out[j] += a * w[j]


@compiled
def correct(
    g: GroupArrays, n: int, kept: Ints, landmark: Array, at: int, z: Array, R: Array, own: Array, rows: Array
) -> tuple[float, int]:
    """Corrects by a sighting z (2,), R (2, 2) of a landmark with covariance rows own (2, 3) and rows (2, n).

    The measurement depends on landmark minus position alone: H has no heading column. `at` is the landmark's place in
    the state, -1 for one held fixed, whose error is that of the heading about the origin. The mean and the strip are
    corrected at once; the deferred update replaces `rows`. Returns the normalised innovation squared and an error
    number.
    """
    pose, mean, strip = g.pose, g.mean, g.strip
    dx, dy = landmark[0] - pose[0], landmark[1] - pose[1]
    q = dx * dx + dy * dy
    if not q > 0.0:
        return -1.0, 2
    r, bearing = sighted(pose[0], pose[1], pose[2], landmark[0], landmark[1])
    h00, h01, h10, h11 = dx / r, dy / r, -dy / q, dx / q
    first, second = rows[0], rows[1]
    for j in range(3):  # P H'
        x, y = own[0, j] - strip[0, j], own[1, j] - strip[1, j]
        own[0, j], own[1, j] = h00 * x + h01 * y, h10 * x + h11 * y
    for j in range(n):
        x, y = first[j] - strip[0, 3 + j], second[j] - strip[1, 3 + j]
        first[j], second[j] = h00 * x + h01 * y, h10 * x + h11 * y
    u, v = np.empty(2), np.empty(2)  # H times P: landmark minus position, first in the plane
    for i in range(2):
        if at >= 0:
            u[i], v[i] = rows[i, at] - own[i, 0], rows[i, at + 1] - own[i, 1]
        else:
            u[i], v[i] = landmark[1] * own[i, 2] - own[i, 0], -landmark[0] * own[i, 2] - own[i, 1]
    s00, s10 = h00 * u[0] + h01 * v[0] + R[0, 0], h10 * u[0] + h11 * v[0] + R[1, 0]
    s11 = h10 * u[1] + h11 * v[1] + R[1, 1]
    if not 0.0 < s00 < np.inf:
        return -1.0, 1
    l00 = sqrt(s00)
    l10 = s10 / l00
    rest = s11 - l10 * l10
    if not 0.0 < rest < np.inf:
        return -1.0, 1
    l11 = sqrt(rest)
    nu0 = (z[0] - r) / l00
    nu1 = (wrap(z[1] - bearing) - l10 * nu0) / l11
    for j in range(3):  # W = P H' L^-T, where S = L L'
        own[0, j] /= l00
        own[1, j] = (own[1, j] - l10 * own[0, j]) / l11
    for j in range(n):
        first[j] /= l00
        second[j] = (second[j] - l10 * first[j]) / l11
    for i in range(3):
        by0, by1 = own[0, i], own[1, i]
        for j in range(3):
            strip[i, j] -= by0 * own[0, j] + by1 * own[1, j]
        for j in range(n):
            strip[i, 3 + j] -= by0 * first[j] + by1 * second[j]
    if len(kept) == 0:
        retract(pose, mean, n, own, first, second, nu0, nu1)
    else:
        retract_all(pose, mean, n, kept, own, rows, np.array((nu0, nu1)))
    return nu0 * nu0 + nu1 * nu1, 0


@compiled
def add(g: GroupArrays, n: int, z: Array, R: Array) -> None:
    """Adds a landmark seen at z (2,): its error is that of the position plus the sighting's noise."""
    pose, mean, strip = g.pose, g.mean, g.strip
    r, c, s = z[0], cos(pose[2] + z[1]), sin(pose[2] + z[1])
    mean[n], mean[n + 1] = placed(pose[0], pose[1], pose[2], z[0], z[1])
    a, b, d = R[0, 0], r * R[1, 0], r * r * R[1, 1]
    own = rotated(c, s, a, b, d)
    rows = np.empty((2, n + 2))
    for i in range(2):
        for j in range(n):
            rows[i, j] = strip[i, 3 + j]
        for j in range(i + 1):
            rows[i, n + j] = strip[i, j] + own[i + j]
    put(g.flat, n, n + 2, rows)
    for i in range(3):
        strip[i, 3 + n], strip[i, 4 + n] = strip[i, 0], strip[i, 1]


@compiled
def observe(belief: int, n: int, kept: Ints, slots: Ints, z: Array, R: Array, nis: Array) -> tuple[int, int]:
    """Processes k sightings in their order: z (k, 2), R (k, 2, 2).

    slots[i] is the landmark's number, -1 for a new one, -2 - j for number j of those held fixed.
    Their normalised innovations squared go to `nis` (k,), -1 for none. Returns n and an error number.
    """
    wrong, g = 0, group_at(belief)
    mean, strip, owed, owing, known = g.mean, g.strip, g.owed, g.owing, g.known
    landmark, own = np.empty(2), np.empty((2, 3))
    for i in range(len(slots)):
        nis[i] = -1.0
        if slots[i] == -1:
            add(g, n, z[i], R[i])
            n += 2
            continue
        if owing[0] + owing[1] + 2 > RANK:
            fold(g, n)
        rows = owed[owing[0] : owing[0] + 2]
        at = -1
        if slots[i] >= 0:
            at = 2 * slots[i]
            landmark[0], landmark[1] = mean[at], mean[at + 1]
            gather(g, n, at, rows)
            for j in range(3):
                own[0, j], own[1, j] = strip[j, 3 + at], strip[j, 4 + at]
        else:
            landmark[0], landmark[1] = known[-2 - slots[i], 0], known[-2 - slots[i], 1]
            for j in range(3):
                own[0, j], own[1, j] = landmark[1] * strip[2, j], -landmark[0] * strip[2, j]
            for j in range(n):
                rows[0, j], rows[1, j] = landmark[1] * strip[2, 3 + j], -landmark[0] * strip[2, 3 + j]
        nis[i], wrong = correct(g, n, kept, landmark, at, z[i], R[i], own, rows)
        if wrong:
            break
        owing[0] += 2
    return n, wrong
