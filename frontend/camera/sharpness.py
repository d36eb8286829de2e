"""Measures the blur of images, in pixels."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.se2 import Array

Image = NDArray[np.uint8]

REACH = 16  # px on either side of an edge that are examined: blur up to half of it is measured

STRONGEST, FEWEST = 150, 30
"""Most edges measured per direction in a set of images, and fewest for a result."""

CONTRAST = 25.0  # least contrast, in grey levels, of an edge that counts
SMOOTHING = 1.0  # px, standard deviation of the blur added against noise, and subtracted again


def blur(images: Sequence[Image]) -> float | None:
    """px, the standard deviation of the blur of the sharpest edges; None where there are too few edges.

    Edges across and down are measured separately, and the more blurred direction counts: motion blurs only one. An edge
    of contrast A under a Gaussian of deviation s has slope A / (s sqrt(2 pi)) at its middle; the contrast is the extent
    of the monotonic rise. The first quartile over the edges is taken, as an edge may be soft itself, and a neighbouring
    one can add to its contrast.
    """
    measured = [_along_rows(images), _along_rows([np.swapaxes(image, 0, 1) for image in images])]
    known = [np.quantile(widths, 0.25) for widths in measured if len(widths) >= FEWEST]
    return float(max(known)) if known else None


def _along_rows(images: Sequence[Image]) -> Array:
    """(n,) px, of the strongest edges crossed by rows."""
    each = max(10, STRONGEST // max(1, len(images)))
    return np.concatenate([_image_along_rows(image, each) for image in images])


def _image_along_rows(image: Image, most: int) -> Array:
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) if image.ndim == 3 else np.ascontiguousarray(image)
    smooth = np.asarray(cv2.GaussianBlur(grey.astype(np.float32), (0, 0), SMOOTHING))
    slope = np.diff(smooth, axis=1)
    steep = np.abs(slope)
    across = np.abs(np.diff(smooth, axis=0, append=smooth[-1:]))[:, :-1]
    inner = steep[:, REACH:-REACH]
    peak = (inner >= steep[:, REACH - 1 : -REACH - 1]) & (inner > steep[:, REACH + 1 : steep.shape[1] - REACH + 1])
    peak &= inner > 2 * across[:, REACH:-REACH]  # edges at right angles to the row
    rows, columns = np.nonzero(peak)
    strength = inner[rows, columns]
    if len(strength) == 0:
        return np.zeros(0)
    strongest = np.argsort(-strength)[: 4 * most]
    rows, columns = rows[strongest], columns[strongest] + REACH
    around = slope[rows[:, None], columns[:, None] + np.arange(-REACH, REACH + 1)]
    around *= np.sign(around[:, [REACH]])
    top = around[:, REACH]
    rising = around > 0.05 * top[:, None]
    right = np.cumprod(rising[:, REACH:], axis=1)
    left = np.cumprod(rising[:, REACH::-1], axis=1)
    contrast = (around[:, REACH:] * right).sum(axis=1) + (around[:, REACH::-1] * left).sum(axis=1) - top
    deviation = contrast / (top * np.sqrt(2 * np.pi))
    counted = deviation[contrast > CONTRAST][:most]
    return np.sqrt(np.maximum(counted**2 - SMOOTHING**2, 0))
