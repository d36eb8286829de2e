"""Tells that a bag's file is one part of a recording that was split, by the files beside it and their times."""

from pathlib import Path

from ...core.errors import InputError
from .bag import Bag
from .parts import NUMBERED, OVERLAP, PAUSE


def read_alone(path: Path) -> list[str]:
    """The remark on a file that is read without the recording's other parts beside it, if there are some."""
    own = NUMBERED.fullmatch(path.stem)
    if own is None or not path.is_file():
        return []
    alike = [
        (found, one)
        for one in path.absolute().parent.glob(f"*{path.suffix}")
        if (found := NUMBERED.fullmatch(one.stem))
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
