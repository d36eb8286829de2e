"""Obstacles and free floor in the clouds of a depth camera, as beams for an occupancy grid.

A point between two heights is of an obstacle. A cell is free where the camera sees the floor: in each direction from
the nearest point of the floor to the farthest one, or to the nearest obstacle. So what stands too near to be in view is
not wiped out by what is seen over it.
"""

from typing import NamedTuple

import numpy as np

from ...core.beside import Beams, Clouds
from ...core.relations import Anchors
from ._clouds import swept
from ._grid import one_a_cell
from .cloud import VOXEL

LOW, HIGH = 0.1, 1.0  # m above the floor: the lowest obstacle, and above which a robot passes under
SECTORS = 720  # directions, half a degree each: a cell of 5 cm at 5 m
COLUMN = 0.05  # m; the points of a wall above one another are one hit


class Obstacles(NamedTuple):
    """The beams of clouds."""

    clouds: Clouds
    low: float = LOW  # m
    high: float = HIGH  # m

    @property
    def at(self) -> Anchors:
        """The poses that the clouds were taken from."""
        return self.clouds.at

    def beams(self, k: int) -> Beams:
        """Those of the k-th cloud: over free floor, and of no length where an obstacle is."""
        points, camera = self.clouds.xyz(k), self.clouds.camera[:2].copy()
        nearest, farthest = np.empty(SECTORS), np.empty(SECTORS)
        swept(points, camera, self.low, self.high, VOXEL, nearest, farthest)
        free = np.flatnonzero(farthest > nearest)
        angle = 2 * np.pi * (free + 0.5) / SECTORS - np.pi
        ray = np.column_stack((np.cos(angle), np.sin(angle)))
        starts, ends = (camera + ray * away[free, None] for away in (nearest, farthest))
        tall = (points[:, 2] >= self.low) & (points[:, 2] < self.high)
        hits = one_a_cell(np.ascontiguousarray(points[tall, :2]), COLUMN)
        reflected = np.arange(len(free) + len(hits)) >= len(free)
        return Beams(np.concatenate((starts, hits)), np.concatenate((ends, hits)), reflected)
