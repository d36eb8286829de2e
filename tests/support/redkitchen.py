"""A recorded sequence of a hand-held Kinect, 7-Scenes' red kitchen: motions between neighbours beside the truth.

The truth's own errors, calibration and shutter are larger than what the residuals tell: no covariance is judged here.
"""

import csv
import os
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from slamduel.core.se2 import Array
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.depth.features import Features, Finder, matched
from slamduel.frontend.depth.registration import registered
from slamduel.frontend.depth.settings import Settings

FOLDER = Path(os.environ.get("SLAMDUEL_DATA", "nowhere")) / "rgbd" / "redkitchen"

CAMERA = Camera(640, 480, (525.0, 525.0), (320.0, 240.0), (), np.eye(4))


def poses() -> dict[int, Array]:
    """(3, 4) T_world_camera of each frame."""
    with (FOLDER / "poses.csv").open() as file:
        rows = list(csv.DictReader(file))
    return {int(r["frame"]): np.array([[float(r[f"m{i}{j}"]) for j in range(4)] for i in range(3)]) for r in rows}


def features(frame: int, finder: Finder) -> Features:
    grey = cv2.imread(str(FOLDER / f"frame-{frame:06d}.color.jpg"), cv2.IMREAD_GRAYSCALE)
    depth = cv2.imread(str(FOLDER / f"frame-{frame:06d}.depth.png"), cv2.IMREAD_UNCHANGED)
    return finder.find(np.asarray(grey, np.uint8), (depth / 1000).astype(np.float32))


def judged(frames: Sequence[int], settings: Settings) -> Array:
    """(n, 2) errors of the motions between neighbours, m and degrees; NaN where a pair is lost."""
    true, finder = poses(), Finder(CAMERA, settings)
    seen = [features(frame, finder) for frame in frames]
    out = np.full((len(frames) - 1, 2), np.nan)
    for k, (a, b) in enumerate(pairwise(frames)):
        rows = matched(seen[k].descriptors, seen[k + 1].descriptors, settings.ratio)
        points = seen[k].points.taken(rows[:, 0]), seen[k + 1].points.taken(rows[:, 1])
        found = registered(*points, settings, np.random.default_rng(k))
        if found is None:
            continue
        turn, other = (Rotation.from_matrix(true[f][:, :3]) for f in (a, b))  # the nearest rotation of each
        t = turn.inv().apply(true[b][:, 3] - true[a][:, 3])
        off = Rotation.from_matrix(found.R) * (turn.inv() * other).inv()
        out[k] = np.linalg.norm(found.t - t), np.degrees(off.magnitude())
    return out
