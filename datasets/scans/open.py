"""Opens a recording of laser scans: a ROS bag, a CARMEN log, scans.csv, or a folder of one with its robot.toml."""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.factors import Dataset, Truth
from ...core.files import check_regular
from ...frontend.laser.log import first_scan
from ...frontend.laser.recording import LaserRecording
from ...frontend.laser.settings import Settings
from ...frontend.laser.tilted import levelled
from ...frontend.wheels.track import Poses, Track, TrackNoise
from ..bags.bag import Bag, is_bag, is_whole
from ..bags.siblings import read_alone
from ..fixes.open import OpenedWorld, in_world, open_world
from ..formats import relations
from ..formats.carmen import Reading, read_scans
from ..formats.file_kind import is_carmen
from ..grid_file import localised
from ..inertial.open import OpenedImu, beside, open_imu
from ..robot_files import ROBOT, recording_in, robot_beside
from ..truth import read_truth, with_truth
from .bag_scans import read_bag
from .robot import LaserRobot, read_laser_robot
from .scan_messages import ECHOES, SCAN
from .scans_csv import SCANS, read_scans_csv
from .tilted import levels_of

_KINDS = f"a ROS bag (.bag, .mcap, or a folder with metadata.yaml), a CARMEN log (.clf) or {SCANS}"


class OpenedScans(NamedTuple):
    """A recording of laser scans, ready for `build`."""

    recording: LaserRecording
    settings: Settings
    truth: Truth | None  # at the times of its measurement
    file: Path  # of the recording, beside which its relations may lie
    remarks: list[str]
    start_given: bool = True  # by [prior] in robot.toml
    inertial: OpenedImu | None = None
    world: OpenedWorld | None = None

    def without_gyro(self) -> "OpenedScans":
        """The recording without the turns of its gyro."""
        return self._replace(inertial=None)


class ScanTopics(NamedTuple):
    """Topics that the user names in place of robot.toml; None: those of robot.toml."""

    scan: str | None = None
    odometry: str | None = None


def open_scans(path: Path, robot_file: Path | None = None, topics: ScanTopics | None = None) -> OpenedScans | None:
    """Opens the scans at `path`, with that robot.toml, or the one in its folder or beside it; None for a camera's.

    Without a robot.toml a CARMEN log is read as it is, and a bag if it has scans. InputError for what is missing,
    ambiguous or cannot be used.
    """
    file = robot_file or robot_beside(path)
    robot = None if file is None else read_laser_robot(file)
    if robot is None and file is not None:
        if is_carmen(path):
            raise InputError(f"{file}: has no [laser], expected it for the scans in {path}.")
        if topics is not None and topics != ScanTopics():
            raise InputError(f"{file}: has no [laser], expected it where a topic of scans or their odometry is named.")
        return None
    if robot is None:
        scans = is_bag(path) and path.exists() and _has_scans(path)
        if not (scans or is_carmen(path)):
            return None
        robot = LaserRobot()
    if topics is not None:
        robot = replace(robot, topic=topics.scan or robot.topic, odometry_topic=topics.odometry or robot.odometry_topic)
    if not path.exists():
        raise InputError(f"{path}: there is no such file or folder, expected a recording.")
    found = source_of(path, robot)
    recording, remarks = read_source(found, robot)
    home = path if path.is_dir() and (path != found or (path / ROBOT).is_file()) else found.absolute().parent
    truth = None if file is None else read_truth(home)
    notes, wheels = dict(recording.notes), recording.odometry
    odometry = None if wheels is None else Poses(recording.t, wheels)
    inertial = open_imu(found, home, robot.imu, odometry, notes, remarks)
    felt, given = None if inertial is None else inertial.imu, robot.prior is not None
    motion = None if wheels is None else Track(recording.t, wheels, TrackNoise())
    world = open_world(found, home, robot.world, felt, motion, notes, remarks, start_given=given)
    recording = replace(recording, notes=notes)
    if robot.leans:
        by = levels_of(str(found), inertial, motion, remarks)
        recording = levelled(recording, by, robot.leaning, remarks)
    return OpenedScans(recording, robot.settings, truth, found, remarks, given, inertial, world)


def read_source(found: Path, robot: LaserRobot) -> tuple[LaserRecording, list[str]]:
    """The scans of a bag, a CARMEN log or scans.csv as the robot wants them, and remarks; InputError for others."""
    check_regular(found)
    if is_bag(found):
        recording, remarks = read_bag(found, robot)
        return recording, remarks + read_alone(found)
    if is_carmen(found):
        return _carmen(found, robot)
    if found.suffix.lower() == ".csv":
        return _table(found, robot)
    raise InputError(f"{found}: found a file of an unknown kind, expected {_KINDS}.")


def build(opened: OpenedScans) -> Dataset:
    """The log of the scans by the front end, with the ground truth at its times; InputError as in `build_log`."""
    recording = localised(opened.recording, opened.settings)
    made = relations.build(recording, opened.settings, opened.file, opened.remarks).dataset
    first = first_scan(made.log)
    log = in_world(beside(made.log, opened.inertial, first), opened.world, first)
    if opened.truth is None:
        return Dataset(log, made.truth)
    return with_truth(log, opened.truth, first, opened.start_given)


def _carmen(path: Path, robot: LaserRobot) -> tuple[LaserRecording, list[str]]:
    """A CARMEN log as the robot wants it."""
    if robot.time_offset:
        raise InputError(
            f"{path}: [laser] time_offset is {robot.time_offset:g}, and a CARMEN log has scans and odometry at one "
            "time; expected it without."
        )
    for setting, given in (("topic", robot.topic), ("odometry", robot.odometry_topic)):
        if given is not None:
            raise InputError(f"{path}: {setting} is given, {given!r}, and a CARMEN log has no topics; expected a bag.")
    pose = np.zeros(3) if robot.pose is None else robot.pose
    recording, remarks = read_scans(path, Reading(pose, robot.min_range, robot.max_range, robot.odometry))
    recording = replace(recording, name=robot.name or recording.name, prior=robot.prior or recording.prior)
    return recording, remarks


def _table(path: Path, robot: LaserRobot) -> tuple[LaserRecording, list[str]]:
    """The scans of a CSV file, which has no odometry of its own."""
    for setting, given in (("topic", robot.topic), ("odometry", robot.odometry_topic)):
        if given is not None:
            raise InputError(f"{path}: {setting} is given, {given!r}, and a CSV file has no topics; expected a bag.")
    if robot.odometry == "wheels":
        raise InputError(f'{path}: a CSV file of scans has no odometry, expected [laser] odometry = "none" or "auto".')
    recording, remarks = read_scans_csv(path, robot)
    return (replace(recording, t=recording.t + robot.time_offset) if robot.time_offset else recording), remarks


def _has_scans(path: Path) -> bool:
    return any(one.type in (SCAN, ECHOES) and one.messages for one in Bag(path).listed())


def source_of(path: Path, robot: LaserRobot) -> Path:
    """The bag, log or table that `path` is or contains; of several the one that robot.toml names."""
    if not path.is_dir() or is_whole(path, robot.source):
        return path
    inside = sorted(one for one in path.iterdir() if is_bag(one) or is_carmen(one) or one.name == SCANS)
    return recording_in(path, "laser", robot.source, inside, _KINDS, SCANS)
