"""The inner loops of `invariant_ekf.py`.

The belief, in the right-invariant error (x, y, heading, x and y of each landmark): pose (3,) and landmarks' mean (n,);
the pose's three rows of the covariance in full, strip (3, 3 + n); and the lower triangle of the landmarks' block, row
after row, so that it grows at its end without a copy. What changes the whole of that block is low-rank: such
corrections are owed, sign w w' each with w = owed[m, :n], until there are RANK of them, and then folded in at one go.
"""

from math import cos, sin, sqrt

import numpy as np

from ..frontend.compiled import compiled
from ..frontend.se2 import Array, Ints
from ._models import moved, placed, sighted, wrap

RANK = 16
"""Corrections that may be owed, a multiple of eight."""
TILE = 1024
"""Columns that are folded at once: RANK rows of them stay in a processor's second cache."""
WRONG = (
    "nothing",
    "an innovation's covariance is not positive definite",
    "a landmark's estimate lies at the robot's own position, where its bearing is undefined",
)
"""What went wrong, by the number that `take` returns."""


@compiled
def fold(block: Array, n: int, owed: Array, sign: Array, count: int) -> None:
    """Add the `count` corrections that are owed to the lower triangle's n rows."""
    for m in range(count, (count + 7) // 8 * 8):
        sign[m] = 0.0
        for j in range(n):
            owed[m, j] = 0.0
    for start in range(0, n if count > 0 else 0, TILE):
        for i in range(start, n):
            stop, at = min(start + TILE, i + 1), i * (i + 1) // 2
            for m in range(0, count, 8):
                add_eight(
                    block[at + start : at + stop],
                    owed[m, start:stop],
                    owed[m + 1, start:stop],
                    owed[m + 2, start:stop],
                    owed[m + 3, start:stop],
                    owed[m + 4, start:stop],
                    owed[m + 5, start:stop],
                    owed[m + 6, start:stop],
                    owed[m + 7, start:stop],
                    sign[m : m + 8],
                    owed[m : m + 8, i],
                )


@compiled
def add_eight(
    row: Array,
    w0: Array,
    w1: Array,
    w2: Array,
    w3: Array,
    w4: Array,
    w5: Array,
    w6: Array,
    w7: Array,
    sign: Array,
    own: Array,
) -> None:
    """row += own[0] sign[0] w0 + ... + own[7] sign[7] w7, an entry read and written once.

    The rows come one by one and from their first entries on: only then does the compiler take several entries at once.
    """
    b0, b1, b2, b3 = sign[0] * own[0], sign[1] * own[1], sign[2] * own[2], sign[3] * own[3]
    b4, b5, b6, b7 = sign[4] * own[4], sign[5] * own[5], sign[6] * own[6], sign[7] * own[7]
    for j in range(len(row)):
        first = (b0 * w0[j] + b1 * w1[j]) + (b2 * w2[j] + b3 * w3[j])
        row[j] += first + ((b4 * w4[j] + b5 * w5[j]) + (b6 * w6[j] + b7 * w7[j]))


@compiled
def move(
    pose: Array,
    mean: Array,
    strip: Array,
    block: Array,
    n: int,
    delta: Array,
    cov: Array,
    owed: Array,
    sign: Array,
    count: int,
) -> int:
    """Predict with the body-frame motion `delta` (3,), noise `cov` (3, 3); returns how many corrections are owed.

    The error itself is carried over as it is, F = I. The noise of the turn is an error of everything about the origin,
    a rank-1 correction of the whole; what is independent of it in the noise of the translation is the position's alone.
    """
    if count == RANK:
        fold(block, n, owed, sign, count)
        count = 0
    c, s = cos(pose[2]), sin(pose[2])
    pose[0], pose[1], pose[2] = moved(pose[0], pose[1], pose[2], delta[0], delta[1], delta[2])
    turn = sqrt(cov[2, 2])
    u, v = cov[0, 2] / turn, cov[1, 2] / turn
    w = owed[count]
    sign[count] = 1.0
    for j in range(0, n, 2):
        w[j], w[j + 1] = turn * mean[j + 1], -turn * mean[j]
    own = (c * u - s * v + turn * pose[1], s * u + c * v - turn * pose[0], turn)
    for i in range(3):
        for j in range(3):
            strip[i, j] += own[i] * own[j]
        for j in range(n):
            strip[i, 3 + j] += own[i] * w[j]
    uu, uv, vv = cov[0, 0] - u * u, cov[0, 1] - u * v, cov[1, 1] - v * v
    across = c * s * (uu - vv) + (c * c - s * s) * uv
    strip[0, 0] += c * c * uu - 2.0 * c * s * uv + s * s * vv
    strip[0, 1] += across
    strip[1, 0] += across
    strip[1, 1] += s * s * uu + 2.0 * c * s * uv + c * c * vv
    return count + 1


@compiled
def gather(strip: Array, block: Array, n: int, at: int, owed: Array, sign: Array, count: int, columns: Array) -> None:
    """The covariance's columns of the landmark at `at`, as if nothing were owed, to columns (2, 3 + n)."""
    for i in range(2):
        column, k = columns[i], at + i
        for j in range(3):
            column[j] = strip[j, 3 + k]
        for j in range(k + 1):
            column[3 + j] = block[k * (k + 1) // 2 + j]
        for j in range(k + 1, n):
            column[3 + j] = block[j * (j + 1) // 2 + k]
        for m in range(count):
            by, w, rest = sign[m] * owed[m, k], owed[m, :n], column[3 : 3 + n]
            for j in range(n):
                rest[j] += by * w[j]


@compiled
def correct(
    pose: Array,
    mean: Array,
    strip: Array,
    n: int,
    landmark: Array,
    at: int,
    z: Array,
    R: Array,
    columns: Array,
    owed: Array,
    sign: Array,
    count: int,
) -> tuple[float, int]:
    """Correct by a sighting z (2,), R (2, 2) of the landmark whose columns of the covariance are `columns`.

    The measurement depends on landmark less position alone: H has no heading column. `at` is the landmark's place in
    the state, -1 for one held fixed, whose error is that of the heading about the origin. The mean and the strip are
    corrected at once, two corrections of the rest are owed. Returns the normalised innovation squared, and what went
    wrong.
    """
    dx, dy = landmark[0] - pose[0], landmark[1] - pose[1]
    q = dx * dx + dy * dy
    if not q > 0.0:
        return -1.0, 2
    r, bearing = sighted(pose[0], pose[1], pose[2], landmark[0], landmark[1])
    h00, h01, h10, h11 = dx / r, dy / r, -dy / q, dx / q
    first, second = columns[0], columns[1]
    for j in range(3 + n):  # P H'
        x, y = first[j] - strip[0, j], second[j] - strip[1, j]
        first[j], second[j] = h00 * x + h01 * y, h10 * x + h11 * y
    u, v = np.empty(2), np.empty(2)  # what H makes of it: landmark less position, first in the plane
    for i in range(2):
        column = columns[i]
        if at >= 0:
            u[i], v[i] = column[3 + at] - column[0], column[4 + at] - column[1]
        else:
            u[i], v[i] = landmark[1] * column[2] - column[0], -landmark[0] * column[2] - column[1]
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
    for j in range(3 + n):  # W = P H' L^-T, where S = L L'
        first[j] /= l00
        second[j] = (second[j] - l10 * first[j]) / l11
    for i in range(3):
        by0, by1 = first[i], second[i]
        for j in range(3 + n):
            strip[i, j] -= by0 * first[j] + by1 * second[j]
    for j in range(n):
        owed[count, j], owed[count + 1, j] = first[3 + j], second[3 + j]
    sign[count], sign[count + 1] = -1.0, -1.0
    retract(pose, mean, n, first, second, nu0, nu1)
    return nu0 * nu0 + nu1 * nu1, 0


@compiled
def retract(pose: Array, mean: Array, n: int, first: Array, second: Array, nu0: float, nu1: float) -> None:
    """The group's exponential of xi = first nu0 + second nu1, (3 + n,), times the mean: everything turns and shifts."""
    angle = first[2] * nu0 + second[2] * nu1
    c, s = cos(angle), sin(angle)
    along, across = 1.0, 0.0  # the left Jacobian of SO(2): sin(a) / a and (1 - cos(a)) / a
    if angle != 0.0:
        along, across = s / angle, 2.0 * sin(angle / 2.0) * sin(angle / 2.0) / angle
    x, y = first[0] * nu0 + second[0] * nu1, first[1] * nu0 + second[1] * nu1
    pose[0], pose[1] = (
        c * pose[0] - s * pose[1] + along * x - across * y,
        s * pose[0] + c * pose[1] + across * x + along * y,
    )
    pose[2] = wrap(pose[2] + angle)
    for j in range(0, n, 2):
        x, y = first[3 + j] * nu0 + second[3 + j] * nu1, first[4 + j] * nu0 + second[4 + j] * nu1
        mean[j], mean[j + 1] = (
            c * mean[j] - s * mean[j + 1] + along * x - across * y,
            s * mean[j] + c * mean[j + 1] + across * x + along * y,
        )


@compiled
def add(
    pose: Array, mean: Array, strip: Array, block: Array, n: int, z: Array, R: Array, owed: Array, count: int
) -> None:
    """Add a landmark seen at z (2,): in this error it is off as the position is, and by its own sighting's noise."""
    r, c, s = z[0], cos(pose[2] + z[1]), sin(pose[2] + z[1])
    mean[n], mean[n + 1] = placed(pose[0], pose[1], pose[2], z[0], z[1])
    a, b, d = R[0, 0], r * R[1, 0], r * r * R[1, 1]
    own = (
        c * c * a - 2.0 * c * s * b + s * s * d,
        c * s * (a - d) + (c * c - s * s) * b,
        s * s * a + 2.0 * c * s * b + c * c * d,
    )
    for i in range(2):
        at = (n + i) * (n + i + 1) // 2
        for j in range(n):
            block[at + j] = strip[i, 3 + j]
        for j in range(i + 1):
            block[at + n + j] = strip[i, j] + own[i + j]
        for j in range(3):
            strip[j, 3 + n + i] = strip[j, i]
        for m in range(count):
            owed[m, n + i] = 0.0
    for i in range(3):
        strip[i, 3 + n], strip[i, 4 + n] = strip[i, 0], strip[i, 1]


@compiled
def take(
    pose: Array,
    mean: Array,
    strip: Array,
    block: Array,
    n: int,
    known: Array,
    slots: Ints,
    z: Array,
    R: Array,
    owed: Array,
    sign: Array,
    count: int,
    columns: Array,
    nis: Array,
) -> tuple[int, int, int]:
    """Take k sightings in their order: z (k, 2), R (k, 2, 2).

    slots[i] is the landmark's number, -1 for a new one, -2 - j for number j of those in `known` (., 2), held fixed.
    Their normalised innovations squared go to `nis` (k,), -1 for none. Returns n and how many corrections are owed
    afterwards, and what went wrong.
    """
    wrong = 0
    landmark = np.empty(2)
    for i in range(len(slots)):
        nis[i] = -1.0
        if slots[i] == -1:
            add(pose, mean, strip, block, n, z[i], R[i], owed, count)
            n += 2
            continue
        if count + 2 > RANK:
            fold(block, n, owed, sign, count)
            count = 0
        at = -1
        if slots[i] >= 0:
            at = 2 * slots[i]
            landmark[0], landmark[1] = mean[at], mean[at + 1]
            gather(strip, block, n, at, owed, sign, count, columns)
        else:
            landmark[0], landmark[1] = known[-2 - slots[i], 0], known[-2 - slots[i], 1]
            for j in range(3 + n):
                columns[0, j], columns[1, j] = landmark[1] * strip[2, j], -landmark[0] * strip[2, j]
        nis[i], wrong = correct(pose, mean, strip, n, landmark, at, z[i], R[i], columns, owed, sign, count)
        if wrong:
            break
        count += 2
    return n, count, wrong
