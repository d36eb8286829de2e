"""Corrects a joint belief by measurements of few entries of its state: a range, a bearing, a position, a heading.

An entry is counted from the first one of the map: -3, -2 and -1 are the pose's x, y and heading. A kept pose has three
entries of the map (see `kept_poses`), a landmark two, and the constant errors of a sensor two: scale and offset.
"""

from math import atan2, cos, sin, sqrt

import numpy as np

from ...core.kernels._planar import wrap
from ...core.kernels._small import cholesky
from ...core.kernels._turns import conditioned
from ...core.kernels.compiled import compiled
from ...core.partial import RANGE
from ...core.se2 import Array, Ints
from ._beliefs import JointArrays, belief_at
from ._ekf import AT_ROBOT, FIRST, IDEAL, INDEFINITE, advance, settle
from ._triangle import put, take_row
from ._triangle import row as row_at

NO_ENTRY = -4
"""In place of an entry: there is none, and it counts as zero."""

USED, REFUSED = 0, -1
"""Outcome of a correction; else the reason why it failed."""


@compiled
def entry_rows(b: JointArrays, n: int, entries: Ints, H: Array, u: Array, v: Array) -> None:
    """H P for H (k, e) of the given entries: u (k, 3) by the pose, v (k, n) by the map."""
    k = H.shape[0]
    row = np.empty(n)
    u[:], v[:] = 0.0, 0.0
    for e in range(len(entries)):
        i = int(entries[e])
        if i == NO_ENTRY:
            continue
        if i < 0:
            for a in range(k):
                h = H[a, e]
                if h == 0.0:
                    continue
                for j in range(3):
                    u[a, j] += h * b.pose[3 + i, j]
                for j in range(n):
                    v[a, j] += h * b.cross[3 + i, j]
            continue
        take_row(b.flat, i, n, row)
        for a in range(k):
            h = H[a, e]
            if h == 0.0:
                continue
            for j in range(3):
                u[a, j] += h * b.cross[j, i]
            for j in range(n):
                v[a, j] += h * row[j]


@compiled
def correct(
    b: JointArrays, n: int, entries: Ints, H: Array, innovation: Array, R: Array, gate: float
) -> tuple[int, float]:
    """Corrects by a measurement with Jacobian H (k, e) by some entries, k <= 3, and noise R (k, k).

    Returns the outcome, and the squared Mahalanobis distance of the innovation (k,); one beyond `gate` is refused.
    """
    k = H.shape[0]
    u, v, S, f = np.empty((k, 3)), np.empty((k, n)), np.empty((k, k)), np.empty(k)
    entry_rows(b, n, entries, H, u, v)
    for a in range(k):
        for c in range(a + 1):
            total = R[a, c]
            for e in range(len(entries)):
                i = int(entries[e])
                if i != NO_ENTRY:
                    total += H[c, e] * (u[a, 3 + i] if i < 0 else v[a, i])
            S[a, c] = total
    if not cholesky(S, S, k, 0.0, 0.0):
        return INDEFINITE, 0.0
    distance = 0.0
    for a in range(k):
        rest = innovation[a]
        for c in range(a):
            rest -= S[a, c] * f[c]
        f[a] = rest / S[a, a]
        distance += f[a] * f[a]
    if gate > 0.0 and not distance <= gate:
        return REFUSED, distance
    Wp, Wm = b.owed_pose, b.owed_map
    for a in range(k):
        for j in range(3):
            rest = u[a, j]
            for c in range(a):
                rest -= S[a, c] * Wp[c, j]
            Wp[a, j] = rest / S[a, a]
            b.mean[j] += Wp[a, j] * f[a]
        for j in range(n):
            rest = v[a, j]
            for c in range(a):
                rest -= S[a, c] * Wm[c, j]
            Wm[a, j] = rest / S[a, a]
            b.mean[3 + j] += Wm[a, j] * f[a]
    b.mean[2] = wrap(b.mean[2])
    settle(b, n, 0, k)
    return USED, distance


@compiled
def expectation(kind: int, at: Array, H: Array) -> tuple[bool, float]:
    """The range or bearing expected at (7,): a pose, a landmark's x and y, scale and offset; H (1, 7) its Jacobian.

    False where the landmark is at the robot, and neither has a derivative.
    """
    dx, dy = at[3] - at[0], at[4] - at[1]
    q = dx * dx + dy * dy
    H[:] = 0.0
    if not q > 0.0:
        return False, 0.0
    r = sqrt(q)
    if kind == RANGE:
        scale = 1.0 + at[5]
        H[0, 3], H[0, 4], H[0, 5], H[0, 6] = scale * dx / r, scale * dy / r, r, 1.0
        expected = scale * r + at[6]
    else:
        H[0, 2], H[0, 3], H[0, 4] = -1.0, -dy / q, dx / q
        expected = wrap(atan2(dy, dx) - at[2])
    H[0, 0], H[0, 1] = -H[0, 3], -H[0, 4]
    return True, expected


