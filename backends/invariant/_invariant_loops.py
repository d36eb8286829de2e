"""Kept poses and loop closures of the invariant filter: see `kept_poses`, and `invariant_ekf` for the equations."""

from math import cos, sin

import numpy as np

from ...core.kernels._planar import wrap
from ...core.kernels._small import cholesky
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from ..gaussian._loops import whiten
from ..gaussian._triangle import entry, put, put_row
from ._arrays import group_at
from ._group import exponential, logarithm, retract_all
from ._invariant import RANK, fold, gather, gather_row


@compiled
def keep(belief: int, n: int, at: int, turn: int) -> None:
    """Clones the pose, its error with it, into the entries `at`, `at` + 1 and `turn`, all below n.

    What these entries were before is lost; they have no pending updates then.
    """
    g = group_at(belief)
    pose, mean, strip, flat, owed = g.pose, g.mean, g.strip, g.flat, g.owed
    rows = np.empty((2, n))
    for i in range(3):
        k = turn if i == 2 else at + i
        mean[k] = pose[i]
        for j in range(3):
            strip[j, 3 + k] = strip[j, i]
        for q in range(len(owed)):
            owed[q, k] = 0.0
    for j in range(n):
        rows[0, j], rows[1, j] = strip[0, 3 + j], strip[1, 3 + j]
    put(flat, at, n, rows)
    for j in range(n):
        rows[0, j] = strip[2, 3 + j]
    put_row(flat, turn, n, rows[0])


@compiled
def innovation(pose: Array, x: float, y: float, heading: float, z: Array, N: Array) -> tuple[float, float, float]:
    """eta = log(X_k Z X^-1) of the pose X, measured at z (3,) from X_k = (x, y, heading); N (3, 3) maps z's noise."""
    c, s = cos(heading), sin(heading)
    N[0, 0], N[0, 1], N[0, 2] = c, -s, pose[1]
    N[1, 0], N[1, 1], N[1, 2] = s, c, -pose[0]
    N[2, 0], N[2, 1], N[2, 2] = 0.0, 0.0, 1.0
    angle = wrap(heading + z[2] - pose[2])
    px, py = exponential(0.0, 0.0, angle, pose[0], pose[1])
    ex, ey = logarithm(x + c * z[0] - s * z[1] - px, y + s * z[0] + c * z[1] - py, angle)
    return ex, ey, angle


@compiled
def close(belief: int, n: int, kept: Ints, entries: Ints, delta: Array, R: Array) -> tuple[int, float]:
    """Corrects by loop closures one by one: delta (k, 3), R (k, 3, 3), from the poses at `entries` (k, 2).

    `kept` (., 2) are the entries of all kept poses. H is [1 -1] of the errors of pose and kept pose, whatever the
    estimate. Returns the loop closure with an innovation's covariance that is not positive definite, -1 for none, and
    the NIS.
    """
    g = group_at(belief)
    pose, mean, strip, owed, owing = g.pose, g.mean, g.strip, g.owed, g.owing
    own, S, N, e, nu = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty(3), np.empty(3)
    nis, where = 0.0, np.empty(3, np.int64)
    for i in range(len(entries)):
        if owing[0] + owing[1] + 3 > RANK:
            fold(g, n)
        at, turn = int(entries[i, 0]), int(entries[i, 1])
        where[0], where[1], where[2] = at, at + 1, turn
        e[0], e[1], e[2] = innovation(pose, mean[at], mean[at + 1], mean[turn], delta[i], N)
        rows = owed[owing[0] : owing[0] + 3]
        gather(g, n, at, rows[:2])
        gather_row(g, n, turn, rows[2])
        for a in range(3):  # H P
            for j in range(3):
                own[a, j] = strip[a, j] - strip[j, 3 + where[a]]
            for j in range(n):
                rows[a, j] = strip[a, 3 + j] - rows[a, j]
        for a in range(3):
            for b in range(a + 1):
                S[a, b] = own[a, b] - rows[a, where[b]]
                for c in range(3):
                    for d in range(3):
                        S[a, b] += N[a, c] * R[i, c, d] * N[b, d]
        if not cholesky(S, S, 3, 0.0, 0.0):
            for a in range(3):
                for j in range(n):
                    rows[a, j] = 0.0
            return i, nis
        nu[0] = e[0] / S[0, 0]
        nu[1] = (e[1] - S[1, 0] * nu[0]) / S[1, 1]
        nu[2] = (e[2] - S[2, 0] * nu[0] - S[2, 1] * nu[1]) / S[2, 2]
        nis += nu[0] * nu[0] + nu[1] * nu[1] + nu[2] * nu[2]
        whiten(S, own, 3, own, 0)
        whiten(S, rows, n, rows, 0)
        for a in range(3):
            for b in range(3):
                for j in range(3):
                    strip[b, j] -= own[a, b] * own[a, j]
                for j in range(n):
                    strip[b, 3 + j] -= own[a, b] * rows[a, j]
        retract_all(pose, mean, n, kept, own, rows, nu)
        owing[0] += 3
    return -1, nis


@compiled
def marginals(belief: int, entries: Ints, path: Array, cov: Array) -> None:
    """The poses at `entries` (k, 2), to `path` (k, 3), and plain covariances, to `cov` (k, 3, 3)."""
    g = group_at(belief)
    mean, flat, owed, owing = g.mean, g.flat, g.owed, g.owing
    P, J, where = np.empty((3, 3)), np.eye(3), np.empty(3, np.int64)
    for k in range(len(entries)):
        at = int(entries[k, 0])
        where[0], where[1], where[2] = at, at + 1, int(entries[k, 1])
        for a in range(3):
            path[k, a] = mean[where[a]]
            for b in range(a + 1):
                value = entry(flat, where[a], where[b])
                for q in range(owing[0]):
                    value -= owed[q, where[a]] * owed[q, where[b]]
                for q in range(RANK - owing[1], RANK):
                    value += owed[q, where[a]] * owed[q, where[b]]
                P[a, b] = P[b, a] = value
        J[0, 2], J[1, 2] = -mean[at + 1], mean[at]
        for a in range(3):
            for b in range(a + 1):
                value = 0.0
                for c in range(3):
                    for d in range(3):
                        value += J[a, c] * P[c, d] * J[b, d]
                cov[k, a, b] = cov[k, b, a] = value
