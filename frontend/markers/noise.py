"""Noise models of a marker's range and bearing."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Protocol

import numpy as np

from ...core.se2 import Array
from .aruco import Sighting, range_bearing


class Noise(Protocol):
    """Turns sightings into measurements with their covariances."""

    def measure(self, sightings: Sequence[Sighting], mounting: Array) -> tuple[Array, Array]:
        """z (k, 2), range (m) and bearing (rad) in the robot's plane, and cov (k, 2, 2); `mounting`: T_robot_camera."""
        ...

    @property
    def settings(self) -> dict[str, Any]:
        """The model's entry in a log's notes."""
        ...


@dataclass(frozen=True)
class ProportionalNoise:
    """Standard deviations proportional to the reading: ArUco EKF SLAM, eq. (10), with floors.

    The floors are not in the document: without them a marker straight ahead has a bearing without error.
    """

    k_range: float = 0.05  # of the range
    k_bearing: float = 0.05  # of the bearing
    floor_range: float = 0.02  # m
    floor_bearing: float = 0.01  # rad

    def cov(self, z: Array) -> Array:
        """(k, 2, 2) covariances of the measurements `z` (k, 2) of range (m) and bearing (rad)."""
        slope = np.array([self.k_range, self.k_bearing])
        floor = np.array([self.floor_range, self.floor_bearing])
        return ((slope * z) ** 2 + floor**2)[:, :, None] * np.eye(2)

    def measure(self, sightings: Sequence[Sighting], mounting: Array) -> tuple[Array, Array]:
        """The measurements and their covariances."""
        z = range_bearing(sightings, mounting)
        return z, self.cov(z)

    @property
    def settings(self) -> dict[str, Any]:
        """The slopes and floors."""
        return {"model": "proportional", **asdict(self)}


@dataclass(frozen=True)
class PropagatedNoise:
    """Propagates the corners' covariance to range and bearing, through the marker's pose and the camera's mounting.

    `scale` covers errors not seen in the corners, such as an inexact mounting or calibration: it multiplies standard
    deviations; the floors are added.
    """

    scale: float = 1.0
    floor_range: float = 0.0  # m
    floor_bearing: float = 0.0  # rad

    def measure(self, sightings: Sequence[Sighting], mounting: Array) -> tuple[Array, Array]:
        """The measurements and their covariances."""
        z = range_bearing(sightings, mounting)
        cov = np.zeros((len(z), 2, 2))
        for k, sighting in enumerate(sightings):
            r, (c, s) = z[k, 0], (np.cos(z[k, 1]), np.sin(z[k, 1]))
            by_centre = np.array([[c, s], [-s / r, c / r]]) @ mounting[:2, :3]
            cov[k] = self.scale**2 * by_centre @ sighting.centre_cov @ by_centre.T
        return z, cov + np.diag([self.floor_range**2, self.floor_bearing**2])

    @property
    def settings(self) -> dict[str, Any]:
        """The scale and the floors."""
        return {"model": "propagated", **asdict(self)}
