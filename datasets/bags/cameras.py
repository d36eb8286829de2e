"""The cameras of a bag: their images in the order of time, and the topic of their calibration."""

import heapq
from collections.abc import Iterator, Sequence
from itertools import chain, islice
from pathlib import Path

import numpy as np

from .bag import Message, Topic
from .clock import DAY, MINUTE, SINGLE
from .left_out import LeftOut
from .topics import beside, choose

IMAGE, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"

WAITING = 4  # most images held back for one received late


def in_order(messages: Iterator[Message], left_out: LeftOut) -> Iterator[Message]:
    """Sorts images by their own times, as long as each arrives before `WAITING` later ones; without repetitions.

    Single ones whose stamps are before the others', or a day away from them, are added to `left_out`.
    """
    latest: Message | None = None
    back = 0
    for number, message in _sorted(_of_the_day(messages, left_out)):
        if latest is not None and message.nanoseconds < latest.nanoseconds and back < SINGLE:
            back += 1
            found = f"is stamped {message.nanoseconds / 1e9:.10g} s, after one of {latest.nanoseconds / 1e9:.10g} s"
            left_out.add(number, found)
            continue
        if latest is None or message.nanoseconds != latest.nanoseconds or not _alike(message, latest):
            yield message  # else recorded twice
        latest, back = message, 0


def info_beside(path: Path, listed: Sequence[Topic], named: str | None, setting: str, image: Topic) -> Topic | None:
    """The topic of a camera's calibration: the one `named`, by `setting`; else of several the one beside the images."""
    if named is None:
        known = {topic.name for topic in listed if topic.type == CAMERA_INFO and topic.messages}
        named = beside(image.name, "camera_info", known)
    return choose(path, listed, named, setting, (CAMERA_INFO,))


def _of_the_day(messages: Iterator[Message], left_out: LeftOut) -> Iterator[tuple[int, Message]]:
    """Messages with their numbers, from 1 on, without single ones far from those around, as in `clock.astray`."""
    first, away = list(islice(messages, WAITING + 1)), 0
    latest, behind = (sorted(times)[len(first) // 2] if first else 0 for times in _clocks(first))
    for number, message in enumerate(chain(first, messages), start=1):
        now, late = (times[0] for times in _clocks([message]))
        far = abs(now - latest)
        if (far > DAY or min(far, abs(late - behind)) > MINUTE) and away < SINGLE:
            away += 1
            left_out.add(number, f"is stamped {now / 1e9:.10g} s, beside one of {latest / 1e9:.10g} s")
            continue
        latest, behind, away = now, late, 0
        yield number, message


def _clocks(messages: Sequence[Message]) -> tuple[list[int], list[int]]:
    """The stamps, and how long they are after the times of reception, ns."""
    return [one.nanoseconds for one in messages], [one.nanoseconds - one.received for one in messages]


def _sorted(messages: Iterator[tuple[int, Message]]) -> Iterator[tuple[int, Message]]:
    waiting = list[tuple[int, int, Message]]()
    for number, message in messages:
        heapq.heappush(waiting, (message.nanoseconds, number, message))
        if len(waiting) > WAITING:
            yield heapq.heappop(waiting)[1:]
    while waiting:
        yield heapq.heappop(waiting)[1:]


def _alike(one: Message, other: Message) -> bool:
    a, b = one.content, other.content
    return a is not None and b is not None and np.array_equal(a.data, b.data)
