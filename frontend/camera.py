"""A camera and its place on the robot.

Pixels are OpenCV's: u to the right, v down, whole numbers at the pixels' centres. The camera frame is x right, y down,
z forward.
"""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from .errors import InputError
from .se2 import Array

DISTORTION_LENGTHS = (0, 4, 5, 8, 12, 14)
"""The numbers of distortion coefficients OpenCV takes: k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4 [tx ty]]]]."""


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera with OpenCV's lens distortion, mounted on a robot."""

    width: int  # px
    height: int  # px
    focal: tuple[float, float]  # fx, fy, px
    centre: tuple[float, float]  # cx, cy, px
    distortion: tuple[float, ...]  # in OpenCV's order
    mounting: Array  # (4, 4) T_robot_camera: from the camera's frame to the robot's, m

    @cached_property
    def matrix(self) -> Array:
        """(3, 3) K."""
        (fx, fy), (cx, cy) = self.focal, self.centre
        return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])

    @cached_property
    def coefficients(self) -> Array:
        """(d,) the distortion, as OpenCV wants it. InputError for a number of them that OpenCV does not know."""
        if len(self.distortion) not in DISTORTION_LENGTHS:
            known = ", ".join(map(str, DISTORTION_LENGTHS))
            raise InputError(f"camera distortion: found {len(self.distortion)} coefficients, expected one of {known}")
        return np.array(self.distortion, float)

    def undistort(self, pixels: Array) -> Array:
        """The rays of `pixels` (n, 2), as (n, 2) coordinates on the plane z = 1 of the camera frame."""
        if len(pixels) == 0:
            return np.zeros((0, 2))
        # Five rounds, OpenCV's default, leave a twentieth of a pixel in the corners of a strongly curved lens.
        rounds = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 50, 1e-12)
        points = np.ascontiguousarray(pixels, float).reshape(-1, 1, 2)
        rays = cv2.undistortPoints(points, self.matrix, self.coefficients, criteria=rounds)
        return np.asarray(rays, float).reshape(-1, 2)

    def project(self, points: Array) -> Array:
        """The pixels (n, 2) of `points` (n, 3), m, in the camera frame; they have to lie in front of it."""
        if len(points) == 0:
            return np.zeros((0, 2))
        points = np.ascontiguousarray(points, float).reshape(-1, 1, 3)
        pixels, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), self.matrix, self.coefficients)
        return np.asarray(pixels, float).reshape(-1, 2)


def mounting(forward: float, left: float, up: float, tilt: float) -> Array:
    """(4, 4) T_robot_camera of a camera at (forward, left, up), m, that looks ahead and `tilt` (rad) down."""
    c, s = np.cos(tilt), np.sin(tilt)
    return np.array(
        [
            [0.0, -s, c, forward],
            [-1.0, 0.0, 0.0, left],
            [0.0, -c, -s, up],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
