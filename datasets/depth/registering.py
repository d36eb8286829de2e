"""Registers depth to another camera: the depth of that camera's pixels, from where it is."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...core.se2 import Array
from ...frontend.camera.camera import Camera
from ...frontend.depth.recording import Depth
from ._registering import draw, draw_through_lens

MORE = 1.1
"""Times a pixel's own size that it covers in the other image: neighbours on a slanted surface leave no gaps."""

LENS = 8
"""Coefficients of a pinhole camera that the compiled projection knows; OpenCV projects for others."""


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
        out = np.zeros((self.target.height, self.target.width), np.float32)
        lens = self.target.coefficients
        if self.target.model == "pinhole" and len(lens) <= LENS:
            lens = np.pad(lens, (0, LENS - len(lens)))
            pose, matrix, reach = np.ascontiguousarray(self.pose), self.target.matrix, self.target.reach
            depth = np.ascontiguousarray(depth)
            draw_through_lens(depth, self.source.rays, self._apart, pose, matrix, lens, reach, out)
        else:
            self.draw_by_opencv(depth, out)
        out[self._blind] = 0
        return out

    def draw_by_opencv(self, depth: Depth, out: Depth) -> None:
        """Draws `depth` into `out`, of the target and zeros, for a target of any lens; OpenCV projects the points."""
        z = depth.astype(np.float64)
        some = (z > 0) & np.isfinite(self._apart)
        rays, apart, z = self.source.rays[some], self._apart[some], z[some]
        points = np.column_stack((rays * z[:, None], z)) @ self.pose[:3, :3].T + self.pose[:3, 3]
        seen = points[:, 2] > 0
        seen[seen] = np.hypot(*(points[seen, :2] / points[seen, 2:]).T) < self.target.reach
        points, apart, z = points[seen], apart[seen], z[seen]
        # A fisheye's pixels are of equal angles, another lens's of equal lengths in a plane.
        away = np.linalg.norm(points, axis=1) if self.target.model == "fisheye" else points[:, 2]
        half = 0.5 * apart * z / away * sum(self.target.focal) / 2
        draw(self.target.project(points), points[:, 2].copy(), half, out)

    @cached_property
    def _apart(self) -> Array:
        """(h, w) how far the rays of the source's neighbouring pixels are apart, times MORE; NaN without a ray."""
        steps = [np.linalg.norm(np.asarray(np.gradient(self.source.rays, axis=axis)), axis=-1) for axis in (0, 1)]
        return MORE * np.maximum(*steps)

    @cached_property
    def _blind(self) -> NDArray[np.bool_]:
        """(height, width) pixels of the target without a ray."""
        return np.isnan(self.target.rays[..., 0])
