"""Clouds of a drive on their way to its log, in files without names of the temporary folder, not in memory."""

from contextlib import suppress
from tempfile import TemporaryFile, gettempdir
from typing import IO, Any
from weakref import finalize

import numpy as np
from numpy.typing import NDArray

from ..beside import UNIT, Clouds
from ..camera.camera import Camera
from ..relations import Anchors
from .cloud import Cloud

WIDTH = 3
"""Numbers of a point, and of its colour."""


class Spool:
    """Takes the cloud of one step after another. OSError, with the folder's name, where there is no room for them."""

    def __init__(self) -> None:
        self._points, self._colours = _Rows(np.int16), _Rows(np.uint8)
        self._first = [0]

    def add(self, cloud: Cloud) -> None:
        """Takes the next cloud; a point is kept to UNIT."""
        limit = np.iinfo(np.int16)
        self._points.add(np.rint(cloud.points / UNIT).clip(limit.min, limit.max).astype(np.int16))
        self._colours.add(cloud.colours)
        self._first.append(self._first[-1] + len(cloud.points))

    def clouds(self, camera: Camera) -> Clouds:
        """All clouds, the k-th one taken at step k; their points are read from the files as they are asked for."""
        n, count = len(self._first) - 1, self._first[-1]
        at = Anchors(np.arange(n), np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(n))
        first, height = np.array(self._first, np.int64), camera.mounting[:3, 3].copy()
        return Clouds(at, first, self._points.all(count), self._colours.all(count), height)


class _Rows:
    """Rows of three numbers in a file."""

    def __init__(self, kind: type[np.int16 | np.uint8]) -> None:
        self._kind, self._file = kind, TemporaryFile()  # noqa: SIM115 - open as long as this is
        finalize(self, _close, self._file)

    def add(self, rows: NDArray[Any]) -> None:
        try:
            self._file.write(np.ascontiguousarray(rows, self._kind).tobytes())
            self._file.flush()
        except OSError as error:
            error.filename = error.filename or gettempdir()  # a full disk names no file
            raise

    def all(self, count: int) -> NDArray[Any]:
        """The first `count` rows (count, 3), for reading."""
        if not count:  # an empty file cannot be mapped
            return np.zeros((0, WIDTH), self._kind)
        return np.asarray(np.memmap(self._file, self._kind, "c", shape=(count, WIDTH)))


def _close(file: IO[bytes]) -> None:
    """Closes a file that nobody reads any more, and so may lack what a full disk had no room for."""
    with suppress(OSError):
        file.close()
