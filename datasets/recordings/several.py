"""Opens a recording whose robot.toml has two or all of [markers], [laser] and [depth]: one log of all of them.

The scans are in the same bag as the images, or in another, a CARMEN log or scans.csv beside them. The wheels are those
of the recording's motion, for all: the other front ends take them from there, and not from topics of their own. The
depth camera's images and depths are in the same bag, too, or in another or a folder that [depth] source names.
"""

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from ...core.errors import InputError
from ...core.factors import Dataset, Log
from ...core.se2 import Array
from ...core.toml.table import TomlTable
from ...frontend.depth.recording import DepthRecording
from ...frontend.depth.settings import Settings as DepthSettings
from ...frontend.laser.tilted import levelled
from ...frontend.several.log import Several, build_log
from ...frontend.several.wheels_path import walked
from ...frontend.wheels.motion import Drift, Motion
from ..depth.open import OpenedDepth, open_beside
from ..depth.robot import DepthRobot
from ..remarks import remarked
from ..robot_files import ROBOT, is_settings, robot_beside
from ..scans.odometry import UNMOVED
from ..scans.open import OpenedScans, ScanTopics, read_source, source_of
from ..scans.robot import LaserRobot
from ..scans.tilted import levels_of
from ..truth import with_truth
from .open import is_live
from .recording import Opened, open_recording
from .recording import finished as finished_frames
from .robot import Robot, read_robot
from .sensors import COMPASS, DEPTH, GPS, LASER, MARKERS, SEEING, WHEELS, beside_them, chosen, seeing


class OpenedSeveral(NamedTuple):
    """A recording with several sensors, ready for `build`."""

    frames: Opened
    scans: OpenedScans | None  # with the motion of the frames' recording as its odometry
    depth: DepthRecording | None = None  # with that motion
    depth_settings: DepthSettings | None = None
    markers: bool = True  # False: the log is of the scans and the depth, with what is beside them

    @property
    def recording(self) -> Several:
        """The front ends' input."""
        felt = None if self.frames.inertial is None else self.frames.inertial.imu
        made = Several(self.frames.recording, depth=self.depth, imu=felt, markers=self.markers)
        if self.scans is not None:
            made = made._replace(scans=self.scans.recording, settings=self.scans.settings)
        return made if self.depth_settings is None else made._replace(depth_settings=self.depth_settings)


def open_several(
    path: Path,
    robot_file: Path | None = None,
    topics: ScanTopics | None = None,
    sensors: Collection[str] | None = None,
    seconds: float | None = None,
) -> OpenedSeveral | Opened | OpenedScans | OpenedDepth | None:
    """Opens the recording at `path` whose robot.toml has several sensors that see, with all or `sensors` of them.

    None for a recording with another robot.toml, or without one, and no `sensors` named. InputError as of the readers
    of each, for sensors that robot.toml does not have, and for scans at other times than the motion.
    """
    file = robot_file or (None if is_live(path) else robot_beside(path))
    tables = () if file is None or is_settings(file) else tuple(TomlTable.read(file).entries)
    named = seeing(sensors)
    for name in named or ():
        if name not in tables:
            where = path if file is None else file
            has = " and ".join(f"[{one}]" for one in SEEING if one in tables)
            found = f"found {has or 'no table of a sensor'}" if file is not None else f"found no {ROBOT}"
            raise InputError(f"{where}: {found}, expected [{name}] for the sensor {name} that is named.")
    there = [one for one in SEEING if one in tables]
    for name in {GPS, COMPASS} & set(sensors or ()):
        if name not in tables:
            where = path if file is None else file
            raise InputError(f"{where}: has no [{name}], expected it for the sensor {name} that is named.")
    if file is None or len(there) < 2:
        return None
    robot, given = read_robot(file), topics or ScanTopics()
    robot = replace(robot, topics=robot.topics._replace(odometry=given.odometry or robot.topics.odometry))
    used = named or there
    frames = chosen(open_recording(path, robot, seconds, wheels=WHEELS in beside_them(sensors)), sensors)
    if used == (MARKERS,):
        return frames
    if is_live(path):
        raise InputError(f"{path}: is a camera, which has no scans and no depth; expected --sensors markers.")
    scans = depth = settings = None
    if LASER in used and (laser := robot.laser) is not None:
        scans = _scans(path, robot, replace(laser, topic=given.scan or laser.topic), frames)
    if DEPTH in used and robot.depth is not None:
        depth, settings = _depth(path, file, robot.depth, frames, there[0])
    if MARKERS in used or (scans is not None and depth is not None):
        return OpenedSeveral(frames, scans, depth, settings, MARKERS in used)
    if scans is not None and depth is None:
        return scans._replace(remarks=[*frames.told, *(one for one in scans.remarks if one not in frames.told)])
    assert depth is not None
    depth.remarks[:0] = frames.told  # in place: it grows while the frames are read
    assert settings is not None
    return OpenedDepth(depth, settings, frames.truth, None, frames.start_given, frames.inertial, frames.world)


