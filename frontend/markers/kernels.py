"""The inner loops of the marker detector, each with arguments of its types, to be compiled at once."""

import numpy as np

from ...core.kernels.compile_ahead import Kernels
from . import _alignment, _corners, _edges, _pixels, _square_pose


def kernels() -> Kernels:
    """The two that take longest first and last."""
    table = np.zeros((3, 3))
    misfit = _edges.Misfit(table, table, np.zeros(3), np.zeros(3))
    image, rays = np.zeros((2, 2), np.uint8), np.zeros((2, 2, 2))
    return [
        (_alignment.align, (image, rays, table, table, table, table)),
        (_pixels.worst_module, (image, rays, table, table, np.zeros(3), table)),
        (_corners.corner_rays, (table, 4, table)),
        (_edges.spread, (table, misfit)),
        (_square_pose.explain, (table, table, table, table, table)),
        (_corners.homography, (table, 4)),
        (_corners.mixture, (table, np.zeros((2, 6, 6)), np.zeros(2))),
        (_corners.judge, (table, table)),
        (_corners.slopes, (table,)),
        (_corners.to_project, (table, table, table)),
    ]
