"""Depth images of a room: exact ones, and as a structured-light camera measures them."""

from functools import cache

import numpy as np

from ...core.elementary import exp
from ...core.se2 import Array
from ._depth import measured, reach, smooth
from .lens import Lens, Singles
from .room import Room

FOCAL_BASE = 43.5
"""px m, focal length times base of Microsoft's Kinect: 580 px and 75 mm. Disparity is this over the depth."""

NOISE_SD = 0.12
"""px, of a disparity. The standard deviation of a depth z is NOISE_SD / FOCAL_BASE z^2, some 0.003 z^2 m."""

SMOOTH = 1.0
"""px, standard deviation of the window that a disparity is found with: neighbours within 3 px err alike."""

STEPS = 8  # disparities per px: the Kinect tells eighths
NEAR, FARTHEST = 0.5, 4.5  # m, the range of depths

JUMP, AROUND = 0.06, 2
"""Nothing is measured where depth changes by more than this share of it within so many pixels."""


def true_depth(room: Room, lens: Lens, pose: Array) -> Singles:
    """(height, width) m along the optical axis from `pose` (4, 4) T_world_camera; 0 for pixels without a ray.

    To walls, floor and boxes, and to a level ceiling at the walls' height. Markers are as thin as paint.
    """
    eye = pose[:3, 3]
    faces = [face for box in room.boxes for face in box.faces if face.pose[:3, 2] @ (eye - face.pose[:3, 3]) > 0]
    rows = [[*face.pose[:3, [3, 0, 1, 2]].T.ravel(), face.width / 2, face.height / 2] for face in faces]
    half = np.array([room.length / 2, room.width / 2, room.height])
    depth = np.empty(lens.rays.shape[1:], np.float32)
    turn = np.ascontiguousarray(pose[:3, :3])
    reach(lens.rays.reshape(3, -1), turn, eye.copy(), half, np.array(rows).reshape(-1, 14), depth.reshape(-1))
    depth[~lens.open] = 0
    return depth


def kinect(depth: Singles, rng: np.random.Generator, noise: float = NOISE_SD) -> Singles:
    """The true `depth` (h, w), m, as a Kinect measures it: in whole mm, 0 where it measures nothing.

    Its disparities err by `noise` px, alike for neighbours, and come in steps of 1/8 px: at z m a depth has a standard
    deviation of some 0.003 z^2 m (Khoshelham and Elberink, Sensors 12, 2012, derive the square). Edges have no depth.
    """
    taps = _taps()
    more = len(taps) - 1
    white = rng.standard_normal((depth.shape[0] + more, depth.shape[1] + more), np.float32)
    errors = smooth(white, taps) * np.float32(noise)
    return measured(depth, errors, FOCAL_BASE, float(STEPS), NEAR, FARTHEST, JUMP, AROUND)


@cache
def _taps() -> Singles:
    """A Gaussian window along one axis that keeps the variance of white noise."""
    at = np.arange(-3, 4) / SMOOTH
    taps = exp(-(at**2) / 2)
    return (taps / np.sqrt((taps**2).sum())).astype(np.float32)
