"""Features of a grey image that have a depth, and matches of them by descriptors."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.se2 import Array, Ints
from ..camera.camera import Camera
from ..maps._clouds import DepthLimits
from ._bits import Bits, two_nearest
from ._depth_image import depths_at
from .points import Points, points_of
from .settings import Settings

LENGTHS = {"orb": 32, "sift": 128}  # columns of a descriptor: bytes of bits, or numbers
FINEST = 31.0  # px, the size of an ORB feature of the finest scale


class Features(NamedTuple):
    """n features of one frame."""

    pixels: Array  # (n, 2) px
    points: Points
    descriptors: NDArray[Any]  # (n, 32) uint8 of bits, or (n, 128) float32

    def taken(self, rows: Any) -> "Features":
        """Those of `rows`."""
        return Features(self.pixels[rows], self.points.taken(rows), self.descriptors[rows])

    def __len__(self) -> int:
        """The number of features, not of columns."""
        return len(self.pixels)


class Finder:
    """Finds features: ORB (Rublee et al., ICCV 2011) or SIFT (Lowe, IJCV 2004), by OpenCV."""

    def __init__(self, camera: Camera, settings: Settings) -> None:
        self._camera, self._settings = camera, settings

    @cached_property
    def _detector(self) -> Any:
        return detector(self._settings)

    def find(self, grey: NDArray[np.uint8], depth: NDArray[np.float32]) -> Features:
        """Finds the features of `grey` (h, w) on surfaces that `depth` (h, w), m, knows."""
        s = self._settings
        keypoints, descriptors = self._detector.detectAndCompute(grey, None)
        if not keypoints:
            kind = np.uint8 if s.features == "orb" else np.float32
            descriptors = np.zeros((0, LENGTHS[s.features]), kind)
        pixels, scales = self._places(keypoints, grey.shape)
        sd = s.pixel_sd * scales
        z = depths_at(depth, pixels, DepthLimits(s.near, s.far, s.jump, s.jump_by_depth))
        kept = np.flatnonzero(np.isfinite(z))
        points = points_of(self._camera, pixels[kept], z[kept], sd[kept], s)
        seen = np.isfinite(points.rays).all(axis=1)
        return Features(pixels[kept], points, descriptors[kept]).taken(seen)

    def _places(self, keypoints: Sequence[cv2.KeyPoint], shape: tuple[int, ...]) -> tuple[Array, Array]:
        """The places of features (n, 2), px, and their errors (n,) by those of the finest scale.

        ORB has a place by the pixels of its scale, 0.35 px to 1.2 px from the finest to the coarsest as measured in
        the rendered room; SIFT interpolates, and is as good on all scales.
        """
        found = np.array([one.pt for one in keypoints], float).reshape(-1, 2)
        if self._settings.features == "sift":
            return found, np.ones(len(found))
        scales = np.array([one.size for one in keypoints], float) / FINEST
        return unscaled(found, scales, shape), scales


def unscaled(pixels: Array, scales: Array, shape: tuple[int, ...]) -> Array:
    """(n, 2) px, the places in an image (h, w) of ORB's features, found in smaller ones: `pixels` as OpenCV tells them.

    OpenCV multiplies a place in a smaller image by the scale. That image has a whole number of rows and columns, which
    makes its scale another one by up to 0.1 %, and its first pixel covers several: at coarse scales the place is off by
    up to 2 px, and by another amount on every scale.
    """
    size = np.array(shape[1::-1], float)
    smaller = np.rint(size / scales[:, None])
    return (pixels / scales[:, None] + 0.5) * (size / smaller) - 0.5


def detector(settings: Settings) -> Any:
    """OpenCV's detector of the features."""
    if settings.features == "sift":  # without a precise doubling of the image, all places are off by a quarter of a px
        return cv2.SIFT.create(nfeatures=settings.most, contrastThreshold=0.01, enable_precise_upscale=True)
    return cv2.ORB.create(nfeatures=settings.most, scaleFactor=1.2, nlevels=8, fastThreshold=10)


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
