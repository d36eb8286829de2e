"""Inner loop: the depth of features, from the surface around each."""

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..se2 import Array


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
