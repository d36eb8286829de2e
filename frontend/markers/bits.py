"""Samples the bits in a black square outline, whether or not any dictionary has them."""

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.se2 import Array

CLEAN = 0.9  # least share of a sample's cells whose points agree, all but one
_POINTS = (0.3, 0.5, 0.7)  # sample positions in a cell, across and down
RIM = 0.4  # cells outside the black border where the rim has to be white
LEAST_CONTRAST = 8.0  # grey levels; OpenCV requires 7 between a square and its surroundings


def sample(grey: NDArray[np.uint8], quad: Array, size: int) -> NDArray[np.bool_] | None:
    """(size, size) the bits in a square outline (4, 2) px, or None unless border, white rim and all cells are clean."""
    cells, points = size + 2, len(_POINTS)
    at = np.concatenate(([-RIM], (np.arange(cells)[:, None] + _POINTS).ravel(), [cells + RIM]))
    x, y = np.meshgrid(at, at)
    corners = np.array([[0, 0], [cells, 0], [cells, cells], [0, cells]], np.float32)
    to_image = cv2.getPerspectiveTransform(corners, np.asarray(quad, np.float32))
    u, v, w = to_image @ np.stack((x.ravel(), y.ravel(), np.ones(x.size)))
    column, row = ((c / w).reshape(x.shape).astype(np.float32) for c in (u, v))
    seen = np.asarray(cv2.remap(grey, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), float)
    low, high = np.percentile(seen, (5, 95))
    bright = seen > (low + high) / 2
    rim = np.concatenate((bright[0], bright[-1], bright[:, 0], bright[:, -1]))
    white = bright[1:-1, 1:-1].reshape(cells, points, cells, points).sum(axis=(1, 3))
    clean = ((white <= 1) | (white >= points**2 - 1)).mean()
    bits = white > points**2 / 2
    inside = bits[1:-1, 1:-1]
    if high - low < LEAST_CONTRAST or clean < CLEAN or rim.mean() < CLEAN or bits.sum() > inside.sum():
        return None
    return inside if 0.1 < inside.mean() < 0.9 else None
