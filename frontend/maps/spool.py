"""Clouds of a drive on their way to its log, in files of the temporary folder, not in memory."""

import numpy as np

from ...core.beside import UNIT, Clouds
from ...core.files import Rows
from ...core.relations import Anchors
from ..camera.camera import Camera
from .cloud import Cloud


class Spool:
    """Takes the cloud of one step after another. OSError, with the folder's name, where there is no room for them."""

    def __init__(self) -> None:
        self._points, self._colours = Rows(np.int16, 3), Rows(np.uint8, 3)
        self._first = [0]

    def add(self, cloud: Cloud) -> None:
        """Takes the next cloud; a point is kept to UNIT."""
        limit = np.iinfo(np.int16)
        self._points.add(np.rint(cloud.points / UNIT).clip(limit.min, limit.max).astype(np.int16))
        self._colours.add(cloud.colours)
        self._first.append(self._first[-1] + len(cloud.points))

    def clouds(self, camera: Camera) -> Clouds:
        """All clouds, the k-th one taken at step k; their points are read from the files as they are asked for."""
        n = len(self._first) - 1
        at = Anchors(np.arange(n), np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(n))
        first, height = np.array(self._first, np.int64), camera.mounting[:3, 3].copy()
        return Clouds(at, first, self._points.all(), self._colours.all(), height)
