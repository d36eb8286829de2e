"""Registers depth to another camera: the depth of that camera's pixels, from where it is."""

from dataclasses import dataclass

import numpy as np

from ...frontend.camera.camera import Camera
from ...frontend.depth.frame import Depth
from ...frontend.se2 import Array
from ._registering import draw

MORE = 1.05
"""Times a pixel's own size that it covers in the other image: neighbours on a slanted surface leave no gaps."""


@dataclass(frozen=True, eq=False)
class Registration:
    """From a camera that measures depth to one that takes pictures."""

    source: Camera  # of the depth
    target: Camera  # of the pictures
    pose: Array  # (4, 4) T_target_source, m

    def registered(self, depth: Depth) -> Depth:
        """(height, width) of the target, m, of `depth`, of the source; 0 where no depth falls.

        Each depth is a point that moves into the target's frame and covers its pixel's size there, the nearest in front
        of the others.
        """
        rays, z = self.source.rays, depth.astype(np.float64)
        some = (z > 0) & np.isfinite(rays[..., 0])
        rays, z = rays[some], z[some]
        points = np.column_stack((rays * z[:, None], z)) @ self.pose[:3, :3].T + self.pose[:3, 3]
        seen = points[:, 2] > 0
        seen[seen] = np.hypot(*(points[seen, :2] / points[seen, 2:]).T) < self.target.reach
        points, z = points[seen], z[seen]
        half = 0.5 * MORE * sum(self.target.focal) / sum(self.source.focal) * z / points[:, 2]
        out = np.zeros((self.target.height, self.target.width), np.float32)
        draw(self.target.project(points), points[:, 2].copy(), half, out)
        return out
