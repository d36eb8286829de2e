"""Detects ArUco markers in a camera frame and locates their centres relative to the robot."""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from ...core.factors import UNKNOWN
from ...core.kernels.compile_ahead import compile_ahead
from ...core.se2 import Array
from ..camera.camera import Camera
from ..camera.shutter import CameraMotion, SweptPlane
from . import template
from ._corners import judge, mixture, slopes, to_project
from .bits import sample
from .markers import Markers
from .prior import prior_of
from .square_pose import square, square_poses

Image = NDArray[np.uint8]

Refinement = Literal["template", "none", "subpix", "contour", "apriltag"]

OPENCV = {
    "none": cv2.aruco.CORNER_REFINE_NONE,
    "subpix": cv2.aruco.CORNER_REFINE_SUBPIX,
    "contour": cv2.aruco.CORNER_REFINE_CONTOUR,
    "apriltag": cv2.aruco.CORNER_REFINE_APRILTAG,
}
"""OpenCV's own corner refinements; any other method starts from unrefined corners."""

ROUGH_SD = 0.3  # px, of each corner along each axis, as OpenCV leaves it

CELL = 8
"""px per module when a square is rectified for reading; OpenCV's 4 loses one in ten markers of 15 px."""

APART = 0.05
"""Share of their perimeter between two outlines from which both are tried.

With OpenCV's 0.125 the edge of the paper stands for one marker in thirty at 2 m, and for many an unread square.
"""


FARTHEST, LARGEST_SHARE = 2.0, 0.04
"""px, and share of a marker's size, by which refinement may move a corner; most move less than a pixel."""

TWICE = "same id twice in a frame"
"""The reason of rejection of all markers of an id that several in a frame have."""

IGNORED = "id {} is to be left out"
"""The reason of rejection of a marker whose id is among those to ignore."""

_NOTHING, _NOWHERE = np.zeros((0, 3)), np.eye(4)


class Sighting(NamedTuple):
    """A marker found in a frame."""

    id: int  # UNKNOWN: of a square whose bits are no marker's
    corners: Array  # (4, 2) px, in the image, clockwise from the marker's own top left one; of a flat one, if it curls
    corner_cov: Array  # (8, 8) px^2, of u0, v0, u1, v1, ...
    pose: Array  # (4, 4) T_camera_marker; the marker's frame: x right, y up, z out of its printed face
    centre: Array  # (3,) m, the marker's centre in the camera frame, averaged over the poses that explain the corners
    cov: Array  # (6, 6) of the centre, m, and of a turn about the camera's axes after the pose's, rad; both poses count
    error: float  # px, RMS distance of the corners from where `pose` puts them; NaN: unknown, as the corners are
    ambiguity: float  # likelihood ratio of the second pose that explains the square; 1: indistinguishable

    @property
    def centre_cov(self) -> Array:
        """(3, 3) m^2, of the centre."""
        return self.cov[:3, :3]


class Rejections(Counter[str]):
    """Rejections in a frame, counted by reason."""

    twice: tuple[int, ...] = ()  # the ids that several markers have


