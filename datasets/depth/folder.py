"""A folder of colour and depth images as files.

rgb.txt, depth.txt    stamp file        a list each, as in the TUM RGB-D benchmark: lines of a time, s, and a file's
                                        name, comments after #; 5,000 units of a depth image are a metre
frames.csv            image,depth,t     both images of each frame and their time, s; 1,000 units are a metre

Depth images are PNG files of 16 bits. The truth of a TUM folder, groundtruth.txt, is of the camera's poses.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from ...core.csv_values import finite
from ...core.errors import InputError
from ...core.factors import Truth
from ...core.se2 import Array
from ...core.table import text
from ...frontend.camera.quaternions import matrix
from ...frontend.camera.quiet_decoders import silenced
from .shots import Flaw, Pixels, Shot, in_metres

RGB, DEPTH, FRAMES, TRUTH = "rgb.txt", "depth.txt", "frames.csv", "groundtruth.txt"

TUM_UNITS, MM = 5000.0, 1000.0  # units of a depth image that are a metre

COLUMNS = ["image", "depth", "t"]

UPRIGHT = 0.5  # least cosine between the robot's z axis by the truth and the world's


class Listed(NamedTuple):
    """A file and its time."""

    path: Path
    t: float  # s


@dataclass(frozen=True)
class Folder:
    """The files of a folder."""

    images: Sequence[Listed]
    depths: Sequence[Listed]
    units: float  # of a depth image that are a metre

    def pictures(self) -> Iterator[Shot]:
        """The images, grey or BGR."""
        return (Shot(one.t, str(one.path), lambda path=one.path: _picture(path)) for one in self.images)

    def measured(self) -> Iterator[Shot]:
        """The depth images, m."""
        return (Shot(one.t, str(one.path), lambda path=one.path: _depth(path, self.units)) for one in self.depths)


def is_folder(path: Path) -> bool:
    """Tells if a folder has lists of colour and depth images."""
    return (path / RGB).is_file() or (path / DEPTH).is_file() or _is_ours(path / FRAMES)


def read_folder(path: Path, units: float | None) -> Folder:
    """The files that are listed in a folder; `units` of a depth image are a metre, None: the layout's own.

    InputError for lists that are missing, empty or out of order.
    """
    if _is_ours(path / FRAMES):
        images, depths = _frames(path / FRAMES)
        return Folder(images, depths, units or MM)
    for name, other in ((RGB, DEPTH), (DEPTH, RGB)):
        if not (path / name).is_file():
            raise InputError(f"{path}: has {other} and no {name}, expected both lists of images.")
    return Folder(_list(path / RGB), _list(path / DEPTH), units or TUM_UNITS)


def read_camera_truth(path: Path, mounting: Array) -> Truth | None:
    """The robot's path by the camera's poses in a TUM folder; `mounting` (4, 4) is T_robot_camera. None: no truth.

    InputError names the line of a fault, or says that the world's z axis does not point up.
    """
    file = path / TRUTH
    if not file.is_file():
        return None
    rows = list[Array]()
    for number, words in _rows(file):
        try:
            row = np.array([float(word) for word in words])
        except ValueError:
            row = np.zeros(0)
        if len(row) != 8 or not np.isfinite(row).all() or not abs(np.linalg.norm(row[4:]) - 1) < 1e-2:
            raise InputError(
                f"{file}, line {number}: found {' '.join(words)!r}, expected t x y z qx qy qz qw, the last four of "
                "length 1."
            )
        if rows and not row[0] > rows[-1][0]:
            raise InputError(f"{file}, line {number}: t is {row[0]} s, expected later than {rows[-1][0]} s.")
        rows.append(row)
    if not rows:
        raise InputError(f"{file}: found no poses, expected at least one.")
    columns = np.array(rows)
    return robot_truth(str(file), columns[:, 0], np.array([matrix(row) for row in columns[:, 1:]]), mounting)


def robot_truth(where: str, t: Array, cameras: Array, mounting: Array) -> Truth:
    """The robot's path by the camera's poses (n, 4, 4) at `t` (n,), s; InputError, after `where`, if z is not up."""
    back = np.eye(4)  # T_camera_robot
    back[:3, :3], back[:3, 3] = mounting[:3, :3].T, -mounting[:3, :3].T @ mounting[:3, 3]
    world = cameras @ back
    for row in np.flatnonzero(world[:, 2, 2] < UPRIGHT):
        lean = np.rad2deg(np.arccos(np.clip(world[row, 2, 2], -1, 1)))
        raise InputError(
            f"{where}: at {t[row]} s the robot would lean by {lean:.0f} degrees, expected a world whose z axis points "
            "up, and the camera's mounting in [camera]."
        )
    heading = np.arctan2(world[:, 1, 0], world[:, 0, 0])
    return Truth(t, np.column_stack((world[:, :2, 3], heading)))


def _is_ours(path: Path) -> bool:
    """Tells a frames.csv of a depth camera from one of another camera."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return [cell.strip() for cell in file.readline(200).decode(errors="replace").split(",")] == COLUMNS


