"""Matches of features by descriptors."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..se2 import Ints
from ._bits import Bits, two_nearest


def matched(first: NDArray[Any], second: NDArray[Any], ratio: float) -> Ints:
    """(m, 2) rows of descriptors (n, d) of two frames that belong together; a row is in one pair at most.

    The best in `second` has to be nearer than `ratio` times the next one (Lowe, IJCV 2004), and best to no other row.
    """
    if len(first) == 0 or len(second) < 2:
        return np.zeros((0, 2), np.int64)
    if first.dtype == np.uint8:
        distance, best = np.empty((len(first), 2), np.int64), np.empty(len(first), np.int64)
        two_nearest(bits_of(first), bits_of(second), distance, best)
    else:
        distance, nearest = cv2.batchDistance(first, second, cv2.CV_32F, normType=cv2.NORM_L2, K=2)
        best = nearest[:, 0].astype(np.int64)
    clear = np.flatnonzero(distance[:, 0] < ratio * distance[:, 1])
    to = best[clear]
    alone = np.bincount(to, minlength=len(second))[to] == 1
    return np.column_stack((clear[alone], to[alone]))


def bits_of(descriptors: NDArray[np.uint8]) -> Bits:
    """(n, d / 8) the bits of descriptors (n, d) of bytes, 64 in a column."""
    return np.ascontiguousarray(descriptors).view(np.uint64)
