"""References for the depth front end's cost: OpenCV's programs for parts of the same work."""

import cv2
import numpy as np

from ...core.se2 import Array, Ints
from ...frontend.depth.features import Features

ROUNDS, PIXELS = 200, 2.0  # hypotheses of RANSAC, as many as ours; px, of an inlier


def matches(first: Features, second: Features, ratio: float) -> Ints:
    """(m, 2) rows of two frames' descriptors that belong together: OpenCV's brute-force matcher with Lowe's ratio."""
    kind = cv2.NORM_HAMMING if first.descriptors.dtype == np.uint8 else cv2.NORM_L2
    found = cv2.BFMatcher(kind).knnMatch(first.descriptors, second.descriptors, k=2)
    pairs = [pair for pair in found if len(pair) == 2 and pair[0].distance < ratio * pair[1].distance]
    rows = [(nearest.queryIdx, nearest.trainIdx) for nearest, _ in pairs]
    return np.array(rows, np.int64).reshape(-1, 2)


def motion(first: Features, second: Features, ratio: float, focal: float) -> Array | None:
    """The motion (4, 4) from the second frame to the first, from matched points of the second and rays of the first.

    OpenCV's perspective-n-point with RANSAC, which takes depths of one frame as exact; `focal` is in px. None where it
    fails.
    """
    rows = matches(first, second, ratio)
    if len(rows) < 4:
        return None
    xyz, rays = second.points.xyz[rows[:, 1]], first.points.rays[rows[:, 0]]
    found, turn, shift, _ = cv2.solvePnPRansac(
        xyz, rays, np.eye(3), None, iterationsCount=ROUNDS, reprojectionError=PIXELS / focal
    )
    if not found:
        return None
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = cv2.Rodrigues(turn)[0], shift[:, 0]
    return T
