"""Reads the messages of a ROS bag: a ROS 1 .bag, a ROS 2 folder (sqlite3 or mcap), a single .mcap or .db3.

A folder may have the parts of a recording that was split.

Messages are parsed with ROS's own definitions, so it does not matter if the bag's definitions are unknown, or missing
as in most ROS 2 bags; those of detected tags, which are not ROS's own, with the bag's, else with known ones.
"""

from collections.abc import Callable, Generator, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from ...core.errors import InputError
from .parts import BAGS, Joined, check_parts, missing, parts_in
from .tag_types import register

REPAIRS = {
    ".bag": "`rosbag reindex` may repair an interrupted recording.",
    ".mcap": "`mcap recover` may repair an interrupted recording.",
    ".db3": "`sqlite3 FILE .recover` may recover the messages of an interrupted recording.",
    "": (
        "If its recording was interrupted, `mcap recover` or `sqlite3 FILE .recover` may recover its messages, and "
        "`ros2 bag reindex` writes its metadata.yaml."
    ),
}
"""Possible remedies, by the ending of the bag's file; "" for a folder."""


TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
"""Types of the messages of tf, which are alike; the parser's own types of ROS 1 lack them."""

BEGINNING = 10**9
"""ns; up to here 0 in a header is the time at which a simulated clock begins, where reception agrees."""


def is_bag(path: Path) -> bool:
    """Tells if the path is that of a bag, by its ending or, of a folder, by its metadata.yaml or the parts in it."""
    if path.is_dir():
        return (path / "metadata.yaml").is_file() or bool(parts_in(path))
    return path.suffix.lower() in BAGS


def is_whole(path: Path, source: str | None) -> bool:
    """Tells if the folder at `path` is a bag that is read whole; else `source` in robot.toml may name a part of it."""
    return is_bag(path) and (source is None or not (path / source).exists())


class Topic(NamedTuple):
    """A topic of a bag."""

    name: str
    type: str  # as in sensor_msgs/msg/Image; "": several
    messages: int


class Message(NamedTuple):
    """A message and its time.

    That is of its header, or of reception where all headers of its topic have 0. One clock counts for a whole topic:
    where only some headers have 0, but for those at the beginning of a clock, their messages are `untimed`, and as long
    before their reception as the message before; so are unreadable ones.
    """

    nanoseconds: int
    content: Any  # None: unreadable
    untimed: bool = False
    received: int = 0  # ns


@dataclass(frozen=True)
class Bag:
    """The messages of a bag, read again on each access."""

    path: Path

    @cached_property
    def parts(self) -> list[Path]:
        """The files that are read: the path itself, or those of a recording that was split."""
        split = self.path.is_dir() and not (self.path / "metadata.yaml").is_file()
        return parts_in(self.path) or [self.path] if split else [self.path]

    def remarks(self) -> list[str]:
        """Says which of its parts are missing or not closed; InputError if they are not of one recording."""
        if len(self.parts) < 2:
            return []
        with self._open() as (reader, _):
            check_parts(self.parts, reader.spans)
        return missing(self.parts)

    def listed(self) -> list[Topic]:
        """The topics, by name."""
        with self._open() as (reader, _):
            return [Topic(name, topic.msgtype or "", topic.msgcount) for name, topic in sorted(reader.topics.items())]

    def span(self) -> tuple[int, int] | None:
        """The first and the last time of reception, ns; None without a message."""
        with self._open() as (reader, _):
            return (reader.start_time, reader.end_time) if reader.message_count else None

    def messages(self, topic: str) -> Iterator[Message]:
        """The messages of `topic` in order of reception."""
        with self._open() as (reader, decode):
            first = next((received - stamp for received, stamp, _ in _stamped(reader, decode, topic) if stamp), None)
            delay, begun = first or 0, False
            for received, stamp, content in _stamped(reader, decode, topic):
                delay, begun = (received - stamp, True) if stamp else (delay, begun)
                at = stamp or received - delay
                unsaid = content is not None and not stamp and first is not None
                if unsaid and not begun and abs(at) < BEGINNING:
                    at, unsaid = 0, False
                yield Message(at, content, unsaid, received)

    def contents(self, topic: str) -> Iterator[Any]:
        """The contents of the messages of `topic`, which need no header; None for one that is unreadable."""
        return (content for _, content in self.received(topic))

    def received(self, topic: str) -> Iterator[tuple[int, Any]]:
        """Times of reception, ns, and `contents`."""
        with self._open() as (reader, decode):
            for connection, received, content in reader.messages(reader.topics[topic].connections):
                try:
                    message = decode(content, connection.msgtype)
                except Exception:  # a damaged message may raise anything
                    message = None
                yield received, message

    @contextmanager
    def _open(self) -> Generator[tuple[Any, Callable[[bytes, str], Any]]]:
        from rosbags.rosbag1 import Reader as Reader1
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        from .ros2 import Reader as Reader2

        if not self.path.exists():
            raise InputError(f"{self.path}: there is no such file or folder, expected a ROS bag.")
        if self.path.is_dir() and self.parts == [self.path] and not (self.path / "metadata.yaml").is_file():
            raise InputError(f"{self.path}: has no metadata.yaml, expected the folder of a ROS 2 bag. {REPAIRS['']}")
        old = self.parts[0].suffix == ".bag"
        types = get_typestore(Stores.ROS1_NOETIC if old else Stores.LATEST)
        for name in TRANSFORMS if old else ():
            types.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", name))
        part = self.path
        try:
            with ExitStack() as stack:
                readers = list[Any]()
                for part in self.parts:
                    readers.append(stack.enter_context((Reader1 if old else Reader2)(part)))
                for connection in (one for each in readers for one in each.connections):
                    register(types, connection.msgtype, connection.msgdef.data)
                part = self.parts[0] if len(readers) == 1 else self.path
                reader = readers[0] if len(readers) == 1 else Joined(readers)
                yield reader, types.deserialize_ros1 if old else types.deserialize_cdr
        except InputError:
            raise
        except PermissionError as error:
            raise InputError(f"{part}: cannot be read ({error.strerror}).") from error
        except Exception as error:  # a damaged file may raise anything
            repair = REPAIRS.get("" if part.is_dir() else part.suffix, "")
            said = " ".join(str(error).split()).rstrip(".") or type(error).__name__
            raise InputError(f"{part}: is damaged or not a ROS bag ({said}). {repair}".rstrip()) from error


def _stamped(reader: Any, decode: Callable[[bytes, str], Any], topic: str) -> Iterator[tuple[int, int, Any]]:
    """Yields times of reception and of the header, ns, and the content of each message.

    A message without a header has 0; an unreadable one 0 and None.
    """
    for connection, received, content in reader.messages(reader.topics[topic].connections):
        try:
            message = decode(content, connection.msgtype)
            header = getattr(message, "header", None)
            stamp = 0 if header is None else header.stamp.sec * 10**9 + header.stamp.nanosec
        except Exception:  # a damaged message may raise anything
            yield received, 0, None
        else:
            yield received, stamp, message
