"""Inner loops of `registering`: draws the points of one camera's depth image into another's, the nearest in front."""

from math import ceil, sqrt

import numpy as np
from numpy.typing import NDArray

from ...core.kernels.compiled import compiled
from ...core.se2 import Array

Singles = NDArray[np.float32]


@compiled
def draw(pixels: Array, depth: Array, half: Array, out: Singles) -> None:
    """Writes to `out` (h, w), zeros, the least `depth` (n,) of those that cover a pixel.

    Each covers a square around its place `pixels` (n, 2), u and v, px, that reaches `half` (n,) px to each side.
    """
    for k in range(len(depth)):
        cover(out, pixels[k, 0], pixels[k, 1], half[k], depth[k])


@compiled
def draw_through_lens(
    depth: Singles, rays: Array, apart: Array, pose: Array, matrix: Array, lens: Array, widest: float, out: Singles
) -> None:
    """Draws `depth` (h, w), m, of a camera whose pixels have `rays` (h, w, 2), into another's image `out`.

    `apart` (h, w) is how far the rays of neighbours are apart, times a margin, NaN without a ray. `pose` (4, 4) moves
    points to the other camera, which has `matrix` (3, 3) and OpenCV's coefficients `lens` (8,), k1 k2 p1 p2 k3 k4 k5
    k6, and sees no ray longer than `widest`.
    """
    fx, fy, cx, cy = matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]
    for v in range(depth.shape[0]):
        for u in range(depth.shape[1]):
            z = depth[v, u]
            if not (z > 0.0 and apart[v, u] > 0.0):
                continue
            a, b = z * rays[v, u, 0], z * rays[v, u, 1]
            ahead = pose[2, 0] * a + pose[2, 1] * b + pose[2, 2] * z + pose[2, 3]
            if ahead <= 0.0:
                continue
            x = (pose[0, 0] * a + pose[0, 1] * b + pose[0, 2] * z + pose[0, 3]) / ahead
            y = (pose[1, 0] * a + pose[1, 1] * b + pose[1, 2] * z + pose[1, 3]) / ahead
            r = x * x + y * y
            if sqrt(r) >= widest:
                continue
            radial = 1.0 + r * (lens[0] + r * (lens[1] + r * lens[4]))
            radial /= 1.0 + r * (lens[5] + r * (lens[6] + r * lens[7]))
            seen_x = x * radial + 2.0 * lens[2] * x * y + lens[3] * (r + 2.0 * x * x)
            seen_y = y * radial + lens[2] * (r + 2.0 * y * y) + 2.0 * lens[3] * x * y
            half = 0.5 * apart[v, u] * z / ahead * 0.5 * (fx + fy)
            cover(out, fx * seen_x + cx, fy * seen_y + cy, half, ahead)


@compiled
def cover(out: Singles, u: float, v: float, half: float, depth: float) -> None:
    """Writes a depth to the square of pixels around (u, v), px, where nothing is nearer; 0 is nothing."""
    rows, columns = out.shape
    if not (u + half >= 0.0 and v + half >= 0.0 and u - half < columns and v - half < rows):
        return  # outside, or not a number
    z = np.float32(depth)
    for row in range(max(ceil(v - half), 0), min(ceil(v + half), rows)):
        for column in range(max(ceil(u - half), 0), min(ceil(u + half), columns)):
            if out[row, column] == 0.0 or z < out[row, column]:
                out[row, column] = z
