"""Scalar versions of `models.py`, one landmark at a time, for compiled inner loops."""

from math import atan2, cos, floor, pi, sin, sqrt

from ..core.kernels.compiled import compiled


@compiled
def wrap(angle: float) -> float:
    """Wraps an angle (rad) to (-pi, pi]; one already there is returned bit for bit."""
    if -pi < angle <= pi:
        return angle
    turned = angle - 2 * pi * floor((angle + pi) / (2 * pi))
    return turned if turned > -pi else pi


@compiled
def moved(x: float, y: float, heading: float, dx: float, dy: float, turn: float) -> tuple[float, float, float]:
    """The pose after a motion in its body frame: ArUco EKF SLAM, eq. (2)."""
    c, s = cos(heading), sin(heading)
    return x + c * dx - s * dy, y + s * dx + c * dy, wrap(heading + turn)


@compiled
def sighted(x: float, y: float, heading: float, mx: float, my: float) -> tuple[float, float]:
    """The (range, bearing) of a landmark seen from a pose: ArUco EKF SLAM, eq. (12)."""
    dx, dy = mx - x, my - y
    return sqrt(dx * dx + dy * dy), wrap(atan2(dy, dx) - heading)


@compiled
def placed(x: float, y: float, heading: float, r: float, bearing: float) -> tuple[float, float]:
    """Position of a landmark seen at (range, bearing) from a pose: ArUco EKF SLAM, eq. (17)."""
    return x + r * cos(heading + bearing), y + r * sin(heading + bearing)
