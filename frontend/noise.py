"""How far a marker's range and bearing are trusted."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Protocol

import numpy as np

from .aruco import Sighting, range_bearing
from .se2 import Array


class Noise(Protocol):
    """Turns sightings into measurements with their covariances."""

    def measure(self, sightings: Sequence[Sighting], mounting: Array) -> tuple[Array, Array]:
        """z (k, 2), ranges (m) and bearings (rad) in the robot's plane, and cov (k, 2, 2).

        `mounting` is T_robot_camera.
        """
        ...

    @property
    def settings(self) -> dict[str, Any]:
        """What a log's notes say of it."""
        ...


@dataclass(frozen=True)
class ProportionalNoise:
    """Standard deviations that grow with the reading: ArUco EKF SLAM, eq. (10), with floors.

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
