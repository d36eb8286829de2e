"""Tells that a bag's file is one part of a recording that was split, by the files beside it and their times."""

import re
from pathlib import Path

from ...core.errors import InputError
from .bag import Bag

PAUSE, OVERLAP = 60.0, 1.0
"""s from the end of a part to the beginning of the next one, and by which they may overlap: splitting takes no time."""

_NUMBERED = re.compile(r"(?P<stem>.*?)(?P<date>_?\d{4}-\d\d-\d\d-\d\d-\d\d-\d\d)?_(?P<number>\d{1,6})", re.DOTALL)
"""drive_0, drive_1 ...; of ROS 1 with the time at which a part was begun before its number."""


def read_alone(path: Path) -> list[str]:
    """The remark on a file that is read without the recording's other parts beside it, if there are some."""
    own = _NUMBERED.fullmatch(path.stem)
    if own is None or not path.is_file():
        return []
    alike = [
        (found, one)
        for one in path.absolute().parent.glob(f"*{path.suffix}")
        if (found := _NUMBERED.fullmatch(one.stem))
    ]
    parts = {int(found["number"]): one for found, one in alike if found["stem"] == own["stem"]}
    number = int(own["number"])
    if not (_follows(path, parts.get(number + 1)) or _follows(parts.get(number - 1), path)):
        return []
    names = f"{parts[min(parts)].name} to {parts[max(parts)].name}"
    return [f"{path}: is one of the {len(parts)} parts of a recording, {names}: the log has nothing of the others"]


def _follows(one: Path | None, other: Path | None) -> bool:
    """Tells if the messages of the second file begin where those of the first end."""
    if one is None or other is None:
        return False
    try:
        before, after = Bag(one).span(), Bag(other).span()
    except InputError:
        return False
    return before is not None and after is not None and -OVERLAP <= (after[0] - before[1]) / 1e9 <= PAUSE
