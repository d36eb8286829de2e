"""One frame of EKF-SLAM with slow errors of sightings in its state, in one compiled call.

The state is (x, y, heading), and four entries per landmark: its place, and the slow errors of its ranges and of its
bearings in units of their standard deviation. A sighting of stated covariance R is

    z = h(pose, place) + S g + w,        S = diag(sqrt(share R_ii)),  w ~ N(0, D R D),  D = diag(sqrt(1 - share))

with first-order Gauss-Markov processes g of unit variance, g' = keep g + N(0, 1 - keep^2), keep = exp(-dt / time).

The covariance is of plain errors, and carried along as that of the right-invariant error is (see `invariant_ekf`): a
point's invariant error is its plain one less its lever about the origin times the heading's, so a correction that moves
the point by (dx, dy) adds (-dy, dx) times the heading's row to its own. Corrections move poses and places by the
exponential of the group, slow errors by addition.
"""

from math import cos, sin, sqrt

import numpy as np

from ...core.kernels._arrays import Arrays, Integers, Numbers, Table, at
from ...core.kernels._planar import add_rotated, moved, wrap
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from .._models import placed, sighted

EACH = 4
"""Entries per landmark."""

INDEFINITE, AT_ROBOT = 1, 2
"""Reasons why a frame could not be finished."""

SMALL = 1e-4
"""rad, below which the exponential's coefficients are taken from their series."""


class BiasedArrays(Arrays):
    """The belief and the step's motion, for compiled code."""

    mean: Numbers
    cov: Table
    agreed: Integers  # sightings that agreed with a landmark since its first
    share: Numbers  # (2,) of the variance of ranges and of bearings that is slow
    keep: Numbers  # (2,) the part of these errors that is left since the last step
    motion: Table  # (4, 3) the odometry and its covariance


belief_at = at(BiasedArrays)
"""The belief at an address."""


@compiled
def frame(
    belief: int, n: int, held: int, moves: bool, slots: Ints, z: Array, R: Array, gate: float, confirm: int
) -> tuple[int, int, float, int, int]:
    """Predicts, then processes the sightings of the landmarks in `slots`, of which those from entry `n` on are new.

    `belief` is the address of `BiasedArrays`; the first `held` landmarks do not move. Returns the sighting at which it
    failed and the reason (-1, 0: none), the NIS, its degrees of freedom and the number of rejected sightings.
    """
    b = belief_at(belief)
    mean, cov, agreed, share = b.mean, b.cov, b.agreed, b.share
    fade(mean, cov, n, b.keep)
    if moves:
        predict(mean, cov, n, b.motion)
    nis, dof, refused = 0.0, 0, 0
    white, slow = np.empty((2, 2)), np.empty(2)
    for i in range(len(slots)):
        at = 3 + EACH * int(slots[i])
        for h in range(2):
            slow[h] = sqrt(share[h] * R[i, h, h])
            for j in range(2):
                white[h, j] = sqrt((1 - share[h]) * (1 - share[j])) * R[i, h, j]
        if at >= n:
            n = at + EACH
            add(mean, cov, n, at, z[i], white, slow)
            agreed[slots[i]] = 0
            continue
        why, distance = correct(mean, cov, n, held, at, z[i], white, slow, gate)
        if why:
            return i, why, nis, dof, refused
        if gate > 0.0 and not distance <= gate:
            if agreed[slots[i]] >= confirm:
                refused += 1
            else:
                add(mean, cov, n, at, z[i], white, slow)
                agreed[slots[i]] = 0
            continue
        agreed[slots[i]] += 1
        nis += distance
        dof += 2
    for i in range(n):
        for j in range(i):
            cov[i, j] = cov[j, i] = (cov[i, j] + cov[j, i]) / 2
    return -1, 0, nis, dof, refused


@compiled
def fade(mean: Array, cov: Array, n: int, keep: Array) -> None:
    """The slow errors after some time."""
    for first in range(5, n, EACH):
        for h in range(2):
            i, a = first + h, keep[h]
            mean[i] *= a
            for j in range(n):
                cov[i, j] *= a
            for j in range(n):
                cov[j, i] *= a
            cov[i, i] += 1.0 - a * a


@compiled
def predict(mean: Array, cov: Array, n: int, motion: Array) -> None:
    """ArUco EKF SLAM, eqs (5)-(9), at the mean."""
    x, y, c, s = mean[0], mean[1], cos(mean[2]), sin(mean[2])
    mean[0], mean[1], mean[2] = moved(x, y, mean[2], motion[0, 0], motion[0, 1], motion[0, 2])
    lever(cov, n, 0, mean[0] - x, mean[1] - y)
    add_rotated(cov, c, s, motion)


@compiled
def lever(cov: Array, n: int, at: int, dx: float, dy: float) -> None:
    """The covariance after the point at `at` has moved by (dx, dy) with an error that turns with the heading's."""
    for j in range(n):
        cov[at, j] -= dy * cov[2, j]
        cov[at + 1, j] += dx * cov[2, j]
    for j in range(n):
        cov[j, at] -= dy * cov[j, 2]
        cov[j, at + 1] += dx * cov[j, 2]


