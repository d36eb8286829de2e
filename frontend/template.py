"""Where a marker's printed pattern lies in a frame, to a hundredth of a pixel.

The pattern is known once the id is, so all of its edges are laid over the frame at once: the homography between the
marker's plane and the rays of the frame's pixels, the blur, and the light on the paper are fitted to the grey values by
weighted least squares, Lucas and Kanade's alignment (1981) with the pattern in closed form. A pattern of modules under
a Gaussian blur is a sum of products of normal distribution functions, exact along every straight edge; a kurtosis lets
the blur be a streak's or a pixel's. Rays as coordinates take the lens's distortion out, however strong.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ._alignment import RIM, align, worst_module
from .se2 import Array

LEAST_CONTRAST = 12.0
"""Grey levels between black and white."""

CLOSE_FIT = 0.05
"""Residuals' standard deviation over the contrast: rendered markers have 0.02, photographs not sharpened 0.04, squares
that only read as a marker 0.08 and more. More than this has to be explained, by noise or by sharpening."""

NO_FIT = 0.25
"""Likewise: more is not explained by anything."""

SHARP = 0.6
"""px: sharpened edges look as if they had a smaller blur than a pixel's own, and they overshoot."""

CLEAN_MODULE = 0.3
"""Of the contrast, from black or white: in grainy and in sharpened pictures the middle of every module has at most
0.25; where something else is printed one has 0.4 and more."""

NEIGHBOURS = 1.2
"""What the residuals' covariance is multiplied with: a blur makes those of neighbouring pixels alike."""

MODEL_SD = 0.002
"""px, of a corner along each axis, from all that the model leaves out."""


class Fit(NamedTuple):
    """A pattern laid over a frame."""

    rays: Array  # (4, 2) its corners on the plane z = 1 of the camera frame
    cov: Array  # (8, 8) their covariance
    residual: float  # grey levels, standard deviation
    contrast: float  # grey levels between white and black
    blur: Array  # (2, 2) px^2, the blur's covariance


def fit(image: NDArray[np.uint8], rays: Array, pattern: NDArray[np.bool_], start: Array, corners: Array) -> Fit | None:
    """The square `pattern` (m + 2 RIM, m + 2 RIM), True is white, in a grey `image` (h, w); None where nothing is.

    `rays` (h, w, 2) are the pixels' rays; `start` (4, 2) and `corners` (4, 2) a first guess of the pattern's corners,
    to a pixel or two, as rays and in px: clockwise from the one at the pattern's first row and column.
    """
    modules = len(pattern) - 2 * RIM
    try:
        guess = _homography(start, modules)
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
        outline, cov = _corners(found, modules, NEIGHBOURS * residual**2 * np.linalg.inv(normal)[:8, :8].astype(float))
    except np.linalg.LinAlgError:
        return None
    return Fit(outline, cov, float(residual), contrast, root @ root.T)


def pattern(bits: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The marker's inner `bits` (n, n), True is white, with its black border and RIM modules of paper."""
    return np.pad(np.pad(bits, 1, constant_values=False), RIM, constant_values=True)


@njit(cache=True)
def _homography(rays: Array, modules: int) -> Array:
    """(3, 3) from rays (x, y, 1) to the pattern's (u, v, 1), in modules; LinAlgError: the corners are of no square."""
    rows = np.zeros((8, 8))
    places = np.zeros(8)
    for k in range(4):
        x, y = rays[k]
        u, v = (modules if k in (1, 2) else 0.0), (modules if k > 1 else 0.0)
        places[2 * k], places[2 * k + 1] = u, v
        rows[2 * k, 0], rows[2 * k, 1], rows[2 * k, 2], rows[2 * k, 6], rows[2 * k, 7] = x, y, 1.0, -u * x, -u * y
        rows[2 * k + 1, 3], rows[2 * k + 1, 4], rows[2 * k + 1, 5] = x, y, 1.0
        rows[2 * k + 1, 6], rows[2 * k + 1, 7] = -v * x, -v * y
    solution = np.linalg.solve(rows, places)
    homography = np.append(solution, 1.0).reshape(3, 3)
    # The sign for which the pattern is in front: positive where its corners are.
    return homography if (rays @ solution[6:] + 1 > 0).all() else -homography


@njit(cache=True)
def _corners(homography: Array, modules: int, change_cov: Array) -> tuple[Array, Array]:
    """The corners' rays (4, 2), and their covariance (8, 8), from that of the homography's change, (8, 8)."""
    inverse = np.linalg.inv(homography)
    by_change = np.zeros((8, 8))
    rays = np.zeros((4, 2))
    for k in range(4):
        p, q = (0.5 if k in (1, 2) else -0.5), (0.5 if k > 1 else -0.5)
        x, y, w = inverse @ np.array([modules * (p + 0.5), modules * (q + 0.5), 1.0])
        rays[k, 0], rays[k, 1] = x / w, y / w
        for row in range(2):
            # What moves the pattern's coordinates by a change moves its corners the other way.
            by_u = -(inverse[row, 0] - rays[k, row] * inverse[2, 0]) / w
            by_v = -(inverse[row, 1] - rays[k, row] * inverse[2, 1]) / w
            line = by_change[2 * k + row]
            line[0], line[1], line[2] = by_u, by_u * p, by_u * q
            line[3], line[4], line[5] = by_v, by_v * p, by_v * q
            line[6] = (by_u * p + by_v * q) * p
            line[7] = (by_u * p + by_v * q) * q
    return rays, by_change @ change_cov @ by_change.T


def _grain(image: NDArray[np.uint8]) -> float:
    """Grey levels, the standard deviation of the noise: the median of what straight edges and slopes do not leave.

    Immerkaer 1996: the difference of two Laplacians, here on a sixteenth of the pixels.
    """
    height, width = image.shape
    rows = [[image[v : height - 2 + v : 4, u : width - 2 + u : 4].astype(np.int16) for u in range(3)] for v in range(3)]
    left, middle, right = (rows[0][u] - 2 * rows[1][u] + rows[2][u] for u in range(3))
    return float(np.median(np.abs(left - 2 * middle + right))) / 0.6745 / 6
