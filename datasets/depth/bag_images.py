"""Reads images and depth images of a ROS bag: sensor_msgs/Image and CompressedImage.

Depth is 16UC1 or mono16, in millimetres, or 32FC1, in metres; compressed, a PNG file of 16 bits, or of the transport
compressedDepth, whose PNG files follow a header of 12 bytes: a kind, and two numbers by which a 32FC1 depth was
quantised as its inverse.
"""

import struct
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ...core.errors import InputError
from ...frontend.camera.quiet_decoders import silenced
from ..bags import images
from ..bags.bag import Bag, Topic
from ..bags.cameras import COMPRESSED, IMAGE, in_order
from ..bags.left_out import LeftOut
from ..bags.topics import found, shown
from .folder import MM
from .shots import Flaw, Pixels, Shot, in_metres

ENCODINGS = {"16UC1": "u2", "mono16": "u2", "32FC1": "f4"}
"""Of depth images -> the type of a value. 8UC1 is no depth, whatever a topic is called."""

TRANSPORT = "compressedDepth"

PNG = b"\x89PNG\r\n\x1a\n"  # a file begins with it

HEADER = struct.Struct("<iff")
"""A kind, which is of no use, and the quantisation of inverse depths: depth = a / (value - b)."""


def chosen(bag: Bag, listed: Sequence[Topic], image: str | None, depth: str | None) -> tuple[Topic, Topic]:
    """The topics of images and depth images, named or the only ones; InputError for missing or ambiguous ones."""
    ofs = [topic for topic in listed if topic.type in (IMAGE, COMPRESSED) and topic.messages]
    deep = [topic for topic in ofs if is_depth(bag, topic)]
    flat = [topic for topic in ofs if topic not in deep]
    return (
        _one(bag.path, listed, ofs, flat, image, "image", "images, of 8 bits or in colour"),
        _one(bag.path, listed, ofs, deep, depth, "depth", f"depth images ({', '.join(ENCODINGS)} or {TRANSPORT})"),
    )


def is_depth(bag: Bag, topic: Topic) -> bool:
    """Tells if the first message of a topic that can be read is a depth image."""
    for message in bag.contents(topic.name):
        if message is not None:
            if topic.type == COMPRESSED:
                by_name = TRANSPORT in message.format or topic.name.endswith(f"/{TRANSPORT}")
                return by_name or _is_plain(message)
            return message.encoding in ENCODINGS
    return False


def _is_plain(message: Any) -> bool:
    """Tells if a compressed image is depth without the transport's header: by its format, or a grey PNG of 16 bits."""
    content = bytes(message.data[: len(PNG) + 18])
    bits, colour = content[len(PNG) + 16 : len(PNG) + 18].ljust(2)
    grey = content.startswith(PNG) and (bits, colour) == (16, 0)
    return grey or message.format.partition(";")[0].strip() in ENCODINGS


def frame_of(bag: Bag, topic: Topic) -> str:
    """tf's frame of a topic's images."""
    messages = (message for message in bag.contents(topic.name) if message is not None)
    message = next(messages, None)
    return "" if message is None else message.header.frame_id.strip("/")


def shots(bag: Bag, topic: Topic, load: Callable[[Any], Pixels | Flaw], remarks: list[str]) -> Iterator[Shot]:
    """The images of a topic in the order of time, decoded by `load`; `remarks` grows at the end."""
    latest, number = None, 0
    left_out = LeftOut(str(bag.path), "image", f"of topic {topic.name}")
    for number, message in enumerate(in_order(bag.messages(topic.name), left_out), start=1):
        if message.nanoseconds == latest:
            continue  # of two images at one time, the first
        latest = message.nanoseconds
        name = f"message {number} of topic {topic.name}"
        yield Shot(message.nanoseconds / 10**9, name, lambda content=message.content: load(content))
    remarks += [one for one in left_out.remarks(number + left_out.count) if one not in remarks]


def picture(topic: Topic) -> Callable[[Any], Pixels | Flaw]:
    """The decoder of a topic's images."""
    decode = images.raw if topic.type == IMAGE else images.compressed

    def load(content: Any) -> Pixels | Flaw:
        pixels = None if content is None else decode(content)
        if pixels is None:
            kind = getattr(content, "encoding", getattr(content, "format", "of unknown layout"))
            return Flaw("images that cannot be decoded", f"is {kind!r} and cannot be decoded")
        return pixels

    return load


def measured(topic: Topic, units: float | None) -> Callable[[Any], Pixels | Flaw]:
    """The decoder of a topic's depth images into depths, m; `units` of integers are a metre, None: 1,000."""
    decode = _raw if topic.type == IMAGE else _compressed

    def load(content: Any) -> Pixels | Flaw:
        pixels = Flaw("depth images that cannot be decoded", "cannot be read") if content is None else decode(content)
        return pixels if isinstance(pixels, Flaw) else in_metres(pixels, units or MM)

    return load


def _one(
    path: Path, listed: Sequence[Topic], ofs: list[Topic], fitting: list[Topic], named: str | None, key: str, what: str
) -> Topic:
    setting = f"[topics] {key}"
    if named is not None:
        topic = next((topic for topic in ofs if topic.name.strip("/") == named.strip("/")), None)
        if topic is None:
            raise InputError(f"{path}: has no images in the topic {named!r}, which {setting} names; {found(listed)}")
        return topic
    if len(fitting) > 1:
        choices = ", ".join(map(shown, fitting))
        raise InputError(f"{path}: has {choices}, expected {setting} to name the one to use.")
    if not fitting:
        raise InputError(f"{path}: has no topic with {what}; {found(listed)}")
    return fitting[0]


def _raw(message: Any) -> Pixels | Flaw:
    kind = ENCODINGS.get(message.encoding)
    if kind is None:
        if message.encoding in ("mono8", "8UC1"):
            return Flaw("depth images of 8 bits", "has 8 bits in a pixel, expected 16UC1 or 32FC1")
        expected = ", ".join(ENCODINGS)
        return Flaw("depth images of other encodings", f"has the encoding {message.encoding!r}, expected {expected}")
    dtype = np.dtype(kind).newbyteorder(">" if message.is_bigendian else "<")
    row = message.width * dtype.itemsize
    step = message.step or row
    if not message.height or not message.width or step < row or len(message.data) < step * (message.height - 1) + row:
        expected = f"{message.width}x{message.height} of them"
        return Flaw("depth images that are too short", f"has {len(message.data)} bytes of pixels, expected {expected}")
    return np.ndarray((message.height, message.width), dtype, message.data, 0, (step, dtype.itemsize))


def _compressed(message: Any) -> Pixels | Flaw:
    content = np.asarray(message.data, np.uint8)
    pixels, plain = None, TRANSPORT not in message.format and content[: HEADER.size].tobytes().startswith(PNG)
    header = 0 if plain else HEADER.size
    if len(content) > header:
        try:
            with silenced():
                pixels = cv2.imdecode(content[header:], cv2.IMREAD_UNCHANGED)
        except cv2.error:
            pixels = None
    if pixels is None or b"IEND" not in content[-64:].tobytes():
        return Flaw(
            "depth images that cannot be decoded",
            f"is {message.format!r} and cannot be decoded, expected a PNG file"
            + f" after {HEADER.size} bytes" * (not plain),
        )
    if plain or not message.format.startswith("32FC1"):
        return np.asarray(pixels)
    _, a, b = HEADER.unpack(content[: HEADER.size].tobytes())
    with np.errstate(divide="ignore"):
        depth = a / (np.asarray(pixels, np.float64) - b)
    return np.where(np.asarray(pixels) > 0, depth, 0.0)
