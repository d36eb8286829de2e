"""Markers whose bits are no marker's: a camera finds the square, but cannot read an id."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

LEAST_APART = 4
"""Bits by which a pattern differs from every marker however turned: a detector corrects fewer."""


def scrambled(
    dictionary: cv2.aruco.Dictionary, ids: Sequence[int], rng: np.random.Generator
) -> dict[int, NDArray[np.bool_]]:
    """Random bits (n, n), True is white, for each of the `ids`."""
    size = dictionary.markerSize
    drawn = [dictionary.generateImageMarker(k, size + 2, borderBits=1) for k in range(len(dictionary.bytesList))]
    words = np.array([np.rot90(np.asarray(one)[1:-1, 1:-1] > 0, turns) for one in drawn for turns in range(4)])
    found = dict[int, NDArray[np.bool_]]()
    while len(found) < len(ids):
        bits = rng.uniform(size=(size, size)) < 0.5
        if (bits != words).sum(axis=(1, 2)).min() >= LEAST_APART and 0.25 < bits.mean() < 0.75:
            found[ids[len(found)]] = bits
    return found
