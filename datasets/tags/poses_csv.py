"""Poses of tags as a CSV file: time, frame, id, pose and the upper triangle of its covariance, row by row."""

from itertools import combinations_with_replacement
from pathlib import Path

from ...core.files import csv_text, write_whole
from ...core.small_matrices import upper
from ...frontend.camera.quaternions import quaternion
from .tag_poses import TagPoses

PLACE, TURN = ("x", "y", "z"), ("qx", "qy", "qz", "qw")
COV = tuple(f"c_{a}_{b}" for a, b in combinations_with_replacement((*PLACE, "rx", "ry", "rz"), 2))
"""r: turns about the camera's axes, after the pose's own."""

COLUMNS = ("t", "frame", "id", *PLACE, *TURN, *COV)


def write_csv(path: Path, found: TagPoses) -> None:
    """Writes the poses to `path` atomically, all digits of them; OSError where that is impossible."""
    triangles = upper(found.cov).T.tolist()
    columns = zip(found.t.tolist(), found.frame.tolist(), found.ids.tolist(), found.poses, triangles, strict=True)
    rows = (
        (t, frame, name, *pose[:3, 3].tolist(), *quaternion(pose[:3, :3]).tolist(), *cov)
        for t, frame, name, pose, cov in columns
    )
    write_whole(path, csv_text(COLUMNS, rows))
