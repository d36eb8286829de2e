"""Reads recordings in ROS bags: a ROS 1 .bag, a ROS 2 folder (sqlite3 or mcap), a single .mcap or .db3.

Frames are sensor_msgs/Image or CompressedImage. The motion is that of the original ArUco EKF system, a
geometry_msgs/QuaternionStamped with four cumulative counts (x and y of the wheels on the left, z and w of those on the
right, averaged per side), or a nav_msgs/Odometry. Times are those of the messages' headers, or of reception if these
are zero.
"""

import heapq
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...frontend.camera.camera import Camera
from ...frontend.errors import InputError
from ...frontend.markers.pipeline import Frame
from ...frontend.se2 import Array
from ...frontend.wheels.counters import unwrap
from ...frontend.wheels.motion import Ticks
from . import rosimage
from .bag import Bag, Message, Topic
from .streams import Poses, Streams

IMAGE, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
ENCODER, ODOMETRY, CAMERA_INFO = (
    "geometry_msgs/msg/QuaternionStamped",
    "nav_msgs/msg/Odometry",
    "sensor_msgs/msg/CameraInfo",
)

WAITING = 4
"""Most images held back for one received late."""

LEVEL = np.cos(np.deg2rad(30))
"""Cosine of the largest angle between the robot's z axis and the world's on a level floor."""


class Topics(NamedTuple):
    """Topics of a bag's streams; None: the only topic of a fitting type."""

    image: str | None = None
    encoder: str | None = None
    odometry: str | None = None
    camera_info: str | None = None


def read(path: Path, topics: Topics, counter_bits: int | None = None) -> Streams:
    """The recording in the bag at `path`; its frames are read on demand.

    Counters `counter_bits` wide are unwrapped before those of one side are averaged. InputError for a bag that is
    invalid, empty or damaged, a topic that is missing or ambiguous, and for messages with implausible contents; for
    images, as they are read.
    """
    bag = Bag(path)
    listed = bag.listed()
    if not any(topic.messages for topic in listed):
        raise InputError(f"{path}: contains no messages, expected a recording.")
    image = _choose(path, listed, topics.image, "image", (IMAGE, COMPRESSED))
    if image is None:
        raise InputError(f"{path}: has no topic with images ({_plain(IMAGE)} or CompressedImage); {_found(listed)}")
    info = _camera_info(path, listed, topics.camera_info, image)
    remarks = list[str]()
    return Streams(
        frames=_Frames(bag, image, remarks),
        length=image.messages,
        readings=_readings(bag, listed, topics, counter_bits, remarks),
        camera=None if info is None else _camera(bag, info),
        truth=None,
        remarks=remarks,
    )


@dataclass(frozen=True)
class _Frames:
    """The images of a topic, sorted by their headers' times."""

    bag: Bag
    topic: Topic
    remarks: list[str]  # grows at the end

    def __iter__(self) -> Iterator[Frame]:
        decode = rosimage.raw if self.topic.type == IMAGE else rosimage.compressed
        count, untimed, decoded, example, latest = 0, 0, False, None, None
        for message in _in_order(self.bag.messages(self.topic.name)):
            if latest is not None and message.nanoseconds == latest.nanoseconds and _alike(message, latest):
                continue  # recorded twice
            latest = message
            image = None if message.content is None else decode(message.content)
            untimed += message.untimed
            count, decoded, example = count + 1, decoded or image is not None, example or message.content
            yield Frame(message.nanoseconds / 10**9, image)
        self.remarks.extend(_of_untimed(self.bag, self.topic, untimed))
        if count and not decoded:
            kind = getattr(example, "encoding", getattr(example, "format", "of unknown layout"))
            expected = "a format that OpenCV reads" if decode is rosimage.compressed else ", ".join(rosimage.ENCODINGS)
            raise InputError(
                f"{self.bag.path}: none of the {count} images of topic {self.topic.name} can be decoded; found "
                f"{kind!r}, expected {expected}."
            )


