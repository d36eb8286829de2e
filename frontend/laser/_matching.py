"""Inner loop of scan matching: points to the lines through the cells of a submap, by Gauss-Newton."""

from math import atan2, cos, floor, sin, sqrt
from typing import NamedTuple

import numpy as np

from ...core.kernels._planar import wrap
from ...core.kernels._small import cholesky, solve
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints
from ..maps._grid import DX, DY, HIT, Cells, Grid, is_wall

LINE = 2
"""Cells around the nearest one that a line is laid through."""

LONG, THIN = 9e-4, 0.1
"""m², least variance of the cells' means along a line, and the largest share of it across; else it is a point."""

POINT_SD = 0.04
"""m; how far a point of the surface may be from a cell's mean where there is no line."""

INSIDE = 9.0
"""Squared distance, in its own variance, of a point that counts as explained."""

HITS = 4.0
"""Hits of a cell from which on its weight in a line does not grow."""

SOFT = 4.0
"""Squared distance at which the weight of Geman and McClure's loss is a quarter; half in the first iterations."""


# What halving and doubling these changes is in docs/settings.md.

EARLY, MIDDLE = 2, 4
"""Iterations after which a point's wall is looked for nearer than `reach`, and nearer still."""

NEARER, NEAREST = 4, 2
"""Cells around a point in which its wall is looked for after EARLY iterations, and after MIDDLE."""

CLOSER, CLOSEST = 0.2, 0.12
"""m; how far the wall's mean may be, likewise."""

ACROSS = 0.25
"""Share of the variance of the cells' means across a line that is added to that of a point from it."""


class Hold(NamedTuple):
    """A pose to which a scan is held while it is matched."""

    pose: Array  # (3,)
    information: Array  # (3, 3) in the submap's axes


class Lines(NamedTuple):
    """The line that each point of a scan was last compared with: most belong to the same one at the next pose."""

    cells: Ints  # (k, 2) the cell that it is laid around; below 0 at first
    values: Array  # (k, 6) of `line`


@compiled
def match(
    grid: Grid, points: Array, start: Array, hold: Hold, sd: float, reach: int, iterations: int
) -> tuple[Array, Array, float]:
    """Moves a scan's points (k, 2) onto a submap; returns pose (3,), information (3, 3) and share of points explained.

    Minimises the sum of squared distances in units of `sd` (m), under Geman and McClure's loss, and the squared
    distance of the pose from the one of `hold`, by its information, from `start` (3,) on. A point belongs to the line
    through the cells around the nearest one, within `reach` cells at first, and fewer later. The information is that of
    the points alone, in the submap's axes; along a corridor it is zero. Point to line: Censi, ICRA 2008.
    """
    pose, step = start.copy(), np.empty(3)
    H, g, A = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    lines = Lines(np.full((len(points), 2), -1), np.empty((len(points), 6)))
    explained = 0
    for turn in range(iterations):
        within = reach if turn < EARLY else (min(reach, NEARER) if turn < MIDDLE else min(reach, NEAREST))
        furthest = within * grid.size
        if turn >= EARLY:
            furthest = min(furthest, CLOSER if turn < MIDDLE else CLOSEST)
        explained = normal_equations(grid, points, pose, sd, within, furthest**2, turn > EARLY, lines, H, g)
        off = (pose[0] - hold.pose[0], pose[1] - hold.pose[1], wrap(pose[2] - hold.pose[2]))
        for i in range(3):
            for j in range(3):
                A[i, j] = H[i, j] + hold.information[i, j]
                g[i] += hold.information[i, j] * off[j]
            A[i, i] += 1e-6
        if not cholesky(A, A, 3, 0.0, 0.0):
            break
        solve(A, g, step, 3)
        for i in range(3):
            pose[i] -= step[i]
        pose[2] = wrap(pose[2])
        if turn > MIDDLE and abs(step[0]) + abs(step[1]) + abs(step[2]) < 1e-4:
            break
    return pose, H, explained / max(len(points), 1)


