"""Reads the robot.toml of a robot with a depth camera.

    name = "my robot"
    [camera]     calibration, size, mounting = {xyz, rpy} or {matrix}, time_offset, exposure
    [depth]      source, units, within, calibration, size, pose = {xyz, rpy} or {matrix}, registered, odom_frame,
                 truth_frame,
                 step, turn, features, landmarks, loops, odometry ...      as the options of the dataset depth-room, but
                 that floor, turn_floor and floor_share are those of a real camera
    [odometry]   forward, turning, turning_by_turn, floors, max_speed
    [prior]      pose, sd
    [topics]     image, depth, camera_info, depth_info, odometry
    [imu]        as `inertial.robot` reads it
    [gps]        and [compass], as `fixes.robot` reads them

Only [depth] is required, where the recording has the rest. [camera] is the camera of the images; `calibration` in
[depth] is of a second camera, which measures depth, and `pose` is its mounting on the first one, whose x axis is where
it looks, y left and z up: {} is at the same place. Lengths are in m, angles in rad, times in s.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import tomli_w

from ...core.errors import InputError
from ...core.factors import Prior
from ...core.files import write_whole
from ...core.se2 import Array
from ...core.toml.table import TomlTable
from ...frontend.camera.calibration import write_opencv
from ...frontend.camera.camera import Camera
from ...frontend.camera.mounting import mounting as ahead
from ...frontend.depth.recording import DepthRecording
from ...frontend.depth.settings import RecordedSettings, Settings
from ...frontend.wheels.counters import MAX_SPEED
from ...frontend.wheels.track import Track, TrackNoise
from ..bags.odometry import FRAME
from ..fixes.robot import WorldTables, world_in
from ..inertial.robot import ImuTable, imu_in
from ..prior import read_prior
from ..robot_files import CALIBRATION, ROBOT
from ..robot_limits import check_limits
from ..robot_tables import (
    TRACK,
    calibrated,
    cameras_in,
    names_of,
    pose_in,
    robot_of,
    settings_in,
    track_noise,
    without_none,
)
from .frames import WITHIN

FLOORS = ("floor", "turn_floor", "floor_share")

CAMERA = ("calibration", "size", "mounting", "time_offset", "exposure")

_OWN = ("source", "units", "within", "calibration", "size", "pose", "registered", "odom_frame", "truth_frame")


class DepthTopics(NamedTuple):
    """Topics of a bag; None: the only one of a fitting type."""

    image: str | None = None
    depth: str | None = None
    camera_info: str | None = None
    depth_info: str | None = None
    odometry: str | None = None


@dataclass(frozen=True, eq=False)
class DepthRobot:
    """A robot with a depth camera, and the settings of its front end."""

    name: str | None = None  # None: that of the recording
    camera: Camera | None = None  # of the images; None: from the recording
    mounting: Array | None = None  # (4, 4) T_robot_camera; None: as tf has it
    placing: str = f"[camera] mounting in {ROBOT}"  # what places the camera where tf does not
    time_offset: float = 0.0  # s, added to the images' stamps to get the odometry's clock
    exposure: float = 0.0  # s; images are stamped at its start
    source: str | None = None  # the recording, relative to its folder; None: the only one there
    units: float | None = None  # of a depth image of integers that are a metre; None: as its kind of recording has them
    within: float = WITHIN  # s between an image and its depth image
    depth_camera: Camera | None = None  # None: from the recording, where the depth is not registered
    pose: Array | None = None  # (4, 4) T_camera_depth; None: as tf has it
    registered: bool | None = None  # None: as the recording says
    odom_frame: str = FRAME  # tf's frame of the odometry, where no topic has it
    truth_frame: str | None = None  # tf's frame in which the camera's true poses are; None: no truth in the bag
    max_speed: float = MAX_SPEED  # m/s; a faster robot is a misreading
    noise: TrackNoise = field(default_factory=TrackNoise)
    topics: DepthTopics = field(default_factory=DepthTopics)
    settings: Settings = field(default_factory=RecordedSettings)
    prior: Prior | None = None  # None: the first pose of the odometry
    imu: ImuTable | None = None
    world: WorldTables = field(default_factory=WorldTables)

    @property
    def words(self) -> dict[str, Any]:
        """[depth] of a rendered robot as TOML has it, whose errors have no floors; None where it says nothing."""
        floors = {name: getattr(self.settings, name) for name in FLOORS}
        return {"source": self.source, "registered": self.registered, **floors}


def read_depth_robot(path: Path) -> DepthRobot | None:
    """Reads the robot in `path`, a robot.toml; None if it has no [depth]. InputError names a fault's line and key."""
    file = robot_of(path, "depth", ("camera", "odometry", "topics"))
    if file is None:
        return None
    file.table("topics").only(DepthTopics._fields)
    if not cameras_in(file.table("camera"), CAMERA):
        file.table("camera").only(CAMERA)
    return depth_robot_in(file)