@compiled
def add(mean: Array, cov: Array, n: int, at: int, z: Array, white: Array, slow: Array) -> None:
    """ArUco EKF SLAM, eqs (17)-(20): initialises a landmark, and its slow errors, from one sighting."""
    mean[at], mean[at + 1] = placed(mean[0], mean[1], mean[2], z[0], z[1])
    mean[at + 2] = mean[at + 3] = 0.0
    dx, dy = mean[at] - mean[0], mean[at + 1] - mean[1]
    ux, uy = cos(mean[2] + z[1]), sin(mean[2] + z[1])
    for i in range(EACH):
        for j in range(n):
            cov[at + i, j] = cov[j, at + i] = 0.0
    for j in range(n):
        cov[at, j] = cov[0, j] - dy * cov[2, j]
        cov[at + 1, j] = cov[1, j] + dx * cov[2, j]
    for j in range(n):
        cov[j, at], cov[j, at + 1] = cov[at, j], cov[at + 1, j]
    G = np.array([[ux, -dy], [uy, dx]])  # of the place by range and bearing
    for i in range(2):
        by = (-dy, dx)[i]
        for j in range(2):
            own = cov[i, at + j] + by * cov[2, at + j]
            for a in range(2):
                for b in range(2):
                    own += G[i, a] * white[a, b] * G[j, b]
                own += G[i, a] * slow[a] * slow[a] * G[j, a]
            cov[at + i, at + j] = own
            cov[at + i, at + 2 + j] = cov[at + 2 + j, at + i] = -G[i, j] * slow[j]
        cov[at + 2 + i, at + 2 + i] = 1.0


@compiled
def correct(
    mean: Array, cov: Array, n: int, held: int, at: int, z: Array, white: Array, slow: Array, gate: float
) -> tuple[int, float]:
    """ArUco EKF SLAM, eqs (13)-(16), with slow errors; returns a reason to fail or 0, and the innovation squared.

    Nothing changes where that is beyond the `gate`.
    """
    dx, dy = mean[at] - mean[0], mean[at + 1] - mean[1]
    q = dx * dx + dy * dy
    if not q > 0.0:
        return AT_ROBOT, 0.0
    r = sqrt(q)
    a, b, c, d = dx / r, dy / r, -dy / q, dx / q
    w = np.empty((2, n))
    for j in range(n):
        w[0, j] = a * (cov[at, j] - cov[0, j]) + b * (cov[at + 1, j] - cov[1, j]) + slow[0] * cov[at + 2, j]
        w[1, j] = c * (cov[at, j] - cov[0, j]) + d * (cov[at + 1, j] - cov[1, j]) - cov[2, j] + slow[1] * cov[at + 3, j]
    s00 = a * (w[0, at] - w[0, 0]) + b * (w[0, at + 1] - w[0, 1]) + slow[0] * w[0, at + 2] + white[0, 0]
    s10 = a * (w[1, at] - w[1, 0]) + b * (w[1, at + 1] - w[1, 1]) + slow[0] * w[1, at + 2] + white[1, 0]
    s11 = c * (w[1, at] - w[1, 0]) + d * (w[1, at + 1] - w[1, 1]) - w[1, 2] + slow[1] * w[1, at + 3] + white[1, 1]
    if not s00 > 0.0:
        return INDEFINITE, 0.0
    l00 = sqrt(s00)
    l10 = s10 / l00
    rest = s11 - l10 * l10
    if not rest > 0.0:
        return INDEFINITE, 0.0
    l11 = sqrt(rest)
    er, eb = sighted(mean[0], mean[1], mean[2], mean[at], mean[at + 1])
    f0 = (z[0] - er - slow[0] * mean[at + 2]) / l00
    f1 = (wrap(z[1] - eb - slow[1] * mean[at + 3]) - l10 * f0) / l11
    distance = f0 * f0 + f1 * f1
    if gate > 0.0 and not distance <= gate:
        return 0, distance
    for j in range(n):
        w[0, j] /= l00
        w[1, j] = (w[1, j] - l10 * w[0, j]) / l11
    for i in range(n):
        for j in range(n):
            cov[i, j] -= w[0, i] * w[0, j] + w[1, i] * w[1, j]
    put(mean, cov, n, held, w, f0, f1)
    return 0, distance


@compiled
def put(mean: Array, cov: Array, n: int, held: int, w: Array, f0: float, f1: float) -> None:
    """Moves the mean by the correction w' f, by the group's exponential, and the covariance with it."""
    turn = w[0, 2] * f0 + w[1, 2] * f1
    c, s = cos(turn), sin(turn)
    along, across = 1.0 - turn * turn / 6, turn / 2 - turn**3 / 24
    if abs(turn) > SMALL:
        along, across = s / turn, (1.0 - c) / turn
    for i in range(5, n, EACH):
        for j in range(i, i + 2):
            mean[j] += w[0, j] * f0 + w[1, j] * f1
    for k in range(held - 1, (n - 3) // EACH):
        i = 0 if k < held else 3 + EACH * k
        x, y = mean[i], mean[i + 1]
        ex = w[0, i] * f0 + w[1, i] * f1 + turn * y
        ey = w[0, i + 1] * f0 + w[1, i + 1] * f1 - turn * x
        mean[i] = c * x - s * y + along * ex - across * ey
        mean[i + 1] = s * x + c * y + across * ex + along * ey
        lever(cov, n, i, mean[i] - x, mean[i + 1] - y)
    mean[2] = wrap(mean[2] + turn)
