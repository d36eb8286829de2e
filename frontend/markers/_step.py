"""Steps of the parameters of `_grey`, compiled: solved from normal equations, kept within limits, made.

The first eight parameters change the homography: u grows by d0 + d1 p + d2 q + p (d6 p + d7 q) modules and v by d3 + d4
p + d5 q + q (d6 p + d7 q), in the pattern's centred coordinates p and q.
"""

import numpy as np

from ...core.kernels.compiled import compiled
from ...core.se2 import Array
from ._grey import BLACK, BLACKEST, INK, SHARP, TONE, WHITE, A, C

LIMITED = np.array([INK, TONE, SHARP])
"""Parameters of the look that are kept within limits."""

LIMITS = np.array([[-0.1, -0.5, -0.5], [0.1, 1.3, 2.0]])
"""(2, 3) their least and largest values."""


@compiled
def moved(G: Array, look: Array, step: Array, active: int, m: int) -> tuple[Array, Array, float]:
    """The homography and look after a step, and the largest change of the homography, modules.

    A step over 0.7 modules is shortened, and so are large changes of the blur.
    """
    largest = 0.0
    for k in range(8):
        largest = max(largest, abs(step[k]))
    scale = 0.7 / max(largest, 0.7) / m
    # P, Q and W are the centred coordinates times the homography's third row
    moved_homography = np.empty((3, 3))
    for k in range(3):
        W = G[2, k]
        P, Q = G[0, k] / m - 0.5 * W, G[1, k] / m - 0.5 * W
        p = P + scale * (step[0] * W + step[1] * P + step[2] * Q)
        q = Q + scale * (step[3] * W + step[4] * P + step[5] * Q)
        w = W - scale * (step[6] * P + step[7] * Q)
        moved_homography[0, k], moved_homography[1, k], moved_homography[2, k] = m * (p + 0.5 * w), m * (q + 0.5 * w), w
    changed = look.copy()
    for k in range(active - 8):
        changed[k] = look[k] + (min(max(step[8 + k], -0.7), 0.7) if k in (A, A + 1, C) else step[8 + k])
    changed[BLACK], changed[WHITE] = max(changed[BLACK], BLACKEST), max(changed[WHITE], BLACKEST + 1.0)
    changed[A] = min(max(changed[A], -2.0), 2.3)
    changed[C] = min(max(changed[C], -2.0), 2.3)
    for k in range(3):
        changed[LIMITED[k]] = min(max(changed[LIMITED[k]], LIMITS[0, k]), LIMITS[1, k])
    return moved_homography, changed, largest


@compiled
def hold(look: Array, normal: Array, gradient: Array) -> None:
    """Takes out of the normal equations, in place, what is at a limit and would pass it.

    Solved with it, the others' step counts on a change that `moved` does not make (Bertsekas 1982, projected Newton
    methods).
    """
    for k in range(3):
        value, i = look[LIMITED[k]], 8 + LIMITED[k]
        if (value <= LIMITS[0, k] and gradient[i] < 0.0) or (value >= LIMITS[1, k] and gradient[i] > 0.0):
            diagonal = normal[i, i]
            normal[i, :] = 0.0
            normal[:, i] = 0.0
            normal[i, i], gradient[i] = diagonal, 0.0
