"""[imu] of a robot.toml, of a robot of any kind.

    [imu]        topic, magnetometer_topic                             in a bag with several
                 mounting = {xyz, rpy} or {matrix}                     of its axes on the robot's
                 gyro, accelerometer, magnetometer                     units, where nothing else says them
                 columns                                               of an imu.csv without a header
                 time_offset

Lengths are in m, angles in rad, times in s.
"""

from dataclasses import dataclass
from typing import Any

from ...core.se2 import Array
from ...core.toml.table import TomlTable
from ...frontend.camera.mounting import from_rpy
from ...frontend.camera.mounting import mounting as ahead
from ..robot_tables import pose_in
from .units import ROBOT_SAYS, UNITS, Says

KEYS = (
    "topic", "magnetometer_topic", "mounting", "gyro", "accelerometer", "magnetometer", "columns", "time_offset",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class ImuTable:
    """The table; None is what it does not say."""

    topic: str | None = None
    magnetometer_topic: str | None = None
    mounting: Array | None = None  # (4, 4) T_robot_imu
    gyro: str | None = None  # a unit
    accelerometer: str | None = None
    magnetometer: str | None = None
    columns: tuple[str, ...] | None = None
    time_offset: float = 0.0  # s, added to its times to get those of the motion's readings
    says: Says = ROBOT_SAYS

    @property
    def words(self) -> dict[str, Any]:
        """The table as TOML has it, None where it says nothing."""
        said = {key: getattr(self, key) for key in KEYS}
        said["mounting"] = None if self.mounting is None else {"matrix": self.mounting.tolist()}
        said["columns"] = None if self.columns is None else list(self.columns)
        return said | {"time_offset": self.time_offset or None}


def imu_in(file: TomlTable) -> ImuTable | None:
    """[imu] of a robot.toml; None without one. InputError names a fault's line and key."""
    if not file.has("imu"):
        return None
    table = file.table("imu").only(KEYS)
    units = {key: table.choice(key, None, tuple(UNITS[key])) for key in ("gyro", "accelerometer", "magnetometer")}
    return ImuTable(
        topic=table.text_or_none("topic"),
        magnetometer_topic=table.text_or_none("magnetometer_topic"),
        mounting=_mounting(table) if table.has("mounting") else None,
        columns=tuple(table.names("columns")) if table.has("columns") else None,
        time_offset=table.number("time_offset", 0.0),
        gyro=units["gyro"],
        accelerometer=units["accelerometer"],
        magnetometer=units["magnetometer"],
    )


def turned(roll: float, pitch: float, yaw: float) -> Array:
    """(4, 4) T_robot_imu at the robot's origin, turned about its x axis first, then y, then z, rad."""
    return from_rpy((0, 0, 0), (roll, pitch, yaw)) @ ahead(0, 0, 0, 0).T


def _mounting(table: TomlTable) -> Array:
    """T_robot_imu: a pose of a camera's table is of one that looks ahead, a matrix is of the axes themselves."""
    pose = pose_in(table, "mounting")
    if not table.table("mounting").has("matrix"):
        pose = pose @ ahead(0, 0, 0, 0).T
    return pose
