"""Draws the map: what the beams hit, seen from above, along the front end's own path."""

from typing import NamedTuple

import cv2
import numpy as np

from ...datasets.formats.scans_file import Scans
from ...frontend.markers.aruco import Image
from ...frontend.se2 import Array, act

CELL = 0.05
"""m of a pixel, or more where the picture would be larger than MOST."""

MOST, BORDER = 1600, 12
"""px: longest side of the picture, and what is left free around the map."""

FULL = 4
"""Hits that make a pixel black."""

ROUND = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)
"""m: lengths of the bar."""

OUTLIERS = 0.001
"""Share of the hits on each side of the map that may lie outside of the picture."""

INK, WALKED = (60, 60, 60), (178, 114, 0)
"""BGR: of the bar, and of the path."""


class MapPicture(NamedTuple):
    """The map as a picture."""

    image: Image  # (height, width, 3) BGR; north is up
    cell: float  # m of a pixel
    corner: Array  # (2,) m, the place of the lower left corner
    bar: float  # m, the length of the bar


def map_picture(scans: Scans, path: Array | None = None) -> MapPicture:
    """Draws the hits of all scans, the robot's poses (n, 3) at these being `path`, the front end's own where None."""
    poses = scans.estimate if path is None else path
    hits = np.concatenate([poses[:, :2], *(act(pose, scans.points(row)) for row, pose in enumerate(poses))])
    low = np.minimum(np.quantile(hits, OUTLIERS, axis=0), poses[:, :2].min(axis=0))
    high = np.maximum(np.quantile(hits, 1 - OUTLIERS, axis=0), poses[:, :2].max(axis=0))
    cell = max(CELL, float((high - low).max()) / (MOST - 2 * BORDER - 1))
    corner = low - BORDER * cell
    width, height = (np.ceil((high - low) / cell).astype(int) + 2 * BORDER + 1).tolist()
    at = np.floor((hits[len(poses) :] - corner) / cell).astype(int)
    inside = ((at >= 0) & (at < (width, height))).all(axis=1)
    count = np.zeros((height, width))
    np.add.at(count, (height - 1 - at[inside, 1], at[inside, 0]), 1.0)
    grey = np.round(255 * (1 - np.minimum(count / FULL, 1.0))).astype(np.uint8)
    picture = np.repeat(grey[:, :, None], 3, axis=2)
    walked = (poses[:, :2] - corner) / cell
    line = np.round(np.column_stack((walked[:, 0], height - 1 - walked[:, 1]))).astype(np.int32)
    cv2.polylines(picture, [line], False, WALKED, 1, cv2.LINE_AA)
    bar = max((one for one in ROUND if one / cell <= width / 3), default=cell * width / 3)
    left, foot = BORDER, height - BORDER // 2
    cv2.line(picture, (left, foot), (left + round(bar / cell), foot), INK, 2)
    return MapPicture(np.asarray(picture, np.uint8), cell, corner, bar)