@dataclass(frozen=True, eq=False)
class Detector:
    """Finds the square markers of one dictionary."""

    markers: Markers
    camera: Camera
    refinement: Refinement = "template"
    unread: bool = (
        False  # squares whose bits are no marker's are found, too: as UNKNOWN, with the bits as their pattern
    )

    @cached_property
    def _opencv(self) -> cv2.aruco.ArucoDetector:
        if self.refinement == "template":
            compile_ahead(f"{__package__}.kernels")
        parameters = cv2.aruco.DetectorParameters()
        parameters.cornerRefinementMethod = OPENCV.get(self.refinement, cv2.aruco.CORNER_REFINE_NONE)
        parameters.perspectiveRemovePixelPerCell = CELL
        parameters.minMarkerDistanceRate = APART
        return cv2.aruco.ArucoDetector(self.markers.opencv, parameters)

    @cached_property
    def _prior(self) -> Array:
        return prior_of(self.camera.response)

    @cached_property
    def _patterns(self) -> dict[int, Array]:
        return {}

    def _pattern(self, name: int) -> Array:
        """The printed pattern of marker `name`."""
        if name not in self._patterns:
            dictionary = self.markers.opencv
            modules = dictionary.markerSize + 2
            drawn = np.asarray(dictionary.generateImageMarker(name, modules, borderBits=1))
            self._patterns[name] = template.pattern(drawn[1:-1, 1:-1] > 0)
        return self._patterns[name]

    def detect(self, image: Image, motion: CameraMotion | None = None) -> tuple[list[Sighting], Rejections]:
        """Detects the markers in a grey or BGR `image`, sorted by id, and counts rejections by reason.

        Of several with one id, unless it is UNKNOWN, none stays: which of them is the landmark, a frame does not tell.
        With the `motion` of a camera that has a rolling shutter, poses and centres are those at the middle of the
        frame; without it such a camera is taken to stand. InputError for an image that is not of the camera's size.
        """
        height, width = image.shape[:2]
        if (width, height) != (self.camera.width, self.camera.height):
            expected = f"{self.camera.width}x{self.camera.height}"
            raise InputError(f"frame: found {width}x{height} pixels, expected the camera's {expected}.")
        grey = image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)
        found, ids, others = self._opencv.detectMarkers(grey)
        corners = np.asarray(found, float).reshape(-1, 4, 2)
        names = np.asarray(ids, int).ravel() if len(found) else np.zeros(0, int)
        rays = self.camera.undistort(corners.reshape(-1, 2)).reshape(-1, 4, 2)
        rejected = Rejections()
        sightings: list[Sighting] = []
        for index in np.lexsort((-_area(corners), names)):
            name = int(names[index])
            if name in self.markers.ignore:
                rejected[IGNORED.format(name)] += 1
                continue
            refined = self._refine(grey, self._pattern(name), corners[index], rays[index], name, motion)
            if refined is None:
                rejected["the printed pattern is not there"] += 1
                continue
            sighting = self._located(name, *refined, motion)
            if sighting is None:
                rejected["no pose explains the corners"] += 1
            else:
                sightings.append(sighting)
        if self.unread:
            sightings = [*self._unread(grey, np.asarray(others, float).reshape(-1, 4, 2), motion), *sightings]
        alone = _alone(sightings)
        if len(alone) < len(sightings):
            rejected["inside another marker"] += len(sightings) - len(alone)
        return single(alone, rejected), rejected

    def _unread(self, grey: Image, quads: Array, motion: CameraMotion | None) -> Iterator[Sighting]:
        """Yields the squares among the outlines `quads` (n, 4, 2) that are printed like a marker."""
        for corners, rays in zip(quads, self.camera.undistort(quads.reshape(-1, 2)).reshape(-1, 4, 2), strict=True):
            bits = sample(grey, corners, self.markers.opencv.markerSize)
            if bits is None:
                continue
            refined = self._refine(grey, template.pattern(bits), corners, rays, UNKNOWN, motion)
            sighting = None if refined is None else self._located(UNKNOWN, *refined, motion)
            if sighting is not None:
                yield sighting

    def _refine(
        self, grey: Image, pattern: Array, corners: Array, start: Array, name: int, motion: CameraMotion | None
    ) -> tuple[Array, Array] | None:
        """The rays (4, 2) at the middle of the frame, of `corners` (4, 2), px, and their covariance (8, 8).

        `start` (4, 2) are about the rays that see them. None where the marker is not in the frame.
        """
        if not np.isfinite(start).all():
            return None
        if motion is None:
            return self._aligned(grey, pattern, start, corners, None)
        swept = self._swept(name, start, self._cov_of_rays(start, ROUGH_SD), motion)
        if swept is None:
            return None
        start = swept.at_middle(start[:, None], corners[:, 1])[:, 0]
        aligned = self._aligned(grey, pattern, start, corners, swept) if np.isfinite(start).all() else None
        if aligned is None:
            return None
        # Rough corners give a rough distance; now it is known, and so is how far the plane moved past each row.
        seen, again = swept.seen(aligned[0]), self._swept(name, *aligned, motion)
        if again is None:
            return None
        rays, motion_cov = again.corners_at_middle(self.camera.undistort(seen), seen[:, 1])
        return (rays, aligned[1] + motion_cov) if np.isfinite(rays).all() else None

    def _aligned(
        self, grey: Image, pattern: Array, start: Array, corners: Array, swept: SweptPlane | None
    ) -> tuple[Array, Array] | None:
        """`_refine` for corners at the rays `start` (4, 2) and, in the image, `corners` (4, 2) px.

        `swept` is the marker's plane where the camera moves, roughly.
        """
        if self.refinement != "template":
            return start, self._cov_of_rays(start, ROUGH_SD)
        rays = self.camera.rays if swept is None else swept.rays_around(corners)
        fit = template.fit(grey, rays, pattern, start, corners, self._prior)
        if fit is None:
            return None
        size = np.ptp(corners, axis=0).max()
        moved = np.abs(fit.rays - start).max() / np.ptp(start, axis=0).max() * size
        if not moved < FARTHEST + LARGEST_SHARE * size:
            return None
        # The model's errors are in the image; at its centre a pixel is one over the focal length.
        return fit.rays, fit.cov + (template.MODEL_SD / self.camera.focal[0]) ** 2 * np.eye(8)

    def _swept(self, name: int, rays: Array, cov: Array, motion: CameraMotion) -> SweptPlane | None:
        """The plane of the marker whose corners have `rays` (4, 2) with covariance (8, 8); None without a pose."""
        poses = square_poses(rays, cov, self.markers.side_of(name))
        return SweptPlane(self.camera, poses[0].pose, motion) if poses else None

    def _cov_of_rays(self, rays: Array, sd: float) -> Array:
        """(8, 8) the covariance of the `rays` (4, 2) of corners that have `sd` px along both axes of the image."""
        by_pixel = np.linalg.inv(slopes(self.camera.project(to_project(rays, _NOTHING, _NOWHERE))))
        cov = np.zeros((4, 2, 4, 2))
        cov[range(4), :, range(4)] = sd**2 * by_pixel @ by_pixel.transpose(0, 2, 1)
        return cov.reshape(8, 8)

    def at_corners(self, name: int, corners: Array, sd: float) -> Sighting | None:
        """The pose of the marker with `corners` (4, 2), px, of `sd` px along both axes; None without a solution."""
        rays = self.camera.undistort(corners)
        return self.locate(name, rays, self._cov_of_rays(rays, sd)) if np.isfinite(rays).all() else None

    def _located(self, name: int, rays: Array, cov: Array, motion: CameraMotion | None) -> Sighting | None:
        """`locate`, with the corners where a moving camera sees them."""
        sighting = self.locate(name, rays, cov)
        if sighting is None or motion is None:
            return sighting
        return sighting._replace(corners=SweptPlane(self.camera, sighting.pose, motion).seen(rays))

    def locate(self, name: int, rays: Array, cov: Array) -> Sighting | None:
        """The pose of the marker whose corners have `rays` (4, 2) with covariance (8, 8); None without a solution.

        A small square has two poses that project almost alike. `pose` is the likelier one, `centre` the mean of both,
        weighted by likelihood, and `cov` the mean square about `centre` and about the turn of `pose`.
        """
        poses = square_poses(rays, cov, self.markers.side_of(name))
        if not poses:
            return None
        best = poses[0]
        centre, pose_cov = best.pose[:3, 3], best.cov
        if len(poses) > 1:
            turns = (cv2.Rodrigues(each.pose[:3, :3] @ best.pose[:3, :3].T)[0].ravel() for each in poses)
            centre, pose_cov = mixture(
                np.array([[*each.pose[:3, 3], *turn] for each, turn in zip(poses, turns, strict=True)], float),
                np.array([each.cov for each in poses]),
                np.array([each.chi2 for each in poses]),
            )
        pixels = self.camera.project(to_project(rays, square(self.markers.side_of(name)), best.pose))
        corner_cov, error = judge(pixels, cov)
        return Sighting(
            id=name,
            corners=pixels[:4],
            corner_cov=corner_cov,
            pose=best.pose,
            centre=centre,
            cov=pose_cov,
            error=error,
            ambiguity=math.exp((best.chi2 - poses[1].chi2) / 2) if len(poses) > 1 else 0.0,
        )


