"""The messages in a ROS bag: a ROS 1 .bag, a ROS 2 folder (sqlite3 or mcap), a lone .mcap or .db3.

The messages' layout is the one that ROS itself has for them, so definitions in the bag of types that nobody has here,
and that they are missing, as in most ROS 2 bags, do not matter.
"""

from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from ...frontend.errors import InputError

REPAIRS = {
    ".bag": "`rosbag reindex` may repair one whose recording was cut short.",
    ".mcap": "`mcap recover` may repair one whose recording was cut short.",
    ".db3": "`sqlite3 FILE .recover` may rescue the messages of one whose recording was cut short.",
    "": (
        "Where recording it was cut short, `mcap recover` or `sqlite3 FILE .recover` may rescue its messages, and "
        "`ros2 bag reindex` writes its metadata.yaml."
    ),
}
"""What may help, by the ending of the bag's file; "" for a folder."""


class Topic(NamedTuple):
    """A topic of a bag."""

    name: str
    type: str  # as in sensor_msgs/msg/Image; "": several
    messages: int


class Message(NamedTuple):
    """A message and its time."""

    nanoseconds: int  # of its header, or when the bag got it, where that is 0
    content: Any  # None: it could not be read, and its time is by the delay of the one before


@dataclass(frozen=True)
class Bag:
    """The messages of a bag, read anew each time they are asked for."""

    path: Path

    def listed(self) -> list[Topic]:
        """The topics, by name."""
        with self._open() as (reader, _):
            return [Topic(name, topic.msgtype or "", topic.msgcount) for name, topic in sorted(reader.topics.items())]

    def messages(self, topic: str) -> Iterator[Message]:
        """The messages of `topic` as the bag got them."""
        delay = 0
        with self._open() as (reader, decode):
            for connection, received, content in reader.messages(reader.topics[topic].connections):
                try:
                    message = decode(content, connection.msgtype)
                    stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
                except Exception:  # a damaged message surfaces as whatever the parser stumbles on
                    yield Message(received - delay, None)
                else:
                    delay = received - stamp if stamp else 0
                    yield Message(stamp or received, message)

    @contextmanager
    def _open(self) -> Generator[tuple[Any, Callable[[bytes, str], Any]]]:
        from rosbags.rosbag1 import Reader as Reader1
        from rosbags.rosbag2 import Reader as Reader2
        from rosbags.typesys import Stores, get_typestore

        if not self.path.exists():
            raise InputError(f"{self.path}: there is no such file or folder, expected a ROS bag.")
        if self.path.is_dir() and not (self.path / "metadata.yaml").is_file():
            raise InputError(f"{self.path}: has no metadata.yaml, expected the folder of a ROS 2 bag. {REPAIRS['']}")
        old = self.path.suffix == ".bag"
        types = get_typestore(Stores.ROS1_NOETIC if old else Stores.LATEST)
        try:
            with (Reader1 if old else Reader2)(self.path) as reader:
                yield reader, types.deserialize_ros1 if old else types.deserialize_cdr
        except InputError:
            raise
        except PermissionError as error:
            raise InputError(f"{self.path}: cannot be read ({error.strerror}).") from error
        except Exception as error:  # a damaged file surfaces as whatever the parser stumbles on
            repair = REPAIRS.get("" if self.path.is_dir() else self.path.suffix, "")
            said = str(error).strip().rstrip(".") or type(error).__name__
            raise InputError(f"{self.path}: is damaged or no ROS bag ({said}). {repair}".rstrip()) from error
