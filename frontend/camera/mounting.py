"""Camera mountings: T_robot_camera, from the camera's frame to the robot's.

The robot's frame is x forward, y left, z up; the camera's is OpenCV's, x right, y down, z forward.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...core.errors import InputError
from ...core.se2 import Array

_ROUNDING = 1e-3
"""Largest deviation from a rotation that is accepted, for matrices written with few digits."""

_AHEAD = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""The camera's axes in the robot's frame when it looks straight ahead."""


def mounting(forward: float, left: float, up: float, tilt: float) -> Array:
    """(4, 4) T_robot_camera of a camera at (forward, left, up), m, that looks ahead and `tilt` (rad) down."""
    return from_rpy((forward, left, up), (0.0, tilt, 0.0))


def from_rpy(xyz: Sequence[float], rpy: Sequence[float]) -> Array:
    """(4, 4) T_robot_camera of a camera at `xyz` (3), m, rotated by roll, pitch and yaw `rpy` (3), rad.

    They rotate the camera's body, x where it looks, y left and z up: at zero it looks straight ahead, upright. Roll
    about x first, then pitch about y, then yaw about z, all three the robot's axes. A positive pitch looks down, a
    positive yaw to the left, a positive roll leans to the right.
    """
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    roll = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    pitch = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    yaw = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    pose = np.eye(4)
    pose[:3, :3] = yaw @ pitch @ roll @ _AHEAD + 0.0  # no negative zeros
    pose[:3, 3] = xyz
    return pose


def from_matrix(rows: Any, where: str) -> Array:
    """(4, 4) T_robot_camera from a user's matrix, its rotation made exact.

    InputError, which begins with `where`, for anything but four rows of four numbers that are a rigid motion: a
    rotation without stretch or mirror and a last row of 0, 0, 0, 1.
    """
    try:
        matrix = np.array(rows, float)
    except (TypeError, ValueError):
        raise InputError(f"{where}: found {rows!r}, expected four rows of four numbers") from None
    if matrix.shape != (4, 4):
        raise InputError(f"{where}: found {_shape(matrix)}, expected four rows of four numbers")
    if not np.isfinite(matrix).all():
        raise InputError(f"{where}: found a number that is not finite, expected four rows of four numbers")
    if not np.array_equal(matrix[3], [0, 0, 0, 1]):
        raise InputError(f"{where}: found the last row {matrix[3].tolist()}, expected [0, 0, 0, 1]")
    turn = matrix[:3, :3]
    off = float(np.abs(turn @ turn.T - np.eye(3)).max())
    if off > _ROUNDING:
        raise InputError(
            f"{where}: found rows that are {off:.2g} from being a rotation, expected at most {_ROUNDING:g}"
        )
    if np.linalg.det(turn) < 0:
        raise InputError(f"{where}: found a mirrored rotation (its determinant is -1), expected a right-handed one")
    left, _, right = np.linalg.svd(turn)
    matrix[:3, :3] = left @ right
    return matrix


def _shape(matrix: Array) -> str:
    return "one number" if matrix.ndim == 0 else " x ".join(map(str, matrix.shape)) + " numbers"
