"""The pose of a square from its four corners and their covariance."""

from typing import NamedTuple

import cv2
import numpy as np

from ...core.se2 import Array
from ._square_pose import explain


class SquarePose(NamedTuple):
    """One of the poses that explain a square's corners."""

    pose: Array  # (4, 4) T_camera_square
    cov: Array  # (6, 6) of x, y, z, m, and of a turn about the axes x, y, z of the camera frame, after the pose's, rad
    chi2: float  # of the corners' residuals; 2 degrees of freedom


def square(side: float) -> Array:
    """(4, 3) the corners of a marker in its own frame, in the order of detection and IPPE."""
    return side / 2 * np.array([[-1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, -1.0, 0.0]])


def square_poses(rays: Array, cov: Array, side: float) -> list[SquarePose]:
    """Poses in front of the camera and facing it that explain the corners, likeliest first; may be empty.

    `rays` (4, 2) are the corners on the plane z = 1 of the camera frame and `cov` (8, 8) their covariance. A small
    square has two poses that project almost alike, mirrored about the line of sight: IPPE (Collins and Bartoli 2014)
    gives both, and each is then refined by weighted least squares.
    """
    outline = square(side)
    _, turns, shifts, _ = cv2.solvePnPGeneric(outline, rays, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE_SQUARE)
    starts = (np.asarray(each, float).reshape(-1, 3) for each in (turns, shifts))
    try:
        poses, spreads, squares = explain(outline, rays, cov, *starts)
    except np.linalg.LinAlgError:
        return []
    return [SquarePose(*each) for each in zip(poses, spreads, squares.tolist(), strict=True)]
