"""Inner loops on the cells of a grid: what beams hit and what they passed through.

A cell is four numbers: hits, beams that passed through, and the sums of the hits' offsets (m) from the cell's corner in
x and y. So a cell knows the mean of what was hit in it, to a fraction of its size. Cell (i, j) spans
[origin + size (i, j), origin + size (i + 1, j + 1)).
"""

from math import cos, floor, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.kernels.compiled import compiled
from ...core.se2 import Array

Cells = NDArray[np.float32]
Mask = NDArray[np.bool_]
Box = tuple[int, int, int, int]
"""Of cells: the first row and the one after the last, the first column and the one after the last."""

HIT, THROUGH, DX, DY = 0, 1, 2, 3
"""Columns of a cell."""


class Grid(NamedTuple):
    """Cells, their place, and the walls among them."""

    cells: Cells  # (n, m, 4)
    origin: Array  # (2,) m, the corner of cell (0, 0)
    size: float  # m, of a cell
    share: float  # of the beams that came to a wall, those that were reflected there at least


@compiled
def insert(cells: Cells, origin: Array, size: float, pose: Array, scanner: Array, points: Array) -> Box:
    """Inserts the points (k, 2) of a scan, m in the robot's frame at `pose`, that a scanner at `scanner` (2,) saw.

    Returns the box of the cells that were hit: the first and the one after the last row, and the same of the columns.
    """
    rows, columns = cells.shape[0], cells.shape[1]
    top, bottom, left, right = rows, 0, columns, 0
    c, s = cos(pose[2]), sin(pose[2])
    start_i = (pose[0] + c * scanner[0] - s * scanner[1] - origin[0]) / size
    start_j = (pose[1] + s * scanner[0] + c * scanner[1] - origin[1]) / size
    for k in range(len(points)):
        u = (pose[0] + c * points[k, 0] - s * points[k, 1] - origin[0]) / size
        v = (pose[1] + s * points[k, 0] + c * points[k, 1] - origin[1]) / size
        pass_through(cells, start_i, start_j, u, v)
        if hit(cells, size, u, v):
            i, j = floor(u), floor(v)
            top, bottom, left, right = min(top, i), max(bottom, i + 1), min(left, j), max(right, j + 1)
    return top, bottom, left, right


@compiled
def insert_beams(
    cells: Cells, origin: Array, size: float, pose: Array, starts: Array, ends: Array, reflected: Mask
) -> None:
    """Inserts beams from `starts` to `ends` (k, 2), m in the robot's frame at `pose`; those `reflected` (k,) hit."""
    c, s = cos(pose[2]), sin(pose[2])
    for k in range(len(ends)):
        start_i = (pose[0] + c * starts[k, 0] - s * starts[k, 1] - origin[0]) / size
        start_j = (pose[1] + s * starts[k, 0] + c * starts[k, 1] - origin[1]) / size
        u = (pose[0] + c * ends[k, 0] - s * ends[k, 1] - origin[0]) / size
        v = (pose[1] + s * ends[k, 0] + c * ends[k, 1] - origin[1]) / size
        pass_through(cells, start_i, start_j, u, v)
        if reflected[k]:
            hit(cells, size, u, v)


@compiled
def pass_through(cells: Cells, start_i: float, start_j: float, u: float, v: float) -> None:
    """Counts a beam from one place to another, in cells, in all cells but the last ones."""
    along_i, along_j = u - start_i, v - start_j
    steps = int(max(abs(along_i), abs(along_j)))
    if steps > 1:
        step_i, step_j = along_i / steps, along_j / steps
        for q in range(steps - 1):  # not the last cells: a beam that grazes a wall ends there
            i, j = floor(start_i + q * step_i), floor(start_j + q * step_j)
            if 0 <= i < cells.shape[0] and 0 <= j < cells.shape[1]:
                cells[i, j, THROUGH] += 1


@compiled
def hit(cells: Cells, size: float, u: float, v: float) -> bool:
    """Counts what a beam hit at a place, in cells; False outside of the grid."""
    i, j = floor(u), floor(v)
    if not (0 <= i < cells.shape[0] and 0 <= j < cells.shape[1]):
        return False
    cells[i, j, HIT] += 1
    cells[i, j, DX] += size * (u - i)
    cells[i, j, DY] += size * (v - j)
    return True


@compiled
def is_wall(cells: Cells, i: int, j: int, share: float) -> bool:
    """Tells if at least `share` of the beams that came to a cell were reflected there."""
    hits = cells[i, j, HIT]
    return hits > 0 and hits >= share * (hits + cells[i, j, THROUGH])


@compiled
def walls(cells: Cells, share: float) -> Mask:
    """Marks the cells that are walls, (n, m)."""
    out = np.empty(cells.shape[:2], np.bool_)
    for i in range(cells.shape[0]):
        for j in range(cells.shape[1]):
            out[i, j] = is_wall(cells, i, j, share)
    return out


@compiled
def walls_within(cells: Cells, box: Box, share: float) -> Box:
    """The smallest box of all walls in a box; one without rows where there is none."""
    top, bottom, left, right = box[1], box[0], box[3], box[2]
    for i in range(box[0], box[1]):
        for j in range(box[2], box[3]):
            if (i < top or i >= bottom or j < left or j >= right) and is_wall(cells, i, j, share):
                top, bottom, left, right = min(top, i), max(bottom, i + 1), min(left, j), max(right, j + 1)
    return top, bottom, left, right