@compiled
def gather(values: Array, entries: Ints, out: Array) -> None:
    """The entries of a mean, or of linearisation points, into `out` (e,)."""
    for e in range(len(entries)):
        i = int(entries[e])
        out[e] = 0.0 if i == NO_ENTRY else values[3 + i]


@compiled
def partly(
    belief: int, n: int, entries: Ints, kind: int, z: float, var: float, where: int, gate: float
) -> tuple[int, float]:
    """Corrects the joint belief at an address by one partial sighting of the entries (7,), as in `expectation`.

    It is linearised at the points that `where` names, and expected at the mean.
    """
    b = belief_at(belief)
    at, H = np.empty(7), np.empty((1, 7))
    gather(b.mean, entries, at)
    there, expected = expectation(kind, at, H)
    if there and where in (FIRST, IDEAL):
        gather(b.points, entries, at)
        there, _ = expectation(kind, at, H)
    if not there:
        return AT_ROBOT, 0.0
    off, R = np.empty(1), np.empty((1, 1))
    off[0] = z - expected if kind == RANGE else wrap(z - expected)
    R[0, 0] = var
    return correct(b, n, entries, H, off, R, gate)


@compiled
def shift(belief: int, n: int, entry: int, x: float, y: float) -> None:
    """Adds an entry's error, times x (y), to the error of the pose's x (y)."""
    b = belief_at(belief)
    row, own, way = np.empty(n), np.empty(3), (x, y)
    take_row(b.flat, entry, n, row)
    for i in range(3):
        own[i] = b.cross[i, entry]
    for i in range(2):
        for j in range(n):
            b.cross[i, j] += way[i] * row[j]
        for j in range(3):
            b.pose[i, j] += way[i] * own[j]
            b.pose[j, i] += way[i] * own[j]
        for j in range(2):
            b.pose[i, j] += way[i] * way[j] * row[entry]


@compiled
def begin(belief: int, n: int, at: int, xy: Array, sd: float, moves_points: bool) -> None:
    """Sets the entries `at` and `at` + 1 to a new landmark at xy (2,), independent, of standard deviation `sd`."""
    b = belief_at(belief)
    rows = np.zeros((2, n))
    rows[0, at] = rows[1, at + 1] = sd * sd
    put(b.flat, at, n, rows)
    for i in range(2):
        b.mean[3 + at + i] = xy[i]
        if moves_points:
            b.points[3 + at + i] = xy[i]
        for j in range(3):
            b.cross[j, at + i] = 0.0


@compiled
def together(belief: int, n: int, entries: Ints, kind: Ints, z: Array, var: Array, points: bool) -> tuple[int, float]:
    """Corrects by several partial sightings at once: entries (k, 7), all linearised and expected at the present mean.

    `points` has them linearised at the points instead. Returns the reason of a failure, 0 if there is none, and the sum
    of the squared distances.
    """
    b = belief_at(belief)
    k = len(z)
    base = b.mean[: 3 + n].copy()
    at, now, H = np.empty(7), np.empty(7), np.empty((1, 7))
    off, R, total = np.empty(1), np.empty((1, 1)), 0.0
    for i in range(k):
        gather(base, entries[i], at)
        there, expected = expectation(kind[i], at, H)
        off[0] = z[i] - expected if kind[i] == RANGE else wrap(z[i] - expected)
        gather(b.mean, entries[i], now)
        if points and there:
            gather(b.points, entries[i], now)
            there, _ = expectation(kind[i], now, H)
            gather(b.mean, entries[i], now)
        if not there:
            return AT_ROBOT, total
        for e in range(7):
            moved = now[e] - at[e]
            off[0] -= H[0, e] * (wrap(moved) if e == 2 else moved)
        R[0, 0] = var[i]
        why, distance = correct(b, n, entries[i], H, off, R, 0.0)
        if why != USED:
            return why, total
        total += distance
    return USED, total


