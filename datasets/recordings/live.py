"""Reads a live camera of this machine.

Wheels are not read along: without their readings the front end needs [drift] in robot.toml. A drive with wheel counters
is recorded first, as frames or a video with ticks.csv.
"""

import signal
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from types import FrameType
from typing import Any

import cv2
import numpy as np

from ...core.errors import InputError
from ...frontend.camera.quiet_decoders import silenced
from ...frontend.markers.pipeline import Frame

PREFIX = "camera:"


@dataclass(frozen=True)
class Live:
    """The frames of an open camera, until `seconds` have passed, or Ctrl-C; the camera is then released."""

    capture: Any  # cv2.VideoCapture, or anything with its read and release
    name: str
    seconds: float | None  # None: until Ctrl-C

    def __iter__(self) -> Iterator[Frame]:
        stopped = threading.Event()
        previous = _on_interrupt(stopped)
        begin, missed = time.monotonic(), 0
        try:
            while not stopped.is_set() and missed < _PATIENCE:
                t = time.monotonic() - begin
                if self.seconds is not None and t >= self.seconds:
                    break
                with silenced():
                    there, image = self.capture.read()
                missed = 0 if there else missed + 1
                yield Frame(t, np.asarray(image, np.uint8) if there else None)
            if missed == _PATIENCE:
                raise InputError(f"{self.name}: gave no frame {_PATIENCE} times in a row, expected a working camera.")
        finally:
            if previous is not None:
                signal.signal(signal.SIGINT, previous)
            self.capture.release()


_PATIENCE = 30  # most consecutive frames that a camera may fail to deliver


def read(name: str, seconds: float | None) -> Live:
    """Opens the camera `name`, such as camera:0. InputError if there is none."""
    number = name.removeprefix(PREFIX)
    if not (number.isascii() and number.isdigit()):
        raise InputError(f"{name}: found the camera number {number!r}, expected camera:0, camera:1 and so on.")
    with silenced():
        capture = cv2.VideoCapture(int(number))
    if not capture.isOpened():
        raise InputError(f"{name}: there is no such camera, or another program uses it.")
    capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)  # the latest frame, not the oldest
    return Live(capture, name, seconds)


def _on_interrupt(stopped: threading.Event) -> Any:
    """Makes Ctrl-C set `stopped`; returns the previous handler, None if it cannot be changed from here."""
    if threading.current_thread() is not threading.main_thread():
        return None

    def stop(_: int, __: FrameType | None) -> None:
        stopped.set()

    return signal.signal(signal.SIGINT, stop)
