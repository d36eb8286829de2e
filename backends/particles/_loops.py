"""Loop closures of particles over the path: each particle measures its pose from its own earlier one.

Given that pose X, a loop closure z of covariance R = L L' is linear in the pose p, z = Q' (p - X) with Q the rotation
of X's axes, so its product with the motion's Gaussian is exact. With that one's mean and A A', as in `_proposal.py`,
e = z - Q' (mean - X) and F = L^-1 Q' A

    G = 1 + F F',   B = 1 + F' F
    mean + A F' G^-1 L^-1 e,   A B^-T/2,   -2 log-likelihood + constant = (L^-1 e)' G^-1 (L^-1 e) + log |G|

where only matrices with eigenvalues of at least 1 are factored, so that no covariance can become indefinite.
"""

from math import log
from typing import NamedTuple

import numpy as np

from ...core.kernels._planar import wrap
from ...core.kernels._small import factored
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from ._particles import BLOCK, cosine_sine, root
from ._proposal import ROWS, Motion, draw, fold_all, predict


class Loops(NamedTuple):
    """n loop closures of M particles."""

    earlier: Array  # (n, 3, M) the particles' poses that they are to
    delta: Array  # (n, 3)
    cov: Array  # (n, 3, 3)


@compiled
def widened(
    f1: float, f2: float, f3: float, g1: float, g2: float, g3: float, h1: float, h2: float, h3: float
) -> tuple[float, float, float, float, float, float]:
    """The Cholesky factor of 1 + F F', row by row, for the rows f, g and h of F."""
    return factored(
        1 + f1 * f1 + f2 * f2 + f3 * f3,
        f1 * g1 + f2 * g2 + f3 * g3,
        1 + g1 * g1 + g2 * g2 + g3 * g3,
        f1 * h1 + f2 * h2 + f3 * h3,
        g1 * h1 + g2 * h2 + g3 * h3,
        1 + h1 * h1 + h2 * h2 + h3 * h3,
    )


@compiled
def fold_loop(work: Array, count: int, earlier: Array, start: int, z: Array, cov: Array) -> None:
    """Corrects `count` proposals, mean and A in `work`, by a loop closure z (3,) of covariance (3, 3).

    It is to the poses `earlier` (3, M), of which columns from `start` on are used. Row 17 receives -2 log-likelihood,
    up to a constant.
    """
    la, lb, lc, ld, le, lf = root(cov)
    part = slice(start, start + count)
    x, y, heading = earlier[0, part], earlier[1, part], earlier[2, part]
    for m in range(count):
        c, s = cosine_sine(heading[m])
        dx, dy = work[m] - x[m], work[BLOCK + m] - y[m]
        turn = wrap(z[2] - work[2 * BLOCK + m] + heading[m])
        e1 = (z[0] - c * dx - s * dy) / la
        e2 = (z[1] + s * dx - c * dy - lb * e1) / lc
        e3 = (turn - ld * e1 - le * e2) / lf
        a1, a2, a3 = work[3 * BLOCK + m], work[4 * BLOCK + m], work[5 * BLOCK + m]
        b1, b2, b3 = work[6 * BLOCK + m], work[7 * BLOCK + m], work[8 * BLOCK + m]
        t1, t2, t3 = work[9 * BLOCK + m], work[10 * BLOCK + m], work[11 * BLOCK + m]
        f1, f2, f3 = (c * a1 + s * b1) / la, (c * a2 + s * b2) / la, (c * a3 + s * b3) / la
        g1, g2, g3 = (
            (c * b1 - s * a1 - lb * f1) / lc,
            (c * b2 - s * a2 - lb * f2) / lc,
            (c * b3 - s * a3 - lb * f3) / lc,
        )
        h1, h2, h3 = (
            (t1 - ld * f1 - le * g1) / lf,
            (t2 - ld * f2 - le * g2) / lf,
            (t3 - ld * f3 - le * g3) / lf,
        )
        # G = l l', n = l^-1 e, k = l'^-1 n
        l11, l21, l22, l31, l32, l33 = widened(f1, f2, f3, g1, g2, g3, h1, h2, h3)
        n1 = e1 / l11
        n2 = (e2 - l21 * n1) / l22
        n3 = (e3 - l31 * n1 - l32 * n2) / l33
        k3 = n3 / l33
        k2 = (n2 - l32 * k3) / l22
        k1 = (n1 - l21 * k2 - l31 * k3) / l11
        v1, v2, v3 = f1 * k1 + g1 * k2 + h1 * k3, f2 * k1 + g2 * k2 + h2 * k3, f3 * k1 + g3 * k2 + h3 * k3
        work[m] += a1 * v1 + a2 * v2 + a3 * v3
        work[BLOCK + m] += b1 * v1 + b2 * v2 + b3 * v3
        work[2 * BLOCK + m] += t1 * v1 + t2 * v2 + t3 * v3
        work[17 * BLOCK + m] = n1 * n1 + n2 * n2 + n3 * n3 + 2 * log(l11 * l22 * l33)
        # B = l l', A l'^-1
        l11, l21, l22, l31, l32, l33 = widened(f1, g1, h1, f2, g2, h2, f3, g3, h3)
        a1, b1, t1 = a1 / l11, b1 / l11, t1 / l11
        a2, b2, t2 = (a2 - l21 * a1) / l22, (b2 - l21 * b1) / l22, (t2 - l21 * t1) / l22
        work[3 * BLOCK + m], work[6 * BLOCK + m], work[9 * BLOCK + m] = a1, b1, t1
        work[4 * BLOCK + m], work[7 * BLOCK + m], work[10 * BLOCK + m] = a2, b2, t2
        work[5 * BLOCK + m] = (a3 - l31 * a1 - l32 * a2) / l33
        work[8 * BLOCK + m] = (b3 - l31 * b1 - l32 * b2) / l33
        work[11 * BLOCK + m] = (t3 - l31 * t1 - l32 * t2) / l33


