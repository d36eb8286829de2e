"""Clouds of points: one frame of a depth camera, thinned, and those of a drive."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.beside import Clouds
from ...core.se2 import Array, act
from ..camera.camera import Camera
from ._clouds import DepthLimits, Depths, lifted, one_a_voxel

EVERY = 2  # pixels from one that becomes a point to the next, in rows and columns
VOXEL = 0.05  # m; edge of the cubes of which each has one point of a frame

BLUR = VOXEL / 2
"""m; sd of a depth from which on its point is left out: walls would become thicker than a cell."""

JUMP, JUMP_BY_DEPTH = 0.02, 0.03
"""m, and m a metre, of depth between neighbours of one surface: a floor 4 m away at a slant has 0.05 m."""


class Cloud(NamedTuple):
    """Coloured points."""

    points: Array  # (n, 3) m
    colours: NDArray[np.uint8]  # (n, 3) red, green, blue
    weights: Array  # (n,) of how many points each is the mean


NOTHING = Cloud(np.zeros((0, 3)), np.zeros((0, 3), np.uint8), np.zeros(0))


def cloud_of(camera: Camera, T: Array, depth: Depths, colour: NDArray[np.uint8], reach: tuple[float, float]) -> Cloud:
    """The points of `depth` (h, w) from `reach[0]` to `reach[1]`, m, thinned, in the robot's frame.

    T (4, 4) takes points of the camera to it, `colour` is the image, (h, w) grey or (h, w, 3) blue, green, red.
    """
    shown = np.dstack([colour] * 3) if colour.ndim == 2 else np.ascontiguousarray(colour[:, :, ::-1])
    most = -(-depth.shape[0] // EVERY) * -(-depth.shape[1] // EVERY)
    points, colours = np.empty((most, 3)), np.empty((most, 3), np.uint8)
    limits = DepthLimits(*reach, JUMP, JUMP_BY_DEPTH)
    count = lifted(depth, shown, camera.rays, np.ascontiguousarray(T), EVERY, limits, points, colours)
    return thinned(Cloud(points[:count], colours[:count], np.ones(count)), VOXEL)


def thinned(cloud: Cloud, size: float) -> Cloud:
    """One point, the mean, in every cube of edge `size`, m, in the order of their first points."""
    out = Cloud(np.empty_like(cloud.points), np.empty_like(cloud.colours), np.empty_like(cloud.weights))
    count = one_a_voxel(*cloud, size, *out)
    return Cloud(out.points[:count].copy(), out.colours[:count].copy(), out.weights[:count].copy())


def placed(clouds: Clouds, k: int, pose: Array) -> Cloud:
    """The k-th of the clouds where the robot is at `pose` (3,)."""
    points = clouds.xyz(k)
    points[:, :2] = act(pose, points[:, :2])
    return Cloud(points, clouds.rgb(k), np.ones(len(points)))


def merged(clouds: Clouds, path: Array, size: float) -> Cloud:
    """All clouds along `path` (n, 3) of the steps, thinned to one point in every cube of edge `size`, m."""
    whole, waiting = NOTHING, list[Cloud]()
    for k, pose in enumerate(clouds.at.along(path)):
        waiting.append(placed(clouds, k, pose))
        if k % TOGETHER == TOGETHER - 1:
            whole, waiting = thinned(_joined([whole, *waiting]), size), []
    return thinned(_joined([whole, *waiting]), size)


TOGETHER = 100  # clouds that are thinned at once: a long drive's need not all be in memory


def _joined(parts: Sequence[Cloud]) -> Cloud:
    points, colours, weights = zip(*parts, strict=True)
    return Cloud(np.concatenate(points), np.concatenate(colours), np.concatenate(weights))
