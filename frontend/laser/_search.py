"""Inner loops of correlative search: where in a window do a scan's points fall on walls?

A field (n, m) of bytes is 255 on a wall and falls off beside it; the score of a pose is the mean of the field at the
points. Branch and bound (Hess et al., ICRA 2016, section V) looks at squares of places first: level h of the pyramid is
the field's maximum over 2^h x 2^h cells, so that its score bounds those of all places in the square.
"""

from math import ceil, cos, exp, floor, sin, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.kernels._planar import wrap
from ...core.kernels.compiled import compiled
from ...core.se2 import Array
from ..maps._grid import Box, Cells, is_wall

Bytes = NDArray[np.uint8]

LEVELS = 7
"""Of the pyramid: the coarsest squares have 64 cells a side."""

FULL = 255
"""The field on a wall."""

BLOCK = 16
"""Points between two looks at whether a sum can still be large enough."""

ANYWHERE = np.zeros(5)
"""No pose is left out of a search."""


class Search(NamedTuple):
    """The poses that are compared: those of a window, in steps of a cell and of a turn."""

    points: Array  # (k, 2) in the robot's frame
    centre: Array  # (3,)
    window: float  # m
    turn: float  # rad
    turn_step: float  # rad


@compiled
def likelihoods(cells: Cells, box: Box, share: float, stamp: Bytes) -> Bytes:
    """The field of a box of a grid's cells: `stamp` (2 r + 1, 2 r + 1) around each wall in it, the highest of several.

    That is the field by the distance to the nearest wall, which a distance transform of all cells takes ten times as
    long for. A wall is where at least `share` of the beams were reflected.
    """
    rows, columns, reach = box[1] - box[0], box[3] - box[2], stamp.shape[0] // 2
    out = np.zeros((rows, columns), np.uint8)
    for i in range(rows):
        for j in range(columns):
            if is_wall(cells, box[0] + i, box[2] + j, share):
                first, last = max(j - reach, 0), min(j + reach + 1, columns)
                for a in range(max(i - reach, 0), min(i + reach + 1, rows)):
                    for b in range(first, last):
                        out[a, b] = max(out[a, b], stamp[a - i + reach, b - j + reach])
    return out


@compiled
def coarser(finer: Bytes, width: int) -> Bytes:
    """The next level of a pyramid, from one of squares of `width` cells.

    Entry (i, j) is about the square whose first cell is (i - 2 width + 1, j - 2 width + 1): squares that overlap the
    field in part are there, too.
    """
    rows, columns = finer.shape
    out = np.zeros((rows + width, columns + width), np.uint8)
    for i in range(rows):
        for j in range(columns):
            value = finer[i, j]
            for a in (i, i + width):
                for b in (j, j + width):
                    out[a, b] = max(out[a, b], value)
    return out


@compiled
def total(level: Bytes, width: int, at_i: NDArray[np.int32], at_j: NDArray[np.int32], di: int, dj: int) -> int:
    """Sum, over cells moved by the squares from (di, dj) on, of the maximum in the square."""
    rows, columns = np.uint64(level.shape[0]), np.uint64(level.shape[1])
    value = 0
    for k in range(len(at_i)):
        i, j = np.uint64(at_i[k] + di + width - 1), np.uint64(at_j[k] + dj + width - 1)  # huge where it is negative
        if i < rows and j < columns:
            value += int(level[i, j])
    return value


@compiled
def totals(
    level: Bytes, width: int, at_i: NDArray[np.int32], at_j: NDArray[np.int32], di: int, dj: int, limit: int
) -> tuple[int, int, int, int]:
    """The totals of a square's four quarters, `width` cells wide each; zeros as soon as none can be above `limit`."""
    rows, columns = np.uint64(level.shape[0]), np.uint64(level.shape[1])
    n, di, dj = len(at_i), di + width - 1, dj + width - 1
    a, b, c, d = 0, 0, 0, 0
    for start in range(0, n, BLOCK):
        end = min(start + BLOCK, n)
        for k in range(start, end):
            top, left = at_i[k] + di, at_j[k] + dj
            i, j = np.uint64(top), np.uint64(left)
            below, right = np.uint64(top + width), np.uint64(left + width)
            if i < rows:
                if j < columns:
                    a += int(level[i, j])
                if right < columns:
                    b += int(level[i, right])
            if below < rows:
                if j < columns:
                    c += int(level[below, j])
                if right < columns:
                    d += int(level[below, right])
        if max(a, b, c, d) + FULL * (n - end) <= limit:
            return 0, 0, 0, 0
    return a, b, c, d


