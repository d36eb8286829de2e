"""Estimates a camera's response from pictures of a board: its tone curve, sharpening, blur and noise.

The markers on the board are fitted like a robot's. Ink, tone and sharpening are common to all of them, and what one
marker leaves undetermined the others tell: their information, with everything else marginalised out and without the
fit's prior, is added up over the pictures. One pass gives the expected values of the next.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import cv2
import numpy as np

from ...core.se2 import Array
from ..camera.camera import Camera
from ..camera.response import Measured, Response
from ..markers import template
from ..markers._grey import INK, SHARP, TONE, WHITE, A
from ..markers._pixels import MARGIN
from ..markers._step import LIMITED, LIMITS
from ..markers.aruco import Image
from ..markers.prior import UNKNOWN_CAMERA
from .board import Board
from .charuco import ViewFit
from .noise_curve import Flat, flat_areas, noise_curve

FEWEST_PICTURES, FEWEST_MARKERS = 4, 12
"""Pictures and markers without which nothing is said of a camera's response."""

PASSES = 3  # of the fits; the last changes nothing any more

CLEAR = 4.5
"""px between the used pixels of a marker and the black around it: three deviations of sharpening's blur, and more."""

CLIPPED = 250.0  # grey level from which white may be that of an overexposed picture
OUTLYING = 2.0  # times the median of the pictures' deviations from which a picture counts less
SHARED = np.array([INK, TONE, SHARP]) + 8  # the common ones among all parameters


class BoardResponse(NamedTuple):
    """A camera's response and the board's ink."""

    response: Response
    ink: Measured  # m, by which every edge of black is printed too far out
    pictures: int
    markers: int


class _Patch(NamedTuple):
    """A marker in a picture, cut out."""

    picture: int
    image: Image
    rays: Array  # (h, w, 2)
    pattern: Array
    corners: Array  # (4, 2) px
    corner_rays: Array  # (4, 2)


class _Shared(NamedTuple):
    """The common parameters by one picture: the loss is quadratic about the solution of this system."""

    normal: Array  # (3, 3)
    right: Array  # (3,)


class Pictures:
    """Collects markers and flat areas, one picture at a time."""

    def __init__(self, board: Board, camera: Camera) -> None:
        self._board, self._camera = board, camera
        self._patches: list[_Patch] = []
        self._flat: list[Flat] = []
        self._count = 0
        self._small = self._clipped = 0

    def add(self, seen: ViewFit, image: Image) -> None:
        """Takes the grey or BGR `image` of a view that was used for the calibration."""
        grey = image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)
        charuco, camera = self._board.opencv, self._camera
        words = charuco.getDictionary()
        modules = words.markerSize + 2
        margin = (self._board.square / self._board.marker - 1) * modules / 2
        limit = np.array([camera.width, camera.height]) - 1
        for name, points in zip(np.ravel(charuco.getIds()), charuco.getObjPoints(), strict=True):
            at = np.asarray(points, float) @ seen.pose[:3, :3].T + seen.pose[:3, 3]
            corners = camera.project(at)
            if not ((corners > 0) & (corners < limit)).all():
                continue
            module = np.linalg.norm(np.roll(corners, 1, axis=0) - corners, axis=1).min() / modules
            if (margin - MARGIN) * module < CLEAR:
                self._small += 1
                continue
            low = np.maximum(np.floor(corners.min(axis=0) - 3 - module), 0).astype(int)
            high = np.ceil(corners.max(axis=0) + 4 + module).astype(int)
            window = np.s_[low[1] : high[1], low[0] : high[0]]
            drawn = np.asarray(words.generateImageMarker(int(name), modules, borderBits=1))
            pattern = template.pattern(drawn[1:-1, 1:-1] > 0)
            rays = np.ascontiguousarray(camera.rays[window])
            patch = np.ascontiguousarray(grey[window])
            self._patches.append(_Patch(self._count, patch, rays, pattern, corners - low, at[:, :2] / at[:, 2:]))
        self._flat.append(flat_areas(self._board, camera, seen.pose, grey))
        self._count += 1

    def result(self) -> BoardResponse | str:
        """The response, or in a few words why these pictures do not tell it."""
        prior = UNKNOWN_CAMERA.copy()
        common, sd = np.zeros(3), np.zeros(3)
        fits: list[tuple[int, template.PatternFit]] = []
        pictures: set[int] = set()
        for _ in range(PASSES):
            fits = self._fits(prior)
            pictures = {picture for picture, _ in fits}
            if len(pictures) < FEWEST_PICTURES or len(fits) < FEWEST_MARKERS:
                return self._too_few(len(fits), len(pictures))
            shares = [
                _summed([_share_of(fit, prior) for number, fit in fits if number == picture])
                for picture in sorted(pictures)
            ]
            common, sd = pooled(shares)
            prior[0, SHARED - 8 - A] = common
        ink, tone, sharp = (Measured(float(value), float(error)) for value, error in zip(common, sd, strict=True))
        gamma = float(np.exp(tone.value))
        noise = noise_curve(self._flat)
        module = self._board.marker / (self._board.opencv.getDictionary().markerSize + 2)
        response = Response(Measured(gamma, gamma * tone.sd), sharp, _blur(fits), *(noise or (None, None)))
        return BoardResponse(response, Measured(module * ink.value, module * ink.sd), len(pictures), len(fits))

    def _fits(self, prior: Array) -> list[tuple[int, template.PatternFit]]:
        """The markers that are fitted, each with its picture's number."""
        found: list[tuple[int, template.PatternFit]] = []
        self._clipped = 0
        for patch in self._patches:
            fit = template.fit(patch.image, patch.rays, patch.pattern, patch.corner_rays, patch.corners, prior)
            if fit is not None and fit.look[WHITE] > CLIPPED:
                self._clipped += 1
            elif fit is not None and _is_optimum(fit):
                found.append((patch.picture, fit))
        return found

    def _too_few(self, markers: int, pictures: int) -> str:
        reasons = [
            f"{self._small} are too small for the white around them" if self._small else "",
            f"{self._clipped} are overexposed" if self._clipped else "",
        ]
        why = " and ".join(reason for reason in reasons if reason)
        return (
            f"found {markers} usable markers in {pictures} pictures, expected at least {FEWEST_MARKERS} in "
            f"{FEWEST_PICTURES}{f': {why}' if why else ''}"
        )