@compiled
def normal_equations(
    grid: Grid, points: Array, pose: Array, sd: float, within: int, furthest: float, settled: bool, lines: Lines,
    H: Array, g: Array,
) -> int:  # fmt: skip
    """Fills J' W J (3, 3) and J' W r (3,) at `pose`; returns the number of points that are explained.

    `lines` has those of the poses before, and gets those of this one.
    """
    cells, origin, size, share = grid  # taken apart here: in an inner loop it costs a fifth of the time
    H[:] = 0.0
    g[:] = 0.0
    c, s = cos(pose[2]), sin(pose[2])
    explained = 0
    for k in range(len(points)):
        rx, ry = c * points[k, 0] - s * points[k, 1], s * points[k, 0] + c * points[k, 1]
        x, y = pose[0] + rx - origin[0], pose[1] + ry - origin[1]
        i, j, d2 = nearest(cells, size, share, x, y, within)
        if i < 0 or d2 > furthest:
            continue
        known = lines.values[k]
        if lines.cells[k, 0] != i or lines.cells[k, 1] != j:
            lines.cells[k, 0], lines.cells[k, 1] = i, j
            known[0], known[1], known[2], known[3], known[4], known[5] = line(cells, size, share, i, j)
        mx, my, nx, ny, along, across = known[0], known[1], known[2], known[3], known[4], known[5]
        if along > LONG and across < THIN * along:
            r = nx * (x - mx) + ny * (y - my)
            variance = sd * sd + ACROSS * across
            e = r * r / variance
            w = 1.0 / (1.0 + e / SOFT)
            a = (w * w if settled else w) / variance
            t = ny * rx - nx * ry
            H[0, 0] += a * nx * nx
            H[1, 0] += a * nx * ny
            H[1, 1] += a * ny * ny
            H[2, 0] += a * nx * t
            H[2, 1] += a * ny * t
            H[2, 2] += a * t * t
            g[0] += a * nx * r
            g[1] += a * ny * r
            g[2] += a * t * r
        else:
            hits = cells[i, j, HIT]
            ex, ey = x - size * i - cells[i, j, DX] / hits, y - size * j - cells[i, j, DY] / hits
            variance = sd * sd + POINT_SD * POINT_SD
            e = (ex * ex + ey * ey) / variance
            w = 1.0 / (1.0 + e / SOFT)
            a = (w * w if settled else w) / variance
            H[0, 0] += a
            H[1, 1] += a
            H[2, 0] -= a * ry
            H[2, 1] += a * rx
            H[2, 2] += a * (rx * rx + ry * ry)
            g[0] += a * ex
            g[1] += a * ey
            g[2] += a * (rx * ey - ry * ex)
        explained += e < INSIDE
    H[0, 1], H[0, 2], H[1, 2] = H[1, 0], H[2, 0], H[2, 1]
    return explained


@compiled
def nearest(cells: Cells, size: float, share: float, x: float, y: float, within: int) -> tuple[int, int, float]:
    """The wall whose mean is nearest to (x, y), m from the corner, at most `within` cells away; or (-1, -1, inf).

    Rings of cells are looked at from inside out: a cell of the next ring is at least as far as the ring's number.
    """
    rows, columns = cells.shape[0], cells.shape[1]
    i, j = floor(x / size), floor(y / size)
    best, at_i, at_j = np.inf, -1, -1
    for ring in range(within + 1):
        if ring > 1 and best <= (size * (ring - 1)) ** 2:
            break
        for a in range(i - ring, i + ring + 1):
            if not 0 <= a < rows:
                continue
            stride = 1 if a == i - ring or a == i + ring or ring == 0 else 2 * ring
            for b in range(j - ring, j + ring + 1, stride):
                if 0 <= b < columns and is_wall(cells, a, b, share):
                    hits = cells[a, b, HIT]
                    dx, dy = x - size * a - cells[a, b, DX] / hits, y - size * b - cells[a, b, DY] / hits
                    d2 = dx * dx + dy * dy
                    if d2 < best:
                        best, at_i, at_j = d2, a, b
    return at_i, at_j, best


