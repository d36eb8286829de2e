"""Messages of a topic as columns: integrated poses of nav_msgs/Odometry, or whatever numbers a message has."""

from collections.abc import Callable
from typing import Any

import numpy as np

from ...core.errors import InputError
from ...core.se2 import Array
from ...core.table import HUGE
from ...frontend.wheels.motion import Poses
from .bag import Bag, Topic

BACK = 1.0
"""s that stamps may go back from one message to the next: messages overtake each other, but no clock is set back."""

LEVEL = np.cos(np.deg2rad(30))
"""Cosine of the largest angle between the robot's z axis and the world's on a level floor."""


def poses(bag: Bag, topic: Topic, remarks: list[str], back: float = np.inf) -> Poses:
    """The poses of a topic of nav_msgs/Odometry; `remarks` grows by what is odd.

    InputError for messages that cannot be read, stamps that go `back`, s, and for a robot that is not on a floor.
    """

    def row(message: Any) -> tuple[float, ...]:
        place, turn = message.pose.pose.position, message.pose.pose.orientation
        return place.x, place.y, turn.x, turn.y, turn.z, turn.w

    return planar(f"{bag.path}: topic {topic.name}", *columns(bag, topic, row, remarks, back))


def planar(where: str, t: Array, found: Array) -> Poses:
    """Poses (m, 3) of the rows x, y, qx, qy, qz, qw (m, 6) at `t` (m,), s; InputError, after `where`, as in `poses`."""
    x, y, z, w = found[:, 2:].T
    with np.errstate(over="ignore"):
        norm = np.linalg.norm(found[:, 2:], axis=1)
    for one in np.flatnonzero(np.abs(norm - 1) > 1e-2):
        raise InputError(f"{where} at {t[one]} s: the orientation's quaternion has length {norm[one]:.3g}, expected 1.")
    upright = (w**2 + z**2 - x**2 - y**2) / norm**2
    for one in np.flatnonzero(upright < LEVEL):
        tilt = np.rad2deg(np.arccos(np.clip(upright[one], -1, 1)))
        raise InputError(
            f"{where} at {t[one]} s: the robot is tilted by {tilt:.0f} degrees, expected one that drives on a floor."
        )
    heading = np.arctan2(2 * (w * z + x * y), w**2 + x**2 - y**2 - z**2)
    return Poses(t, np.column_stack((found[:, :2], heading)))


def columns(
    bag: Bag, topic: Topic, row: Callable[[Any], tuple[float, ...]], remarks: list[str], back: float = np.inf
) -> tuple[Array, Array]:
    """Times (m,), s, strictly increasing, and the `row` (m, k) of each message; of equal times the last counts."""
    at = dict[int, tuple[float, ...]]()
    messages = untimed = latest = 0
    for message in bag.messages(topic.name):
        messages, untimed = messages + 1, untimed + message.untimed
        if message.content is None:
            raise InputError(f"{bag.path}: message {messages} of topic {topic.name} cannot be read.")
        check_clock(bag, topic, messages, message.nanoseconds, latest if messages > 1 else message.nanoseconds, back)
        latest = message.nanoseconds
        at[latest] = row(message.content)
    if not at:
        raise InputError(f"{bag.path}: none of the {topic.messages} messages of topic {topic.name} can be read.")
    if len(at) < messages / 2:
        raise InputError(
            f"{bag.path}: the {messages} messages of topic {topic.name} have only {len(at)} distinct times, expected "
            "headers with the time of each reading, or zero times."
        )
    remarks += of_untimed(bag, topic, untimed)
    rows = np.array([at[time] for time in sorted(at)], float)
    t = np.array([time / 10**9 for time in sorted(at)])
    for one in np.flatnonzero(~(np.abs(rows) <= HUGE).all(axis=1)):
        raise InputError(f"{bag.path}: topic {topic.name} at {t[one]} s: found {rows[one]}, expected finite numbers.")
    return t, rows


def check_clock(bag: Bag, topic: Topic, number: int, now: int, before: int, back: float = BACK) -> None:
    """Raises InputError if message `number`, at `now` ns, is more than `back` s earlier than the one `before`."""
    if before - now > back * 1e9:
        raise InputError(
            f"{bag.path}: message {number} of topic {topic.name} is at {now / 1e9} s, {(before - now) / 1e9:.6g} s "
            "before the message received before it; expected one clock that goes forward."
        )


def of_untimed(bag: Bag, topic: Topic, untimed: int) -> list[str]:
    """The remark on messages whose headers have no time, where the others of their topic have."""
    if not untimed:
        return []
    found = f"{untimed} of {topic.messages} messages of topic {topic.name} have the time 0 in their headers"
    return [f"{bag.path}: {found}: theirs is that of their reception, less the others' delay"]