@compiled
def thinned(points: Array, spacing: float) -> Mask:
    """Which points of a scan (k, 2), in the order of its beams, to keep so that neighbours are `spacing` (m) apart.

    Kept is the first point, and the one after each that is so far from the last such one, so that its own noise has no
    part in the choice. Noise that takes a point away from the last one would choose it more often: along the walls on
    both sides of a corridor these are off to one side, and so is the place of a matched scan.
    """
    keep = np.empty(len(points), np.bool_)
    x, y, far = np.inf, np.inf, True
    for k in range(len(points)):
        keep[k] = far
        dx, dy = points[k, 0] - x, points[k, 1] - y
        far = not dx * dx + dy * dy < spacing * spacing
        if far:
            x, y = points[k, 0], points[k, 1]
    return keep


@compiled
def one_a_cell(points: Array, size: float) -> Array:
    """The first of the points (k, 2) in every cell of a grid of that size, in their order."""
    n = len(points)
    slots = 16
    while slots < 2 * n:
        slots *= 2
    keys, used = np.empty(slots, np.int64), np.zeros(slots, np.bool_)
    out, m = np.empty((n, 2)), 0
    for k in range(n):
        key = (floor(points[k, 0] / size) << 32) + floor(points[k, 1] / size)
        at = (key * 0x9E3779B97F4A7C1 >> 20) & (slots - 1)
        while used[at] and keys[at] != key:
            at = (at + 1) & (slots - 1)
        if not used[at]:
            used[at], keys[at] = True, key
            out[m] = points[k]
            m += 1
    return out[:m].copy()


@compiled
def seen_through(grid: Grid, pose: Array, scanner: Array, points: Array, slack: float) -> tuple[float, float]:
    """Two shares of the beams of a scan at `pose`: those that the walls and those that the free space contradict.

    Of the beams over ground that the submap has seen: those that pass through a wall more than `slack` (m) before they
    end. Of the beams that end in ground it has seen: those that end where it has seen nothing but free space.
    """
    cells, origin, size = grid.cells, grid.origin, grid.size
    rows, columns = cells.shape[0], cells.shape[1]
    c, s = cos(pose[2]), sin(pose[2])
    start_i = (pose[0] + c * scanner[0] - s * scanner[1] - origin[0]) / size
    start_j = (pose[1] + s * scanner[0] + c * scanner[1] - origin[1]) / size
    crossed, compared, in_free, ended = 0, 0, 0, 0
    for k in range(len(points)):
        u = (pose[0] + c * points[k, 0] - s * points[k, 1] - origin[0]) / size
        v = (pose[1] + s * points[k, 0] + c * points[k, 1] - origin[1]) / size
        along_i, along_j = u - start_i, v - start_j
        steps = int(max(abs(along_i), abs(along_j)))
        if steps < SHORT:
            continue
        known, wall = 0, False
        step_i, step_j = along_i / steps, along_j / steps
        for q in range(steps - int(slack / size)):
            i, j = floor(start_i + q * step_i), floor(start_j + q * step_j)
            if 0 <= i < rows and 0 <= j < columns:
                hits, all_ = cells[i, j, HIT], cells[i, j, HIT] + cells[i, j, THROUGH]
                known += all_ > 0
                wall = wall or (hits >= SOLID_HITS and hits >= SOLID_SHARE * all_)
        if known > COMPARED * steps:
            compared += 1
            crossed += wall
        i, j = floor(u), floor(v)
        near, seen = False, 0
        for a in range(max(i - AROUND, 0), min(i + AROUND + 1, rows)):
            for b in range(max(j - AROUND, 0), min(j + AROUND + 1, columns)):
                near = near or is_wall(cells, a, b, FREE_SHARE)
                seen += cells[a, b, HIT] + cells[a, b, THROUGH] > 0
        if 2 * seen > (2 * AROUND + 1) ** 2:
            ended += 1
            in_free += not near
    return crossed / max(compared, 1), in_free / max(ended, 1)


@compiled
def known(grid: Grid, pose: Array, points: Array) -> float:
    """Share of a scan's points, taken at `pose`, that are on ground which the submap has seen.

    A quarter of the cells around a point is enough: of a wall, one side is seen.
    """
    cells, origin, size = grid.cells, grid.origin, grid.size
    c, s = cos(pose[2]), sin(pose[2])
    count = 0
    for k in range(len(points)):
        u = (pose[0] + c * points[k, 0] - s * points[k, 1] - origin[0]) / size
        v = (pose[1] + s * points[k, 0] + c * points[k, 1] - origin[1]) / size
        seen = 0
        for a in range(max(floor(u) - AROUND, 0), min(floor(u) + AROUND + 1, cells.shape[0])):
            for b in range(max(floor(v) - AROUND, 0), min(floor(v) + AROUND + 1, cells.shape[1])):
                seen += cells[a, b, HIT] + cells[a, b, THROUGH] > 0
        count += 4 * seen > (2 * AROUND + 1) ** 2
    return count / max(len(points), 1)


SHORT, COMPARED = 4, 0.3
"""Cells of a beam that is compared at least, and the share of them that the submap has seen."""

SOLID_HITS, SOLID_SHARE = 3, 0.5
"""Hits, and their share of all beams, of a cell that no beam can pass through."""

FREE_SHARE, AROUND = 0.2, 3
"""A beam ends in free space if no cell within AROUND of its end has this share of hits."""
