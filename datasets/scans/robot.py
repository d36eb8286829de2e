"""Reads the robot.toml of a robot with a laser scanner.

    name = "my robot"
    [laser]      topic, source, pose, min_range, max_range, odometry, max_gap, odom_frame, time_offset, max_tilt,
                 height, step, turn, cell, loops, loop_every       as the options of the datasets carmen and laser-floor
    [topics]     odometry
    [prior]      pose, sd
    [imu]        as `inertial.robot` reads it
    [gps]        and [compass], as `fixes.robot` reads them

Only [laser] is required. Lengths are in m, angles in rad, times in s.
"""

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ...core.factors import Prior
from ...core.se2 import Array
from ...core.toml.table import TomlTable
from ...frontend.laser.scanner import Scanner
from ...frontend.laser.settings import Settings
from ...frontend.laser.tilted import Leaning
from ..fixes.robot import WorldTables, world_in
from ..inertial.robot import ImuTable, imu_in
from ..prior import read_prior
from ..robot_limits import check_limits
from ..robot_tables import names_of, robot_of, settings_in

FARTHEST = 100.0  # m; ranges end here

_OWN = (
    "topic",
    "source",
    "pose",
    "min_range",
    "max_range",
    "odometry",
    "max_gap",
    "odom_frame",
    "time_offset",
    "max_tilt",
    "height",
)


@dataclass(frozen=True, eq=False)
class LaserRobot:
    """A robot with a laser scanner, and the settings of its front end."""

    name: str | None = None  # None: that of the recording
    topic: str | None = None  # of the scans in a bag; None: the only one of its type
    odometry_topic: str | None = None
    source: str | None = None  # the recording, relative to its folder; None: the only one there
    pose: Array | None = None  # (3,) of the scanner on the robot; None: as tf has it, else the robot's origin
    min_range: float = Scanner.least  # m; nearer returns are of the robot itself
    max_range: float = Scanner.most  # m; beyond it a beam says nothing
    odometry: str = "auto"  # wheels; none; auto: none if there is none, or it never moves
    max_gap: float = 1.0  # s between two readings of odometry that a scan's is interpolated from
    odom_frame: str = "odom"  # tf's frame of the odometry, where no topic has it
    time_offset: float = 0.0  # s, added to the times of scans to get those of the odometry
    leaning: Leaning = field(default_factory=Leaning)  # by default scans are taken to be level
    settings: Settings = field(default_factory=Settings)
    prior: Prior | None = None  # None: the first pose of the odometry
    imu: ImuTable | None = None
    world: WorldTables = field(default_factory=WorldTables)

    @property
    def leans(self) -> bool:
        """True where scans are levelled."""
        return self.leaning != Leaning()

    @property
    def words(self) -> dict[str, Any]:
        """The table [laser], beside others: the scanner's place, and what is not by default."""
        given = {
            name: getattr(self, name)
            for name in ("topic", "source", "min_range", "max_range", "odometry", "time_offset")
        }
        given |= {"max_tilt": self.leaning.most, "height": self.leaning.height}
        given |= {name: getattr(self.settings, name) for name in names_of(Settings)}
        default = {
            name: getattr(LaserRobot, name) for name in ("min_range", "max_range", "odometry", "time_offset")
        } | asdict(Settings())
        own = {name: value for name, value in given.items() if value is not None and value != default.get(name)}
        return {"pose": [0.0, 0.0, 0.0] if self.pose is None else self.pose.tolist(), **own}


def read_laser_robot(path: Path) -> LaserRobot | None:
    """Reads the robot in `path`, a robot.toml; None if it has no [laser]. InputError names a fault's line and key."""
    file = robot_of(path, "laser", ("topics",))
    if file is None:
        return None
    file.table("topics").only(("odometry",))
    return laser_robot_in(file)


def laser_robot_in(file: TomlTable) -> LaserRobot:
    """The robot with a laser scanner of a robot.toml, which may have other sensors, too."""
    laser = file.table("laser").only((*_OWN, *names_of(Settings)))
    topics = file.table("topics")
    least = laser.number("min_range", Scanner.least, least=0)
    most = laser.number("max_range", Scanner.most, above=0)
    pose = laser.numbers("pose", 3) if laser.has("pose") else None
    check_limits(file)
    if not least < most <= FARTHEST:
        raise laser.refused(
            "max_range" if laser.has("max_range") else "min_range",
            f"ranges would count from {least:g} to {most:g} m, expected min_range below max_range, at most "
            f"{FARTHEST:g}.",
        )
    if pose is not None and abs(pose[2]) > np.pi:
        raise laser.fault("pose", "x, y and a heading from -pi to pi, in radians")
    return LaserRobot(
        name=file.text_or_none("name"),
        topic=laser.text_or_none("topic"),
        odometry_topic=topics.text_or_none("odometry"),
        source=laser.text_or_none("source"),
        pose=pose,
        min_range=least,
        max_range=most,
        odometry=laser.choice("odometry", "auto", ("auto", "wheels", "none")),
        max_gap=laser.number("max_gap", LaserRobot.max_gap, above=0),
        odom_frame=laser.text_or_none("odom_frame") or LaserRobot.odom_frame,
        leaning=Leaning(*(laser.number(name, above=0) if laser.has(name) else None for name in ("max_tilt", "height"))),
        time_offset=laser.number("time_offset", 0.0),
        settings=settings_in(laser, Settings, Path(laser.file).parent),
        prior=read_prior(file.table("prior")) if file.has("prior") else None,
        imu=imu_in(file),
        world=world_in(file),
    )