@compiled
def branch_and_bound(
    pyramid: tuple[Bytes, ...],
    origin: Array,
    size: float,
    search: Search,
    least: float,
    apart: Array,
) -> tuple[Array, float, int]:
    """The best pose of a search in a field with that corner (2,), m, and size of cells, m.

    Returns it, its score from 0 to 1, and the number of sums computed; the score is 0 where none is above `least`. Of
    equally good poses the first found is taken. `apart` is ANYWHERE, or x, y, heading of a pose with the distance (m)
    and turn (rad) from it: those within both are not looked for.

    Headings are bounded together, too: turned by some steps no point moves by more than half a square, so that a
    square twice as large, at the heading in the middle, bounds its group.
    """
    points, centre, turn_step = search.points, search.centre, search.turn_step
    count, turns = len(points), ceil(search.turn / turn_step)
    half, width = ceil(search.window / size), 1 << (LEVELS - 2)
    across, headings = 2 * half // width + 1, 2 * turns + 1
    limit = int(least * FULL * count)
    farthest = 0.0
    for k in range(count):
        farthest = max(farthest, points[k, 0] * points[k, 0] + points[k, 1] * points[k, 1])
    beside = min(int(0.5 * width * size / (sqrt(farthest) * turn_step + 1e-12)), turns)
    group = 2 * beside + 1
    groups = (headings + group - 1) // group
    at_i, at_j = np.empty((headings, count), np.int32), np.empty((headings, count), np.int32)
    for a in range(headings):
        heading = centre[2] + (a - turns) * turn_step
        c, s = cos(heading), sin(heading)
        for k in range(count):
            at_i[a, k] = floor((centre[0] + c * points[k, 0] - s * points[k, 1] - origin[0]) / size)
            at_j[a, k] = floor((centre[1] + s * points[k, 0] + c * points[k, 1] - origin[1]) / size)
    visited = groups * across * across
    sums, of = np.empty(visited, np.int64), np.empty((visited, 3), np.int32)
    m = 0
    for g in range(groups):
        a = min(g * group + beside, headings - 1)
        for p in range(across):
            for q in range(across):
                i, j = p * width - half, q * width - half
                value = total(
                    pyramid[LEVELS - 1], 2 * width, at_i[a], at_j[a], i - width // 2, j - width // 2
                )  # fmt: skip
                if value > limit:
                    sums[m], of[m, 0], of[m, 1], of[m, 2] = value, g * group, i, j
                    m += 1
    best_a, best_i, best_j, found = turns, 0, 0, False
    members, values = np.empty(group, np.int64), np.empty(group, np.int64)
    barred, free = np.empty(3), np.empty(2, np.int64)
    order = np.argsort(-sums[:m])
    for t in range(m):
        at = order[t]
        if sums[at] <= limit:
            break
        first, i, j = of[at, 0], of[at, 1], of[at, 2]
        last, n = min(first + group, headings), 0
        visited += last - first
        for a in range(first, last):
            value = total(pyramid[LEVELS - 2], width, at_i[a], at_j[a], i, j)
            if value > limit:
                q = n  # the best is looked at first
                while q > 0 and values[q - 1] < value:
                    values[q], members[q] = values[q - 1], members[q - 1]
                    q -= 1
                values[q], members[q] = value, a
                n += 1
        for k in range(n):
            a = members[k]
            turned = wrap(centre[2] + (a - turns) * turn_step - apart[2])
            barred[0], barred[1] = (apart[0] - centre[0]) / size, (apart[1] - centre[1]) / size
            barred[2] = (apart[3] / size) ** 2 if abs(turned) < apart[4] else 0.0
            value, more = best_in_square(pyramid, at_i[a], at_j[a], i, j, values[k], limit, half, barred, free)
            visited += more
            if value > limit:
                limit, best_a, best_i, best_j, found = value, a, free[0], free[1], True
    pose = centre.copy()
    pose[0] += size * best_i
    pose[1] += size * best_j
    pose[2] += turn_step * (best_a - turns)
    return pose, limit / FULL / count if found else 0.0, visited


