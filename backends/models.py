"""Measurement models with Jacobians, for one pose or a batch on leading axes: ArUco EKF SLAM's."""

import numpy as np

from ..core.se2 import Array, act, act_jacobians, wrap
from .api import Diverged


def sight(pose: Array, xy: Array) -> tuple[Array, Array, Array]:
    """The (range, bearing) (..., 2) of a landmark at `xy` (..., 2) m seen from `pose`, and its Jacobians.

    Those are (..., 2, 3) by the pose and (..., 2, 2) by the landmark: ArUco EKF SLAM, eqs (12), (13) and (16). Raises
    Diverged where the landmark is at the robot itself: the bearing has no derivative there.
    """
    dx, dy = xy[..., 0] - pose[..., 0], xy[..., 1] - pose[..., 1]
    q = dx * dx + dy * dy
    if not np.all(q > 0):
        raise Diverged("a landmark's estimate lies at the robot's own position, where its bearing is undefined")
    r = np.sqrt(q)
    z = np.stack((r, wrap(np.arctan2(dy, dx) - pose[..., 2])), axis=-1)
    by_landmark = np.empty((*q.shape, 2, 2))
    by_landmark[..., 0, 0] = dx / r
    by_landmark[..., 0, 1] = dy / r
    by_landmark[..., 1, 0] = -dy / q
    by_landmark[..., 1, 1] = dx / q
    by_pose = np.zeros((*q.shape, 2, 3))
    by_pose[..., :2] = -by_landmark
    by_pose[..., 1, 2] = -1.0
    return z, by_pose, by_landmark


def innovation(z: Array, expected: Array) -> Array:
    """Measured minus expected (range, bearing) (..., 2), the bearing wrapped."""
    difference = z - expected
    difference[..., 1] = wrap(difference[..., 1])
    return difference


def place(pose: Array, z: Array) -> tuple[Array, Array, Array]:
    """World position (..., 2), m, of a landmark measured at `z` (range, bearing) from `pose`.

    With it the Jacobians by the pose, (..., 2, 3), and by the measurement, (..., 2, 2): ArUco EKF SLAM, eqs (17), (19)
    and (20).
    """
    r, c, s = z[..., 0], np.cos(z[..., 1]), np.sin(z[..., 1])
    xy = np.stack((r * c, r * s), axis=-1)
    by_z = np.empty((*r.shape, 2, 2))
    by_z[..., 0, 0] = c
    by_z[..., 0, 1] = -r * s
    by_z[..., 1, 0] = s
    by_z[..., 1, 1] = r * c
    by_pose, by_xy = act_jacobians(pose, xy)
    return act(pose, xy), by_pose, by_xy @ by_z
