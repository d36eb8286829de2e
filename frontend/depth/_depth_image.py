"""Inner loops over depth images: features' depths, the plane of the floor, and two frames' surfaces."""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from ...core.kernels._small import inverse
from ...core.kernels.compiled import compiled
from ...core.se2 import Array, Ints

AGREE, AGAINST, HIDDEN = range(3)

ROUNDS, WIDEST, NARROWER = 8, 0.02, 0.75
"""Of robust least squares; m, the width of the first one's loss, and of the next one's by this one's."""

BELOW = 4.0
"""What a point below a plane counts against its being the floor, by one above it: nothing is below the floor."""

FOOT = 0.5
"""m a metre, from a point of the floor to the one above it in the image: half-way between a floor and a wall."""

LEAST_AREA = 0.02
"""m^2, twice that of the triangle that tells a plane."""


@compiled
def depths_at(
    depth: NDArray[np.float32], pixels: Array, near: float, far: float, jump: float, jump_by_depth: float
) -> Array:
    """The depths (n,), m, at `pixels` (n, 2); NaN where the nine pixels around one are not all of one surface.

    The inverse depth of a plane is linear in the pixel: nine of them, by least squares, give it between pixels.
    """
    height, width = depth.shape
    out = np.full(len(pixels), np.nan)
    for k in range(len(pixels)):
        u, v = int(np.rint(pixels[k, 0])), int(np.rint(pixels[k, 1]))
        if u < 1 or v < 1 or u > width - 2 or v > height - 2:
            continue
        least, most, total, by_u, by_v = np.inf, 0.0, 0.0, 0.0, 0.0
        for i in range(-1, 2):
            for j in range(-1, 2):
                z = float(depth[v + i, u + j])
                least, most = min(least, z), max(most, z)
                if z > 0.0:
                    total += 1.0 / z
                    by_u += j / z
                    by_v += i / z
        if not (least > near and most < far and most - least < jump + jump_by_depth * least):
            continue
        out[k] = 1.0 / (total / 9.0 + by_u / 6.0 * (pixels[k, 0] - u) + by_v / 6.0 * (pixels[k, 1] - v))
    return out


@compiled
def crowds(pixels: Array, near: float) -> Array:
    """The number (n,) of `pixels` (n, 2) within `near` px of each in rows and columns, itself included."""
    out = np.ones(len(pixels))
    for i in range(len(pixels)):
        for j in range(i):
            if abs(pixels[i, 0] - pixels[j, 0]) < near and abs(pixels[i, 1] - pixels[j, 1]) < near:
                out[i] += 1.0
                out[j] += 1.0
    return out


@compiled
def apart(pixels: Array, taken: NDArray[np.bool_], rows: Ints, near: float) -> NDArray[np.bool_]:
    """Takes those of `rows` (k,) whose `pixels` (n, 2) have none of `taken` (n,) within `near` px, one after another.

    Marks them in `taken`, and tells for each row (k,) whether it was.
    """
    out = np.ones(len(rows), np.bool_)
    for k in range(len(rows)):
        row = rows[k]
        for j in range(len(pixels)):
            close = abs(pixels[row, 0] - pixels[j, 0]) < near and abs(pixels[row, 1] - pixels[j, 1]) < near
            if taken[j] and close:
                out[k] = False
                break
        if out[k]:
            taken[row] = True
    return out


