"""Collects the poses of tags along a recording of markers, and writes them as a file of their own."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ...core.errors import InputError
from ...core.factors import UNKNOWN, Log
from ...core.se2 import Array
from ...datasets.tags.poses_csv import write_csv
from ...datasets.tags.poses_jrl import write_jrl
from ...datasets.tags.poses_pyfg import write_pyfg
from ...datasets.tags.tag_poses import TagPoses, graph_of
from ...frontend.markers.pipeline import FrameSightings

ENDINGS = (".csv", ".jrl", ".pyfg", ".pfg")


@dataclass
class TagFile:
    """The poses of all tags that are found, those too far for the log as well."""

    path: Path
    clock: float  # s by which the frames' times are later than their stamps
    _times: list[float] = field(default_factory=list[float])  # of all frames
    _rows: list[tuple[int, int, Array, Array]] = field(default_factory=list[tuple[int, int, Array, Array]])

    def observe(self, seen: FrameSightings) -> None:
        """Takes in a frame; the place of a tag is its centre's, the mean of the poses that explain its corners."""
        for one in seen.sightings:
            if one.id != UNKNOWN:
                if np.isnan(one.cov).any():
                    raise InputError(
                        f"--poses {self.path}: the pose of tag {one.id} at {seen.frame.t} s has no covariance, "
                        "expected [camera] calibration, by which [markers] corner_sd tells it."
                    )
                pose = one.pose.copy()
                pose[:3, 3] = one.centre
                self._rows.append((len(self._times), one.id, pose, one.cov))
        self._times.append(seen.frame.t - self.clock)

    def write(self, log: Log, mounting: Array) -> int:
        """Writes the file in the format of its ending; returns the number of poses. InputError where it cannot be."""
        times = np.array(self._times)
        frame = np.array([row[0] for row in self._rows], np.int64)
        found = TagPoses(
            times[frame],
            frame,
            np.array([row[1] for row in self._rows], np.int64),
            np.array([row[2] for row in self._rows]).reshape(-1, 4, 4),
            np.array([row[3] for row in self._rows]).reshape(-1, 6, 6),
        )
        try:
            if self.path.suffix.lower() == ".csv":
                write_csv(self.path, found)
            else:
                graph = graph_of(found, mounting, times, log.dead_reckoned())
                if self.path.suffix.lower() == ".jrl":
                    write_jrl(self.path, graph, log.name)
                else:
                    write_pyfg(self.path, graph)
        except OSError as error:
            raise InputError(f"--poses {self.path}: cannot be written ({error.strerror}).") from error
        return len(frame)
