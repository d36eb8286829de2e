"""Draws a map from above with the path that it was drawn along, and a bar of its length."""

from typing import NamedTuple

import cv2
import numpy as np

from ...core.se2 import Array
from ...frontend.maps.occupancy import Occupancy
from ...frontend.maps.top_view import TopView
from ...frontend.markers.aruco import Image

CELL = 0.05  # m of a pixel, or more where the picture would be larger than MOST
MOST, FOOT = 1600, 12  # px: longest side of the picture, and the room for the bar below the map

ROUND = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)
"""m: lengths of the bar."""

INK, WALKED = (60, 60, 60), (178, 114, 0)  # BGR: of the bar, and of the path


class MapPicture(NamedTuple):
    """The map as a picture."""

    image: Image  # (height, width, 3) BGR; north is up, the bar's row below
    cell: float  # m of a pixel
    corner: Array  # (2,) m, the place of the map's lower left corner
    bar: float  # m, the length of the bar


def map_picture(grid: Occupancy | TopView, path: Array, zoom: int = 1) -> MapPicture:
    """Draws a path (n, 3) of the log's steps on a map; a cell is `zoom` pixels wide."""
    shown = grid.picture.repeat(zoom, axis=0).repeat(zoom, axis=1)
    size = grid.size / zoom
    height, width = shown.shape[:2]
    picture = np.full((height + FOOT, width, 3), 255, np.uint8)
    picture[:height] = shown[:, :, None] if shown.ndim == 2 else shown[:, :, ::-1]
    walked = (path[:, :2] - grid.origin) / size
    line = np.round(np.column_stack((walked[:, 0], height - 1 - walked[:, 1]))).astype(np.int32)
    cv2.polylines(picture, [line], False, WALKED, min(zoom, 2), cv2.LINE_AA)
    bar = max((one for one in ROUND if one / size <= width / 3), default=size * width / 3)
    foot = height + FOOT // 2
    cv2.line(picture, (2, foot), (2 + round(bar / size), foot), INK, 2)
    return MapPicture(picture, size, grid.origin, bar)
