"""Inner loops on clouds of points: thinning of a depth image, the free floor around a camera, and merging."""

from math import asin, atan2, floor, pi, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints

Bytes = NDArray[np.uint8]
Depths = NDArray[np.float32]
"""(h, w) m; 0 where there is none."""


class DepthLimits(NamedTuple):
    """The depths that are used: those in reach of which all around are of one surface."""

    near: float  # m
    far: float  # m
    jump: float  # m between neighbours on one surface, at most
    jump_by_depth: float  # and m more for each metre of depth


@compiled
def lifted(
    depth: Depths, colours: Bytes, rays: Array, T: Array, every: int, limits: DepthLimits, points: Array, found: Bytes
) -> int:
    """Writes every `every`-th pixel of `depth` (h, w), m, as a point; returns their number.

    T (4, 4) takes points of the camera to the frame of `points` (n, 3), `found` (n, 3) are their colours. Pixels beside
    an edge are left out: their depth is a mixture of two surfaces.
    """
    rows, columns = depth.shape
    count = 0
    for v in range(every // 2, rows, every):
        for u in range(every // 2, columns, every):
            z = float(depth[v, u])
            a, b = rays[v, u, 0], rays[v, u, 1]
            if not (z > limits.near and z < limits.far and a == a):
                continue
            edge, most = False, limits.jump + limits.jump_by_depth * z
            for k in range(4):
                i, j = v + (k == 0) - (k == 1), u + (k == 2) - (k == 3)
                if 0 <= i < rows and 0 <= j < columns:
                    edge = edge or not abs(float(depth[i, j]) - z) < most
            if edge:
                continue
            for i in range(3):
                points[count, i] = (T[i, 0] * a + T[i, 1] * b + T[i, 2]) * z + T[i, 3]
                found[count, i] = colours[v, u, i]
            count += 1
    return count


@compiled
def one_a_voxel(
    points: Array, colours: Bytes, weights: Array, size: float, means: Array, mixed: Bytes, totals: Array
) -> int:
    """Writes the mean point (m) and colour of every cube of edge `size` that has points (n, 3); returns their number.

    `weights` (n,) are those of the points, `totals` (n,) their sums in the cubes.
    """
    n = len(points)
    slots = 16
    while slots < 2 * n:
        slots *= 2
    keys, at = np.empty(slots, np.int64), np.full(slots, -1)
    sums, count = np.zeros((n, 6)), 0
    totals[:] = 0.0
    for k in range(n):
        # 21 bits for each coordinate: a million cubes on either side of the origin
        key = 0
        for i in range(3):
            key = (key << 21) + (floor(points[k, i] / size) & 0x1FFFFF)
        slot = ((key * 0x9E3779B97F4A7C1) >> 20) & (slots - 1)
        while at[slot] >= 0 and keys[slot] != key:
            slot = (slot + 1) & (slots - 1)
        if at[slot] < 0:
            keys[slot], at[slot] = key, count
            count += 1
        row = at[slot]
        totals[row] += weights[k]
        for i in range(3):
            sums[row, i] += weights[k] * points[k, i]
            sums[row, 3 + i] += weights[k] * colours[k, i]
    for row in range(count):
        for i in range(3):
            means[row, i] = sums[row, i] / totals[row]
            mixed[row, i] = int(sums[row, 3 + i] / totals[row] + 0.5)
    return count


@compiled
def swept(points: Array, camera: Array, low: float, high: float, width: float, nearest: Array, farthest: Array) -> None:
    """Writes from where to where, m from `camera` (2,), the floor is seen to be free in every sector around it.

    `points` (n, 3), m, at most `low` above or below z = 0 are of the floor, higher ones up to `high` of obstacles; each
    is taken to be `width` (m) wide. Sector k of n begins at the angle 2 pi k / n - pi. `farthest` is 0 where no floor
    is seen.
    """
    n = len(nearest)
    closed = np.full(n, np.inf)
    nearest[:] = np.inf
    farthest[:] = 0.0
    for turn in range(2):  # obstacles first: floor that is seen behind one, past its edge, is not free up to there
        for k in range(len(points)):
            if not -low < points[k, 2] < high or (points[k, 2] >= low) != (turn == 0):
                continue
            x, y = points[k, 0] - camera[0], points[k, 1] - camera[1]
            away = sqrt(x * x + y * y)
            if away <= width:
                continue
            half, angle = asin(width / 2 / away), atan2(y, x) + pi
            for q in range(floor((angle - half) * n / (2 * pi)), floor((angle + half) * n / (2 * pi)) + 1):
                at = q % n
                if turn == 0:
                    closed[at] = min(closed[at], away)
                elif away < closed[at]:
                    nearest[at], farthest[at] = min(nearest[at], away), max(farthest[at], away)


@compiled
def from_above(points: Array, colours: Bytes, cells: Ints, high: float, layer: float, top: Array, sums: Array) -> None:
    """Adds points (n, 3) below `high` to a picture from above: in each of `cells` (n, 2) those of the highest layer.

    `top` (n, m) is the height of a cell's highest layer, m, of thickness `layer`; `sums` (n, m, 4) are of its red,
    green, blue and points.
    """
    for k in range(len(points)):
        z, i, j = points[k, 2], cells[k, 0], cells[k, 1]
        if not (z < high and 0 <= i < top.shape[0] and 0 <= j < top.shape[1]):
            continue
        level = layer * floor(z / layer)
        if level > top[i, j]:
            top[i, j] = level
            sums[i, j] = 0.0
        if level == top[i, j]:
            for c in range(3):
                sums[i, j, c] += colours[k, c]
            sums[i, j, 3] += 1.0
