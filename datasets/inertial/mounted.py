"""The axes of an inertial measurement unit on the robot: by robot.toml, else by tf, else by gravity."""

from typing import NamedTuple

import numpy as np

from ...core.se2 import Array
from .units import ROBOT_SAYS, Says

TILTED = 20.0  # degrees from the robot's z axis beyond which gravity says that the axes are others
ELSEWHERE = 5.0  # degrees by which tf and robot.toml may differ without a remark


class Placed(NamedTuple):
    """The axes and the place of a unit on the robot."""

    turn: Array  # (3, 3) from its axes to the robot's
    arm: Array  # (3,) m, its place
    words: str
    told: bool = True  # by robot.toml or tf; False: taken to be so


def placed(
    where: str,
    accel: Array | None,
    given: Array | None,
    by_tf: Array | None,
    frame: str,
    remarks: list[str],
    says: Says = ROBOT_SAYS,
) -> Placed:
    """The mounting (4, 4) that is `given`, as `says` names it, else that of tf's `frame`; without both the robot axes.

    Where gravity, as the median of `accel` (n, 3) has it, says that z points elsewhere, a mounting that was given
    stays, and axes of which nothing was said are turned the shortest way. Both are a remark in `remarks`.
    """
    pose, words = np.eye(4), "its axes are taken to be the robot's"
    if given is not None:
        pose, words = given, f"mounted as {says.mounted} says"
        if by_tf is not None and (off := _angle(given[:3, :3].T @ by_tf[:3, :3])) > ELSEWHERE:
            remarks.append(
                f"{where}: [imu] mounting, which is used, is turned by {off:.0f} degrees from where tf has {frame}"
            )
    elif by_tf is not None:
        pose, words = by_tf, f"mounted as tf has {frame}"
    turn, arm = pose[:3, :3], pose[:3, 3]
    told = given is not None or by_tf is not None
    if accel is None:
        return Placed(turn, arm, words, told)
    up = turn @ np.median(accel, axis=0)
    up = up / np.linalg.norm(up)
    tilt = float(np.rad2deg(np.arccos(np.clip(up[2], -1, 1))))
    if tilt <= TILTED:
        return Placed(turn, arm, words, told)
    shown = ", ".join(f"{one:+.2f}" for one in up)
    found = f"{where}: gravity is {tilt:.0f} degrees from the z axis (up is {shown})"
    if given is not None or by_tf is not None:
        remarks.append(
            f"{found}, {words}: expected it along z of a robot on a floor; perhaps the mounting is another, or the "
            "accelerometer's sign"
        )
        return Placed(turn, arm, words)
    upside = tilt > 180 - TILTED
    taken = "upside down" if upside else "turned so"
    ahead = "" if upside else "; where it looks is not known, so that pitch and roll may be exchanged"
    remarks.append(
        f"{found} and nothing says how it is mounted: taken to be {taken}, and turned back{ahead}; {says.mounting} says"
    )
    words = "upside down by gravity" if upside else f"turned by {tilt:.0f} degrees by gravity"
    return Placed(_upwards(up), arm, words, told=False)


def _upwards(up: Array) -> Array:
    """(3, 3) the shortest rotation that turns the direction `up` (3,) to z; about x where it is right below."""
    if up[2] < -1 + 1e-9:
        return np.diag([1.0, -1.0, -1.0])
    x, y, z = up
    cross = np.array([[0.0, 0.0, -x], [0.0, 0.0, -y], [x, y, 0.0]])
    return np.eye(3) + cross + cross @ cross / (1 + z)


def _angle(turn: Array) -> float:
    """Degrees of a rotation (3, 3)."""
    return float(np.rad2deg(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1))))
