"""The square markers of a recording: their dictionary and printed sizes."""

import difflib
import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path

import cv2
import numpy as np

from ...core.errors import InputError
from ...core.files import write_whole
from ..plausible import SIDE

MOST, SMALLEST, LARGEST = 1000, 3, 8
"""The markers, and the bits along a side, of a custom dictionary."""

CUSTOM = "write a custom one as custom[count=30,size=4,seed=0] or custom[base=4X4_50,count=80,seed=0], or give a file"


@dataclass(frozen=True, eq=False)
class Markers:
    """The markers of one dictionary; all of one size, except those in `sides`."""

    dictionary: str  # OpenCV's name without its prefix, such as 4X4_50; or as `find` accepts it; "": not known
    side: float  # m, of the black square; NaN: not known
    sides: Mapping[int, float] = field(default_factory=dict[int, float])  # id -> m, where it differs
    folder: Path | None = None  # base of a dictionary file's relative path; None: the working directory
    ignore: tuple[int, ...] = ()  # ids that are left out, such as those on what moves

    @cached_property
    def opencv(self) -> cv2.aruco.Dictionary:
        """OpenCV's dictionary. InputError for an unknown name."""
        return find(self.dictionary, self.folder)

    def side_of(self, name: int) -> float:
        """m, the side of marker `name`."""
        return self.sides.get(name, self.side)

    def check(self, where: str) -> None:
        """Raises InputError, beginning with `where`, for an invalid side or an id that is not in the dictionary."""
        _check_side(self.side, f"{where}: side")
        count = len(self.opencv.bytesList) if self.dictionary else math.inf
        for key, names in (("sides", self.sides), ("ignore", self.ignore)):
            for name in names:
                if not 0 <= name < count:
                    raise InputError(
                        f"{where}: {key}: found id {name}, expected one of {self.dictionary}, 0 to {count - 1}"
                    )
        for name, side in self.sides.items():
            _check_side(side, f"{where}: sides: {name}")


def find(name: str, folder: Path | None = None) -> cv2.aruco.Dictionary:
    """Finds a dictionary by name; InputError if there is none.

    `name` is OpenCV's without its prefix, such as 4X4_50; or `custom[count=30,size=4,seed=0]`, random markers as
    different as possible; or `custom[base=4X4_50,count=80,seed=0]`, which extends another dictionary; or the path of a
    file, relative to `folder`, in the format of cv2.aruco.Dictionary.writeDictionary.
    """
    if name.startswith("custom[") and name.endswith("]"):
        return _custom(name)
    if Path(name).suffix or "/" in name or os.sep in name:
        return _read((folder or Path()) / name)
    known = predefined()
    key = name.upper().removeprefix("DICT_")
    if key not in known:
        close = difflib.get_close_matches(key, known, n=1, cutoff=0.5)
        hint = f"the nearest is {close[0]}" if close else f"expected one of {', '.join(known)}"
        raise InputError(f"marker dictionary: there is no {name!r}; {hint}; {CUSTOM}")
    return cv2.aruco.getPredefinedDictionary(known[key])


@cache
def predefined() -> dict[str, int]:
    """OpenCV's dictionaries: upper-case name without prefix -> its number."""
    names = sorted(name for name in dir(cv2.aruco) if name.startswith("DICT_"))
    return {name.removeprefix("DICT_").upper(): getattr(cv2.aruco, name) for name in names}