def pooled(pictures: Sequence[_Shared]) -> tuple[Array, Array]:
    """The common parameters (3,) and their standard errors (3,), by leaving out one picture at a time (jackknife).

    A picture whose own solution deviates by more than OUTLYING times the median counts less.
    """
    weights = np.ones(len(pictures))
    for _ in range(5):
        common = _solved(pictures, weights)
        off = [one.right - one.normal @ common for one in pictures]
        apart = np.array([np.sqrt(o @ np.linalg.solve(p.normal, o)) for o, p in zip(off, pictures, strict=True)])
        weights = np.minimum(1.0, OUTLYING * np.median(apart) / np.maximum(apart, 1e-300))
    without = np.array([_solved(pictures, weights * (np.arange(len(pictures)) != k)) for k in range(len(pictures))])
    n = len(pictures)
    return _solved(pictures, weights), np.sqrt((n - 1) * without.var(axis=0))


def _solved(pictures: Sequence[_Shared], weights: Array) -> Array:
    whole = sum(weight * one.normal for weight, one in zip(weights, pictures, strict=True))
    return np.linalg.solve(whole, sum(weight * one.right for weight, one in zip(weights, pictures, strict=True)))


def _summed(parts: Iterable[_Shared]) -> _Shared:
    normals, rights = zip(*parts, strict=True)
    return _Shared(np.sum(normals, axis=0), np.sum(rights, axis=0))


def _is_optimum(fit: template.PatternFit) -> bool:
    """Tells if no parameter was stopped at its limit: there the loss is not quadratic about what was found."""
    stopped = (fit.look[LIMITED] <= LIMITS[0]) | (fit.look[LIMITED] >= LIMITS[1])
    return not stopped.any()


def _share_of(fit: template.PatternFit, prior: Array) -> _Shared:
    """The information of one marker about the common parameters, without the prior: the rest is marginalised out."""
    normal = fit.normal / max(fit.residual**2, 0.25)
    taken = 1 / prior[1, SHARED - 8 - A] ** 2
    rest = np.setdiff1d(np.arange(len(normal)), SHARED)
    across = normal[np.ix_(SHARED, rest)]
    own = normal[np.ix_(SHARED, SHARED)] - across @ np.linalg.solve(normal[np.ix_(rest, rest)], across.T)
    own -= np.diag(taken)
    found = fit.look[SHARED - 8]
    # at the optimum the data pull as hard as the prior
    return _Shared(own, own @ found + taken * (found - prior[0, SHARED - 8 - A]))


def _blur(fits: Sequence[tuple[int, template.PatternFit]]) -> Measured:
    """px, the median over the pictures of their markers' median blur."""
    by_picture: dict[int, list[float]] = {}
    for picture, fit in fits:
        by_picture.setdefault(picture, []).append(float(np.sqrt(np.trace(fit.blur) / 2)))
    blurs = np.array([np.median(widths) for widths in by_picture.values()])
    middle = float(np.median(blurs))
    spread = 1.4826 * float(np.median(np.abs(blurs - middle)))
    return Measured(middle, 1.2533 * spread / np.sqrt(len(blurs)))
