"""Corrects the invariant filter's belief by a range, a bearing, a position or a heading.

To first order, an error xi of the group moves a landmark f by J f xi_h + xi_f, where J rotates by a right angle and h
is its heading, and a kept pose of position p by J p xi_kh + xi_kp, with the heading of its own error. With d = f - p
and q = |d|^2, a range and a bearing from a kept pose change by

    d' / |d| e       and       (J d)' / q e - xi_kh,       e = J f xi_h + xi_f - J p xi_kh - xi_kp

From the present pose, where both errors are one, e = J d xi_h + xi_f - xi_p, and xi_h drops out of either: the Jacobian
depends on d alone, as that of a whole sighting does (Barrau and Bonnabel, arXiv 1510.06263, section 4; Zhang et al.,
IEEE RA-L 2(2), 2017). If all errors are those of one motion of the world, a kept pose's measurements do not change
either. A landmark held fixed does not move: its e lacks the first two terms. A range is multiplied by 1 + scale, whose
derivative is |d|, and an offset is added.

A fix is not invariant: the antenna at a in the body has the place p + R a in the world, which moves by
J (p + R a) xi_h + xi_p, and the heading by xi_h.

Entries are those of `..gaussian._partial`, with the present heading as the eighth of a partial sighting.
"""

from math import atan2, cos, sin, sqrt

import numpy as np

from ...core.kernels._planar import wrap
from ...core.kernels._small import cholesky
from ...core.kernels.compiled import compiled
from ...core.partial import RANGE
from ...core.se2 import Array, Ints
from ..gaussian._ekf import AT_ROBOT, INDEFINITE
from ..gaussian._partial import NO_ENTRY, REFUSED, USED
from ..gaussian._triangle import put
from ._arrays import GroupArrays, group_at
from ._group import retract_all
from ._invariant import RANK, fold, gather_row

HEADING = -1
"""The entry of the present heading."""


@compiled
def expectation(kind: int, at: Array, entries: Ints, H: Array) -> tuple[bool, float]:
    """The range or bearing expected at (7,): a pose, a landmark's x and y, scale and offset.

    H (8,) becomes its Jacobian by the errors of the `entries` (8,). False where the landmark is at the robot.
    """
    dx, dy = at[3] - at[0], at[4] - at[1]
    q = dx * dx + dy * dy
    H[:] = 0.0
    if not q > 0.0:
        return False, 0.0
    r = sqrt(q)
    if kind == RANGE:
        scale = 1.0 + at[5]
        a, b, turn, expected = scale * dx / r, scale * dy / r, 0.0, scale * r + at[6]
        H[5], H[6] = r, 1.0
    else:
        a, b, turn, expected = -dy / q, dx / q, 1.0, wrap(atan2(dy, dx) - at[2])
    H[0], H[1] = -a, -b
    if entries[3] != NO_ENTRY:
        H[3], H[4] = a, b
        if entries[2] == HEADING:
            return True, expected  # both parts of the heading cancel
        H[7] = b * at[3] - a * at[4]
    H[2] = -(b * at[0] - a * at[1]) - turn
    return True, expected


@compiled
def values(g: GroupArrays, entries: Ints, out: Array) -> None:
    """The mean at entries (e,), into `out`; zero where there is none."""
    for e in range(len(entries)):
        i = int(entries[e])
        out[e] = 0.0 if i == NO_ENTRY else g.pose[3 + i] if i < 0 else g.mean[i]


@compiled
def across(g: GroupArrays, n: int, entries: Ints, H: Array, own: Array, rows: Array) -> None:
    """H P for H (e,) by the errors of entries (e,): own (3,) by the pose, rows (n,) by the rest."""
    strip, row = g.strip, np.empty(n)
    own[:], rows[:] = 0.0, 0.0
    for e in range(len(entries)):
        i, h = int(entries[e]), H[e]
        if i == NO_ENTRY or h == 0.0:
            continue
        if i >= 0:
            gather_row(g, n, i, row)
        for j in range(3):
            own[j] += h * (strip[j, 3 + i] if i >= 0 else strip[3 + i, j])
        for j in range(n):
            rows[j] += h * (row[j] if i >= 0 else strip[3 + i, 3 + j])


@compiled
def shift(group: int, n: int, entry: int, x: float, y: float) -> None:
    """Adds an entry's error, times (x, y), to the error of the position; xi_h has no part in it."""
    g = group_at(group)
    row, own, way = np.empty(n), np.empty(3), (x, y)
    gather_row(g, n, entry, row)
    for i in range(3):
        own[i] = g.strip[i, 3 + entry]
    for i in range(2):
        for j in range(n):
            g.strip[i, 3 + j] += way[i] * row[j]
        for j in range(3):
            g.strip[i, j] += way[i] * own[j]
            g.strip[j, i] += way[i] * own[j]
        for j in range(2):
            g.strip[i, j] += way[i] * way[j] * row[entry]


