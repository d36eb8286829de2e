"""Initial values of landmarks from their first sightings."""

import numpy as np

from ...core.se2 import Array, Ints
from ..incremental.smoother import NEAREST


def first_values(poses: Array, z: Array, cov: Array, which: Ints, landmarks: int) -> Array:
    """(landmarks, 2) the mean of the sighted positions, each weighted by its information.

    Sighting i, z (s, 2) with covariance (s, 2, 2), is of landmark `which[i]`, from the pose (s, 3).
    """
    r, angle = np.maximum(z[:, 0], NEAREST), poses[:, 2] + z[:, 1]
    c, s = np.cos(angle), np.sin(angle)
    xy = poses[:, :2] + r[:, None] * np.stack((c, s), axis=-1)
    rr, rb, bb = cov[:, 0, 0], (cov[:, 0, 1] + cov[:, 1, 0]) / 2, cov[:, 1, 1]
    along, mixed, across = np.stack((bb, -rb / r, rr / r**2)) / (rr * bb - rb**2)  # to the line of sight
    information = np.stack(
        (
            c * c * along - 2 * c * s * mixed + s * s * across,
            c * s * (along - across) + (c * c - s * s) * mixed,
            s * s * along + 2 * c * s * mixed + c * c * across,
        ),
        axis=-1,
    )
    total, moment = np.zeros((landmarks, 3)), np.zeros((landmarks, 2))
    np.add.at(total, which, information)
    np.add.at(moment, which, _times(information, xy))
    xx, xy, yy = total.T
    return _times(np.stack((yy, -xy, xx), axis=-1) / (xx * yy - xy * xy)[:, None], moment)


def _times(A: Array, x: Array) -> Array:
    """Products (n, 2) of symmetric matrices, xx, xy, yy in A (n, 3), with x (n, 2)."""
    return np.stack((A[:, 0] * x[:, 0] + A[:, 1] * x[:, 1], A[:, 1] * x[:, 0] + A[:, 2] * x[:, 1]), axis=-1)