def single(sightings: Sequence[Sighting], rejected: Rejections) -> list[Sighting]:
    """The sightings whose ids no other one has, or is UNKNOWN; the others are counted in `rejected`."""
    seen = Counter(one.id for one in sightings if one.id != UNKNOWN)
    kept = [one for one in sightings if seen[one.id] < 2]
    if len(kept) < len(sightings):
        rejected[TWICE] += len(sightings) - len(kept)
        rejected.twice = tuple(name for name, times in seen.items() if times > 1)
    return kept


def range_bearing(sightings: Sequence[Sighting], mounting: Array) -> Array:
    """(k, 2) range (m) and bearing (rad) of the markers' centres in the robot's plane.

    ArUco EKF SLAM: T_r_m = T_r_c T_c_m, range = |(x, y)|, bearing = atan2(y, x); `mounting` is T_robot_camera. The
    Matlab report's eq. (3-8), positive to the right, is minus this bearing for a camera that looks ahead.
    """
    x, y, _ = on_robot(sightings, mounting).T
    return np.stack((np.hypot(x, y), np.arctan2(y, x)), axis=-1)


def on_robot(sightings: Sequence[Sighting], mounting: Array) -> Array:
    """(k, 3) m, the markers' centres ahead, to the left and up of the robot's origin; `mounting` is T_robot_camera."""
    return np.array([mounting[:3, :3] @ sighting.centre + mounting[:3, 3] for sighting in sightings]).reshape(-1, 3)


def _alone(sightings: Sequence[Sighting]) -> list[Sighting]:
    """The sightings that lie in no larger one, where only the larger one's own pattern is printed."""
    # two outlines of one square may end at the same corners: the first of them counts as larger
    areas = [(area, -k) for k, area in enumerate(_area(np.array([s.corners for s in sightings]).reshape(-1, 4, 2)))]
    outlines = [one.corners.astype(np.float32) for one in sightings]
    return [
        one
        for one, area in zip(sightings, areas, strict=True)
        if not any(
            one is not other and area <= larger and cv2.pointPolygonTest(outline, one.corners.mean(axis=0), False) > 0
            for other, larger, outline in zip(sightings, areas, outlines, strict=True)
        )
    ]


def _area(corners: Array) -> Array:
    """(n,) px^2, of the quadrilaterals (n, 4, 2)."""
    across, along = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
    return np.abs(across[:, 0] * along[:, 1] - across[:, 1] * along[:, 0]) / 2