@compiled
def place_in_world(at: Array, arm: Array, H: Array) -> tuple[float, float, float]:
    """The x and y of an antenna and the heading as fixes tell them, at (7,), and H (3, 7) by these.

    They are a pose (p, theta), the heading's offset, and the frame (t, phi) of the state in the world. The antenna at a
    in the body is at t + R(phi) (p + R(theta) a); phi turns it about t, and theta about the robot.
    """
    c, s = np.cos(at[2]), np.sin(at[2])
    ahead, left = c * arm[0] - s * arm[1], s * arm[0] + c * arm[1]
    c, s = np.cos(at[6]), np.sin(at[6])
    x, y = c * at[0] - s * at[1], s * at[0] + c * at[1]
    ahead, left = c * ahead - s * left, s * ahead + c * left
    H[:] = 0.0
    H[0, 0], H[0, 1], H[0, 2], H[0, 4], H[0, 6] = c, -s, -left, 1.0, -y - left
    H[1, 0], H[1, 1], H[1, 2], H[1, 5], H[1, 6] = s, c, ahead, 1.0, x + ahead
    H[2, 2], H[2, 3], H[2, 6] = 1.0, 1.0, 1.0
    return x + ahead + at[4], y + left + at[5], at[2] + at[3] + at[6]


@compiled
def fixed(
    belief: int, n: int, entries: Ints, z: Array, cov: Array, arm: Array, where: int, gate: float
) -> tuple[int, float, int]:
    """Corrects by a fix z (3,) of the pose, NaN where nothing is measured.

    Its entries (7,) are those of `place_in_world`; without a frame the state's coordinates are the world's. Returns the
    outcome, the squared distance and the number of entries measured.
    """
    b = belief_at(belief)
    at, k, all_rows = np.empty(7), 0, np.empty((3, 7))
    for i in range(3):
        k += not np.isnan(z[i])
    H, off, R, rows = np.empty((k, 7)), np.empty(k), np.empty((k, k)), np.empty(k, np.int64)
    k = 0
    for i in range(3):
        if not np.isnan(z[i]):
            rows[k] = i
            k += 1
    gather(b.mean, entries, at)
    x, y, heading = place_in_world(at, arm, all_rows)
    for a in range(k):
        i = rows[a]
        off[a] = wrap(z[2] - heading) if i == 2 else z[i] - (x if i == 0 else y)
        for d in range(k):
            R[a, d] = cov[i, rows[d]]
    if where in (FIRST, IDEAL):
        gather(b.points, entries, at)
        place_in_world(at, arm, all_rows)
    for a in range(k):
        for e in range(7):
            H[a, e] = all_rows[rows[a], e]
    why, distance = correct(b, n, entries, H, off, R, gate)
    return why, distance, k


@compiled
def turned(
    belief: int, n: int, motion: Array, truth: Array, entry: int, turn: float, var: float, dt: float, walk: float,
    where: int,
) -> None:  # fmt: skip
    """Corrects a gyro's bias, the map's `entry`, and makes a `motion` (4, 3) by the wheels that by wheels and gyro.

    It comes before the step's motion: see `core.gyro`. That motion depends on the bias, and so will the pose after it,
    by L = G slope: `frame` knows of no such motion. It moves the pose by F, so the pose before gets F^-1 L times the
    bias' error first.
    """
    b, slope = belief_at(belief), np.empty(3)
    b.flat[row_at(entry) + entry] += walk
    told, told_var = conditioned(motion, turn, var, dt, slope)
    H, off, R, entries = np.full((1, 1), dt), np.empty(1), np.full((1, 1), told_var), np.full(1, entry)
    off[0] = wrap(told - dt * b.mean[3 + entry])
    correct(b, n, entries, H, off, R, 0.0)
    bias = b.mean[3 + entry]
    for i in range(3):
        motion[0, i] += slope[i] * bias
    gx, gy, heading = advance(b.mean[:3].copy(), b.points[:3].copy(), motion, truth, where)
    c, s = cos(heading), sin(heading)
    M, P, of = np.empty(3), np.empty(n), np.empty(3)
    M[0] = c * slope[0] - s * slope[1] - gx * slope[2]
    M[1] = s * slope[0] + c * slope[1] - gy * slope[2]
    M[2] = slope[2]
    take_row(b.flat, entry, n, P)
    for i in range(3):
        of[i] = b.cross[i, entry]
    for i in range(3):
        for j in range(3):
            b.pose[i, j] += M[i] * of[j] + of[i] * M[j] + M[i] * M[j] * P[entry]
        for j in range(n):
            b.cross[i, j] += M[i] * P[j]
