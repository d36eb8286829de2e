"""Comparison of two frames' surfaces: does one see through what the other has measured?

The environment measurement model of RGBD-SLAM (Endres, Hess, Sturm, Cremers and Burgard, T-RO 2014): points of one
frame are projected into the other. A point that is where the other has a surface agrees; one in front of it is
contradicted, as it would have been seen; one behind it is hidden and says nothing.
"""

from collections.abc import Iterator
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.se2 import Array
from ..camera.camera import Camera
from ._depth_image import RayGrid, compared
from .settings import Settings

EVERY = 8  # pixels from one ray of the grid to the next

ONE_SURFACE = 0.15
"""Largest difference of neighbours' depths, by the least, on one surface of the grid."""

Coarse = NDArray[np.float32]  # (h, w) depths, m, on the grid of rays; 0 where there is none


class _Pixels(NamedTuple):
    at: NDArray[np.intp]  # (h, w) row-major index of the pixel of each ray; -1: outside the image
    grid: RayGrid


class Surfaces:
    """Compares frames of one camera."""

    def __init__(self, camera: Camera, settings: Settings) -> None:
        self._camera, self._settings = camera, settings

    def coarse(self, depth: NDArray[np.float32]) -> Coarse:
        """The depths of `depth` (h, w) on a grid of rays."""
        pixels = self._pixels.at
        taken = np.where(pixels < 0, np.float32(0), depth.ravel()[pixels])
        return np.where((taken > self._settings.near) & (taken < self._settings.far), taken, np.float32(0))

    def agree(self, first: Coarse, second: Coarse, R: Array, t: Array) -> bool:
        """Tells if the surfaces of two frames agree when R, t takes points of the second to the first."""
        s = self._settings
        return all(
            agree >= s.agree * (agree + against) and agree >= s.seen * points
            for agree, against, points in self._shares(first, second, R, t)
        )

    def contradict(self, first: Coarse, second: Coarse, R: Array, t: Array) -> bool:
        """Tells if they see through each other there: frames that show nothing neither agree nor contradict."""
        s = self._settings
        return any(
            agree < s.agree * (agree + against) and agree + against >= s.seen * points
            for agree, against, points in self._shares(first, second, R, t)
        )

    def _shares(self, first: Coarse, second: Coarse, R: Array, t: Array) -> Iterator[tuple[int, int, int]]:
        """Points of each in the other: those that agree, those against, and all."""
        s = self._settings
        for seen, other, A, b in ((first, second, R, t), (second, first, R.T, -R.T @ t)):
            agree, against = compared(
                seen, other, self._pixels.grid, np.ascontiguousarray(A), b, s.constant_sd, s.depth_sd, s.surface_gate,
                ONE_SURFACE,
            )  # fmt: skip
            yield agree, against, int(np.count_nonzero(other))

    @cached_property
    def _pixels(self) -> _Pixels:
        """The rays that the camera's image spans, as far apart as EVERY pixels in its middle."""
        camera, step = self._camera, EVERY / float(np.mean(self._camera.focal))
        rays = camera.rays.reshape(-1, 2)
        low, high = np.nanmin(rays, axis=0), np.nanmax(rays, axis=0)
        low, high = np.maximum(low, -WIDEST), np.minimum(high, WIDEST)
        x, y = (np.arange(a, b, step) for a, b in zip(low, high, strict=True))
        grid = np.stack((*np.meshgrid(x, y), np.ones((len(y), len(x)))), axis=-1)
        at = np.rint(camera.project(grid.reshape(-1, 3))).astype(np.intp)
        inside = ((at >= 0) & (at < [camera.width, camera.height])).all(axis=1)
        inside &= np.hypot(*grid.reshape(-1, 3)[:, :2].T) < camera.reach
        pixels = np.where(inside, at[:, 1] * camera.width + at[:, 0], -1)
        return _Pixels(pixels.reshape(len(y), len(x)), RayGrid(float(x[0]), float(y[0]), step))


WIDEST = 1.5  # rays farther from the axis are left out: their pixels are too far apart
