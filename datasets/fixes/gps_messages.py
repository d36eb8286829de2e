"""Reads sensor_msgs/NavSatFix of a ROS bag: WGS84 degrees, with the covariance of east and north."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...core.errors import InputError
from ...core.se2 import Array
from ..bags.bag import Bag, Topic
from ..bags.columns import columns
from ..bags.topics import choose
from .degrees import Degrees
from .robot import GpsTable

NAVSAT = "sensor_msgs/msg/NavSatFix"

NO_FIX = 0  # of a status; below it the receiver has none

UNKNOWN = 0  # kind of a covariance


def read_gps_messages(bag: Bag, listed: Sequence[Topic], table: GpsTable, remarks: list[str]) -> Degrees | None:
    """The positions of the only topic of its type, or of the one that [gps] names; None without one.

    `remarks` grows by messages without a fix. InputError where most have none, and for covariances that are not.
    """
    topic = choose(bag.path, listed, table.topic, "[gps] topic in robot.toml", (NAVSAT,))
    if topic is None:
        return None
    where = f"{bag.path}: topic {topic.name}"
    t, found = columns(bag, topic, _row, remarks, faults=_unusable)
    if table.sd is not None:
        return Degrees(where, t, found[:, 1:3], None)
    kind, cov = found[:, 3], found[:, [4, 5, 5, 6]].reshape(-1, 2, 2)
    if (kind == UNKNOWN).all():
        return Degrees(where, t, found[:, 1:3], None)
    finite = np.where(np.isfinite(cov), cov, 0.0)
    sound = (np.linalg.eigvalsh(finite)[:, 0] > 0) & (finite == cov).all(axis=(1, 2)) & (kind != UNKNOWN)
    for row in np.flatnonzero(~sound)[:1]:
        said = "unknown" if kind[row] == UNKNOWN else f"{cov[row].ravel().tolist()} m^2 of east and north"
        raise InputError(
            f"{where}: {int((~sound).sum())} of {len(sound)} messages have a covariance that is none, the first, at "
            f"{t[row]:.10g} s, {said}; expected variances above 0, or [gps] sd in robot.toml."
        )
    return Degrees(where, t, found[:, 1:3], cov)


def _row(message: Any) -> tuple[float, ...]:
    cov = message.position_covariance
    return (
        message.status.status, message.latitude, message.longitude, message.position_covariance_type, cov[0], cov[1],
        cov[4],
    )  # fmt: skip


def _unusable(found: Array, t: Array) -> dict[int, str]:  # noqa: ARG001 - at any time
    """The rows that are no position, and why."""
    status, (latitude, longitude) = found[:, 0], found[:, 1:3].T
    faults = dict.fromkeys(np.flatnonzero(status < NO_FIX).tolist(), "has no fix by its status")
    with np.errstate(invalid="ignore"):
        wrong = ~((np.abs(latitude) <= 90) & (np.abs(longitude) <= 360))
    for row in np.flatnonzero(wrong).tolist():
        swapped = "; perhaps they are swapped" if abs(latitude[row]) > 90 >= abs(longitude[row]) else ""
        faults.setdefault(
            row,
            f"has latitude {latitude[row]!s} and longitude {longitude[row]!s}, expected at most 90 and 360 "
            f"degrees{swapped}",
        )
    return faults
