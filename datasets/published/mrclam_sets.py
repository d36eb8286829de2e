"""The sets of MRCLAM and their robots that are in a folder, and the number of a set by its folder's name."""

import os
from pathlib import Path
from typing import NamedTuple

from ...core.errors import InputError
from .catalogue import named_in

SETS = 9  # number of datasets
LAST_ROBOT = 5  # the robots of each are numbered from 1 to this
USUAL = 6  # the set that is read where nothing names one
MARK = "Barcodes.dat"  # the file that identifies a dataset's folder
FAMILIES = ("MRCLAM", "MRSLAM")  # beginnings of the folders' names; set 4 has the latter


class RecordedSet(NamedTuple):
    """A set on this machine, or the place where one is expected."""

    number: int | None  # None where the folder has another name than the publisher's
    folder: Path

    @property
    def called(self) -> str:
        """Its number, or its folder's name."""
        return self.folder.absolute().name if self.number is None else str(self.number)

    @property
    def robots(self) -> list[int]:
        """The robots whose odometry is there."""
        return [k for k in range(1, LAST_ROBOT + 1) if os.path.lexists(self.folder / f"Robot{k}_Odometry.dat")]


def sets_in(path: Path) -> list[RecordedSet]:
    """Lists the set whose folder `path` is, or those whose folders are in it."""
    if (path / MARK).exists():
        return [RecordedSet(_number(path), path)]
    places = {number: [path / f"{family}_Dataset{number}" for family in FAMILIES] for number in range(1, SETS + 1)}
    return [
        RecordedSet(number, folder)
        for number, named in places.items()
        for folder in [one for one in named if one.is_dir()][:1]
    ]


def set_in(path: Path, number: int | None) -> RecordedSet:
    """Finds set `number`, if it is None the only one there is, or else the USUAL one; where none is, `path` itself.

    InputError where `path` is another set than `number`, or has several of which None tells none.
    """
    found = sets_in(path)
    if len(found) == 1 and found[0].folder == path:
        (only,) = found
        if None not in (number, only.number) and number != only.number:
            raise InputError(
                f"{path}: found set {only.number}, expected set {number}, as option dataset={number} of dataset mrclam "
                "says; without that option the folder's set is read."
            )
        return RecordedSet(number or only.number, path)
    if number is None and len(found) == 1:
        return found[0]
    if number is None and found and all(one.number != USUAL for one in found):
        there = ", ".join(one.called for one in found)
        raise InputError(f"{path}: found sets {there}, expected dataset=NUMBER to say which of them.")
    wanted = USUAL if number is None else number
    return next((one for one in found if one.number == wanted), RecordedSet(number or _number(path), path))


def _number(folder: Path) -> int | None:
    """The number in the name of a set's folder, such as MRCLAM_Dataset9 or mrclam-9; None without one."""
    name = named_in(os.path.basename(os.path.abspath(folder)))
    return None if name is None else int(name.rpartition("-")[2])
