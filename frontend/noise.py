"""How far a marker's range and bearing are trusted."""

from dataclasses import dataclass

import numpy as np

from .se2 import Array


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