def build(opened: OpenedSeveral) -> Dataset:
    """Builds the log of all sensors, with the ground truth at its times."""
    log = finished(opened, build_log(opened.recording))
    return with_truth(log, opened.frames.truth, start_given=opened.frames.start_given)


def finished(opened: OpenedSeveral, log: Log) -> Log:
    """The log with the remarks on the scans, the gyro's turns, and positions and headings in the world."""
    remarks = [] if opened.scans is None else opened.scans.remarks
    return finished_frames(opened.frames, remarked(log, remarks))


def _depth(
    path: Path, file: Path, robot: DepthRobot, frames: Opened, other: str
) -> tuple[DepthRecording, DepthSettings]:
    """The frames of the depth camera beside the sensor `other`, and its front end's settings: without landmarks."""
    table = TomlTable.read(file).table("depth")
    if table.has("landmarks") and robot.settings.landmarks:
        raise table.refused(
            "landmarks",
            f"is true beside [{other}], expected false: features tell motions and loop closures there, and would count "
            "twice.",
        )
    motion = frames.recording.motion
    motion.check()
    odometry = "visual" if isinstance(motion, Drift) else "wheels"
    loops = robot.settings.loops if table.has("loops") else True
    settings = replace(robot.settings, landmarks=False, loops=loops, odometry=odometry)
    recording = open_beside(path, replace(robot, name=frames.recording.name), motion, frames.recording.prior)
    return replace(recording, tilts=frames.recording.tilts), settings


def _scans(path: Path, robot: Robot, laser: LaserRobot, frames: Opened) -> OpenedScans:
    """The scans with the motion of the frames' recording at their times."""
    found = source_of(path, laser)
    recording, remarks = read_source(found, replace(laser, odometry="none", odometry_topic=None))
    motion = frames.recording.motion
    motion.check()
    first, last = motion.t[[0, -1]].tolist()
    here = (first <= recording.t) & (recording.t <= last)
    if here.sum() < 2:
        raise InputError(
            f"{found}: {'none' if not here.any() else 'only one'} of the {len(here)} scans is within the time of the "
            f"{motion.readings}: scans are from {recording.t[0]!s} to {recording.t[-1]!s} s, {motion.readings} from "
            f"{first!s} to {last!s} s; expected one clock."
        )
    if not here.all():
        remarks.append(
            f"{int((~here).sum())} of {len(here)} scans are before or after the {motion.readings}, {first:.10g} to "
            f"{last:.10g} s, and are left out"
        )
    recording = recording.taken(here)
    if laser.leans:
        by = frames.recording.tilts or levels_of(str(found), frames.inertial, motion, remarks)
        recording = levelled(recording, by, laser.leaning, remarks)
    odometry = None if laser.odometry == "none" else _walked(found, motion, recording.t, laser, remarks)
    prior = frames.recording.prior
    recording = replace(recording, name=robot.name, odometry=odometry, prior=prior)
    return OpenedScans(
        recording, laser.settings, frames.truth, found, remarks, frames.start_given, frames.inertial, frames.world
    )


def _walked(found: Path, motion: Motion, t: Array, laser: LaserRobot, remarks: list[str]) -> Array | None:
    """The poses (n, 3) of the wheels at `t` (n,), s, from the first one on; None where nothing measured the motion."""
    if isinstance(motion, Drift):
        if laser.odometry == "wheels":
            raise InputError(f'{found}: nothing measured the motion, expected wheels for [laser] odometry = "wheels".')
        return None
    path = walked(motion, t)
    if path.any():
        return path
    if laser.odometry == "wheels":
        raise InputError(f'{found}: the {motion.readings} never move, expected [laser] odometry = "none".')
    remarks.append(UNMOVED)
    return None
