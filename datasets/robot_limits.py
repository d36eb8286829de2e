"""The values that a robot.toml may have: those beyond are of no robot, but of another unit."""

from collections.abc import Collection, Iterator, Mapping
from typing import Any

from ..core.toml.table import TomlTable, is_number
from ..frontend.plausible import DEGREES, LENGTHS, SECONDS, Measure, of_units

_PLACE = Measure("metres", -5.0, 5.0, LENGTHS, (0.01, 1.0))  # on the robot
_ROLL = Measure("radians", -3.15, 3.15, DEGREES)  # 3.15: half a turn, rounded
_PITCH = Measure("radians", -1.58, 1.58, DEGREES)  # beyond a quarter of a turn it would be another roll and yaw
_SHORT = Measure("seconds", 0.0, 0.5, SECONDS, (1e-6, 0.5))  # the slowest sensors take 0.1 s for all rows
_COUNT = Measure(
    "metres per count",
    -1.0,
    1.0,
    (("counts per metre", lambda value: 1 / value), *of_units(("millimetres", 1e-3))),
    (1e-7, 0.05),
)
_WIDTH = Measure("metres", 0.01, 10.0, LENGTHS, (0.05, 1.0))
_SPEED = Measure("metres per second", 0.0, 100.0, LENGTHS, (0.05, 5.0))
_REACH = Measure("metres", 0.0, 100.0, LENGTHS[::-1], (1.0, 50.0))  # 3000 is 3 m rather than 30 m
_NEAR = Measure("metres", 0.0, 100.0, LENGTHS, (0.02, 1.0))
_SHARE = Measure("a share of 1", 0.0, 1.0, of_units(("percent", 1e-2)))
_SD = Measure("metres", 0.0, 1.0, of_units(("millimetres", 1e-3)), (0.0, 0.1))
_SD_ANGLE = Measure("radians", 0.0, 0.8, DEGREES, (0.0, 0.5))
_FORWARD = Measure("metres per root metre", 0.0, 2.0, LENGTHS, (0.0, 0.5))
_TURNING = Measure("radians per root metre", 0.0, 2.0, DEGREES, (0.0, 0.5))
_BY_TURN = Measure("radians per root radian", 0.0, 2.0, DEGREES, (0.0, 0.5))
_TILT = Measure("radians", 0.0, 0.2, DEGREES, (0.0, 0.2))  # 0.2: a robot that rocks by 11 degrees

LIMITS: Mapping[str, list[Measure]] = {
    "camera.mounting.xyz": [_PLACE],
    "camera.mounting.rpy": [_ROLL, _PITCH, _ROLL],
    "camera.mounting.matrix": [_PLACE],
    "camera.exposure": [_SHORT],
    "camera.readout": [_SHORT],
    "markers.max_range": [_REACH],
    "markers.max_distance": [_REACH],
    "encoder.left": [_COUNT],
    "encoder.right": [_COUNT],
    "encoder.base": [_WIDTH],
    "encoder.k": [Measure("metres per root metre or a share", 0.0, 0.5, of_units(("millimetres", 1e-3)), (0.0, 0.2))],
    "encoder.interval": [Measure("seconds", 0.0, 10.0, SECONDS, (1e-4, 1.0))],
    "encoder.max_speed": [_SPEED],
    "encoder.floors.position": [_SD],
    "encoder.floors.heading": [_SD_ANGLE],
    "odometry.forward": [_FORWARD],
    "odometry.turning": [_TURNING],
    "odometry.turning_by_turn": [_BY_TURN],
    "odometry.max_speed": [_SPEED],
    "odometry.floors.position": [_SD],
    "odometry.floors.heading": [_SD_ANGLE],
    "commands.full": [_SPEED],
    "commands.base": [_WIDTH],
    "commands.delay": [Measure("seconds", -10.0, 10.0, SECONDS, (1e-3, 5.0))],
    "commands.forward": [_FORWARD],
    "commands.turning": [_TURNING],
    "commands.turning_by_turn": [_BY_TURN],
    "commands.max_speed": [_SPEED],
    "commands.floors.position": [_SD],
    "commands.floors.heading": [_SD_ANGLE],
    "drift.position": [Measure("metres per root second", 0.0, 20.0, LENGTHS, (0.0, 5.0))],
    "drift.turning": [Measure("radians per root second", 0.0, 20.0, DEGREES, (0.0, 10.0))],
    "drift.floors.position": [_SD],
    "drift.floors.heading": [_SD_ANGLE],
    "noise.k_range": [_SHARE],
    "noise.k_bearing": [_SHARE],
    "noise.floor_range": [_SD],
    "noise.floor_bearing": [_TILT],
    "noise.sway": [_TILT],
    "frames.fps": [Measure("frames per second", 0.001, 10_000.0)],
    "depth.pose.xyz": [_PLACE],
    "depth.pose.rpy": [_ROLL, _PITCH, _ROLL],
    "depth.pose.matrix": [_PLACE],
    "depth.units": [Measure("units per metre", 1.0, 1e6, (("metres per unit", lambda value: 1 / value),))],
    "depth.within": [Measure("seconds", 0.0, 10.0, SECONDS, (1e-4, 1.0))],
    "imu.mounting.xyz": [_PLACE],
    "imu.mounting.rpy": [_ROLL, _PITCH, _ROLL],
    "imu.mounting.matrix": [_PLACE],
    "imu.time_offset": [Measure("seconds", -10.0, 10.0, SECONDS, (1e-3, 5.0))],
    "laser.pose": [_PLACE, _PLACE, _ROLL],
    "laser.min_range": [_NEAR],
    "laser.max_range": [_REACH],
    "laser.max_tilt": [Measure("radians", 0.0, 0.5, DEGREES)],  # no robot with a scanner of one plane drives beyond
    "laser.max_gap": [Measure("seconds", 0.0, 100.0, SECONDS, (0.05, 10.0))],
}
"""Dotted keys of numbers -> their measure; of lists, that of all or of each number in them."""

OF_CAMERAS = ("camera", "frames")
"""Tables whose keys are those of each of several cameras."""


def check_limits(file: TomlTable, cameras: Collection[str] = ()) -> None:
    """Raises InputError for the first number of a robot.toml, already read, that no robot has.

    `cameras` are the names of several, whose tables in [camera] have the keys of [frames] as well.
    """
    for dotted, measures in LIMITS.items():
        head, *path, key = dotted.split(".")
        for place in [("camera", name) for name in cameras] if cameras and head in OF_CAMERAS else [(head,)]:
            table = file
            for name in (*place, *path):
                table = table.table(name)
            numbers = list(_numbers(table.entries.get(key)))
            for measure, value in zip(measures * (len(numbers) if len(measures) == 1 else 1), numbers, strict=False):
                if (odd := measure.odd(value)) is not None:
                    raise table.refused(key, f"{odd}.")


def _numbers(value: Any) -> Iterator[float]:
    if is_number(value):
        yield float(value)
    elif isinstance(value, list):
        for one in value:
            yield from _numbers(one)
