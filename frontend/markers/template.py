"""Locates a marker's printed pattern in a frame, to a hundredth of a pixel.

Once the id is known so is the pattern, and all of its edges are aligned at once: the homography between the marker's
plane and the rays of the frame's pixels, the blur, the light on the paper, its curl, the spread of the ink and the
camera's tone curve and sharpening are fitted to the grey values by weighted least squares, Lucas and Kanade's alignment
(1981) with the pattern in closed form. A pattern of modules under a Gaussian blur is a sum of products of normal
distribution functions, exact along every straight edge. Rays as coordinates eliminate the lens's distortion, however
strong.

A tone curve and ink move every edge between black and white the same way, as a change of distance moves the outline
alone: the inner modules tell them apart. Paper that curls moves edges by their squared distance from the middle,
towards or away from where the camera stands: a change of perspective moves some of them sideways, too, and so a frame
tells these two apart.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.se2 import Array
from ._alignment import align
from ._corners import corner_rays, homography
from ._edges import spread
from ._grey import BLACK, SHARP, WHITE, A
from ._pixels import worst_module
from ._share import RIM
from .prior import UNKNOWN_CAMERA

LEAST_CONTRAST = 12.0  # least grey levels between black and white

CLOSE_FIT = 0.07
"""Residuals' standard deviation over the contrast that must be explained by noise or by sharpening.

Rendered markers have 0.02, in JPEG of quality 70 up to 0.06, photographs not sharpened 0.04, squares that only read as
a marker 0.08 and more.
"""

NO_FIT = 0.25  # likewise, but never accepted above

FAIR_FIT = 0.05  # likewise, from which on every module is looked at

SHARPENED = 0.3
"""Amount of sharpening from which its overshoot, which noise and JPEG deform, may leave larger residuals."""

CLEAN_MODULE, OTHER_COLOUR = 0.3, 0.5
"""Share of the contrast by which the worst module's middle may be off what is predicted; and in a fair fit.

Grainy and sharpened pictures have at most 0.25, some photographs 0.37; a different print has 0.4 and more.
"""

MODEL_SD = 0.002  # px, of a corner along each axis, for model errors


class PatternFit(NamedTuple):
    """A pattern aligned with a frame; `_grey` says which parameters there are."""

    rays: Array  # (4, 2) its corners on the plane z = 1 of the camera frame
    cov: Array  # (8, 8) their covariance
    residual: float  # grey levels, standard deviation
    contrast: float  # grey levels between white and black
    blur: Array  # (2, 2) px^2, the blur's covariance
    look: Array  # (16,) the parameters from the greys on
    normal: Array  # (24, 24) of all parameters, per squared grey level; it has the prior's part


def fit(
    image: NDArray[np.uint8], rays: Array, pattern: Array, start: Array, corners: Array, prior: Array = UNKNOWN_CAMERA
) -> PatternFit | None:
    """Aligns the square `pattern` (m + 2 RIM, m + 2 RIM), 1 is white, with a grey `image` (h, w); None if it fails.

    `rays` (h, w, 2) are the pixels' rays; `start` (4, 2) and `corners` (4, 2) an initial guess of the pattern's
    corners, to a pixel or two, as rays and in px: clockwise from the one at the pattern's first row and column. `prior`
    is one of `prior.py`.
    """
    modules = len(pattern) - 2 * RIM
    try:
        guess = homography(start, modules)
        found, normal, residual, look, misfit = align(image, rays, pattern, guess, corners, prior)
        contrast = float(look[WHITE] - look[BLACK])
        if not (contrast > LEAST_CONTRAST and residual < NO_FIT * contrast):
            return None
        root = np.array([[np.exp(look[A]), 0.0], [look[A + 1], np.exp(look[A + 2])]])
        if residual > FAIR_FIT * contrast:
            close = residual <= CLOSE_FIT * contrast
            if not (close or look[SHARP] > SHARPENED or residual <= np.hypot(CLOSE_FIT * contrast, _grain(image))):
                return None
            worst = worst_module(image, rays, pattern, found, look, corners)
            if worst > (OTHER_COLOUR if close else CLEAN_MODULE):
                return None
        change_cov = spread(normal, misfit)
        outline, cov = corner_rays(found, modules, change_cov)
    except np.linalg.LinAlgError:
        return None
    return PatternFit(outline, cov, float(residual), contrast, root @ root.T, look, normal)


def pattern(bits: NDArray[np.bool_]) -> Array:
    """The marker's inner `bits` (n, n), True is white, with its black border and RIM modules of paper."""
    return np.pad(np.pad(bits.astype(float), 1), RIM, constant_values=1.0)


def _grain(image: NDArray[np.uint8]) -> float:
    """Grey levels, the standard deviation of the noise: a median over the residuals of straight edges and slopes.

    Immerkaer 1996: the difference of two Laplacians, here on a sixteenth of the pixels.
    """
    height, width = image.shape
    rows = [[image[v : height - 2 + v : 4, u : width - 2 + u : 4].astype(np.int16) for u in range(3)] for v in range(3)]
    left, middle, right = (rows[0][u] - 2 * rows[1][u] + rows[2][u] for u in range(3))
    return float(np.median(np.abs(left - 2 * middle + right))) / 0.6745 / 6
