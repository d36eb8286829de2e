"""A motion by wheels and a gyro's turn, split as in `core.gyro`, for one step."""

from ..se2 import Array
from ._planar import wrap
from .compiled import compiled


@compiled
def conditioned(motion: Array, turn: float, var: float, dt: float, slope: Array) -> tuple[float, float]:
    """Makes a motion (4, 3) and its covariance, in place, that by wheels and gyro given a bias of zero.

    `slope` (3,) is its derivative by the bias. Returns what is told of the bias times `dt`, and its variance.
    """
    told, total = wrap(turn - motion[0, 2]), motion[3, 2] + var
    for i in range(3):
        slope[i] = motion[1 + i, 2] / total
        motion[0, i] += slope[i] * told
    motion[0, 2] = wrap(motion[0, 2])
    for i in range(3):
        for j in range(3):
            motion[1 + i, j] -= slope[i] * slope[j] * total
    for i in range(3):
        slope[i] *= -dt
    return told, total
