"""A rolling shutter: each row of a frame is exposed at a time of its own, while the camera moves.

A frame's time is that of its middle row. Between the first row and the last the camera moves with a constant velocity
and turn rate: from the camera's pose at the middle, at a row's delay t, its origin is at t u and its axes are turned by
t w. An acceleration a adds a t^2 / 2, 0.1 mm at 1 m/s^2 and 15 ms.

A pixel's ray alone does not tell where its point is at the middle of the frame: for a translation, the distance of the
point is needed. Here all points are on a plane of known pose, that of a marker.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...core.factors import Odometry
from ...core.se2 import Array
from .camera import Camera

_ROUNDS = 4
"""Iterations from a point to the row that sees it; each divides the error by ten or more."""

_SAME = np.eye(3)


class CameraMotion(NamedTuple):
    """The motion of a camera at the middle of a frame."""

    rates: Array  # (6,) turn rates w, rad/s, and velocities u, m/s, about and along the x, y and z axes of the camera
    cov: Array  # (6, 6) of the rates


def carried(odometry: Odometry, seconds: float, mounting: Array) -> CameraMotion:
    """The motion of a camera at `mounting` (4, 4) T_robot_camera, from that of its robot over some `seconds`.

    It is that at the middle of these seconds, where the robot's frame has turned by half of the odometry's turn.
    """
    half = -odometry.delta[2] / 2
    c, s = np.cos(half), np.sin(half)
    ahead, left = c * odometry.delta[0] - s * odometry.delta[1], s * odometry.delta[0] + c * odometry.delta[1]
    by_delta = np.array([[c, -s, left / 2], [s, c, -ahead / 2], [0.0, 0.0, 1.0]]) / seconds
    velocity = np.array([ahead, left, odometry.delta[2]]) / seconds
    turn, (x, y, _) = mounting[:3, :3], mounting[:3, 3]
    by_velocity = np.zeros((6, 3))
    by_velocity[:3, 2] = turn[2]
    by_velocity[3:] = turn.T @ np.array([[1.0, 0.0, -y], [0.0, 1.0, x], [0.0, 0.0, 0.0]])
    spread = by_velocity @ by_delta
    return CameraMotion(by_velocity @ velocity, spread @ odometry.cov @ spread.T)


@dataclass(frozen=True, eq=False)
class SweptPlane:
    """A plane seen by the rolling shutter of a camera that moves.

    The ray r of a pixel whose row has the delay t meets the plane n X = 1 at a point whose ray at the middle of the
    frame is (t u n' + (1 - n t u) I) R(t w) r: one homography per row.
    """

    camera: Camera
    pose: Array  # (4, 4) T_camera_plane at the middle of the frame; the plane's z axis is its normal
    motion: CameraMotion

    def at_middle(self, rays: Array, rows: Array) -> Array:
        """(n, w, 2) the rays, at the middle of the frame, to the points of the plane that `rays` (n, w, 2) meet.

        Their pixels are in the `rows` (n,), px. NaN where a ray does not meet the plane.
        """
        turned, shifted = self._swept(self.camera.delays(rows))
        points = _lifted(rays) @ np.swapaxes(shifted @ turned, -1, -2)
        with np.errstate(invalid="ignore", divide="ignore"):
            found = points[..., :2] / points[..., 2:]
        found[~(points[..., 2] > 0)] = np.nan
        return found

    def rays_around(self, corners: Array) -> Array:
        """(height, width, 2) the rays at the middle of the frame, valid in and around the `corners` (n, 2), px, alone.

        The margin is a quarter of their extent and 4 px.
        """
        margin = np.ptp(corners, axis=0).max() / 4 + 4
        left, top = np.maximum(np.floor(corners.min(axis=0) - margin).astype(int), 0)
        right, bottom = np.ceil(corners.max(axis=0) + margin).astype(int)
        own = self.camera.rays[top:bottom, left:right]
        rays = np.empty_like(self.camera.rays)
        rays[top:bottom, left:right] = self.at_middle(own, top + np.arange(len(own)))
        return rays

    def corners_at_middle(self, rays: Array, rows: Array) -> tuple[Array, Array]:
        """`at_middle` of `rays` (n, 2) in `rows` (n,), px, and its covariance (2n, 2n) by that of the motion."""
        by_rates = self.by_rates(rays, rows).reshape(-1, 6)
        return self.at_middle(rays[:, None], rows)[:, 0], by_rates @ self.motion.cov @ by_rates.T

    def by_rates(self, rays: Array, rows: Array) -> Array:
        """(n, 2, 6) d ray at the middle / d rates; to first order in the turn between its row and the middle."""
        delays = self.camera.delays(rows)
        turned, shifted = self._swept(delays)
        ahead = np.einsum("nij,nj->ni", turned, _lifted(rays))
        x, y, z = np.einsum("nij,nj->in", shifted, ahead)
        by_turn = -shifted @ _cross(ahead)
        by_shift = (ahead @ self._normal)[:, None, None] * _SAME - ahead[:, :, None] * self._normal
        moved = delays[:, None, None] * np.concatenate((by_turn, by_shift), axis=-1)
        return (moved[:, :2] - np.stack((x / z, y / z), axis=-1)[:, :, None] * moved[:, 2:]) / z[:, None, None]

    def seen(self, rays: Array) -> Array:
        """(n, 2) px, where the camera sees the points of the plane that are at `rays` (n, 2) at the middle."""
        points = _lifted(rays)
        pixels = self.camera.project(points)
        for _ in range(_ROUNDS):
            turned, shifted = self._swept(self.camera.delays(pixels[:, 1]))
            ahead = np.linalg.solve(shifted @ turned, points[:, :, None])[:, :, 0]
            pixels = self.camera.project(np.asarray(ahead, float))
        return pixels

    @cached_property
    def _normal(self) -> Array:
        """(3,) 1/m, n."""
        return self.pose[:3, 2] / (self.pose[:3, 2] @ self.pose[:3, 3])

    def _swept(self, delays: Array) -> tuple[Array, Array]:
        """The two factors of the homographies at `delays` (...), s, (..., 3, 3): turns, by Rodrigues, and shifts."""
        speed, cross, squared = self._axis
        delays = np.asarray(delays, float)[..., None, None]
        turned = _SAME + np.sin(speed * delays) * cross + (1 - np.cos(speed * delays)) * squared
        shift, normal = self.motion.rates[3:], self._normal
        return turned, _SAME + delays * (np.outer(shift, normal) - (normal @ shift) * _SAME)

    @cached_property
    def _axis(self) -> tuple[float, Array, Array]:
        """The turn rate, rad/s, the matrix of the cross product with its axis, and the square of that matrix."""
        turn = self.motion.rates[:3]
        speed = float(np.linalg.norm(turn))
        cross = _cross(turn[None])[0] / max(speed, 1e-300)
        return speed, cross, cross @ cross


def _cross(vectors: Array) -> Array:
    """(n, 3, 3) the matrices of the cross products with `vectors` (n, 3)."""
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    return np.stack((zero, -z, y, z, zero, -x, -y, x, zero), axis=-1).reshape(-1, 3, 3)


def _lifted(rays: Array) -> Array:
    """(..., 3) the points on the plane z = 1 with `rays` (..., 2)."""
    points = np.ones((*rays.shape[:-1], 3))
    points[..., :2] = rays
    return points
