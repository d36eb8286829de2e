"""Reads sensor_msgs/Imu and sensor_msgs/MagneticField of a ROS bag.

A covariance whose first number is -1 says that its part is not given. The orientation of a message is not read: a
driver computes it from the same rates, accelerations and fields, so that it would count these twice.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...core.errors import InputError
from ...core.se2 import Array
from ...core.table import HUGE
from ..bags.bag import Bag, Topic
from ..bags.clock import BACK
from ..bags.columns import columns
from ..bags.topics import choose, plain
from .imu_csv import Raw

IMU, MAGNETIC = "sensor_msgs/msg/Imu", "sensor_msgs/msg/MagneticField"

NOT_GIVEN = -1.0  # in the first place of a covariance


def read_imu_messages(
    bag: Bag, listed: Sequence[Topic], topic: str | None, magnetometer: str | None, remarks: list[str]
) -> tuple[Raw, str] | None:
    """The readings of the only topic of its type, or of the one that is named, and its name; None without one.

    `remarks` grows. InputError for several topics without a choice, one without rates, and most messages unusable.
    """
    chosen = choose(bag.path, listed, topic, "[imu] topic in robot.toml", (IMU,))
    if chosen is None:
        return None
    first: Any = next((one for one in bag.contents(chosen.name) if one is not None), None)
    if first is not None and first.angular_velocity_covariance[0] == NOT_GIVEN:
        raise InputError(
            f"{bag.path}: the messages of topic {chosen.name} say that they have no angular velocity (a covariance "
            "that begins with -1), expected a gyro's rates."
        )
    with_force = first is None or first.linear_acceleration_covariance[0] != NOT_GIVEN
    t, found = columns(bag, chosen, _row, remarks, BACK, _no_readings)
    accel = found[:, 3:] if with_force and found[:, 3:].any() else None
    if len(t) < 2:
        raise InputError(f"{bag.path}: found {len(t)} messages of topic {chosen.name}, expected at least 2.")
    mag = _magnetic(bag, listed, magnetometer, t, remarks)
    frame = "" if first is None else first.header.frame_id.strip("/")
    return Raw(t, found[:, :3], accel, mag, {}, frame), chosen.name


def _magnetic(bag: Bag, listed: Sequence[Topic], named: str | None, t: Array, remarks: list[str]) -> Array | None:
    """(n, 3) the magnetometer's readings, each in the row of `t` (n,) that is nearest in time; NaN in other rows."""
    topic = choose(bag.path, listed, named, "[imu] magnetometer_topic in robot.toml", (MAGNETIC,))
    if topic is None:
        return None
    at, found = columns(bag, topic, _field, remarks, BACK, _no_readings)
    after = np.clip(np.searchsorted(t, at), 1, len(t) - 1)
    row = after - (at - t[after - 1] < t[after] - at)
    near = np.abs(at - t[row]) <= float(np.median(np.diff(t)))
    mag = np.full((len(t), 3), np.nan)
    mag[row[near]] = found[near]
    if not near.any():
        remarks.append(
            f"{bag.path}: no message of topic {topic.name} ({plain(MAGNETIC)}) is at the time of a message of the IMU: "
            "the magnetometer is not used"
        )
        return None
    return mag


def _row(message: Any) -> tuple[float, ...]:
    rate, force = message.angular_velocity, message.linear_acceleration
    return rate.x, rate.y, rate.z, force.x, force.y, force.z


def _field(message: Any) -> tuple[float, ...]:
    field = message.magnetic_field
    return field.x, field.y, field.z


def _no_readings(found: Array, t: Array) -> dict[int, str]:  # noqa: ARG001 - at any time
    with np.errstate(invalid="ignore"):
        wrong = np.flatnonzero(~(np.abs(found) <= HUGE).all(axis=1))
    return {row: f"has the readings {found[row].tolist()}, expected finite numbers" for row in wrong.tolist()}
