"""Draws detections on camera frames."""

from typing import Any

import cv2
import numpy as np

from ...core.se2 import Array
from ...frontend.markers.aruco import Image
from ...frontend.markers.pipeline import FrameSightings
from .pictures import KEPT, REFUSED, WHITE, extent, write

_SHIFT = 4  # bits of a pixel that OpenCV draws lines to


def annotated(seen: FrameSightings, width: int | None = None) -> Image:
    """Draws outlines, ids, ranges and the time on the frame, `width` px wide (None: as it is)."""
    image = seen.frame.image
    assert image is not None
    picture = np.array(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if image.ndim == 2 else image)
    scale = 1.0 if width is None else width / picture.shape[1]
    if scale != 1.0:
        how = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
        height, across = (round(scale * size) for size in picture.shape[:2])
        picture = cv2.resize(picture, (across, height), interpolation=how)
    size = picture.shape[1] / 640 * (1.1 if width is None else 2.0)  # small pictures need larger letters
    for sighting, z, kept in zip(seen.sightings, seen.z, seen.kept, strict=True):
        colour = KEPT if kept else REFUSED
        corners = (sighting.corners + 0.5) * scale - 0.5
        _outline(picture, corners, colour, size)
        _words(picture, f"{sighting.id}: {z[0]:.2f} m", corners, size)
    said = f"{seen.frame.t:.2f} s  {seen.frame.camera}".rstrip()
    if seen.rejected.total():
        said += f"  {seen.rejected.total()} rejected"
    write(picture, said, (round(6 * size), picture.shape[0] - round(8 * size)), 0.5 * size)
    return np.asarray(picture, np.uint8)


def _outline(picture: Any, corners: Array, colour: tuple[int, int, int], size: float) -> None:
    """Draws the square, and a dot at the marker's own top left corner, which shows its orientation."""
    points = np.round(corners * (1 << _SHIFT)).astype(np.int32)
    cv2.polylines(picture, [points], True, WHITE, max(1, round(2 * size)), cv2.LINE_AA, _SHIFT)
    cv2.polylines(picture, [points], True, colour, max(1, round(1.2 * size)), cv2.LINE_AA, _SHIFT)
    x, y = (int(value) for value in points[0])
    cv2.circle(picture, (x, y), round(2.2 * size * (1 << _SHIFT)), colour, cv2.FILLED, cv2.LINE_AA, _SHIFT)


def _words(picture: Any, text: str, corners: Array, size: float) -> None:
    """Writes above the marker, or below one at the upper edge; never beyond the sides."""
    scale = 0.45 * size
    (width, height), _ = extent(text, scale)
    low, high = corners.min(axis=0), corners.max(axis=0)
    x = int(np.clip((low[0] + high[0] - width) / 2, 3, max(3, picture.shape[1] - width - 3)))
    above = low[1] - 6 * size
    y = above if above > height + 4 else min(high[1] + height + 8 * size, picture.shape[0] - 4)
    write(picture, text, (x, int(y)), scale)
