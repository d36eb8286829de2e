"""The view from above: the colours of all clouds of points along any path of a log's steps."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.beside import Clouds
from ...core.se2 import Array
from ._clouds import from_above
from .cloud import placed
from .obstacles import HIGH
from .occupancy import CELL, MOST, around, framed

LAYER = 0.1  # m of height; the points of a cell's highest layer give its colour
UNSEEN = 255  # grey value of what no point is in


class TopView(NamedTuple):
    """A picture whose cell (i, j) spans [origin + size (i, j), origin + size (i + 1, j + 1))."""

    origin: Array  # (2,) m
    size: float  # m
    colours: NDArray[np.uint8]  # (n, m, 3) red, green, blue

    @property
    def corners(self) -> tuple[Array, Array]:
        """The lower left and the upper right corner (2,), m."""
        return self.origin, self.origin + self.size * np.array(self.colours.shape[:2])

    @property
    def picture(self) -> NDArray[np.uint8]:
        """(m, n, 3) red, green, blue, north up."""
        return np.ascontiguousarray(self.colours.transpose(1, 0, 2)[::-1])


def top_view(clouds: Clouds, path: Array, cell: float = CELL, most: int = MOST, high: float = HIGH) -> TopView:
    """Draws all points below `high`, m, along `path` (n, 3) of the steps; at most `most` cells on a side."""
    poses = clouds.at.along(path)
    below = list[Array]()
    for k, pose in enumerate(poses):
        points = placed(clouds, k, pose).points
        below.append(points[points[:, 2] < high, :2])
    origin, size, shape = framed(*around(np.concatenate(below), poses), cell, most)
    top, sums = np.full(shape, -np.inf), np.zeros((*shape, 4))
    for k, pose in enumerate(poses):
        points = placed(clouds, k, pose).points
        cells = np.floor((points[:, :2] - origin) / size).astype(np.int64)
        from_above(points, clouds.rgb(k), cells, high, LAYER, top, sums)
    with np.errstate(invalid="ignore"):
        means = np.where(sums[:, :, 3:] > 0, sums[:, :, :3] / sums[:, :, 3:], UNSEEN)
    return TopView(origin, size, np.rint(means).astype(np.uint8))
