"""Inner loop of a made-up laser: how far each beam goes."""

from math import sqrt

import numpy as np

from ...core.kernels.compiled import compiled
from ...core.se2 import Array


@compiled
def cast(walls: Array, discs: Array, x: float, y: float, directions: Array, furthest: float) -> Array:
    """Ranges (b,) m along `directions` (b, 2), unit vectors, from (x, y); `furthest` where nothing is nearer.

    `walls` (w, 4) are segments x0, y0, x1, y1, `discs` (d, 3) centres and radii. Only sums, products, quotients and
    roots: the same bits on every machine.
    """
    out = np.empty(len(directions))
    for k in range(len(directions)):
        c, s = directions[k, 0], directions[k, 1]
        best = furthest
        for i in range(len(walls)):
            ax, ay = walls[i, 0] - x, walls[i, 1] - y
            bx, by = walls[i, 2] - walls[i, 0], walls[i, 3] - walls[i, 1]
            across = s * bx - c * by
            if abs(across) < 1e-12:
                continue
            r, share = (ay * bx - ax * by) / across, (c * ay - s * ax) / across
            if 0.0 < r < best and 0.0 <= share <= 1.0:
                best = r
        for i in range(len(discs)):
            ax, ay = discs[i, 0] - x, discs[i, 1] - y
            along = c * ax + s * ay
            inside = discs[i, 2] * discs[i, 2] - (ax * ax + ay * ay - along * along)
            if along > 0.0 and inside > 0.0:
                r = along - sqrt(inside)
                if 0.0 < r < best:
                    best = r
        out[k] = best
    return out
