"""Writes an annotated video, frame by frame beside its place, and moves it there when complete."""

import os
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ...core.errors import InputError
from ...frontend.markers.aruco import Image

CODECS = {".mp4": "mp4v", ".mkv": "mp4v", ".avi": "MJPG", ".webm": "VP80"}
"""suffix -> the codec that OpenCV's own writer has for it everywhere"""

_TIMED = 8  # frames whose times settle the frame rate


class Preview:
    """A context manager; the video is there at the end unless an exception is raised."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._beside = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix}")
        self._waiting: list[Image] = []
        self._times: list[float] = []
        self._writer: Any = None

    def add(self, t: float, image: Image) -> None:
        """Writes a frame of the time `t`, s; InputError where the video cannot be written."""
        self._times.append(t)
        self._waiting.append(image)
        if self._writer is not None or len(self._times) == _TIMED:
            self._flush()

    def __enter__(self) -> "Preview":
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