def _in_order(messages: Iterator[Message]) -> Iterator[Message]:
    """Sorts messages by their own times, as long as each arrives before `WAITING` later ones."""
    waiting = list[tuple[int, int, Message]]()
    for number, message in enumerate(messages):
        heapq.heappush(waiting, (message.nanoseconds, number, message))
        if len(waiting) > WAITING:
            yield heapq.heappop(waiting)[2]
    while waiting:
        yield heapq.heappop(waiting)[2]


def _alike(one: Message, other: Message) -> bool:
    a, b = one.content, other.content
    return a is not None and b is not None and np.array_equal(a.data, b.data)


def _of_untimed(bag: Bag, topic: Topic, untimed: int) -> list[str]:
    """The remark on messages whose headers have no time, where the others of their topic have."""
    if not untimed:
        return []
    found = f"{untimed} of {topic.messages} messages of topic {topic.name} have the time 0 in their headers"
    return [f"{bag.path}: {found}: theirs is that of their reception, less the others' delay"]


def _readings(
    bag: Bag, listed: Sequence[Topic], topics: Topics, counter_bits: int | None, remarks: list[str]
) -> Ticks | Poses | None:
    if topics.encoder is not None and topics.odometry is not None:
        raise InputError(f"{bag.path}: [topics] names both encoder and odometry, expected the one to use.")
    encoder = None if topics.odometry else _choose(bag.path, listed, topics.encoder, "encoder", (ENCODER,))
    odometry = None if topics.encoder else _choose(bag.path, listed, topics.odometry, "odometry", (ODOMETRY,))
    if encoder is not None and odometry is not None:
        raise InputError(
            f"{bag.path}: found both {_shown(encoder)} and {_shown(odometry)}, expected [topics] "
            "encoder or odometry to name the one to use."
        )
    if encoder is not None:
        t, turned = _columns(bag, encoder, _turned, remarks)
        if len(t) > 1 and np.allclose(np.linalg.norm(turned, axis=1), 1, atol=1e-3):
            raise InputError(
                f"{bag.path}: topic {encoder.name} holds orientations, expected the wheels' cumulative counts."
            )
        if counter_bits is not None:
            turned = unwrap(turned, counter_bits)
        return Ticks(t, turned.reshape(-1, 2, 2).mean(axis=2))
    if odometry is not None:
        return _poses(bag, odometry, remarks)
    return None


def _turned(message: Any) -> tuple[float, ...]:
    counts = message.quaternion
    return counts.x, counts.y, counts.z, counts.w


def _poses(bag: Bag, topic: Topic, remarks: list[str]) -> Poses:
    def row(message: Any) -> tuple[float, ...]:
        place, turn = message.pose.pose.position, message.pose.pose.orientation
        return place.x, place.y, turn.x, turn.y, turn.z, turn.w

    t, found = _columns(bag, topic, row, remarks)
    x, y, z, w = found[:, 2:].T
    norm = np.linalg.norm(found[:, 2:], axis=1)
    for one in np.flatnonzero(np.abs(norm - 1) > 1e-2):
        raise InputError(
            f"{bag.path}: topic {topic.name} at {t[one]} s: the orientation's quaternion has length {norm[one]:.3g}, "
            "expected 1."
        )
    upright = (w**2 + z**2 - x**2 - y**2) / norm**2
    for one in np.flatnonzero(upright < LEVEL):
        tilt = np.rad2deg(np.arccos(np.clip(upright[one], -1, 1)))
        raise InputError(
            f"{bag.path}: topic {topic.name} at {t[one]} s: the robot is tilted by {tilt:.0f} degrees, expected one "
            "that drives on a floor."
        )
    heading = np.arctan2(2 * (w * z + x * y), w**2 + x**2 - y**2 - z**2)
    return Poses(t, np.column_stack((found[:, :2], heading)))


