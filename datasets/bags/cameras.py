"""The cameras of a bag: their images in the order of time, and the topic of their calibration."""

import heapq
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from .bag import Message, Topic
from .topics import beside, choose

IMAGE, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"

WAITING = 4  # most images held back for one received late


def in_order(messages: Iterator[Message]) -> Iterator[Message]:
    """Sorts images by their own times, as long as each arrives before `WAITING` later ones; without repetitions."""
    latest = None
    for message in _sorted(messages):
        if latest is None or message.nanoseconds != latest.nanoseconds or not _alike(message, latest):
            yield message  # else recorded twice
        latest = message


def info_beside(path: Path, listed: Sequence[Topic], named: str | None, setting: str, image: Topic) -> Topic | None:
    """The topic of a camera's calibration: the one `named`, by `setting`; else of several the one beside the images."""
    if named is None:
        known = {topic.name for topic in listed if topic.type == CAMERA_INFO and topic.messages}
        named = beside(image.name, "camera_info", known)
    return choose(path, listed, named, setting, (CAMERA_INFO,))


def _sorted(messages: Iterator[Message]) -> Iterator[Message]:
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
