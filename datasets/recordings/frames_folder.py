"""A folder of pictures, one file per frame.

They are read as grey, as used by the marker detector, and unrotated: a picture's orientation tag is ignored, since the
calibration is of the sensor. frames.csv (`frame,t`: file name, seconds) lists the frames and their times. Without it
all pictures in the folder are used, and the time is the file's name,

    1403636579.763556.png              seconds, with a point
    1403636579763555527.png            nanoseconds, microseconds or milliseconds since 1970: 19, 16 or 13 digits

or follows from a fixed frame rate, in the order of the numbers in their names.
"""

import itertools
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from ...core.csv_values import finite
from ...core.errors import InputError
from ...core.table import text
from ...frontend.camera.quiet_decoders import silenced
from ...frontend.markers.aruco import Image
from ...frontend.markers.pipeline import Frame

PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".pgm", ".ppm", ".tif", ".tiff", ".webp")
FRAMES = "frames.csv"

_UNITS = {19: 1e-9, 16: 1e-6, 13: 1e-3}  # digits of an integer time since 1970 -> its unit, s


class Shot(NamedTuple):
    """A picture's file and time."""

    path: Path
    t: float  # s


@dataclass(frozen=True)
class FramesFolder:
    """Frames that are read on demand, any number of times."""

    shots: Sequence[Shot]

    def __len__(self) -> int:
        return len(self.shots)

    def __iter__(self) -> Iterator[Frame]:
        return (Frame(shot.t, load(shot.path)) for shot in self.shots)


def pictures(folder: Path) -> list[Path]:
    """The files in `folder` with names of pictures, in the order of the numbers in their names."""
    found = (path for path in folder.iterdir() if path.suffix.lower() in PICTURES and not path.name.startswith("."))
    return sorted(found, key=lambda path: [(part.isdigit(), int(part) if part.isdigit() else 0, part)
                                           for part in re.split(r"(\d+)", path.name)])  # fmt: skip


def read(folder: Path, home: Path, fps: float | None, start: float) -> FramesFolder:
    """Reads the pictures in `folder`, at times from `home`/frames.csv, their names, or `fps` and `start`.

    InputError if there are none, or their times are unknown or not in order.
    """
    listed = home / FRAMES
    if listed.exists():
        return FramesFolder(_listed(listed, folder))
    found = pictures(folder)
    if not found:
        raise InputError(f"{folder}: has no pictures, expected frames in files such as 000001.png.")
    times = [_time(path.stem) for path in found]
    if fps is not None:
        return FramesFolder([Shot(path, start + number / fps) for number, path in enumerate(found)])
    shots = [Shot(path, t) for path, t in zip(found, times, strict=True) if t is not None]
    if len(shots) < len(found):
        unnamed = found[times.index(None)]
        raise InputError(
            f"{folder}: the time of {unnamed.name} is unknown; expected {listed}, or file names that are times, "
            "such as 12.25.png in seconds, or [frames] fps in robot.toml."
        )
    shots.sort(key=lambda shot: shot.t)
    for before, shot in itertools.pairwise(shots):
        if not shot.t > before.t:
            raise InputError(f"{shot.path}: has the same time as {before.path.name}, expected a later one.")
    return FramesFolder(shots)


def load(path: Path) -> Image | None:
    """The picture in `path` as (height, width) grey, None if it is unreadable, truncated or no regular file."""
    if not path.is_file():  # a pipe may never end
        return None
    try:
        content = np.frombuffer(path.read_bytes(), np.uint8)
        with silenced():
            image = cv2.imdecode(content, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION)
    except (OSError, cv2.error):
        return None
    return None if image is None else np.asarray(image, np.uint8)


def _listed(path: Path, folder: Path) -> list[Shot]:
    """The frames listed in a frames.csv."""
    lines = text(path).split("\n")
    if [cell.strip() for cell in lines[0].split(",")] != ["frame", "t"]:
        raise InputError(f"{path}, line 1: found {lines[0]!r}, expected the columns frame,t.")
    shots = list[Shot]()
    for number, line in enumerate(lines[1:], start=2):
        if not line.strip():
            continue
        name, comma, cell = line.rpartition(",")
        t = finite(cell)
        if not comma or t is None:
            raise InputError(f"{path}, line {number}: found {line!r}, expected a file's name and a time in seconds.")
        shot = Shot(folder / name.strip(), t)
        if not shot.path.is_file():
            raise InputError(f"{path}, line {number}: there is no file {shot.path}.")
        if shots and not t > shots[-1].t:
            raise InputError(f"{path}, line {number}: t is {t!s}, expected later than {shots[-1].t!s}.")
        shots.append(shot)
    if not shots:
        raise InputError(f"{path}: found no rows, expected at least one.")
    return shots


def _time(stem: str) -> float | None:
    """s, for a file name that is a time."""
    if stem.isascii() and stem.isdigit():
        return int(stem) * _UNITS[len(stem)] if len(stem) in _UNITS else None
    return finite(stem) if re.fullmatch(r"-?\d+\.\d+", stem) else None
