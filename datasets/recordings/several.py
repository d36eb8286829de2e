"""Opens a recording of markers and a laser scanner, whose robot.toml has [markers] and [laser]: one log of both.

The scans are in the same bag as the images, or in another, a CARMEN log or scans.csv beside them. The wheels are those
of the recording's motion, for both: the scanner's front end takes them from there, and not from a topic of its own.
"""

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from ...core.errors import InputError, nearest
from ...core.factors import Dataset, Log
from ...core.se2 import Array
from ...core.toml.table import TomlTable
from ...frontend.several.log import Several, build_log
from ...frontend.several.wheels_path import walked
from ...frontend.wheels.motion import Drift, Motion
from ..remarks import remarked
from ..robot_files import ROBOT, is_settings, robot_beside
from ..scans.odometry import UNMOVED
from ..scans.open import OpenedScans, ScanTopics, read_source, source_of
from ..scans.robot import LaserRobot
from ..truth import with_truth
from .open import is_live
from .recording import Opened, open_recording
from .recording import finished as finished_frames
from .robot import Robot, read_robot

MARKERS, LASER = SENSORS = ("markers", "laser")
"""The sensors of which a recording's log is made, by the tables of robot.toml."""


class OpenedSeveral(NamedTuple):
    """A recording with several sensors, ready for `build`."""

    frames: Opened
    scans: OpenedScans  # with the motion of the frames' recording as its odometry

    @property
    def recording(self) -> Several:
        """The front ends' input."""
        return Several(self.frames.recording, self.scans.recording, self.scans.settings)


def sensors_in(text: str, flag: str) -> tuple[str, ...]:
    """The sensors that a `text` names, separated by commas; InputError for one that there is not, or that is twice."""
    names = [name.strip() for name in text.split(",")]
    for name in names:
        if name not in SENSORS:
            raise InputError(f"{flag} {text}: found {name!r}; {nearest(name, SENSORS)}")
    if len(set(names)) < len(names):
        raise InputError(f"{flag} {text}: a sensor is named twice, expected once.")
    return tuple(names)


def open_several(
    path: Path,
    robot_file: Path | None = None,
    topics: ScanTopics | None = None,
    sensors: Collection[str] | None = None,
    seconds: float | None = None,
) -> OpenedSeveral | Opened | OpenedScans | None:
    """Opens the recording at `path` whose robot.toml has markers and a scanner, with all of `sensors`, or one of them.

    None for a recording with another robot.toml, or without one, and no `sensors` named. InputError as of the readers
    of each, for sensors that robot.toml does not have, and for scans at other times than the motion.
    """
    file = robot_file or (None if is_live(path) else robot_beside(path))
    tables = () if file is None or is_settings(file) else tuple(TomlTable.read(file).entries)
    for name in sensors or ():
        if name not in tables:
            where = path if file is None else file
            has = " and ".join(f"[{one}]" for one in (*SENSORS, "depth") if one in tables)
            found = f"found {has or 'no table of a sensor'}" if file is not None else f"found no {ROBOT}"
            raise InputError(f"{where}: {found}, expected [{name}] for the sensor {name} that is named.")
    if file is None or not set(SENSORS) <= set(tables):
        return None
    robot, given = read_robot(file), topics or ScanTopics()
    described = robot.laser
    assert described is not None  # the table is there
    robot = replace(robot, topics=robot.topics._replace(odometry=given.odometry or robot.topics.odometry))
    frames = open_recording(path, robot, seconds)
    if sensors == (MARKERS,):
        return frames
    if is_live(path):
        raise InputError(f"{path}: is a camera, which has no scans; expected --sensors markers.")
    laser = replace(described, topic=given.scan or described.topic)
    scans = _scans(path, robot, laser, frames)
    if sensors == (LASER,):
        return scans
    return OpenedSeveral(frames, scans)


def build(opened: OpenedSeveral) -> Dataset:
    """Builds the log of all sensors, with the ground truth at its times."""
    log = finished(opened, build_log(opened.recording))
    return with_truth(log, opened.frames.truth, start_given=opened.frames.start_given)


def finished(opened: OpenedSeveral, log: Log) -> Log:
    """The log with the remarks on the scans, the gyro's turns, and positions and headings in the world."""
    return finished_frames(opened.frames, remarked(log, opened.scans.remarks))


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
