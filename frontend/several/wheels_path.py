"""The path by a robot's wheels at the times of scans, which guides their matching."""

import numpy as np

from ...core.se2 import Array, compose
from ..wheels.motion import Motion


def walked(motion: Motion, t: Array) -> Array:
    """The poses (n, 3) by a motion at `t` (n,), s, from the first one on."""
    poses = [np.zeros(3)]
    for start, end in zip(t[:-1].tolist(), t[1:].tolist(), strict=True):
        poses.append(compose(poses[-1], motion.odometry(start, end).delta))
    return np.array(poses)
