"""Reads recordings in ROS bags: a ROS 1 .bag, a ROS 2 folder (sqlite3 or mcap), a single .mcap or .db3.

Frames are sensor_msgs/Image or CompressedImage. The motion is that of the original ArUco EKF system, a
geometry_msgs/QuaternionStamped with four cumulative counts (x and y of the wheels on the left, z and w of those on the
right, averaged per side), or a nav_msgs/Odometry, or commands: geometry_msgs/Twist or TwistStamped. Times are those of
the messages' headers, or of reception if these are zero or there are none.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.se2 import Array
from ...frontend.markers.pipeline import Frame
from ...frontend.wheels.commands import Speeds
from ...frontend.wheels.counters import unwrap
from ...frontend.wheels.ticks import Ticks
from ..bags import images
from ..bags.bag import Bag, Topic
from ..bags.camera_info import Recorded, camera_of
from ..bags.cameras import COMPRESSED, IMAGE, in_order, info_beside
from ..bags.columns import SPEEDS, columns, no_numbers, of_untimed, poses
from ..bags.left_out import LeftOut
from ..bags.odometry import ODOMETRY
from ..bags.topics import choose, found, plain, shown
from ..bags.window import window_of
from ..readings import Readings
from ..tags.tag_messages import TYPES, read_tag_messages
from .streams import Streams

ENCODER = "geometry_msgs/msg/QuaternionStamped"
TWISTS = ("geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/Twist")

FASTEST = 1000.0  # m/s and rad/s; a message with more is left out


class Topics(NamedTuple):
    """Topics of a bag's streams; None: the only topic of a fitting type."""

    image: str | None = None
    encoder: str | None = None
    odometry: str | None = None
    camera_info: str | None = None
    commands: str | None = None
    tags: str | None = None  # used in place of images


def read(
    path: Path,
    topics: Topics,
    counter_bits: int | None = None,
    *,
    commands: bool = False,
    camera: str = "",
    motion: bool = True,
) -> Streams:
    """The recording in the bag at `path`; its frames are read on demand.

    Of several cameras it is that of the one called `camera`, whose topic may have tags as well as images. `motion`:
    with the readings. Counters `counter_bits` wide are unwrapped before those of one side are averaged. `commands`
    count where nothing of the motion was measured, or where `topics` names them. InputError for a bag that is invalid,
    empty or damaged, a topic that is missing or ambiguous, and for messages with implausible contents; for images, as
    they are read.
    """
    bag = Bag(path)
    listed = bag.listed()
    if not any(topic.messages for topic in listed):
        raise InputError(f"{path}: contains no messages, expected a recording.")
    if topics.image is not None and topics.tags is not None:
        raise InputError(f"{path}: [topics] names both image and tags, expected the one to use.")
    remarks = bag.remarks()
    table, images = "[topics]", (IMAGE, COMPRESSED)
    if camera:
        table = f"[camera.{camera}]"
        frames = choose(path, listed, topics.image, f"{table} topic", (*images, *TYPES))
    else:
        frames = None if topics.tags else choose(path, listed, topics.image, "[topics] image", images)
        frames = frames or choose(path, listed, topics.tags, "[topics] tags", TYPES)
    if frames is None:
        raise InputError(
            f"{path}: has no topic with images ({plain(IMAGE)} or CompressedImage) or tags ({plain(TYPES[0])} and the "
            f"like); {found(listed)}"
        )
    info = info_beside(path, listed, topics.camera_info, f"{table} camera_info", frames)
    recorded = Recorded(None) if info is None else camera_of(bag, info, frames, remarks)
    tags = read_tag_messages(bag, frames, remarks) if frames.type in TYPES else None
    return Streams(
        frames=_Images(bag, frames, remarks) if tags is None else (),
        length=frames.messages if tags is None else len(tags),
        readings=_readings(bag, listed, topics, counter_bits, remarks, commands=commands) if motion else None,
        camera=recorded.camera,
        lacking=recorded.lacking,
        topic=frames.name,
        truth=None,
        remarks=remarks,
        window=None if info is None or tags is not None else window_of(bag, info, frames),
        tags=tags,
    )


@dataclass(frozen=True)
class _Images:
    """The images of a topic, sorted by their headers' times."""

    bag: Bag
    topic: Topic
    remarks: list[str]  # grows at the end

    def __iter__(self) -> Iterator[Frame]:
        decode = images.raw if self.topic.type == IMAGE else images.compressed
        count, untimed, decoded, example = 0, 0, False, None
        left_out = LeftOut(str(self.bag.path), "image", f"of topic {self.topic.name}")
        for message in in_order(self.bag.messages(self.topic.name), left_out):
            image = None if message.content is None else decode(message.content)
            untimed += message.untimed
            count, decoded, example = count + 1, decoded or image is not None, example or message.content
            yield Frame(message.nanoseconds / 10**9, image)
        self.remarks.extend(left_out.remarks(count + left_out.count))
        self.remarks.extend(of_untimed(self.bag, self.topic, untimed))
        if count and not decoded:
            kind = getattr(example, "encoding", getattr(example, "format", "of unknown layout"))
            expected = "a format that OpenCV reads" if decode is images.compressed else ", ".join(images.ENCODINGS)
            raise InputError(
                f"{self.bag.path}: none of the {count} images of topic {self.topic.name} can be decoded; found "
                f"{kind!r}, expected {expected}."
            )


def _readings(
    bag: Bag,
    listed: Sequence[Topic],
    topics: Topics,
    counter_bits: int | None,
    remarks: list[str],
    *,
    commands: bool,
) -> Readings | None:
    sources = ("encoder", "odometry", "commands")
    named = [one for one in sources if getattr(topics, one) is not None]
    if len(named) > 1:
        raise InputError(f"{bag.path}: [topics] names both {' and '.join(named)}, expected the one to use.")

    def chosen(source: str, types: tuple[str, ...]) -> Topic | None:
        if named not in ([], [source]):
            return None
        return choose(bag.path, listed, getattr(topics, source), f"[topics] {source}", types)

    encoder, odometry = chosen("encoder", (ENCODER,)), chosen("odometry", (ODOMETRY,))
    if encoder is not None and odometry is not None:
        raise InputError(
            f"{bag.path}: found both {shown(encoder)} and {shown(odometry)}, expected [topics] "
            "encoder or odometry to name the one to use."
        )
    if encoder is not None:
        t, turned = columns(bag, encoder, _turned, remarks)
        if len(t) > 1 and np.allclose(np.linalg.norm(turned, axis=1), 1, atol=1e-3):
            raise InputError(
                f"{bag.path}: topic {encoder.name} holds orientations, expected the wheels' cumulative counts."
            )
        if counter_bits is not None:
            turned = unwrap(turned, counter_bits)
        return Ticks(t, turned.reshape(-1, 2, 2).mean(axis=2))
    if odometry is not None:
        return poses(bag, odometry, remarks)
    told = chosen("commands", TWISTS) if commands or named else None
    return None if told is None else Speeds(*columns(bag, told, _told, remarks, faults=_no_speeds))


def _told(message: Any) -> tuple[float, ...]:
    twist = getattr(message, "twist", message)
    return twist.linear.x, twist.angular.z


def _no_speeds(found: Array, t: Array) -> dict[int, str]:  # noqa: ARG001 - at any time
    return no_numbers(found, FASTEST, SPEEDS)


def _turned(message: Any) -> tuple[float, ...]:
    counts = message.quaternion
    return counts.x, counts.y, counts.z, counts.w
