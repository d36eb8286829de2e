"""Recordings that were split into several files: `rosbag record --split`, or a ROS 2 bag without its metadata.yaml.

Their names end in a number: drive_0.bag, drive_1.bag. A ROS 1 name may have the time at which its part was begun before
the number, which is another one in each.
"""

import re
from collections.abc import Iterator, Sequence
from heapq import merge
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

from ...core.errors import InputError

BAGS = (".bag", ".mcap", ".db3")  # endings of a bag's file

UNCLOSED = "*.bag.active"  # of a recording that was interrupted

PAUSE, OVERLAP = 60.0, 1.0
"""s from the end of a part to the beginning of the next one, and by which they may overlap: splitting takes no time."""

NUMBERED = re.compile(r"(?P<stem>.*?)(?P<date>_?\d{4}-\d\d-\d\d-\d\d-\d\d-\d\d)?_(?P<number>\d{1,6})", re.DOTALL)


def parts_in(folder: Path) -> list[Path]:
    """The parts of one recording that a folder has, by their numbers; none where its bags are not all of one."""
    try:
        bags = [one for one in folder.iterdir() if one.suffix.lower() in BAGS]
    except OSError:
        return []
    found = {_number(one): one for one in bags if NUMBERED.fullmatch(one.stem)}
    if len(found) < 2 or len(found) < len(bags) or len({_kind(one) for one in bags}) > 1:
        return []
    return [found[number] for number in sorted(found)]


def missing(parts: Sequence[Path]) -> list[str]:
    """The remarks on parts that the numbers lack, and on one that was not closed."""
    numbers, folder = [_number(one) for one in parts], parts[0].parent
    said = [
        f"{one}: was not closed, and is left out; `rosbag reindex` may repair it"
        for one in sorted(folder.glob(UNCLOSED))
    ]
    lost = sorted(set(range(numbers[-1])) - set(numbers))
    if lost:
        which = ", ".join(map(str, lost[:5])) + ", ..." * (len(lost) > 5)
        said.append(f"{folder}: of the parts of the recording, up to {parts[-1].name}, number {which} is missing")
    return said


def check_parts(parts: Sequence[Path], spans: Sequence[tuple[int, int] | None]) -> None:
    """Raises InputError if parts with consecutive numbers do not follow on each other; `spans` are their times, ns."""
    timed = [(part, span) for part, span in zip(parts, spans, strict=True) if span is not None]
    for (one, (_, end)), (other, (start, _)) in pairwise(timed):
        pause = (start - end) / 1e9
        if pause < -OVERLAP or (pause > PAUSE and _number(other) == _number(one) + 1):
            raise InputError(
                f"{one.parent}: {other.name} begins {abs(pause):.3g} s {'after' if pause > 0 else 'before'} the end of "
                f"{one.name}, expected the parts of one recording; name the file to read, if they are several."
            )


class Joined:
    """Open bags as one: what `Bag` needs of a reader of rosbags."""

    def __init__(self, readers: Sequence[Any]) -> None:
        self._readers = readers

    @property
    def topics(self) -> dict[str, "Joint"]:
        """The topics of all, by name."""
        found = dict[str, Joint]()
        for row, reader in enumerate(self._readers):
            for name, topic in reader.topics.items():
                known = found.setdefault(name, Joint(topic.msgtype, 0, []))
                kind = topic.msgtype if topic.msgtype == known.msgtype else None
                connections = [*known.connections, *((row, one) for one in topic.connections)]
                found[name] = Joint(kind, known.msgcount + topic.msgcount, connections)
        return found

    @property
    def spans(self) -> list[tuple[int, int] | None]:
        """The first and the last time of each bag, ns; None for one without a message."""
        return [(one.start_time, one.end_time) if one.message_count else None for one in self._readers]

    def messages(self, connections: Sequence[tuple[int, Any]]) -> Iterator[tuple[Any, int, bytes]]:
        """The messages of these connections, in the order of reception."""
        streams = [
            reader.messages([one for number, one in connections if number == row])
            for row, reader in enumerate(self._readers)
            if any(number == row for number, _ in connections)
        ]
        return merge(*streams, key=lambda message: message[1])


class Joint(NamedTuple):
    """A topic of several bags."""

    msgtype: str | None  # None: several
    msgcount: int
    connections: list[tuple[int, Any]]  # with the number of their reader


def _number(path: Path) -> int:
    found = NUMBERED.fullmatch(path.stem)
    return -1 if found is None else int(found["number"])


def _kind(path: Path) -> tuple[str, str]:
    """The name and the ending, which all parts have."""
    found = NUMBERED.fullmatch(path.stem)
    return "" if found is None else found["stem"], path.suffix
