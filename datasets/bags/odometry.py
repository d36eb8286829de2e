"""The odometry that a robot integrated itself: a bag's nav_msgs/Odometry, or tf's transform of the robot."""

from collections.abc import Sequence
from typing import NamedTuple

from ...frontend.wheels.track import Poses
from .bag import Bag, Topic
from .clock import BACK
from .columns import poses
from .topics import choose
from .transforms import Transforms

ODOMETRY = "nav_msgs/msg/Odometry"

FRAME = "odom"  # tf's frame of the odometry, unless another one is named


class Odometry(NamedTuple):
    """Poses that the robot integrated itself."""

    source: str  # the topic, or the transform
    base: str | None  # the frame whose poses they are, if named
    readings: Poses


def find_odometry(
    bag: Bag, listed: Sequence[Topic], transforms: Transforms, topic: str | None, frame: str, remarks: list[str]
) -> Odometry | None:
    """The odometry of the `topic`, else of the only one of its type, else of tf from `frame`; None if there is none.

    `remarks` grows. InputError for a topic that is ambiguous or has other contents.
    """
    chosen = choose(bag.path, listed, topic, "[topics] odometry or the option odometry", (ODOMETRY,))
    if chosen is not None:
        readings = poses(bag, chosen, remarks, BACK)
        frames = (one.child_frame_id.strip("/") for one in bag.contents(chosen.name) if one is not None)
        return Odometry(chosen.name, next(frames, "") or None, readings)
    by_tf = transforms.odometry(frame)
    return None if by_tf is None else Odometry(f"tf from {frame} to {by_tf[0]}", *by_tf)
