"""A camera frame -> the ArUco markers in it, and where their centres are from the robot."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from .camera import Camera
from .errors import InputError
from .markers import Markers
from .se2 import Array

_CORNER_SD = 0.1
"""px, of each corner along each axis, as OpenCV's subpixel refinement leaves it."""

Image = NDArray[np.uint8]


class Sighting(NamedTuple):
    """A marker found in a frame."""

    id: int
    corners: Array  # (4, 2) px, clockwise from the marker's own top left one
    corner_cov: Array  # (8, 8) px^2, of u0, v0, u1, v1, ...
    pose: Array  # (4, 4) T_camera_marker; the marker's frame: x right, y up, z out of its printed face
    error: float  # px, RMS distance of the corners from where `pose` puts them
    ambiguity: float  # `error` over the error of the other pose that explains a square; 1: cannot be told apart


@dataclass(frozen=True, eq=False)
class Detector:
    """Finds the square markers of one dictionary."""

    markers: Markers
    camera: Camera

    @cached_property
    def _opencv(self) -> cv2.aruco.ArucoDetector:
        parameters = cv2.aruco.DetectorParameters()
        parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        return cv2.aruco.ArucoDetector(self.markers.opencv, parameters)

    def detect(self, image: Image) -> tuple[list[Sighting], Counter[str]]:
        """The markers of a grey or BGR `image`, in the order of their ids, and how many were turned down and why.

        Of several with one id the largest in the image stays. InputError for an image that is not of the camera's size.
        """
        height, width = image.shape[:2]
        if (width, height) != (self.camera.width, self.camera.height):
            expected = f"{self.camera.width}x{self.camera.height}"
            raise InputError(f"frame: found {width}x{height} pixels, expected the camera's {expected}")
        found, ids, _ = self._opencv.detectMarkers(image)
        corners = np.asarray(found, float).reshape(-1, 4, 2)
        names = np.asarray(ids, int).ravel() if len(found) else np.zeros(0, int)
        largest_first = np.lexsort((-_area(corners), names))
        rejected = Counter[str]()
        sightings: list[Sighting] = []
        previous = None
        for index in largest_first:
            name = int(names[index])
            if name == previous:
                rejected["same id twice in a frame"] += 1
                continue
            previous = name
            sighting = self.locate(name, corners[index])
            if sighting is None:
                rejected["no pose explains the corners"] += 1
            else:
                sightings.append(sighting)
        return sightings, rejected

    def locate(self, name: int, corners: Array) -> Sighting | None:
        """The pose of the marker whose four corners are seen at `corners` (4, 2), px; None where there is none.

        A small square has two poses that put its corners almost alike, mirrored about the line of sight. Of those in
        front of the camera and facing it, the one with the smaller error is taken; range and bearing of the centre
        hardly depend on the choice.
        """
        outline = square(self.markers.side_of(name))
        rays = self.camera.undistort(corners)
        _, turns, shifts, _ = cv2.solvePnPGeneric(outline, rays, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE_SQUARE)
        candidates: list[tuple[float, Array]] = []
        for turn, shift in zip(turns, shifts, strict=True):
            pose = np.eye(4)
            pose[:3, :3] = cv2.Rodrigues(turn)[0]
            pose[:3, 3] = np.ravel(shift)
            seen = outline @ pose[:3, :3].T + pose[:3, 3]
            faces = pose[:3, 2] @ pose[:3, 3] < 0
            if np.isfinite(pose).all() and (seen[:, 2] > 0).all() and faces:
                misses = self.camera.project(seen) - corners
                candidates.append((float(np.sqrt((misses**2).sum(axis=1).mean())), pose))
        if not candidates:
            return None
        candidates.sort(key=lambda candidate: candidate[0])
        error, pose = candidates[0]
        other = candidates[1][0] if len(candidates) > 1 else np.inf
        return Sighting(name, corners, _CORNER_SD**2 * np.eye(8), pose, error, error / other if other > 0 else 1.0)


def square(side: float) -> Array:
    """(4, 3) the corners of a marker in its own frame, in the order they are detected and IPPE wants them."""
    return side / 2 * np.array([[-1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, -1.0, 0.0]])


def range_bearing(sightings: Sequence[Sighting], mounting: Array) -> Array:
    """(k, 2) range (m) and bearing (rad) of the markers' centres in the robot's plane.

    ArUco EKF SLAM: T_r_m = T_r_c T_c_m, range = |(x, y)|, bearing = atan2(y, x); `mounting` is T_robot_camera. The
    Matlab report's eq. (3-8), positive to the right, is minus this bearing for a camera that looks ahead.
    """
    centres = np.array([mounting @ sighting.pose[:, 3] for sighting in sightings]).reshape(-1, 4)
    x, y = centres[:, 0], centres[:, 1]
    return np.stack((np.hypot(x, y), np.arctan2(y, x)), axis=-1)


def _area(corners: Array) -> Array:
    """(n,) px^2, of the quadrilaterals (n, 4, 2)."""
    across, along = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
    return np.abs(across[:, 0] * along[:, 1] - across[:, 1] * along[:, 0]) / 2