@compiled
def floor_points(
    depth: NDArray[np.float32],
    rays: Array,
    mounting: Array,
    every: int,
    near: float,
    far: float,
    constant_sd: float,
    sd: float,
    height: float,
    slope: float,
) -> Array:
    """The points (n, 3), m, in the robot's frame that may be of the floor, with their sd across it as a fourth column.

    `rays` (h, w, 2) and `mounting` (4, 4) lift every `every`-th pixel. Points further than `height` (m) and `slope`
    times their distance from z = 0 are of something else, and so are those at the foot of a wall: their height is that
    of the floor, but from there to the point above them in the image it goes up. Left in, they would lift the floor.
    """
    rows, columns = depth.shape
    most = ((rows + every - 1) // every) * ((columns + every - 1) // every)
    x, count, above = np.empty((most, 4)), 0, np.empty(3)
    for v in range(every // 2, rows, every):
        for u in range(every // 2, columns, every):
            if not lifted(depth, rays, mounting, v, u, near, far, x[count]):
                continue
            away = sqrt(x[count, 0] ** 2 + x[count, 1] ** 2)
            if not abs(x[count, 2]) < height + slope * away:
                continue
            if v >= every and lifted(depth, rays, mounting, v - every, u, near, np.inf, above):
                along = sqrt((above[0] - x[count, 0]) ** 2 + (above[1] - x[count, 1]) ** 2)
                if above[2] - x[count, 2] > FOOT * along:
                    continue
            # along the ray; its part across the floor
            z, a, b = float(depth[v, u]), rays[v, u, 0], rays[v, u, 1]
            down = mounting[2, 0] * a + mounting[2, 1] * b + mounting[2, 2]
            x[count, 3] = (constant_sd + sd * z * z) * abs(down)
            count += 1
    return x[:count]


@compiled
def lifted(
    depth: NDArray[np.float32], rays: Array, mounting: Array, v: int, u: int, near: float, far: float, x: Array
) -> bool:
    """Writes the point of a pixel in the robot's frame to `x`, of three or more; False for one without a depth."""
    z, a, b = float(depth[v, u]), rays[v, u, 0], rays[v, u, 1]
    if not (z > near and z < far and a == a):
        return False
    for i in range(3):
        x[i] = (mounting[i, 0] * a + mounting[i, 1] * b + mounting[i, 2]) * z + mounting[i, 3]
    return True


@compiled
def likeliest_plane(x: Array, draws: Array, steepest: float, plane: Array) -> bool:
    """Writes the plane z = a x + b y + c (3,) that most of the points `x` (n, 4) lie near; False without one.

    MSAC over the planes through three points each, drawn by `draws` (h, 3), shares of n from 0 to 1. Planes steeper
    than `steepest` are no floor.
    """
    n, best = len(x), np.inf
    for k in range(len(draws)):
        i, j, m = int(draws[k, 0] * n), int(draws[k, 1] * n), int(draws[k, 2] * n)
        dx, dy, dz = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
        ex, ey, ez = x[m, 0] - x[i, 0], x[m, 1] - x[i, 1], x[m, 2] - x[i, 2]
        area = dx * ey - dy * ex
        if abs(area) < LEAST_AREA:
            continue
        a, b = (dz * ey - dy * ez) / area, (dx * ez - dz * ex) / area
        if a * a + b * b > steepest * steepest:
            continue
        c = x[i, 2] - a * x[i, 0] - b * x[i, 1]
        total = 0.0
        for p in range(n):
            off = (x[p, 2] - a * x[p, 0] - b * x[p, 1] - c) / max(3.0 * x[p, 3], 0.01)
            total += min(off * off, 1.0 if off > 0.0 else BELOW)
            if total > best:
                break
        if total < best:
            best = total
            plane[0], plane[1], plane[2] = a, b, c
    return best < np.inf


@compiled
def floor_plane(
    x: Array, draws: Array, steepest: float, height: float, slope: float, least: int, plane: Array, cov: Array
) -> int:
    """Fits z = a x + b y + c to the points `x` (n, 4) of the floor; the number of its points, 0 for too few.

    Robust least squares from the likeliest plane on, with `height` (m) and `slope` as the sd of what is known before.
    Writes `plane` (3,) and its covariance `cov` (3, 3).
    """
    if len(x) < least or not likeliest_plane(x, draws, steepest, plane):
        return 0
    A, g, inside, width = np.empty((3, 3)), np.empty(3), 0, WIDEST
    for turn in range(ROUNDS):
        A[:], g[:], inside = 0.0, 0.0, 0
        hard = turn >= ROUNDS - 3
        for k in range(len(x)):
            off = x[k, 2] - plane[0] * x[k, 0] - plane[1] * x[k, 1] - plane[2]
            most_off = max(3.0 * x[k, 3], 0.01)
            if hard and abs(off) > most_off:
                continue
            inside += 1
            w = 1.0 / max(x[k, 3], 0.002) ** 2
            if not hard:
                w /= (1.0 + (off / max(width, most_off)) ** 2) ** 2
            row = (x[k, 0], x[k, 1], 1.0)
            for i in range(3):
                g[i] += w * row[i] * x[k, 2]
                for j in range(3):
                    A[i, j] += w * row[i] * row[j]
        if inside < least:
            return 0
        A[0, 0] += 1.0 / slope**2
        A[1, 1] += 1.0 / slope**2
        A[2, 2] += 1.0 / height**2
        if not inverse(A, cov):
            return 0
        width *= NARROWER
        for i in range(3):
            plane[i] = cov[i, 0] * g[0] + cov[i, 1] * g[1] + cov[i, 2] * g[2]
    return inside


@compiled
def compared(
    seen: NDArray[np.float32],
    other: NDArray[np.float32],
    left: float,
    top: float,
    step: float,
    R: Array,
    t: Array,
    constant_sd: float,
    sd: float,
    gate: float,
    jump: float,
    counts: Ints,
) -> None:
    """Counts the points of `other` (h, w) that `seen` (h, w) shows, contradicts and hides, in `counts` (3,).

    Both are depths, m, on a grid of rays from (`left`, `top`) on, `step` apart; R, t takes points of `other` to `seen`.
    """
    rows, columns = seen.shape
    counts[:] = 0
    for v in range(rows):
        for u in range(columns):
            d = float(other[v, u])
            if not d > 0.0:
                continue
            a, b = (left + u * step) * d, (top + v * step) * d
            z = R[2, 0] * a + R[2, 1] * b + R[2, 2] * d + t[2]
            if not z > 0.1:
                continue
            x = ((R[0, 0] * a + R[0, 1] * b + R[0, 2] * d + t[0]) / z - left) / step
            y = ((R[1, 0] * a + R[1, 1] * b + R[1, 2] * d + t[1]) / z - top) / step
            if not (x >= 0.0 and y >= 0.0 and x < columns - 1 and y < rows - 1):
                continue
            i, j = int(y), int(x)
            p, q, r, s = float(seen[i, j]), float(seen[i, j + 1]), float(seen[i + 1, j]), float(seen[i + 1, j + 1])
            least, most = min(p, q, r, s), max(p, q, r, s)
            if not (least > 0.0 and most - least < jump * least):
                continue
            y, x = y - i, x - j
            # inverse depth is linear on a plane
            there = 1.0 / ((1 - y) * ((1 - x) / p + x / q) + y * ((1 - x) / r + x / s))
            one, two = constant_sd + sd * d * d, constant_sd + sd * there * there
            off = (z - there) / np.sqrt(one * one + two * two)
            if abs(off) < gate:
                counts[AGREE] += 1
            elif off < 0.0:
                counts[AGAINST] += 1
            else:
                counts[HIDDEN] += 1
