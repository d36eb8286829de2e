"""A gyro's turn in the invariant filter, whose state has the gyro's bias beside the group: see `core.gyro`.

The motion by wheels and gyro depends on the bias, whose error e is a number: slope (a, t) e, in the body. As a motion's
noise it moves the group's error: the heading's by t e, the position's by (R a - J p' t) e, where p' is the position
after the motion and J rotates by a right angle, and that of a landmark f by -J f t e, as it stays where it is. With M
the column of these, xi becomes xi + M e: with the bias' variance v and its covariance with all entries c, P becomes

    P + M c' + c M' + v M M' = P - u u' + (u + v^1/2 M) (u + v^1/2 M)',   u = c / v^1/2
"""

from math import cos, sin, sqrt

import numpy as np

from ...core.kernels._planar import moved, wrap
from ...core.kernels._turns import conditioned
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from ..gaussian._triangle import row as row_at
from ._arrays import group_at
from ._invariant import RANK, fold, gather_row
from ._partial import correct


@compiled
def turned(
    belief: int, n: int, kept: Ints, motion: Array, entry: int, turn: float, var: float, dt: float, walk: float
) -> None:
    """Corrects a gyro's bias, the state's `entry`, and makes a `motion` (4, 3) by the wheels that by wheels and gyro.

    It comes before the step's motion, whose share of the bias' error is in the belief then; `kept` as in `move`.
    """
    g, slope = group_at(belief), np.empty(3)
    g.flat[row_at(entry) + entry] += walk
    told, told_var = conditioned(motion, turn, var, dt, slope)
    H, off, R, entries = np.full((1, 1), dt), np.empty(1), np.full((1, 1), told_var), np.full((1, 1), entry)
    off[0] = wrap(told - dt * g.mean[entry])
    correct(g, n, kept, entries, H, off, R, 0.0)
    pose, mean, strip, owed, owing = g.pose, g.mean, g.strip, g.owed, g.owing
    for i in range(3):
        motion[0, i] += slope[i] * mean[entry]
    if owing[0] + owing[1] + 2 > RANK:
        fold(g, n)
    less, more, own = owed[owing[0]], owed[RANK - 1 - owing[1]], np.empty((2, 3))
    gather_row(g, n, entry, less)
    if not less[entry] > 0.0:
        less[:n] = 0.0
        return
    sd = sqrt(less[entry])
    c, s = cos(pose[2]), sin(pose[2])
    x, y, _ = moved(pose[0], pose[1], pose[2], motion[0, 0], motion[0, 1], motion[0, 2])
    for j in range(0, n, 2):
        more[j], more[j + 1] = sd * slope[2] * mean[j + 1], -sd * slope[2] * mean[j]
    for k in range(len(kept)):
        more[kept[k, 0]] = more[kept[k, 0] + 1] = more[kept[k, 1]] = 0.0
    for j in range(n):
        less[j] /= sd
        more[j] += less[j]
    for i in range(3):
        own[0, i] = own[1, i] = strip[i, 3 + entry] / sd
    own[1, 0] += sd * (c * slope[0] - s * slope[1] + slope[2] * y)
    own[1, 1] += sd * (s * slope[0] + c * slope[1] - slope[2] * x)
    own[1, 2] += sd * slope[2]
    for i in range(3):
        for j in range(3):
            strip[i, j] += own[1, i] * own[1, j] - own[0, i] * own[0, j]
        for j in range(n):
            strip[i, 3 + j] += own[1, i] * more[j] - own[0, i] * less[j]
    owing[0] += 1
    owing[1] += 1