@compiled
def line(cells: Cells, size: float, share: float, i: int, j: int) -> tuple[float, float, float, float, float, float]:
    """The line through the walls around cell (i, j): a point of it, its normal, variance along and across it, m²."""
    total, mx, my, xx, xy, yy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for a in range(max(i - LINE, 0), min(i + LINE + 1, cells.shape[0])):
        for b in range(max(j - LINE, 0), min(j + LINE + 1, cells.shape[1])):
            if is_wall(cells, a, b, share):
                hits = cells[a, b, HIT]
                weight = min(float(hits), HITS)
                dx, dy = size * (a - i) + cells[a, b, DX] / hits, size * (b - j) + cells[a, b, DY] / hits
                total += weight
                mx += weight * dx
                my += weight * dy
                xx += weight * dx * dx
                xy += weight * dx * dy
                yy += weight * dy * dy
    mx /= total
    my /= total
    xx, xy, yy = xx / total - mx * mx, xy / total - mx * my, yy / total - my * my
    half, off = (xx + yy) / 2, (xx - yy) / 2
    root = sqrt(off * off + xy * xy)
    angle = 0.5 * atan2(2 * xy, xx - yy)
    return size * i + mx, size * j + my, -sin(angle), cos(angle), half + root, max(half - root, 0.0)


@compiled
def spread(grid: Grid, points: Array, pose: Array, sd: float) -> tuple[Array, Array]:
    """The slope (3, 3) of a match's score by its pose, and the covariance (3, 3) of the score by the points' errors.

    At the match the score J' W r vanishes, and its place errs by the inverse slope times the score's error: the
    sandwich of Huber (The behavior of maximum likelihood estimates under nonstandard conditions, 1967). The slope is a
    difference over STRIDE, not J' W J: where the pose moves, a point finds another cell, and what is nearest to it
    along a wall moves with it and tells nothing. It is between LEAST and once J' W J in every direction. How far points
    err is what they are off their lines, or off the means of their cells, in this scan.
    """
    H, g, higher, lower = np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(3)
    lines = Lines(np.full((len(points), 2), -1), np.empty((len(points), 6)))
    normal_equations(grid, points, pose, sd, NEAREST, CLOSEST**2, True, lines, H, g)
    slope, other = np.empty((3, 3)), np.empty((3, 3))
    for i in range(3):
        there = pose.copy()
        there[i] = pose[i] + STRIDE[i]
        normal_equations(grid, points, there, sd, NEAREST, CLOSEST**2, True, lines, other, higher)
        there[i] = pose[i] - STRIDE[i]
        normal_equations(grid, points, there, sd, NEAREST, CLOSEST**2, True, lines, other, lower)
        for j in range(3):
            slope[j, i] = (higher[j] - lower[j]) / (2 * STRIDE[i])
    return _within(slope, H), _scatter(grid, points, pose, sd, H)


STRIDE = (0.006, 0.006, 0.002)
"""m, m and rad; two or three standard deviations of a match, and a tenth of a cell: nearer, a few points that find
another cell decide.
"""

LEAST = 0.1
"""Share of J' W J that a slope has at least."""

USUAL = 0.21
"""Variance of a point that errs by 14 mm, in units of the variance that matching gives it with `sd` = 3 cm."""

FEW = 3.0
"""Points that err as is usual, beside those of a scan: for those that the fit takes up, and where a scan has few."""


