"""The occupancy grid: what all beams hit and passed through, along any path of a log's steps."""

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ...core.beside import Beams
from ...core.relations import Anchors
from ...core.se2 import Array, act
from ._grid import DX, DY, HIT, THROUGH, Cells, insert_beams, walls

CELL = 0.05  # m of a cell, unless the grid would be larger than MOST cells on a side

MOST = 4000

BORDER = 4  # cells around what was hit

SHARE = 0.25
"""Share of the beams that came to a cell and were reflected there, from which on it is a wall."""

OUTLIERS = 5e-4
"""Share of the points on each side that may lie outside of the grid: beams through windows do not make it large."""

MANY = 10.0  # beams that came to a cell of a grid of which only the states are known

UNKNOWN, FREE, WALL = 0, 1, 2


class SeenBeams(Protocol):
    """Beams from poses at a log's steps and between them."""

    @property
    def at(self) -> Anchors:
        """The poses that they were seen from, (k,)."""
        ...

    def beams(self, k: int) -> Beams:
        """Those of the k-th pose."""
        ...


class Occupancy(NamedTuple):
    """A grid whose cell (i, j) spans [origin + size (i, j), origin + size (i + 1, j + 1))."""

    origin: Array  # (2,) m
    size: float  # m
    cells: Cells  # (n, m, 4), as of a submap

    @property
    def corners(self) -> tuple[Array, Array]:
        """The lower left and the upper right corner (2,), m."""
        return self.origin, self.origin + self.size * np.array(self.cells.shape[:2])

    @property
    def states(self) -> NDArray[np.uint8]:
        """(n, m) UNKNOWN where no beam was, else FREE or WALL."""
        seen = self.cells[:, :, HIT] + self.cells[:, :, THROUGH] > 0
        return np.where(walls(self.cells, SHARE), WALL, np.where(seen, FREE, UNKNOWN)).astype(np.uint8)

    @property
    def picture(self) -> NDArray[np.uint8]:
        """(m, n) grey values, north up: white is free, black a wall, light grey unknown."""
        hits, through = self.cells[:, :, HIT], self.cells[:, :, THROUGH]
        all_ = hits + through
        with np.errstate(invalid="ignore"):
            dark = np.minimum(hits / all_ / (2 * SHARE), 1.0)
        grey = np.where(all_ > 0, 255 - 255 * dark, 205)
        return np.ascontiguousarray(np.rint(grey.T[::-1]).astype(np.uint8))


def of_states(origin: Array, size: float, states: NDArray[np.uint8]) -> Occupancy:
    """A grid of which only the states (n, m) are known: a wall is in the middle of its cells."""
    cells: Cells = np.zeros((*states.shape, 4), np.float32)
    wall = states == WALL
    cells[wall, HIT] = MANY
    cells[wall, DX] = cells[wall, DY] = MANY * size / 2
    cells[states == FREE, THROUGH] = MANY
    return Occupancy(origin, size, cells)


def occupancy(seen: SeenBeams, path: Array, cell: float = CELL, most: int = MOST) -> Occupancy:
    """Draws all beams into one grid, the steps of the log being at `path` (n, 3); at most `most` cells on a side."""
    return inserted(seen, path, *framed(*extent(seen, path), cell, most))


def framed(low: Array, high: Array, cell: float, most: int) -> tuple[Array, float, tuple[int, int]]:
    """The origin (2,), m, cell size (m) and shape of a grid from `low` to `high` (2,), m, with a border."""
    size = max(cell, float((high - low).max()) / (most - 2 * BORDER - 2))
    origin = size * (np.floor(low / size) - BORDER)
    n, m = (np.ceil((high - origin) / size).astype(int) + BORDER).tolist()
    return origin, size, (n, m)


def extent(seen: SeenBeams, path: Array) -> tuple[Array, Array]:
    """The corners (2,), m, low and high, of the rectangle around all ends along `path` (n, 3), OUTLIERS aside."""
    poses = seen.at.along(path)
    return around(np.concatenate([act(pose, seen.beams(k).ends) for k, pose in enumerate(poses)]), poses)


def around(points: Array, poses: Array) -> tuple[Array, Array]:
    """The corners (2,), m, low and high, of the rectangle around points (n, 2), OUTLIERS aside, and poses (k, 3)."""
    hit = points if len(points) else poses[:, :2]
    low = np.minimum(np.quantile(hit, OUTLIERS, axis=0), poses[:, :2].min(axis=0))
    return low, np.maximum(np.quantile(hit, 1 - OUTLIERS, axis=0), poses[:, :2].max(axis=0))


def inserted(seen: SeenBeams, path: Array, origin: Array, size: float, shape: tuple[int, int]) -> Occupancy:
    """Draws the beams along `path` (n, 3) into a grid of that place, cell size (m) and shape, if they are inside."""
    cells: Cells = np.zeros((*shape, 4), np.float32)
    for k, pose in enumerate(seen.at.along(path)):
        insert_beams(cells, origin, size, pose, *seen.beams(k))
    return Occupancy(origin, size, cells)