@compiled
def fold_loops(work: Array, count: int, loops: Loops, start: int, off: Array) -> None:
    """Corrects `count` proposals by loop closures; `off` (count,) receives their -2 log-likelihood."""
    for k in range(len(loops.delta)):
        fold_loop(work, count, loops.earlier[k], start, loops.delta[k], loops.cov[k])
        for m in range(count):
            off[m] += work[17 * BLOCK + m]


@compiled
def propose(
    poses: Array,
    motion: Motion,
    loops: Loops,
    filters: Array,
    slots: Ints,
    z: Array,
    cov: Array,
    distance: Array,
    volume: Array,
) -> None:
    """As `_proposal.propose`, with loop closures.

    They come before the sightings; `distance` receives their part of -2 log-likelihood, too.
    """
    for start in range(0, poses.shape[1], BLOCK):
        part = slice(start, start + BLOCK)
        off = distance[part]
        count = len(off)
        work = np.empty(ROWS * BLOCK)
        predict(work, poses, start, count, motion)
        fold_loops(work, count, loops, start, off)
        fold_all(work, count, filters, slots, z, cov, part, off, volume)
        draw(work, poses, start, count, motion.noise)


@compiled
def weigh(poses: Array, loops: Loops, distance: Array) -> None:
    """Adds e' R^-1 e of the loop closures to `distance` (M,)."""
    earlier, delta = loops.earlier, loops.delta
    for k in range(len(delta)):
        la, lb, lc, ld, le, lf = root(loops.cov[k])
        for m in range(len(distance)):
            c, s = cosine_sine(earlier[k, 2, m])
            dx, dy = poses[0, m] - earlier[k, 0, m], poses[1, m] - earlier[k, 1, m]
            turn = wrap(delta[k, 2] - poses[2, m] + earlier[k, 2, m])
            e1 = (delta[k, 0] - c * dx - s * dy) / la
            e2 = (delta[k, 1] + s * dx - c * dy - lb * e1) / lc
            e3 = (turn - ld * e1 - le * e2) / lf
            distance[m] += e1 * e1 + e2 * e2 + e3 * e3
