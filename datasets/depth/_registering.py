"""Inner loop of `registering`: draws the points of one camera's depth image into another's, the nearest in front."""

import numpy as np
from numpy.typing import NDArray

from ...frontend.compiled import compiled
from ...frontend.se2 import Array

Singles = NDArray[np.float32]


@compiled
def draw(pixels: Array, depth: Array, half: Array, out: Singles) -> None:
    """Writes to `out` (h, w), zeros, the least `depth` (n,) of those that cover a pixel.

    Each covers a square around its place `pixels` (n, 2), u and v, px, that reaches `half` (n,) px to each side.
    """
    rows, columns = out.shape
    for k in range(len(depth)):
        u, v, side = pixels[k, 0], pixels[k, 1], half[k]
        if not (u + side >= 0.0 and v + side >= 0.0 and u - side < columns and v - side < rows):
            continue  # outside, or not a number
        z = np.float32(depth[k])
        for row in range(max(int(np.ceil(v - side)), 0), min(int(np.ceil(v + side)), rows)):
            for column in range(max(int(np.ceil(u - side)), 0), min(int(np.ceil(u + side)), columns)):
                if out[row, column] == 0.0 or z < out[row, column]:
                    out[row, column] = z
