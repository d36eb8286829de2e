"""A submap: some metres of path drawn into a grid, which scans are matched with."""

from functools import cache

import numpy as np

from ...core.se2 import Array
from ..maps._grid import Box, Cells, Grid, insert, walls_within
from ._search import ANYWHERE, FULL, LEVELS, Bytes, Search, branch_and_bound, coarser, likelihoods
from .packed import Packed
from .scanner import Scan, Scanner
from .settings import Settings

BORDER = 8  # cells around what was hit that a finished submap keeps


class Submap:
    """A grid in the axes of the scan matcher's path, as large as what is seen from the path that it lives for.

    Memory that nothing is drawn into costs nothing: the system provides it when it is written to.
    """

    def __init__(self, pose: Array, settings: Settings, scanner: Scanner, born: float) -> None:
        self.settings, self.scanner = settings, scanner
        half = int(np.ceil((scanner.farthest + 2 * settings.submap_path) / settings.cell)) + BORDER
        self.origin = settings.cell * (np.floor(pose[:2] / settings.cell) - half)
        self._cells: Cells | None = np.zeros((2 * half, 2 * half, 4), np.float32)
        self._hit: Box = 2 * half, 0, 2 * half, 0
        self._packed: Packed | None = None
        self._pyramid: tuple[Bytes, ...] | None = None
        self.born = born  # m of path
        self.died = np.inf
        self.steps: list[int] = []  # of the log, while it was drawn

    @classmethod
    def finished(cls, cells: Cells, origin: Array, settings: Settings, scanner: Scanner) -> "Submap":
        """A whole map, of cells (n, m, 4) of the size in `settings`, whose corner is at `origin` (2,)."""
        submap = cls(np.zeros(3), settings, scanner, 0.0)
        submap._cells, submap.origin, submap.died = cells, origin, 0.0
        return submap

    def insert(self, pose: Array, scan: Scan) -> None:
        """Draws a scan taken at `pose` (3,)."""
        if len(scan.points):
            hit = insert(self.cells, self.origin, self.settings.cell, pose, self.scanner.pose[:2], scan.points)
            before = self._hit
            self._hit = (
                min(hit[0], before[0]), max(hit[1], before[1]), min(hit[2], before[2]), max(hit[3], before[3]),
            )  # fmt: skip

    def finish(self, path: float) -> None:
        """Keeps the part of the grid in which something was hit."""
        top, bottom, left, right = walls_within(self.cells, self._hit, self.settings.share)
        self.died = path
        if top >= bottom:
            self._cells = self.cells[:1, :1].copy()
            return
        top, left = max(top - BORDER, 0), max(left - BORDER, 0)
        self._cells = self.cells[top : bottom + BORDER, left : right + BORDER].copy()
        self.origin = self.origin + self.settings.cell * np.array([top, left])

    def pack(self) -> None:
        """Packs a finished submap's cells, and forgets its pyramid; both are made again when they are asked for."""
        if self._packed is None:
            self._packed = Packed(self.cells)
        self._cells = self._pyramid = None

    @property
    def nbytes(self) -> int:
        """Bytes of what it keeps."""
        return sum(part.nbytes for part in (self._cells, self._packed, *(self._pyramid or ())) if part is not None)

    @property
    def cells(self) -> Cells:
        """(n, m, 4) the grid; see `_grid`."""
        if self._cells is None:
            assert self._packed is not None
            self._cells = self._packed.cells()
        return self._cells

    @property
    def grid(self) -> Grid:
        """The grid with its place and its walls."""
        return Grid(self.cells, self.origin, self.settings.cell, self.settings.share)

    @property
    def pyramid(self) -> tuple[Bytes, ...]:
        """The field of likelihoods and its maxima over ever larger squares, of a finished submap; see `_search`."""
        if self._pyramid is None:
            rows, columns, _ = self.cells.shape
            levels = [self._field((0, rows, 0, columns), self.settings.field_sd)]
            for level in range(1, LEVELS):
                levels.append(coarser(levels[-1], 1 << (level - 1)))
            self._pyramid = tuple(levels)
        return self._pyramid

    def best(self, search: Search, least: float, apart: Array = ANYWHERE) -> tuple[Array, float]:
        """The pose (3,) at which most points are on walls, and its score; see `branch_and_bound`."""
        pose, score, _ = branch_and_bound(self.pyramid, self.origin, self.settings.cell, search, least, apart)
        return pose, score

    def field_around(self, pose: Array, reach: float, sd: float) -> tuple[Bytes, Array]:
        """The field within `reach` (m) of a pose, and its origin (2,)."""
        middle = np.floor((pose[:2] - self.origin) / self.settings.cell).astype(int)
        half = int(reach / self.settings.cell)
        first = np.clip(middle - half, 0, np.array(self.cells.shape[:2]) - 1)
        last = np.clip(middle + half, first + 1, self.cells.shape[:2])
        box = int(first[0]), int(last[0]), int(first[1]), int(last[1])
        return self._field(box, sd), self.origin + self.settings.cell * first

    def _field(self, box: Box, sd: float) -> Bytes:
        return likelihoods(self.cells, box, self.settings.share, stamp(self.settings.cell, sd))


@cache
def stamp(size: float, sd: float) -> Bytes:
    """The field around one wall in cells of that size, as far as it is not 0: a Gaussian, `sd` (m), as bytes."""
    reach = int(sd * np.sqrt(2 * np.log(2 * FULL)) / size) + 1
    off = np.arange(-reach, reach + 1)
    distance = size * np.sqrt((off[:, None] ** 2 + off**2).astype(np.float32))
    return np.round(FULL * np.exp(-0.5 * (distance / sd) ** 2)).astype(np.uint8)
