"""Paths from odometry alone."""

from .factors import Log
from .se2 import Array, summed


def dead_reckoned(log: Log) -> Array:
    """(n, 3) the path from the prior's pose along the log's odometry; covariances are not used."""
    return summed(log.prior.pose, log.delta[1:])
