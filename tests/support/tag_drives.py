"""A short drive through the rendered room on a body that does not rock, with the true poses of its tags in space."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from slamduel.core.factors import Truth
from slamduel.core.se2 import Array
from slamduel.datasets.recordings.write import write
from slamduel.datasets.rendering.room import furnish
from slamduel.datasets.worlds.aruco_room import Options, record
from slamduel.datasets.worlds.rendered_world import ROOM, SIDE
from slamduel.frontend.markers.noise import PropagatedNoise
from slamduel.frontend.markers.pipeline import Frame, Recording

OPTIONS = Options(seconds=6.0, frame_rate=1.5, sway=0.0, boxes=0)


class TagDrive(NamedTuple):
    """A recording whose frames are rendered already, its truth, and the true poses of its tags."""

    recording: Recording
    truth: Truth
    tags: dict[int, Array]  # id -> (4, 4) T_world_tag


@cache
def tag_drive(seed: int = 0, options: Options = OPTIONS) -> TagDrive:
    """The drive of `seed`, rendered once per session."""
    recording, truth = record(options, np.random.default_rng(seed))
    layout, *_ = np.random.default_rng(seed).spawn(4)
    room = furnish(*ROOM, SIDE, options.markers, layout)
    frames: tuple[Frame, ...] = tuple(recording.frames)
    propagated = replace(recording, frames=frames, noise=PropagatedNoise(sway=0.01))
    return TagDrive(propagated, truth, {one.id: one.pose for one in room.markers})


def seen_from(drive: TagDrive, t: float, name: int) -> Array:
    """T_camera_tag at time `t`, s."""
    return np.linalg.inv(robot_at(drive, t) @ drive.recording.detector.camera.mounting) @ drive.tags[name]


def robot_at(drive: TagDrive, t: float) -> Array:
    """T_world_robot at time `t`, s."""
    x, y, heading = drive.truth.poses[np.abs(drive.truth.t - t).argmin()]
    pose = np.eye(4)
    pose[:2, :2] = [[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]]
    pose[:2, 3] = x, y
    return pose


def written(drive: TagDrive, folder: Path) -> Path:
    """The drive as a folder of frames with robot.toml."""
    write({folder: "frames"}, drive.recording, drive.truth)
    return folder