@compiled
def correct(
    g: GroupArrays, n: int, kept: Ints, entries: Ints, H: Array, off: Array, R: Array, gate: float
) -> tuple[int, float]:
    """Corrects by k <= RANK measurements at once: Jacobian H (k, e) by entries (k, e), noise R (k, k) of `off` (k,).

    `kept` (., 2) are the entries of all elements of SE(2) beside the group. Returns the outcome, and the squared
    distance of the innovations; one beyond `gate` is refused, 0 for none.
    """
    strip, owed, owing, k = g.strip, g.owed, g.owing, len(off)
    if owing[0] + owing[1] + k > RANK:
        fold(g, n)
    own, rows, S, nu = np.empty((k, 3)), np.empty((k, n)), np.empty((k, k)), np.empty(k)
    for a in range(k):
        across(g, n, entries[a], H[a], own[a], rows[a])
        for c in range(a + 1):
            S[a, c] = R[a, c]
            for e in range(entries.shape[1]):
                i = int(entries[c, e])
                if i != NO_ENTRY:
                    S[a, c] += H[c, e] * (own[a, 3 + i] if i < 0 else rows[a, i])
    if not cholesky(S, S, k, 0.0, 0.0):
        return INDEFINITE, 0.0
    distance = 0.0
    for a in range(k):
        nu[a] = off[a]
        for c in range(a):
            nu[a] -= S[a, c] * nu[c]
        nu[a] /= S[a, a]
        distance += nu[a] * nu[a]
    if gate > 0.0 and not distance <= gate:
        return REFUSED, distance
    for a in range(k):  # W = L^-1 H P, where S = L L'
        for c in range(a):
            for j in range(3):
                own[a, j] -= S[a, c] * own[c, j]
            for j in range(n):
                rows[a, j] -= S[a, c] * rows[c, j]
        for j in range(3):
            own[a, j] /= S[a, a]
        for j in range(n):
            rows[a, j] /= S[a, a]
            owed[owing[0] + a, j] = rows[a, j]
    for a in range(k):
        for i in range(3):
            for j in range(3):
                strip[i, j] -= own[a, i] * own[a, j]
            for j in range(n):
                strip[i, 3 + j] -= own[a, i] * rows[a, j]
    retract_all(g.pose, g.mean, n, kept, own, rows, nu)
    owing[0] += k
    return USED, distance


@compiled
def partly(
    belief: int, n: int, kept: Ints, entries: Ints, place: Array, kind: Ints, z: Array, var: Array, gate: float
) -> tuple[int, float]:
    """Corrects by k <= RANK partial sightings at once, linearised at the mean: entries (k, 7), z (k,), variances (k,).

    `belief` is the address of `GroupArrays`; `place` (2,) is that of a landmark held fixed, which has no entries.
    """
    g, k = group_at(belief), len(z)
    at, of, H, off, R = np.empty(7), np.empty((k, 8), np.int64), np.empty((k, 8)), np.empty(k), np.zeros((k, k))
    for i in range(k):
        of[i, :7], of[i, 7] = entries[i], HEADING
        values(g, entries[i], at)
        if entries[i, 3] == NO_ENTRY:
            at[3], at[4] = place[0], place[1]
        there, expected = expectation(kind[i], at, of[i], H[i])
        if not there:
            return AT_ROBOT, 0.0
        off[i] = z[i] - expected if kind[i] == RANGE else wrap(z[i] - expected)
        R[i, i] = var[i]
    return correct(g, n, kept, of, H, off, R, gate)


@compiled
def begin(belief: int, n: int, at: int, xy: Array, sd: float) -> None:
    """Sets the entries `at` and `at` + 1, the last, to a new landmark at xy (2,), independent, of that deviation."""
    g = group_at(belief)
    rows = np.zeros((2, n))
    rows[0, at] = rows[1, at + 1] = sd * sd
    put(g.flat, at, n, rows)
    g.mean[at], g.mean[at + 1] = xy[0], xy[1]


@compiled
def fixed(
    belief: int, n: int, kept: Ints, offset: int, z: Array, cov: Array, arm: Array, gate: float
) -> tuple[int, float, int]:
    """Corrects by a fix z (3,), in the frame of the group's origin, NaN where nothing is measured.

    `offset` is the entry of the heading's constant error. Returns the outcome, the squared distance and the number of
    entries measured.
    """
    g = group_at(belief)
    pose = g.pose
    rows = np.flatnonzero(~np.isnan(z))
    k = len(rows)
    entries, H, off, R = np.empty((k, 4), np.int64), np.zeros((k, 4)), np.empty(k), np.empty((k, k))
    c, s = cos(pose[2]), sin(pose[2])
    x, y = pose[0] + c * arm[0] - s * arm[1], pose[1] + s * arm[0] + c * arm[1]
    for a in range(k):
        entries[a, 0], entries[a, 1], entries[a, 2], entries[a, 3] = -3, -2, HEADING, offset
        i = rows[a]
        H[a, i] = 1.0
        if i == 2:
            H[a, 3] = 1.0
            off[a] = wrap(z[2] - pose[2] - (0.0 if offset == NO_ENTRY else g.mean[offset]))
        else:
            H[a, 2] = -y if i == 0 else x
            off[a] = z[i] - (x if i == 0 else y)
        for d in range(k):
            R[a, d] = cov[i, rows[d]]
    why, distance = correct(g, n, kept, entries, H, off, R, gate)
    return why, distance, k
