"""A marker's printed sheet of paper: its modules, ink that spreads, paper that curls, and gloss."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.se2 import Array
from ...frontend.markers.aruco import square
from ...frontend.markers.markers import find
from .lens import NOWHERE, Singles

INK, PAPER = 34.0, 222.0  # grey levels of a marker

SHINE = 60.0
"""Exponent of a highlight on glossy paper: half of it is within 9 degrees of the mirrored lamp's half-way normal."""

LEAST_APART = 4
"""Bits by which a pattern differs from every marker however turned: a detector corrects fewer."""


@dataclass(frozen=True)
class Print:
    """Faults of a printer and its paper; by default none."""

    ink: float = 0.0  # share of the marker's side by which each edge of black is moved outwards; negative: inwards
    curl: float = 0.0  # m by which the sheet's left and right edges are in front of its middle; negative: behind it
    gloss: float = 0.0  # grey levels that a lamp's highlight adds at its brightest


PERFECT = Print()


@dataclass(frozen=True, eq=False)
class Sheet:
    """The sheet of one marker: a plane, or a cylinder that touches the plane in the sheet's vertical middle.

    On a bent sheet the marker's pose is that of its middle. The cylinder's radius is that of a parabola with this curl.
    A sheet that is seen from so far aside that one part of it hides another is not drawn correctly.
    """

    texture: Singles  # (n, n, 2) grey level and 1; one pixel per module, with the white rim, or 3 x 3 of them with ink
    side: float  # m, of the marker's black square
    modules: int  # along that side
    prints: Print

    @property
    def module(self) -> float:
        """m, a module's side."""
        return self.side / self.modules

    @property
    def outline(self) -> Array:
        """(n, 3) m, the corners of a polygon that has the sheet in it, in the marker's frame."""
        flat = square(self.side * (self.modules + 2) / self.modules)
        return np.vstack((flat, flat + np.array([0.0, 0.0, self.prints.curl]))) if self.prints.curl else flat

    @property
    def to_sheet(self) -> Array:
        """(3, 3) from homogeneous (x, y, 1), m on the plane, to column and row in modules."""
        middle = (self.modules + 1) / 2
        return np.array([[1 / self.module, 0, middle], [0, -1 / self.module, middle], [0, 0, 1]])

    def grey(self, column: Singles, row: Singles, eye: Array) -> Singles:
        """(m, n, 2) grey level and 1, or 0 beside the sheet, where rays meet its plane at `column` and `row` (m, n).

        `eye` (3,) m is the rays' origin in the marker's frame.
        """
        if self.prints.curl:
            column, row = self._unrolled(column, row, eye)
        if self.prints.ink:
            column, row = self._third(column), self._third(row)
        return np.asarray(
            cv2.remap(self.texture, column, row, cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT), np.float32
        )

    def highlight(self, at: Singles, eye: Array, lamp: Array) -> Singles:
        """(h, w) grey levels that the gloss adds where rays meet the plane, at column and row `at` (2, h, w).

        By Blinn and Phong: the cosine between the paper's normal and the bisector of the lines to eye and lamp (3,), m
        in the marker's frame, to the power of SHINE.
        """
        x, y = self._metres(*at)
        points = np.stack((x, y, np.zeros_like(x)))
        to_eye, to_lamp = (_unit(place.astype(np.float32)[:, None, None] - points) for place in (eye, lamp))
        slope = np.clip(-self._bend * x, -1, 1)
        normal = np.stack((slope, np.zeros_like(x), np.sqrt(1 - slope**2)))
        cosine = np.maximum((normal * _unit(to_eye + to_lamp)).sum(axis=0), 0)
        lit = (normal * to_lamp).sum(axis=0) > 0
        return np.float32(self.prints.gloss) * np.where(lit, cosine, 0) ** np.float32(SHINE)

    @property
    def _bend(self) -> np.float32:
        """1/m, the curvature of the paper, positive where its edges are in front."""
        half = self.side * (self.modules + 2) / self.modules / 2
        return np.float32(2 * self.prints.curl / half**2)

    def _metres(self, column: Singles, row: Singles) -> tuple[Singles, Singles]:
        middle, module = np.float32((self.modules + 1) / 2), np.float32(self.module)
        return (column - middle) * module, (middle - row) * module

    def _unrolled(self, column: Singles, row: Singles, eye: Array) -> tuple[Singles, Singles]:
        """The points of the bent sheet, unrolled, on rays through the plane there: columns and rows along the paper.

        On the ray p + t d through the plane's point p the cylinder x^2 + z^2 = 2 z / k is met where
        (dx^2 + dz^2) t^2 + 2 (x dx - dz / k) t + x^2 = 0; the root next to the plane, without cancellation.
        """
        k = self._bend
        x, y = self._metres(column, row)
        ex, ey, ez = eye.astype(np.float32)
        dx, dy, dz = x - ex, y - ey, -ez
        a, b = dx * dx + dz * dz, x * dx - dz / k
        root = b * b - a * x * x
        t = -x * x / (b + np.copysign(np.sqrt(np.maximum(root, 0)), b))
        along = np.arcsin(np.clip(k * (x + t * dx), -1, 1)) / k
        middle, module = np.float32((self.modules + 1) / 2), np.float32(self.module)
        met = root >= 0
        return np.where(met, middle + along / module, NOWHERE), np.where(met, middle - (y + t * dy) / module, NOWHERE)

    def _third(self, place: Singles) -> Singles:
        """Columns or rows of the texture with ink, from those in modules: a module is edge, middle and edge."""
        edge = np.float32(abs(self.prints.ink) * self.modules)
        cell = np.floor(place + np.float32(0.5))
        within = place + np.float32(0.5) - cell
        return 3 * cell + (within >= edge) + (within >= 1 - edge)


