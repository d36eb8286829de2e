"""Locates a marker's printed pattern in a frame, to a hundredth of a pixel.

Once the id is known so is the pattern, and all of its edges are aligned at once: the homography between the marker's
plane and the rays of the frame's pixels, the blur, and the light on the paper are fitted to the grey values by weighted
least squares, Lucas and Kanade's alignment (1981) with the pattern in closed form. A pattern of modules under a
Gaussian blur is a sum of products of normal distribution functions, exact along every straight edge; a kurtosis covers
motion blur and the pixel's own box. Rays as coordinates eliminate the lens's distortion, however strong.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..se2 import Array
from ._alignment import RIM, align, worst_module
from ._homography import corner_rays, homography

LEAST_CONTRAST = 12.0
"""Least grey levels between black and white."""

CLOSE_FIT = 0.05
"""Residuals' standard deviation over the contrast that must be explained by noise or by sharpening.

Rendered markers have 0.02, photographs not sharpened 0.04, squares that only read as a marker 0.08 and more.
"""

NO_FIT = 0.25
"""Likewise, but never accepted above."""

SHARP = 0.6
"""px: sharpened edges appear to have less blur than a pixel's own, and they overshoot."""

CLEAN_MODULE = 0.3
"""Share of the contrast, from black or white, of the worst module's middle.

Grainy and sharpened pictures have at most 0.25; a different print has 0.4 and more.
"""

NEIGHBOURS = 1.2
"""Factor on the residuals' covariance: blur correlates those of neighbouring pixels."""

MODEL_SD = 0.002
"""px, of a corner along each axis, for model errors."""


class Fit(NamedTuple):
    """A pattern aligned with a frame."""

    rays: Array  # (4, 2) its corners on the plane z = 1 of the camera frame
    cov: Array  # (8, 8) their covariance
    residual: float  # grey levels, standard deviation
    contrast: float  # grey levels between white and black
    blur: Array  # (2, 2) px^2, the blur's covariance


def fit(image: NDArray[np.uint8], rays: Array, pattern: NDArray[np.bool_], start: Array, corners: Array) -> Fit | None:
    """Aligns the square `pattern` (m + 2 RIM, m + 2 RIM), True is white, with a grey `image` (h, w); None if it fails.

    `rays` (h, w, 2) are the pixels' rays; `start` (4, 2) and `corners` (4, 2) an initial guess of the pattern's
    corners, to a pixel or two, as rays and in px: clockwise from the one at the pattern's first row and column.
    """
    modules = len(pattern) - 2 * RIM
    try:
        guess = homography(start, modules)
        found, normal, residual, look = align(image, rays, pattern, guess, corners)
        contrast = float(look[5] - look[4])
        if not (contrast > LEAST_CONTRAST and residual < NO_FIT * contrast):
            return None
        root = np.array([[np.exp(look[0]), 0.0], [look[1], np.exp(look[2])]])
        if residual > CLOSE_FIT * contrast:
            sharpened = np.linalg.norm(root, 2) < SHARP
            if not sharpened and residual > np.hypot(CLOSE_FIT * contrast, _grain(image)):
                return None
            if worst_module(image, rays, pattern, found, look, corners) > CLEAN_MODULE:
                return None
        change_cov = NEIGHBOURS * residual**2 * np.linalg.inv(normal)[:8, :8].astype(float)
        outline, cov = corner_rays(found, modules, change_cov)
    except np.linalg.LinAlgError:
        return None
    return Fit(outline, cov, float(residual), contrast, root @ root.T)


def pattern(bits: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The marker's inner `bits` (n, n), True is white, with its black border and RIM modules of paper."""
    return np.pad(np.pad(bits, 1, constant_values=False), RIM, constant_values=True)


def _grain(image: NDArray[np.uint8]) -> float:
    """Grey levels, the standard deviation of the noise: a median over the residuals of straight edges and slopes.

    Immerkaer 1996: the difference of two Laplacians, here on a sixteenth of the pixels.
    """
    height, width = image.shape
    rows = [[image[v : height - 2 + v : 4, u : width - 2 + u : 4].astype(np.int16) for u in range(3)] for v in range(3)]
    left, middle, right = (rows[0][u] - 2 * rows[1][u] + rows[2][u] for u in range(3))
    return float(np.median(np.abs(left - 2 * middle + right))) / 0.6745 / 6