def write(path: Path, dictionary: cv2.aruco.Dictionary) -> None:
    """Writes `dictionary` to a file that `find`, and every program that uses OpenCV, can read.

    The ending chooses the format: .yml, .yaml, .xml or .json; InputError for another.
    """
    if path.suffix not in _FORMATS:
        raise InputError(f"{path}: found the ending {path.suffix!r}, expected one of {', '.join(_FORMATS)}")
    storage = cv2.FileStorage(path.suffix, cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    dictionary.writeDictionary(storage)
    write_whole(path, storage.releaseAndGetString())


_FORMATS = (".yml", ".yaml", ".xml", ".json")


def _check_side(side: float, where: str) -> None:
    if (odd := SIDE.odd(side)) is not None:
        raise InputError(f"{where}: {odd}")


def _custom(name: str) -> cv2.aruco.Dictionary:
    """Generates the dictionary a `custom[...]` describes."""
    given: dict[str, str] = {}
    for pair in name[len("custom[") : -1].split(","):
        key, equals, value = (part.strip() for part in pair.partition("="))
        if key not in ("count", "size", "base", "seed") or not equals or key in given:
            raise InputError(f"marker dictionary {name}: found {pair.strip()!r}; {CUSTOM}")
        given[key] = value
    if ("base" in given) == ("size" in given) or "count" not in given:
        raise InputError(f"marker dictionary {name}: expected count and either size or base; {CUSTOM}")
    seed = _whole(given.get("seed", "0"), 0, 2**31 - 1, f"{name}: seed")
    count = _whole(given["count"], 1, MOST, f"{name}: count")
    if "size" in given:
        return _extended(count, _whole(given["size"], SMALLEST, LARGEST, f"{name}: size"), None, seed)
    base = find(given["base"])
    if count <= len(base.bytesList):
        raise InputError(f"marker dictionary {name}: count: found {count}, expected more than the base's")
    return _extended(count, base.markerSize, given["base"], seed)


def _whole(text: str, low: int, high: int, where: str) -> int:
    if not (text.isascii() and text.isdigit() and low <= int(text) <= high):
        raise InputError(f"marker dictionary {where}: found {text!r}, expected a whole number from {low} to {high}")
    return int(text)


@cache
def _extended(count: int, size: int, base: str | None, seed: int) -> cv2.aruco.Dictionary:
    """Generates `count` markers of `size` x `size` bits, the first of them those of `base`.

    OpenCV's search slows down with every marker: a thousand of 6 x 6 bits take ten seconds.
    """
    grounds = (find(base),) if base is not None else ()
    words = cv2.aruco.extendDictionary(count, size, *grounds, randomSeed=seed)
    if len({min(turned) for turned in _turned(words)}) < count or any(
        len(set(turned)) < 4 for turned in _turned(words)
    ):
        raise InputError(
            f"marker dictionary: could not generate {count} markers of {size}x{size} bits that differ in every "
            "orientation, expected fewer of them or a larger size"
        )
    return words


def _turned(dictionary: cv2.aruco.Dictionary) -> Iterator[list[bytes]]:
    """Each marker's bits, in its four orientations."""
    for name in range(len(dictionary.bytesList)):
        drawn = np.asarray(dictionary.generateImageMarker(name, dictionary.markerSize + 2))
        yield [np.rot90(drawn, turns).tobytes() for turns in range(4)]


def _read(path: Path) -> cv2.aruco.Dictionary:
    """Reads the dictionary in a file, validating what OpenCV does not."""
    if not path.is_file():
        raise InputError(f"{path}: there is no such file, expected a marker dictionary")
    try:
        storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    except (cv2.error, SystemError):  # OpenCV raises either
        raise InputError(f"{path}: not YAML, XML or JSON as OpenCV writes it, expected a marker dictionary") from None
    count, size = (_number(storage, key, path) for key in ("nmarkers", "markersize"))
    for index in range(count):
        word = storage.getNode(f"marker_{index}")
        text = word.string() if word.isString() else ""
        if len(text) != size**2 or set(text) - {"0", "1"}:
            raise InputError(f"{path}: marker_{index}: found {text!r}, expected {size**2} characters, each 0 or 1")
    dictionary = cv2.aruco.Dictionary()
    dictionary.readDictionary(storage.root())
    return dictionary


def _number(storage: cv2.FileStorage, key: str, path: Path) -> int:
    node = storage.getNode(key)
    number = int(node.real()) if node.isInt() else 0
    if number < 1:
        raise InputError(f"{path}: {key}: found no whole number above 0, expected a marker dictionary")
    return number