def printed_sheets(
    dictionary: str, ids: list[int], side: float, own: Mapping[int, NDArray[np.bool_]], prints: Print
) -> dict[int, Sheet]:
    """The sheets of the markers `ids`; `own` has the bits (n, n), True is white, of those not as in the dictionary."""
    known = find(dictionary)
    modules = known.markerSize + 2
    sheets: dict[int, Sheet] = {}
    for name in ids:
        drawn = np.asarray(known.generateImageMarker(name, modules, borderBits=1), float)
        if name in own:
            drawn[1:-1, 1:-1] = own[name]
        grey = np.pad(np.where(drawn > 0, PAPER, INK), 1, constant_values=PAPER)
        if prints.ink:
            # Of a module's 3 x 3 cells those at an edge have the ink, or the paper, of the neighbour there.
            spread = cv2.erode if prints.ink > 0 else cv2.dilate
            grey = np.asarray(spread(grey.repeat(3, axis=0).repeat(3, axis=1), np.ones((3, 3), np.uint8)))
        texture = np.stack((grey, np.ones_like(grey)), axis=-1).astype(np.float32)
        sheets[name] = Sheet(texture, side, modules, prints)
    return sheets


def _unit(vectors: Singles) -> Singles:
    """(3, ...) of length 1."""
    return vectors / np.sqrt((vectors**2).sum(axis=0))


def scrambled(
    dictionary: cv2.aruco.Dictionary, ids: Sequence[int], rng: np.random.Generator
) -> dict[int, NDArray[np.bool_]]:
    """Random bits (n, n), True is white, for each of the `ids`: of no marker, so that only the square is found."""
    size = dictionary.markerSize
    drawn = [dictionary.generateImageMarker(k, size + 2, borderBits=1) for k in range(len(dictionary.bytesList))]
    words = np.array([np.rot90(np.asarray(one)[1:-1, 1:-1] > 0, turns) for one in drawn for turns in range(4)])
    found = dict[int, NDArray[np.bool_]]()
    while len(found) < len(ids):
        bits = rng.uniform(size=(size, size)) < 0.5
        if (bits != words).sum(axis=(1, 2)).min() >= LEAST_APART and 0.25 < bits.mean() < 0.75:
            found[ids[len(found)]] = bits
    return found
