"""Sample positions within a pixel: points that are even along rows, along columns and in between."""

from functools import lru_cache
from math import gcd

import numpy as np
from numpy.typing import NDArray

from .lens import Singles

PLASTIC = 1.32471795724474602596
"""x^3 = x + 1: multiples of 1 / x and 1 / x^2 are spread over a square as those of the golden ratio over a line."""


def lattice(count: int) -> Singles:
    """(count, 2) points of the pixel [-1/2, 1/2)^2: the best rank-1 lattice, a Korobov lattice.

    Each of the `count` equal strips of the pixel, along u and along v, has one point in its middle: the coverage of an
    upright or level edge is exact to half a strip, that of a grid of as many points to half a root of `count`.
    """
    steps = np.arange(count)
    best = max(
        (step for step in range(1, count + 1) if gcd(step, count) == 1),
        key=lambda step: _apart(np.stack((steps, steps * step % count)), count),
    )
    return ((np.stack((steps, steps * best % count), axis=-1) + 0.5) / count - 0.5).astype(np.float32)


@lru_cache(maxsize=8)
def jitter(height: int, width: int) -> Singles:
    """(2, height, width) a shift of -1/2 to 1/2 of a strip for each pixel's lattice.

    Along any row or column the shifts are even, so that errors of an edge's position average out along it.
    """
    v, u = np.mgrid[:height, :width]
    first, second = 1 / PLASTIC, 1 / PLASTIC**2
    shifts = np.stack((v * first + u * second, u * first + v * second))
    return (shifts % 1 - 0.5).astype(np.float32)


def _apart(points: NDArray[np.int64], count: int) -> int:
    """The least squared distance of lattice points (2, n) from the origin's on the torus of `count`."""
    gaps = np.minimum(points, count - points)[:, 1:]
    return int((gaps**2).sum(axis=0).min(initial=2 * count**2))
