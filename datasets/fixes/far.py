"""Positions that are farther from the others than the robot drives."""

from collections.abc import Sequence

import numpy as np

from ...core.se2 import Array, Ints

WAY, NOISE = 2.0, 10.0
"""Times the way by odometry, whose wheels may be half as large as they are taken for, and standard deviations."""

SINGLE = 0.2
"""Share up to which positions are single ones; of more, the unit or the frame is another."""


def far_off(xy: Array, sd: Array, driven: float, rows: Sequence[int] | None = None) -> Ints:
    """Rows of `xy` (n, 2), m, known to `sd` (n,), that are beyond reach of their middle for a robot that drives so far.

    `rows`: of these alone. The middle is the median, which single ones do not move: none is found in fewer than three.
    """
    if len(xy) < 3:
        return np.zeros(0, np.int64)
    off = np.hypot(*(xy - np.median(xy, axis=0)).T)
    far = off > WAY * driven + NOISE * np.hypot(sd, np.median(sd))
    if far.mean() > SINGLE:
        far[:] = False
    return np.intersect1d(np.flatnonzero(far), rows) if rows is not None else np.flatnonzero(far)
