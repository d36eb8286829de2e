"""A gyro's turn in a joint belief, before its step's motion: see `core.gyro`. The bias is an entry of the state."""

from math import cos, sin

import numpy as np

from ...core.kernels._planar import wrap
from ...core.kernels._turns import conditioned
from ...core.kernels.compiled import compiled
from ._beliefs import belief_at, frame_at
from ._ekf import advance
from ._partial import correct
from ._triangle import row, take_row


@compiled
def turned(
    belief: int, seen: int, n: int, entry: int, turn: float, var: float, dt: float, walk: float, where: int
) -> None:
    """Corrects the bias, the map's `entry`, and makes the motion of the frame at `seen` that by wheels and gyro.

    This motion depends on the bias, and so will the pose after it, by L = G slope: `frame` knows of no such motion. It
    moves the pose by F, so the pose before gets F^-1 L times the bias' error first.
    """
    b, f = belief_at(belief), frame_at(seen)
    motion, slope = f.motion, np.empty(3)
    b.flat[row(entry) + entry] += walk
    told, told_var = conditioned(motion, turn, var, dt, slope)
    H, off, R, entries = np.full((1, 1), dt), np.empty(1), np.full((1, 1), told_var), np.full(1, entry)
    off[0] = wrap(told - dt * b.mean[3 + entry])
    correct(b, n, entries, H, off, R, 0.0)
    bias = b.mean[3 + entry]
    for i in range(3):
        motion[0, i] += slope[i] * bias
    gx, gy, heading = advance(b.mean[:3].copy(), b.points[:3].copy(), motion, f.truth, where)
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
