"""A recorded sequence of a hand-held Kinect: does every pair match, and how close is it?

The truth's own errors, calibration and shutter are larger than what the residuals tell: no covariance is judged here.
"""

import csv
import os
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from slamduel.core.se2 import Array
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.depth.features import Features, Finder, matched
from slamduel.frontend.depth.registration import registered
from slamduel.frontend.depth.settings import Settings

FOLDER = Path(os.environ.get("SLAMDUEL_DATA", "nowhere")) / "rgbd" / "redkitchen"

pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason="no recording of the red kitchen")

CAMERA = Camera(640, 480, (525.0, 525.0), (320.0, 240.0), (), np.eye(4))


def poses() -> dict[int, Array]:
    """(3, 4) T_world_camera of each frame."""
    with (FOLDER / "poses.csv").open() as file:
        rows = list(csv.DictReader(file))
    return {int(r["frame"]): np.array([[float(r[f"m{i}{j}"]) for j in range(4)] for i in range(3)]) for r in rows}


def features(frame: int, finder: Finder) -> Features:
    grey = cv2.imread(str(FOLDER / f"frame-{frame:06d}.color.jpg"), cv2.IMREAD_GRAYSCALE)
    depth = cv2.imread(str(FOLDER / f"frame-{frame:06d}.depth.png"), cv2.IMREAD_UNCHANGED)
    assert grey is not None
    assert depth is not None
    return finder.find(np.asarray(grey, np.uint8), (depth / 1000).astype(np.float32))


def judged(frames: list[int]) -> Array:
    """(n, 2) errors of the motions between neighbours, m and degrees; NaN where a pair is lost."""
    settings, true = Settings(), poses()
    finder = Finder(CAMERA, settings)
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


@pytest.mark.parametrize(
    "frames", [range(0, 90, 3), pytest.param(range(0, 600, 3), marks=pytest.mark.slow)], ids=["first", "all"]
)
def test_no_pair_is_lost_and_half_of_them_are_close(frames: range) -> None:
    off = judged(list(frames))
    assert np.isfinite(off).all()
    metres, degrees = np.median(off, axis=0)
    assert metres < 0.007
    assert degrees < 0.25
