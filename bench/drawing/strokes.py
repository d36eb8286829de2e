"""Lines of long paths: a picture shows a street once, however often the robot drove along it."""

import numpy as np
from numpy.typing import NDArray

from ...core.se2 import Array

MOST = 20_000  # strokes of a line; a path of fewer poses is drawn as it is
FINEST = 1000  # cells along a picture's longer side, at first
FAR = 1 << 30  # more than a picture has cells


def strokes(path: Array, low: Array, high: Array) -> Array:
    """Returns the line (m, 2) of a path (n, 2) in a picture from `low` (2,) to `high` (2,), with gaps of NaN.

    A long path becomes strokes between cells of the picture: a run of poses in one cell is its first one, and of all
    strokes between the same two cells the first is drawn. The cells' side doubles until MOST strokes are left. What is
    more than the picture's size away from it is left out.
    """
    if len(path) <= MOST:
        return path
    size = high - low
    with np.errstate(invalid="ignore"):
        inside = ((path >= low - size) & (path <= high + size)).all(axis=1)
    side = float(size.max()) / FINEST
    while True:
        start, end = _once(np.floor((path[inside] - low) / side).astype(np.int64), np.flatnonzero(inside))
        if len(start) <= MOST:
            return _line(path, start, end)
        side *= 2


def _once(cell: NDArray[np.int64], step: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The steps at which the strokes between two cells begin and end that are not drawn yet."""
    first = np.append(True, (np.diff(cell, axis=0) != 0).any(axis=1) | (np.diff(step) > 1))[: len(step)]
    last = np.append(np.flatnonzero(first)[1:], len(step))[:, None] - 1  # of each run of poses in one cell
    cell, here = cell[first, 0] * FAR + cell[first, 1], step[first]
    unbroken = here[1:] - step[last[:-1, 0]] == 1
    cell = np.unique(cell, return_inverse=True)[1]  # below 2^31, so that a pair is one number
    pairs = np.minimum(cell[:-1], cell[1:]) * FAR + np.maximum(cell[:-1], cell[1:])
    new = np.unique(pairs[unbroken], return_index=True)[1]
    at = np.flatnonzero(unbroken)[np.sort(new)]
    return here[at], here[at + 1]


def _line(path: Array, start: NDArray[np.int64], end: NDArray[np.int64]) -> Array:
    """The strokes one after another, with a gap where the next does not begin where the last ended."""
    goes_on = np.append(False, start[1:] == end[:-1])[: len(start)]
    rows = np.where(goes_on, 1, 3)  # a stroke that goes on adds its end; another a gap, its start and its end
    line = np.full((int(rows.sum()), 2), np.nan)
    last = np.cumsum(rows) - 1
    line[last] = path[end]
    line[last[~goes_on] - 1] = path[start[~goes_on]]
    return line[1:]