def _columns(
    bag: Bag, topic: Topic, row: Callable[[Any], tuple[float, ...]], remarks: list[str]
) -> tuple[Array, Array]:
    """Times (m,), s, strictly increasing, and the `row` (m, k) of each message; of equal times the last counts."""
    at = dict[int, tuple[float, ...]]()
    messages = untimed = 0
    for message in bag.messages(topic.name):
        messages, untimed = messages + 1, untimed + message.untimed
        if message.content is None:
            raise InputError(f"{bag.path}: message {messages} of topic {topic.name} cannot be read.")
        at[message.nanoseconds] = row(message.content)
    if not at:
        raise InputError(f"{bag.path}: none of the {topic.messages} messages of topic {topic.name} can be read.")
    if len(at) < messages / 2:
        raise InputError(
            f"{bag.path}: the {messages} messages of topic {topic.name} have only {len(at)} distinct times, expected "
            "headers with the time of each reading, or zero times."
        )
    remarks += _of_untimed(bag, topic, untimed)
    rows = np.array([at[time] for time in sorted(at)], float)
    t = np.array([time / 10**9 for time in sorted(at)])
    for one in np.flatnonzero(~np.isfinite(rows).all(axis=1)):
        raise InputError(f"{bag.path}: topic {topic.name} at {t[one]} s: found {rows[one]}, expected finite numbers.")
    return t, rows


def _camera_info(path: Path, listed: Sequence[Topic], named: str | None, image: Topic) -> Topic | None:
    """The topic of the camera's calibration: of several, the one beside the images."""
    if named is None:
        known = {topic.name for topic in listed if topic.type == CAMERA_INFO and topic.messages}
        beside = (f"{folder}/camera_info" for folder in _folders(image.name))
        named = next((name for name in beside if name in known), None)
    return _choose(path, listed, named, "camera_info", (CAMERA_INFO,))


def _folders(name: str) -> list[str]:
    """/a/b of /a/b/image, then /a: image_transport puts images one level deeper."""
    parts = name.split("/")[:-1]
    return ["/".join(parts[:length]) for length in range(len(parts), 0, -1)]


def _camera(bag: Bag, topic: Topic) -> Camera | None:
    """The camera, mounted at the robot's origin; None if the messages are of an uncalibrated one."""
    from ...frontend.camera.calibration import from_camera_info

    message = next(bag.messages(topic.name)).content
    if message is None:
        raise InputError(f"{bag.path}: message 1 of topic {topic.name} cannot be read.")
    old = hasattr(message, "K")
    matrix, coefficients = (message.K, message.D) if old else (message.k, message.d)
    if matrix[0] == 0:
        return None
    where = f"{bag.path}: topic {topic.name}"
    return from_camera_info(
        where, message.width, message.height, message.distortion_model, matrix, coefficients, np.eye(4)
    )


def _choose(
    path: Path, listed: Sequence[Topic], named: str | None, setting: str, types: tuple[str, ...]
) -> Topic | None:
    """The topic `named`, or else the only one with messages of `types`; None if there is none."""
    expected = " or ".join(map(_plain, types))
    if named is not None:
        topic = next((topic for topic in listed if topic.name.strip("/") == named.strip("/")), None)
        if topic is None:
            raise InputError(f"{path}: has no topic {named!r}, which [topics] {setting} names; {_found(listed)}")
        if topic.type not in types or not topic.messages:
            raise InputError(f"{path}: [topics] {setting}: found {_shown(topic)}, expected messages of {expected}.")
        return topic
    fitting = [topic for topic in listed if topic.type in types and topic.messages]
    if len(fitting) > 1:
        choices = ", ".join(map(_shown, fitting))
        raise InputError(f"{path}: has {choices}, expected [topics] {setting} to name the one to use.")
    return fitting[0] if fitting else None


def _found(listed: Sequence[Topic]) -> str:
    return f"found {', '.join(map(_shown, listed))}."


def _shown(topic: Topic) -> str:
    return f"{topic.name} ({_plain(topic.type) or 'of several types'}, {topic.messages} messages)"


def _plain(type_name: str) -> str:
    return type_name.replace("/msg/", "/")
