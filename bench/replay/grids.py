"""Draws the occupancy grids of a replay: at some of its frames, the laser scans so far along the path of that moment.

A smoother's path is the one it has at the frame, that of all other backends is the path that the replay shows. All
grids of a replay have the same cells, so that they lie over one another.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.beside import Scans
from ...core.se2 import Array, Ints, act, compose
from ...frontend.maps.occupancy import CELL, extent, inserted
from .course import Course, Revised, moments

ACROSS = 420  # cells across a panel, at most
MOST = 3000  # scans that a grid is drawn of, at most: of more, evenly spaced ones
DOTS = 90  # returns of the newest scan that are shown, at most

Hits = Sequence[Array]


class Raster(NamedTuple):
    """The cells of all grids: n across the panels from their lower left corner on, m upwards."""

    origin: Array  # (2,) m
    size: float  # m
    shape: tuple[int, int]  # n, m


class Sketch(NamedTuple):
    """A grid, and the frame from which on it is shown."""

    frame: int
    states: NDArray[np.uint8]  # (n, m) UNKNOWN, FREE or WALL


def raster(low: Array, high: Array) -> Raster:
    """Covers the plane from `low` to `high` (2,), m."""
    across, up = (high - low).tolist()
    n = int(min(ACROSS, np.ceil(across / CELL)))
    return Raster(low, across / n, (n, int(np.ceil(up * n / across - 1e-9))))


def sketches(scans: Scans, course: Course, frames: Ints, cells: Raster) -> list[Sketch]:
    """Draws the grids of a course, as far as it got, at the steps `frames` (f,) or some of them."""
    reached = len(course.maps)
    shown = course.revised or [Revised(k, course.path[: frames[k] + 1]) for k in moments(len(frames)) if k < reached]
    few = scans.taken(np.arange(0, len(scans.ranges), -(-len(scans.ranges) // MOST)))
    return [Sketch(k, _states(few, path, int(frames[-1]), cells)) for k, path in shown]


def newest(scans: Scans, path: Array, frames: Ints) -> Hits:
    """The newest scan's returns at each of the steps (f,), (k, 2) m, from where `path` (n, 3) has it; some of many."""
    before = np.searchsorted(scans.at.step, frames, "right") - 1
    return [_hits(scans, path, int(k)) if k >= 0 else np.zeros((0, 2)) for k in before]


def around(scans: Scans, paths: Sequence[Array]) -> Array:
    """The corners (c, 2), m, of the rectangles around all scans along the paths (n, 3)."""
    return np.array([corner for path in paths for corner in extent(scans, path)])


def _states(scans: Scans, path: Array, last: int, cells: Raster) -> NDArray[np.uint8]:
    """Draws the scans between the steps of a path that ends at a moment; at the last step also those after it."""
    until = len(path) - 1
    so_far = scans.at.step < until if until < last else np.ones(len(scans.ranges), np.bool_)
    return inserted(scans.taken(so_far), path, *cells).states


def _hits(scans: Scans, path: Array, k: int) -> Array:
    pose = compose(path[scans.at.step[k]], scans.at.since[k])
    found = scans.points(k)
    return act(pose, found[:: max(-(-len(found) // DOTS), 1)])
