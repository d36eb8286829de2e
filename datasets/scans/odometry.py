"""A bag's odometry at the times of its scans: of nav_msgs/Odometry, else of tf's transform of the robot."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from ...core.se2 import Array, between, compose
from ...frontend.wheels.track import Poses
from ..bags.bag import Bag, Topic
from ..bags.odometry import ODOMETRY, Odometry, find_odometry
from ..bags.topics import found as topics
from ..bags.topics import plain
from ..bags.transforms import Transforms
from .robot import LaserRobot

FASTEST = 20.0  # m/s, the median while it moves: no robot in the reach of a scanner is faster, but one in centimetres

UNMOVED = "its odometry never moves: the front end goes by the scans alone"


class Covered(NamedTuple):
    """The scans that have odometry."""

    rows: NDArray[np.bool_]  # (n,) of all scans
    poses: Array | None  # (k, 3) the odometry at these; None: none is used


def read_odometry(
    bag: Bag, listed: Sequence[Topic], transforms: Transforms, robot: LaserRobot, remarks: list[str]
) -> Odometry | None:
    """The bag's odometry as the robot wants it, None for none; `remarks` grows.

    InputError for a topic that is ambiguous or has other contents, and for wheels that are asked for and not there.
    """
    if robot.odometry == "none":
        return None
    found = find_odometry(bag, listed, transforms, robot.odometry_topic, robot.odom_frame, remarks)
    if found is not None:
        return found
    missing = f"has no odometry, neither {plain(ODOMETRY)} nor a transform of tf from {robot.odom_frame!r}"
    if robot.odometry == "wheels":
        raise InputError(f'{bag.path}: {missing}, expected it for [laser] odometry = "wheels"; {topics(listed)}')
    remarks.append(f"{bag.path}: {missing}: the front end goes by the scans alone")
    return None


def covered(path: Path, t: Array, odometry: Odometry, robot: LaserRobot, remarks: list[str]) -> Covered:
    """The scans at `t` (n,) that have odometry, and its poses there; `remarks` grows by those that are left out.

    InputError where there are not two such scans, where the odometry is faster than any robot, and where it never moves
    and wheels are asked for.
    """
    readings = odometry.readings
    here, at = interpolated(readings, t, robot.max_gap)
    if here.sum() < 2:
        raise InputError(
            f"{path}: {'none' if not here.any() else 'only one'} of the {len(t)} scans has odometry: scans are from "
            f"{t[0]} to {t[-1]} s, readings of {odometry.source} from {readings.t[0]} to {readings.t[-1]} s, expected "
            f"two readings at most {robot.max_gap:g} s apart around each scan."
        )
    if (at[here] == at[here][0]).all():
        if robot.odometry == "wheels":
            raise InputError(f'{path}: {odometry.source} never moves, expected [laser] odometry = "none".')
        remarks.append(UNMOVED)
        return Covered(np.ones(len(t), bool), None)
    speed = np.hypot(*np.diff(at[here][:, :2], axis=0).T) / np.diff(t[here])
    if (speed > 0).any() and (median := float(np.median(speed[speed > 0]))) > FASTEST:
        raise InputError(
            f"{path}: {odometry.source} goes at {median:.3g} m/s (median while it moves), expected at most {FASTEST:g}"
            ' m/s: perhaps it is in centimetres or millimetres; [laser] odometry = "none" goes by the scans alone.'
        )
    if not here.all():
        remarks.append(
            f"{int((~here).sum())} of {len(t)} scans have no odometry within {robot.max_gap:g} s around them and are "
            "left out"
        )
    return Covered(here, at[here])


def interpolated(readings: Poses, t: Array, gap: float) -> tuple[NDArray[np.bool_], Array]:
    """Which of the times `t` (n,), s, lie between readings at most `gap` s apart, and the poses (n, 3) at all of them.

    Between two readings the robot moves evenly along the line, and turns evenly; at a reading the pose is its pose.
    """
    last = len(readings.t) - 1
    before = np.clip(np.searchsorted(readings.t, t, side="right") - 1, 0, last)
    after = np.minimum(before + 1, last)
    apart = readings.t[after] - readings.t[before]
    share = np.clip((t - readings.t[before]) / np.where(apart > 0, apart, 1.0), 0.0, 1.0)
    first = readings.poses[before]
    motion = between(first, readings.poses[after])
    exact = readings.t[before] == t
    here = exact | ((readings.t[0] <= t) & (t <= readings.t[-1]) & (apart <= gap))
    return here, np.where(exact[:, None], first, compose(first, motion * share[:, None]))
