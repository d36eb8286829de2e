"""Paths from odometry alone."""

import numpy as np

from .elementary import sincos
from .factors import Log
from .se2 import Array, wrap


def dead_reckoned(log: Log) -> Array:
    """(n, 3) the path from the prior's pose along the log's odometry; covariances are not used."""
    return summed(log.prior.pose, log.delta[1:])


def summed(start: Array, motions: Array) -> Array:
    """(n + 1, 3) the path from the pose `start` (3,) by the motions (n, 3), each in the body frame before it."""
    heading = start[2] + np.concatenate(([0.0], np.cumsum(motions[:, 2])))
    s, c = sincos(heading[:-1])
    dx, dy = motions[:, 0], motions[:, 1]
    moved = np.stack((c * dx - s * dy, s * dx + c * dy), axis=-1)
    xy = start[:2] + np.concatenate((np.zeros((1, 2)), np.cumsum(moved, axis=0)))
    return np.column_stack((xy, wrap(heading)))
