"""Writes a depth camera's frames as PNG files, in whole millimetres, with a table of their times."""

from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ...frontend.depth.recording import DepthFrame
from ..depth.folder import MM
from .write_tables import write_rows


@contextmanager
def depth_files(folder: Path) -> Generator[Callable[[DepthFrame], None]]:
    """Two files for each frame, and their table."""
    rows = list[tuple[str, str, float]]()

    def add(frame: DepthFrame) -> None:
        names = f"frames/{len(rows):06}.png", f"frames/{len(rows):06}-depth.png"
        write_png(folder / names[0], pixels_of(frame))
        write_png(folder / names[1], in_units(frame, MM))
        rows.append((*names, frame.seconds))

    (folder / "frames").mkdir()
    yield add
    write_rows(folder / "frames.csv", "image,depth,t", rows)


def pixels_of(frame: DepthFrame) -> NDArray[np.uint8]:
    """The image, in colour if it is."""
    return frame.grey if frame.colour is None else frame.colour


def in_units(frame: DepthFrame, units: float) -> NDArray[np.uint16]:
    """The depth in units, rounded to whole millimetres."""
    mm = np.rint(1000 * frame.depth.astype(np.float64))
    return (mm * (units / 1000)).astype(np.uint16)


def write_png(path: Path, pixels: NDArray[np.uint8] | NDArray[np.uint16]) -> None:
    """A PNG file."""
    _, content = cv2.imencode(".png", pixels, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    path.write_bytes(content.tobytes())