@compiled
def _scatter(grid: Grid, points: Array, pose: Array, sd: float, H: Array) -> Array:
    """The covariance (3, 3) of the score, J' W J being `H`: of points on lines and of others, each by how far they err.

    It is W's mean square of r times J' W J, of either kind: a point that alone tells a direction is fitted, and its own
    residual tells nothing.
    """
    cells, origin, size, share = grid
    others = np.zeros((3, 3))
    weight, square = np.zeros(2), np.zeros(2)
    c, s = cos(pose[2]), sin(pose[2])
    for k in range(len(points)):
        rx, ry = c * points[k, 0] - s * points[k, 1], s * points[k, 0] + c * points[k, 1]
        x, y = pose[0] + rx - origin[0], pose[1] + ry - origin[1]
        i, j, d2 = nearest(cells, size, share, x, y, NEAREST)
        if i < 0 or d2 > CLOSEST**2:
            continue
        mx, my, nx, ny, along, across = line(cells, size, share, i, j)
        on_line = along > LONG and across < THIN * along
        if on_line:
            r = nx * (x - mx) + ny * (y - my)
            variance = sd * sd + ACROSS * across
            e, kind, count = r * r / variance, 0, 1
        else:
            hits = cells[i, j, HIT]
            ex, ey = x - size * i - cells[i, j, DX] / hits, y - size * j - cells[i, j, DY] / hits
            variance = sd * sd + POINT_SD * POINT_SD
            e, kind, count = (ex * ex + ey * ey) / variance, 1, 2
        w = 1.0 / (1.0 + e / SOFT)
        weight[kind] += count * w * w
        square[kind] += w**4 * e
        if not on_line:
            a = w * w / variance
            others[0, 0] += a
            others[1, 1] += a
            others[0, 2] -= a * ry
            others[1, 2] += a * rx
            others[2, 2] += a * (rx * rx + ry * ry)
    others[2, 0], others[2, 1] = others[0, 2], others[1, 2]
    line_err, other_err = (square + FEW * USUAL) / (weight + 1e-9)
    return line_err * (H - others) + other_err * others


@compiled
def _within(slope: Array, H: Array) -> Array:
    """The symmetric part of `slope` (3, 3), between LEAST and once H in every direction.

    By the eigenvalues of L^-1 slope L'^-1, L L' being H, from Jacobi's rotations.
    """
    L, V, column = np.zeros((3, 3)), np.eye(3), np.empty(3)
    held = H + 1e-3 * np.eye(3)
    if not cholesky(held, L, 3, 0.0, 0.0):
        return held
    L[0, 1] = L[0, 2] = L[1, 2] = 0.0
    inverse = np.zeros((3, 3))
    for j in range(3):
        inverse[j, j] = 1 / L[j, j]
        for i in range(j + 1, 3):
            total = 0.0
            for k in range(j, i):
                total += L[i, k] * inverse[k, j]
            inverse[i, j] = -total / L[i, i]
    M = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                for m in range(3):
                    M[i, j] += inverse[i, k] * 0.5 * (slope[k, m] + slope[m, k]) * inverse[j, m]
    for _ in range(8):
        for p in range(2):
            for q in range(p + 1, 3):
                if abs(M[p, q]) < 1e-15:
                    continue
                angle = 0.5 * atan2(2 * M[p, q], M[q, q] - M[p, p])
                c, s = cos(angle), sin(angle)
                for k in range(3):
                    M[k, p], M[k, q] = c * M[k, p] - s * M[k, q], s * M[k, p] + c * M[k, q]
                for k in range(3):
                    M[p, k], M[q, k] = c * M[p, k] - s * M[q, k], s * M[p, k] + c * M[q, k]
                for k in range(3):
                    V[k, p], V[k, q] = c * V[k, p] - s * V[k, q], s * V[k, p] + c * V[k, q]
    out = np.zeros((3, 3))
    for n in range(3):
        value = min(max(M[n, n], LEAST), 1.0)
        for i in range(3):
            column[i] = 0.0
            for k in range(i + 1):
                column[i] += L[i, k] * V[k, n]
        for i in range(3):
            for j in range(3):
                out[i, j] += value * column[i] * column[j]
    return out
