"""Matches of features by descriptors."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..se2 import Ints


def matched(first: NDArray[Any], second: NDArray[Any], ratio: float) -> Ints:
    """(m, 2) rows of descriptors (n, d) of two frames that belong together; a row is in one pair at most.

    The best in `second` has to be nearer than `ratio` times the next one (Lowe, IJCV 2004), and best to no other row.
    """
    if len(first) == 0 or len(second) < 2:
        return np.zeros((0, 2), np.int64)
    bits = first.dtype == np.uint8
    distance, best = cv2.batchDistance(
        first, second, cv2.CV_32S if bits else cv2.CV_32F, normType=cv2.NORM_HAMMING if bits else cv2.NORM_L2, K=2
    )
    clear = np.flatnonzero(distance[:, 0] < ratio * distance[:, 1])
    to = best[clear, 0].astype(np.int64)
    alone = np.bincount(to, minlength=len(second))[to] == 1
    return np.column_stack((clear[alone], to[alone]))
