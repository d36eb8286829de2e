"""Reads a video file with OpenCV's ffmpeg, frame by frame, ignoring its orientation tag.

Times come from frames.csv (`frame,t`: the frame's number in the video from 0, seconds) if it exists, else from a frame
rate and a start given by the user, else from the time stamps in the video. Only frames in frames.csv are used. If the
video ends early, the missing frames count as undecodable.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from ...core.errors import InputError
from ...core.table import read_csv
from ...frontend.camera.quiet_decoders import silenced
from ...frontend.markers.aruco import Image
from ...frontend.markers.pipeline import Frame
from .frames_folder import FRAMES

VIDEOS = (".mkv", ".avi", ".mp4", ".mov", ".m4v", ".webm", ".mpg", ".mpeg")


@dataclass(frozen=True)
class Video:
    """Frames that are decoded on demand, any number of times, from the video's beginning each time."""

    path: Path
    times: Sequence[tuple[int, float]] | None  # (number of the frame, s); None: all, `fps` or time stamps say when
    fps: float | None  # frames per second; None: the video's own time stamps
    start: float  # s, the time of frame 0 without `times`
    length: int | None  # number of frames; None: unknown

    def __iter__(self) -> Iterator[Frame]:
        return self._timed() if self.times is None else self._listed(self.times)

    def _listed(self, times: Sequence[tuple[int, float]]) -> Iterator[Frame]:
        with _Reader(self.path) as reader:
            for number, t in times:
                yield Frame(t, reader.frame(number))

    def _timed(self) -> Iterator[Frame]:
        rate, t = self.fps, -np.inf
        with _Reader(self.path) as reader:
            number = 0
            while reader.advance():
                previous, t = t, self.start + (reader.stamp if self.fps is None else number / self.fps)
                if not t > previous:
                    raise InputError(
                        f"{self.path}: frame {number} is stamped {t} s, expected later than {previous} s: expected "
                        "frames.csv beside it, or [frames] fps in robot.toml."
                    )
                yield Frame(t, reader.image())
                number += 1
            rate = self.fps or reader.rate
        # The number in a container's header may be one off; if more, the file is truncated.
        missing = (self.length or 0) - number
        for late in range(1, missing + 1 if missing > 1 and rate else 1):
            yield Frame(t + late / rate, None)


def read(path: Path, home: Path, fps: float | None, start: float) -> Video:
    """Opens the video at `path`, with times from `home`/frames.csv, `fps` and `start`, or the video itself.

    InputError if it cannot be opened, and for an invalid frames.csv.
    """
    if not path.stat().st_size:
        raise InputError(f"{path}: the file is empty, expected a video.")
    with _Reader(path) as reader:
        length = reader.length
    listed = home / FRAMES
    if not listed.exists():
        return Video(path, None, fps, start, length)
    table = read_csv(listed, ("frame", "t")).finite()
    numbers, t = table.whole("frame"), table.column("t")
    if not len(t):
        raise InputError(f"{listed}: found no rows, expected at least one.")
    for row in np.flatnonzero(np.diff(numbers, prepend=-1) < 1):
        raise table.fault(row, f"frame is {numbers[row]}, expected numbers from 0 that increase")
    for row in np.flatnonzero(~(np.diff(t) > 0)) + 1:
        raise table.fault(row, f"t is {t[row]!s}, expected later than {t[row - 1]!s}")
    return Video(path, list(zip(numbers.tolist(), t.tolist(), strict=True)), None, start, len(t))


class _Reader:
    """An open video. InputError if it cannot be opened."""

    def __init__(self, path: Path) -> None:
        with silenced():
            # One thread: others would continue, and print errors, after silencing has ended.
            self._capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG, [cv2.CAP_PROP_N_THREADS, 1])
        if not self._capture.isOpened():
            raise InputError(
                f"{path}: cannot be opened as a video: truncated before its index, damaged, or of an unknown kind."
            )
        self._capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)
        self._next = 0  # the number of the frame that comes next

    def __enter__(self) -> "_Reader":
        return self

    def __exit__(self, *_: object) -> None:
        with silenced():
            self._capture.release()

    @property
    def length(self) -> int | None:
        """Number of frames in the video's header."""
        return max(int(self._capture.get(cv2.CAP_PROP_FRAME_COUNT)), 0) or None

    @property
    def rate(self) -> float:
        """Frames per second in the video's header, 0 if unknown."""
        return float(self._capture.get(cv2.CAP_PROP_FPS))

    @property
    def stamp(self) -> float:
        """s, time stamp of the current frame."""
        return float(self._capture.get(cv2.CAP_PROP_POS_MSEC)) / 1e3

    def advance(self) -> bool:
        """Advances to the next frame; False at the end."""
        with silenced():
            self._next += 1
            return bool(self._capture.grab())

    def image(self) -> Image | None:
        """The current frame, (height, width) grey."""
        with silenced():
            there, image = self._capture.retrieve()
        if not there:
            return None
        image = np.asarray(image, np.uint8)
        return image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)

    def frame(self, number: int) -> Image | None:
        """Frame `number`, which must not be behind the current one; None beyond the end."""
        while self._next <= number:
            if not self.advance():
                self._next = number  # the end, also for later calls
                return None
        return self.image()