def _frames(path: Path) -> tuple[list[Listed], list[Listed]]:
    """The files in a frames.csv."""
    images, depths = list[Listed](), list[Listed]()
    for number, line in enumerate(text(path).split("\n")[1:], start=2):
        if not line.strip():
            continue
        cells = [cell.strip() for cell in line.split(",")]
        t = finite(cells[-1])
        if len(cells) != 3 or t is None:
            raise InputError(f"{path}, line {number}: found {line!r}, expected two files' names and a time in seconds.")
        if images and not t > images[-1].t:
            raise InputError(f"{path}, line {number}: t is {t!s}, expected later than {images[-1].t!s}.")
        images.append(Listed(path.parent / cells[0], t))
        depths.append(Listed(path.parent / cells[1], t))
    if not images:
        raise InputError(f"{path}: found no rows, expected at least one.")
    return images, depths


def _list(path: Path) -> list[Listed]:
    """Reads a list of image files in TUM's format."""
    found = list[Listed]()
    for number, words in _rows(path):
        t = finite(words[0])
        if len(words) != 2 or t is None:
            raise InputError(
                f"{path}, line {number}: found {' '.join(words)!r}, expected a time in seconds and a file's name."
            )
        if found and not t > found[-1].t:
            raise InputError(f"{path}, line {number}: the time is {t!s} s, expected later than {found[-1].t!s} s.")
        found.append(Listed(path.parent / words[1], t))
    if not found:
        raise InputError(f"{path}: found no images, expected at least one.")
    return found


def _rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Number and words of each line that is not empty or a comment."""
    for number, line in enumerate(text(path).split("\n"), start=1):
        words = line.partition("#")[0].split()
        if words:
            yield number, words


def _picture(path: Path) -> Pixels | Flaw:
    pixels = _decoded(path)
    if pixels is None:
        return _unreadable(path, "images")
    if pixels.dtype.itemsize == 2:
        pixels = (pixels >> 8).astype(np.uint8)
    if pixels.ndim == 3:
        return pixels[:, :, :3] if pixels.shape[2] >= 3 else pixels[:, :, 0]
    return pixels


def _depth(path: Path, units: float) -> Pixels | Flaw:
    pixels = _decoded(path)
    return _unreadable(path, "depth images") if pixels is None else in_metres(pixels, units)


def _unreadable(path: Path, kind: str) -> Flaw:
    if not path.is_file():
        return Flaw(f"{kind} that are missing", "does not exist, expected the image that is listed")
    return Flaw(f"{kind} that cannot be decoded", "cannot be decoded, expected a whole image file")


def _decoded(path: Path) -> Pixels | None:
    """The pixels of an image file as they are; None if it is unreadable, truncated or no regular file."""
    if not path.is_file():
        return None
    try:
        content = np.frombuffer(path.read_bytes(), np.uint8)
        with silenced():
            pixels = cv2.imdecode(content, cv2.IMREAD_UNCHANGED)
    except (OSError, cv2.error):
        return None
    if pixels is None or not _whole(content):
        return None
    return np.asarray(pixels)


def _whole(content: Pixels) -> bool:
    """Tells if a PNG or JPEG file has its end: OpenCV makes up the rest of a truncated one."""
    start, end = content[:8].tobytes(), content[-64:].tobytes()
    ends = {b"\x89PNG": b"IEND", b"\xff\xd8\xff\xe0": b"\xff\xd9", b"\xff\xd8\xff\xe1": b"\xff\xd9"}
    return ends.get(start[:4], b"") in end
