"""Exact scenes for a depth camera: points seen from two places with the noise that is stated, and depths of planes."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from slamduel.core.se2 import Array
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.camera.mounting import mounting
from slamduel.frontend.depth.points import Points
from slamduel.frontend.depth.settings import Settings

CAMERA = Camera(320, 240, (290.0, 288.0), (161.0, 118.0), (), mounting(0.1, 0.02, 0.7, np.radians(20)))


class Seen(NamedTuple):
    """Points seen from two places, row by row, with the true motion p = R q + t."""

    first: Points
    second: Points
    R: Array
    t: Array


def seen_twice(rng: np.random.Generator, n: int, settings: Settings, noise: float = 1.0) -> Seen:
    """Points at 1 to 3 m, with `noise` times the errors stated for them."""
    R, t = Rotation.from_rotvec([0.02, -0.1, 0.03]).as_matrix(), np.array([0.1, -0.03, 0.15])
    p = np.column_stack((rng.uniform(-0.5, 0.5, (n, 2)), np.ones(n))) * rng.uniform(1.0, 3.0, (n, 1))
    return Seen(measured(p, rng, settings, noise), measured((p - t) @ R, rng, settings, noise), R, t)


def measured(xyz: Array, rng: np.random.Generator, settings: Settings, noise: float = 1.0) -> Points:
    """Points (n, 3) with errors of their rays and depths, stated as of the true depths."""
    z = xyz[:, 2]
    z_sd, ray_sd = settings.constant_sd + settings.depth_sd * z**2, np.full(len(z), settings.pixel_sd / 290.0)
    rays = xyz[:, :2] / z[:, None] + noise * rng.normal(0, 1, (len(z), 2)) * ray_sd[:, None]
    return Points(rays, z + noise * rng.normal(0, 1, len(z)) * z_sd, z_sd, ray_sd)


def on_planes(camera: Camera, T: Array, planes: Array) -> NDArray[np.float64]:
    """(h, w) depth of the nearest of planes (n, 4), n x = d in the world, seen from T (4, 4); 0 where there is none.

    From the definition: a point T (z (ray, 1)) lies on a plane.
    """
    rays = np.concatenate((camera.rays, np.ones((*camera.rays.shape[:2], 1))), axis=2)
    depth = np.full(rays.shape[:2], np.inf)
    for *normal, distance in planes:
        with np.errstate(divide="ignore"):
            z = (distance - normal @ T[:3, 3]) / (rays @ T[:3, :3].T @ normal)
        depth = np.where((z > 0) & (z < depth), z, depth)
    return np.where(np.isfinite(depth), depth, 0.0)
