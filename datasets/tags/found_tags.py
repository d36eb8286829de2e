"""Tags that another program found in a camera's frames, as sightings of the marker detector.

Range, bearing and their covariance follow from these as from tags that are detected here. Only a tag's place counts:
the axes of its frame, and which of its corners is the first, differ between programs.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.se2 import Array
from ...frontend.markers.aruco import IGNORED, Detector, Rejections, Sighting, single, square

BUNDLE = "a bundle of several tags, which is no landmark"
NO_POSE = "no pose explains the corners"
BEHIND = "behind the camera"

LARGEST_COV = 1e6  # m^2 and rad^2; some programs state more where they know nothing


class FoundTag(NamedTuple):
    """A tag in a frame: its pose, or its corners, or both."""

    id: int
    pose: Array | None = None  # (4, 4) T_camera_tag
    cov: Array | None = None  # (6, 6) of the pose, as in `tag_poses`; None: unknown
    corners: Array | None = None  # (4, 2) px, around the tag from any of them, either way


class TagFrame(NamedTuple):
    """A frame's tags."""

    t: float  # s, its stamp
    tags: Sequence[FoundTag]
    bundles: int = 0  # of several tags with one pose


class Known(NamedTuple):
    """The settings by which tags become sightings."""

    detector: Detector
    corner_sd: float  # px, of a corner along each axis
    needs_cov: bool  # the noise model asks for a pose's covariance
    where: str  # the file, and what in it
    table: str  # of the camera in robot.toml


def sightings(frame: TagFrame, known: Known) -> tuple[list[Sighting], Rejections]:
    """The sightings of a frame, sorted by id, and what is rejected, by reason.

    InputError where a covariance is needed and unknown.
    """
    rejected = Rejections({BUNDLE: frame.bundles} if frame.bundles else {})
    found = list[Sighting]()
    for tag in sorted(frame.tags, key=lambda one: one.id):
        if tag.id in known.detector.markers.ignore:
            rejected[IGNORED.format(tag.id)] += 1
            continue
        one = _sighting(tag, known)
        if isinstance(one, str):
            rejected[one] += 1
        else:
            found.append(one)
    return single(found, rejected), rejected


def _sighting(tag: FoundTag, known: Known) -> Sighting | str:
    """A tag as a sighting, or the reason against it."""
    if tag.pose is None:
        assert tag.corners is not None
        return known.detector.at_corners(tag.id, _clockwise(tag.corners), known.corner_sd) or NO_POSE
    if tag.pose[2, 3] <= 0:
        return BEHIND
    camera, cov = known.detector.camera, tag.cov
    corners = np.full((4, 2), np.nan)
    side = known.detector.markers.side_of(tag.id)
    if camera.known and not np.isnan(side):
        outline = square(side)
        corners = _clockwise(camera.project(outline @ tag.pose[:3, :3].T + tag.pose[:3, 3]))
        if cov is None and np.isfinite(corners).all():
            seen = known.detector.at_corners(tag.id, corners, known.corner_sd)
            cov = None if seen is None else seen.cov
    if cov is None and known.needs_cov:
        raise InputError(
            f"{known.where}: the pose of tag {tag.id} at {_place(tag.pose)} m has no covariance, which [noise] model = "
            f'"propagated" needs; expected one, or {known.table} calibration, by which [markers] corner_sd tells it, '
            'or model = "proportional".'
        )
    unknown = np.full((6, 6), np.nan)
    return Sighting(
        id=tag.id,
        corners=corners,
        corner_cov=np.full((8, 8), np.nan),
        pose=tag.pose,
        centre=tag.pose[:3, 3],
        cov=unknown if cov is None else cov,
        error=np.nan,
        ambiguity=0.0,
    )


def _place(pose: Array) -> str:
    return ", ".join(f"{one:.3g}" for one in pose[:3, 3].tolist())


def _clockwise(corners: Array) -> Array:
    """The corners (4, 2) in the order in which an image shows a marker's, from any of them."""
    across, along = corners[2] - corners[0], corners[3] - corners[1]
    return corners if across[0] * along[1] - across[1] * along[0] > 0 else corners[::-1].copy()


def fault_of(pose: Array | None, cov: Array | None, corners: Array | None) -> str | None:
    """The fault of what a program says of a tag: x, y, z, qx, qy, qz, qw (7,), a covariance and corners; None: none."""
    if pose is not None and not np.isfinite(pose).all():
        return "the pose has a number that is not finite"
    if pose is not None and abs(np.linalg.norm(pose[3:]) - 1) > 1e-2:
        return f"the quaternion qx, qy, qz, qw is of length {np.linalg.norm(pose[3:]):.3g}, expected 1"
    if corners is not None and not np.isfinite(corners).all():
        return "the corners have a number that is not finite"
    if cov is None:
        return None
    if not (np.isfinite(cov).all() and np.abs(cov).max() <= LARGEST_COV):
        return f"the covariance has a number that is not finite or beyond {LARGEST_COV:g}"
    if np.abs(cov - cov.T).max() > 1e-6 * np.abs(cov).max():
        return "the covariance is not symmetric"
    least = float(np.linalg.eigvalsh(cov[:3, :3])[0])
    return None if least > 0 else f"the covariance of x, y, z has the eigenvalue {least:.3g}, expected more than 0"
