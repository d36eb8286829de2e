"""Scalar versions of `models.py`, one landmark at a time, for compiled inner loops."""

from math import atan2, cos, sin, sqrt

from ..core.kernels._planar import wrap
from ..core.kernels.compiled import compiled


@compiled
def sighted(x: float, y: float, heading: float, mx: float, my: float) -> tuple[float, float]:
    """The (range, bearing) of a landmark seen from a pose: ArUco EKF SLAM, eq. (12)."""
    dx, dy = mx - x, my - y
    return sqrt(dx * dx + dy * dy), wrap(atan2(dy, dx) - heading)


@compiled
def placed(x: float, y: float, heading: float, r: float, bearing: float) -> tuple[float, float]:
    """Position of a landmark seen at (range, bearing) from a pose: ArUco EKF SLAM, eq. (17)."""
    return x + r * cos(heading + bearing), y + r * sin(heading + bearing)
