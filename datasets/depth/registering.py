"""Registers depth to another camera: the depth of that camera's pixels, from where it is."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...frontend.camera.camera import Camera
from ...frontend.depth.frame import Depth
from ...frontend.se2 import Array
from ._registering import draw

MORE = 1.1
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
        z = depth.astype(np.float64)
        some = (z > 0) & np.isfinite(self._apart)
        rays, apart, z = self.source.rays[some], self._apart[some], z[some]
        points = np.column_stack((rays * z[:, None], z)) @ self.pose[:3, :3].T + self.pose[:3, 3]
        seen = points[:, 2] > 0
        seen[seen] = np.hypot(*(points[seen, :2] / points[seen, 2:]).T) < self.target.reach
        points, apart, z = points[seen], apart[seen], z[seen]
        # A fisheye's pixels are of equal angles, another lens's of equal lengths in a plane.
        away = np.linalg.norm(points, axis=1) if self.target.model == "fisheye" else points[:, 2]
        half = 0.5 * MORE * apart * z / away * sum(self.target.focal) / 2
        out = np.zeros((self.target.height, self.target.width), np.float32)
        draw(self.target.project(points), points[:, 2].copy(), half, out)
        out[np.isnan(self.target.rays[..., 0])] = 0
        return out

    @cached_property
    def _apart(self) -> Array:
        """(h, w) how far the rays of neighbouring pixels of the source are apart; NaN where one has none."""
        steps = [np.linalg.norm(np.asarray(np.gradient(self.source.rays, axis=axis)), axis=-1) for axis in (0, 1)]
        return np.maximum(*steps)