@compiled
def best_in_square(
    pyramid: tuple[Bytes, ...],
    at_i: NDArray[np.int32],
    at_j: NDArray[np.int32],
    i: int,
    j: int,
    bound: int,
    limit: int,
    half: int,
    barred: Array,
    best: NDArray[np.int64],
) -> tuple[int, int]:
    """The largest sum above `limit` in the square of level LEVELS - 2 at (i, j), whose sum is `bound`; else `limit`.

    `best` (2,) becomes its place. None is looked for beyond `half`, nor where x, y in cells are closer to the first two
    of `barred` than the root of the third. Returns the number of sums computed, too.
    """
    visited = 0
    stack = np.empty((3 * LEVELS + 1, 4), np.int64)  # level, place, sum
    child = np.empty((4, 3), np.int64)
    stack[0, 0], stack[0, 1], stack[0, 2], stack[0, 3] = LEVELS - 2, i, j, bound
    top = 1
    while top > 0:
        top -= 1
        level, i, j, value = stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3]
        if value <= limit:
            continue
        if level == 0:
            x, y = i - barred[0], j - barred[1]
            if x * x + y * y >= barred[2]:
                limit, best[0], best[1] = value, i, j
            continue
        width = 1 << (level - 1)
        quarters = totals(pyramid[level - 1], width, at_i, at_j, i, j, limit)
        visited += 4
        for p in range(4):
            di, dj = i + (p >> 1) * width, j + (p & 1) * width
            value = quarters[p] if di <= half and dj <= half else 0
            q = p  # the best is pushed last, and looked at first
            while q > 0 and child[q - 1, 0] > value:
                child[q, 0], child[q, 1], child[q, 2] = child[q - 1, 0], child[q - 1, 1], child[q - 1, 2]
                q -= 1
            child[q, 0], child[q, 1], child[q, 2] = value, di, dj
        for p in range(4):
            if child[p, 0] > limit:
                stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3] = (
                    level - 1, child[p, 1], child[p, 2], child[p, 0],
                )  # fmt: skip
                top += 1
    return limit, visited


@compiled
def correlated(
    field: Bytes, origin: Array, size: float, search: Search, step: float, sd: float, turn_sd: float
) -> Array:
    """The best pose of a small search, each tried in steps of `step` (m); those far from the centre must be better.

    A score is multiplied by a Gaussian of standard deviations `sd` (m) and `turn_sd` (rad), as Cartographer's real-time
    matcher does.
    """
    rows, columns = field.shape
    points, centre, turn_step = search.points, search.centre, search.turn_step
    turns, half = ceil(search.turn / turn_step), ceil(search.window / step)
    best, found = -1.0, centre.copy()
    count = len(points)
    rotated = np.empty((count, 2))
    for a in range(-turns, turns + 1):
        heading = centre[2] + a * turn_step
        c, s = cos(heading), sin(heading)
        for k in range(len(points)):
            rotated[k, 0] = (c * points[k, 0] - s * points[k, 1] - origin[0]) / size
            rotated[k, 1] = (s * points[k, 0] + c * points[k, 1] - origin[1]) / size
        for p in range(-half, half + 1):
            for q in range(-half, half + 1):
                x, y = centre[0] + p * step, centre[1] + q * step
                far = (p * p + q * q) * (step / sd) ** 2 + (a * turn_step / turn_sd) ** 2
                weight, value = exp(-0.5 * far), 0
                for start in range(0, count, BLOCK):
                    end = min(start + BLOCK, count)
                    for k in range(start, end):
                        i, j = floor(x / size + rotated[k, 0]), floor(y / size + rotated[k, 1])
                        if 0 <= i < rows and 0 <= j < columns:
                            value += int(field[i, j])
                    if (value + FULL * (count - end)) * weight <= best:  # the other points can not make it better
                        break
                else:
                    best = value * weight
                    found[0], found[1], found[2] = x, y, heading
    return found
