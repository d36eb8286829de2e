"""Poses of tags as a JSON Robot Log: factors between a robot's poses and the tags', all of them in space.

    BetweenFactorPose3     key1 (a pose of the robot), key2 (a tag), measurement, covariance
    Pose3                  translation: x, y, z; rotation: the quaternion w, x, y, z

The keys are those of the log's own JSON Robot Log: letter a and the number of the step, letter l and the id.
Covariances are GTSAM's: 36 numbers, of the turn first and then of the place, in the tag's axes.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np

from ...core.files import write_whole
from ...core.se2 import Array
from ...frontend.camera.quaternions import quaternion
from ..graphs.jrl_write import LANDMARKS, POSES, ROBOT
from .tag_poses import TagGraph

FACTOR, POSE = "BetweenFactorPose3", "Pose3"

_TURN_FIRST = np.r_[3:6, :3]


def write_jrl(path: Path, graph: TagGraph, name: str) -> None:
    """Writes the graph of the log `name` to `path` atomically, without odometry; OSError where that is impossible."""
    found = [list[dict[str, Any]]() for _ in graph.robot]
    covs = graph.cov[:, _TURN_FIRST][:, :, _TURN_FIRST].reshape(-1, 36).tolist()
    for frame, tag, delta, cov in zip(graph.frame.tolist(), graph.ids.tolist(), graph.delta, covs, strict=True):
        keys = {"key1": POSES + frame, "key2": LANDMARKS + tag}
        found[frame].append({"type": FACTOR, **keys, "measurement": _pose(delta), "covariance": cov})
    initial = [{"key": POSES + k, **_pose(pose)} for k, pose in enumerate(graph.robot)]
    initial += [{"key": LANDMARKS + tag, **_pose(pose)} for tag, pose in sorted(graph.tags.items())]
    content = {
        "name": name,
        "robots": [ROBOT],
        "measurements": {ROBOT: [{"stamp": k, "measurements": some} for k, some in enumerate(found)]},
        "initialization": {ROBOT: initial},
    }
    write_whole(path, f"{json.dumps(content)}\n")


def _pose(pose: Array) -> dict[str, Any]:
    x, y, z, w = quaternion(pose[:3, :3]).tolist()
    return {"type": POSE, "translation": pose[:3, 3].tolist(), "rotation": [w, x, y, z]}
