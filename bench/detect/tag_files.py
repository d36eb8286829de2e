"""Collects the poses of tags along a recording of markers, and writes them as files of their own."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.factors import UNKNOWN, Log
from ...core.se2 import Array
from ...datasets.recordings.robot_camera import table_of
from ...datasets.robot_files import file_of
from ...datasets.tags.poses_csv import write_csv
from ...datasets.tags.poses_jrl import write_jrl
from ...datasets.tags.poses_pyfg import write_pyfg
from ...datasets.tags.tag_poses import TagPoses, graph_of
from ...frontend.markers.pipeline import FrameSightings

ENDINGS = (".csv", ".jrl", ".pyfg", ".pfg")


@dataclass
class TagFile:
    """The poses of all tags that are found, those too far for the log as well.

    A CSV file has them in the frame of the camera, so each of several has one: poses-left.csv of the left one and so
    on, as readable as tags.csv. A graph has them from the robot, of all cameras.
    """

    path: Path
    _times: list[float] = field(default_factory=list[float])  # of all steps
    _stamps: list[float] = field(default_factory=list[float])  # of their first frames
    _rows: list["_Row"] = field(default_factory=list["_Row"])

    def observe(self, seen: FrameSightings) -> None:
        """Takes in a frame; the place of a tag is its centre's, the mean of the poses that explain its corners."""
        stamp = seen.frame.t - seen.frame.clock
        if not self._times or seen.frame.t > self._times[-1]:
            self._times.append(seen.frame.t)
            self._stamps.append(stamp)
        for one in seen.sightings:
            if one.id != UNKNOWN:
                if np.isnan(one.cov).any():
                    raise InputError(
                        f"--poses {self.path}: the pose of tag {one.id} at {seen.frame.t} s has no covariance, "
                        f"expected {table_of(seen.frame.camera)} calibration, by which [markers] corner_sd tells it."
                    )
                pose = one.pose.copy()
                pose[:3, 3] = one.centre
                self._rows.append(_Row(stamp, len(self._times) - 1, one.id, pose, one.cov, seen.frame.camera))

    def write(self, log: Log, mountings: Mapping[str, Array]) -> list[Path]:
        """Writes the file, or one for each of several cameras, in the format of its ending; returns those written.

        `mountings` are T_robot_camera by the cameras' names. InputError where one cannot be written.
        """
        path = self.path
        try:
            if path.suffix.lower() == ".csv":
                written = list[Path]()
                for name in mountings:
                    path = file_of(self.path, name)
                    write_csv(path, _poses([row for row in self._rows if row.camera == name]))
                    written.append(path)
                return written
            on_robot = np.array([mountings[row.camera] for row in self._rows]).reshape(-1, 4, 4)
            graph = graph_of(_poses(self._rows), on_robot, np.array(self._stamps), log.dead_reckoned())
            if path.suffix.lower() == ".jrl":
                write_jrl(path, graph, log.name)
            else:
                write_pyfg(path, graph)
        except OSError as error:
            raise InputError(f"--poses {path}: cannot be written ({error.strerror}).") from error
        return [path]


class _Row(NamedTuple):
    """A tag in a frame."""

    stamp: float  # s, of the frame
    step: int
    id: int
    pose: Array  # (4, 4) T_camera_tag
    cov: Array  # (6, 6)
    camera: str


def _poses(rows: Sequence[_Row]) -> TagPoses:
    stamp, step, ids, poses, covs = ([row[k] for row in rows] for k in range(5))
    return TagPoses(
        np.array(stamp, float),
        np.array(step, np.int64),
        np.array(ids, np.int64),
        np.array(poses, float).reshape(-1, 4, 4),
        np.array(covs, float).reshape(-1, 6, 6),
    )
