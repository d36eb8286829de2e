"""Writes annotated videos, frame by frame beside their places, and moves them there when complete."""

import os
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any

import cv2
import numpy as np

from ...core.errors import InputError
from ...datasets.robot_files import file_of
from ...frontend.markers.aruco import Image

CODECS = {".mp4": "mp4v", ".mkv": "mp4v", ".avi": "MJPG", ".webm": "VP80"}
"""suffix -> the codec that OpenCV's own writer has for it everywhere"""

_TIMED = 8  # frames whose times settle the frame rate


class Preview:
    """A context manager; the video is there at the end unless an exception is raised.

    Each of several cameras has one: film-left.mp4 for film.mp4, and so on.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._films = dict[str, _Film]()
        self._open = ExitStack()

    def add(self, t: float, image: Image, camera: str = "") -> None:
        """Writes a frame of the time `t`, s, of a `camera`, of several; InputError where a video cannot be written."""
        if camera not in self._films:
            self._films[camera] = self._open.enter_context(_Film(file_of(self._path, camera)))
        self._films[camera].add(t, image)

    def __enter__(self) -> "Preview":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._open.__exit__(kind, error, trace)


class _Film:
    """A context manager; the video is there at the end unless an exception is raised."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._beside = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix}")
        self._waiting: list[Image] = []
        self._times: list[float] = []
        self._writer: Any = None

    def add(self, t: float, image: Image) -> None:
        """Writes a frame of the time `t`, s."""
        self._times.append(t)
        self._waiting.append(image)
        if self._writer is not None or len(self._times) == _TIMED:
            self._flush()

    def __enter__(self) -> "_Film":
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            if kind is None and self._waiting:
                self._flush()
            if self._writer is not None:
                self._writer.release()
                if kind is None:
                    if not self._beside.is_file() or not self._beside.stat().st_size:
                        raise self._refusal()
                    os.replace(self._beside, self._path)
        finally:
            self._beside.unlink(missing_ok=True)

    def _flush(self) -> None:
        if self._writer is None:
            height, width = self._waiting[0].shape[:2]
            gap = float(np.median(np.diff(self._times))) if len(self._times) > 1 else 1.0
            codec = cv2.VideoWriter.fourcc(*CODECS[self._path.suffix.lower()])
            rate = float(np.clip(1 / gap, 1, 120))
            self._writer = cv2.VideoWriter(str(self._beside), codec, rate, (width, height))
            if not self._writer.isOpened():
                raise self._refusal()
        for image in self._waiting:
            self._writer.write(image)
        self._waiting.clear()
        self._times = self._times[:_TIMED]

    def _refusal(self) -> InputError:
        codec = CODECS[self._path.suffix.lower()]
        return InputError(f"--preview {self._path}: this OpenCV cannot write a video there with codec {codec}")