def depth_robot_in(file: TomlTable) -> DepthRobot:
    """The robot with a depth camera of a robot.toml, which may have other sensors, too."""
    camera = file.table("camera")
    for name in cameras_in(camera, CAMERA):
        raise camera.refused(name, "is one of several cameras, expected the one whose images have depth, as [camera].")
    depth = file.table("depth").only((*_OWN, *names_of(RecordedSettings)))
    odometry = file.table("odometry").only((*TRACK, "floors", "max_speed"))
    topics = file.table("topics")
    placed = pose_in(camera, "mounting") if camera.has("mounting") else None
    body = ahead(0, 0, 0, 0)  # T_body_camera of the first camera, whose body looks along its own x axis
    if depth.has("calibration") and depth.has("registered") and depth.switch("registered", False):
        raise depth.refused("registered", "is true beside a calibration, expected one or the other.")
    robot = DepthRobot(
        name=file.text_or_none("name"),
        camera=calibrated(camera, body if placed is None else placed),
        mounting=placed,
        time_offset=camera.number("time_offset", 0.0),
        exposure=camera.number("exposure", 0.0, least=0),
        source=depth.text_or_none("source"),
        units=depth.number("units", above=0) if depth.has("units") else None,
        within=depth.number("within", WITHIN, least=0),
        depth_camera=calibrated(depth, np.eye(4)),
        pose=body.T @ pose_in(depth, "pose") if depth.has("pose") else None,
        registered=depth.switch("registered", False) if depth.has("registered") else None,
        odom_frame=depth.text_or_none("odom_frame") or FRAME,
        truth_frame=depth.text_or_none("truth_frame"),
        max_speed=odometry.number("max_speed", MAX_SPEED, above=0),
        noise=track_noise(odometry),
        topics=DepthTopics(**{key: topics.text(key) for key in topics.entries if key in DepthTopics._fields}),
        settings=settings_in(depth, RecordedSettings, Path(file.file).parent),
        prior=read_prior(file.table("prior")) if file.has("prior") else None,
        imu=imu_in(file),
        world=world_in(file),
    )
    check_limits(file)
    return robot


def write_depth_robot(
    path: Path,
    recording: DepthRecording,
    topics: DepthTopics | None = None,
    imu: ImuTable | None = None,
    world: WorldTables | None = None,
) -> None:
    """Writes a robot.toml for a rendered `recording`, whose errors have no floors, with its camera's calibration.

    InputError if it cannot be written, and for a motion that is not a `Track`.
    """
    motion, odometry = recording.motion, dict[str, Any]()
    if isinstance(motion, Track):
        noise = motion.noise
        odometry = {key: getattr(noise, key) for key in TRACK}
        odometry |= {"floors": {"position": noise.floors.position, "heading": noise.floors.heading}}
        odometry |= {"max_speed": motion.max_speed}
    elif motion is not None:
        raise InputError(f"{recording.name}: found {type(motion).__name__} readings, expected a Track, or none.")
    prior = recording.prior
    words: dict[str, Any] = {
        "name": recording.name,
        "camera": {"calibration": CALIBRATION, "mounting": {"matrix": recording.camera.mounting.tolist()}},
        "depth": DepthRobot(registered=True, settings=Settings()).words,
        "odometry": odometry,
        "prior": {"pose": prior.pose.tolist(), "sd": np.sqrt(np.diag(prior.cov)).tolist()},
        "topics": {} if topics is None else topics._asdict(),
        "imu": {} if imu is None else imu.words,
        **({} if world is None else world.words),
    }
    try:
        write_opencv(path.with_name(CALIBRATION), recording.camera)
        write_whole(path, tomli_w.dumps(without_none(words)))
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}).") from error
