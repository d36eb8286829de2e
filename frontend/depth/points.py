"""Points that a depth camera measures, with their noise: rays and depths."""

from typing import Any, NamedTuple

import numpy as np

from ...core.se2 import Array
from ..camera.camera import Camera
from ._depth_image import crowds
from .settings import Settings

SHARED = 3.0
"""px; depths of features that are nearer to each other are by the same pixels, and err alike: 0.9 to 0.5 correlated."""


class Points(NamedTuple):
    """n points in the camera's frame.

    The error of a point is along its ray, in proportion to its depth's, and across it by its pixel's.
    """

    rays: Array  # (n, 2) where the ray meets the plane z = 1
    z: Array  # (n,) depth, m
    z_sd: Array  # (n,) m
    ray_sd: Array  # (n,) of both parts of a ray

    def taken(self, rows: Any) -> "Points":
        """Those of `rows`."""
        return Points(*(column[rows] for column in self))

    @property
    def xyz(self) -> Array:
        """(n, 3) m."""
        return np.column_stack((self.rays * self.z[:, None], self.z))

    @property
    def cov(self) -> Array:
        """(n, 3, 3) m^2."""
        along = np.column_stack((self.rays, np.ones(len(self.z)))) * self.z_sd[:, None]
        cov = along[:, :, None] * along[:, None, :]
        across = (self.z * self.ray_sd) ** 2
        cov[:, 0, 0] += across
        cov[:, 1, 1] += across
        return cov


def points_of(camera: Camera, pixels: Array, z: Array, pixel_sd: Array, settings: Settings) -> Points:
    """Points at `pixels` (n, 2) and depths `z` (n,), m, each by nine pixels, with the pixels' sd (n,)."""
    rays = camera.undistort(pixels)
    ray_sd = pixel_sd / np.mean(camera.focal)
    z_sd = settings.fitted_sd * (settings.constant_sd + settings.depth_sd * z**2)
    return Points(rays, z, z_sd, ray_sd)


def sharing(points: Points, pixels: Array) -> Points:
    """Points as they count together: the sd of a depth that m of them share, at `pixels` (n, 2), grows by sqrt(m).

    A corner is found on several scales, each time at another place of its own, but always with the same depth.
    """
    return points._replace(z_sd=points.z_sd * np.sqrt(crowds(pixels, SHARED)))
