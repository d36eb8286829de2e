"""Lays out markers to be cut out on pages; lengths are mm, from a page's lower left corner."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from ...frontend.markers.markers import Markers

PAGES = {
    "A5": (148.0, 210.0),
    "A4": (210.0, 297.0),
    "letter": (215.9, 279.4),
    "legal": (215.9, 355.6),
    "A3": (297.0, 420.0),
    "A2": (420.0, 594.0),
    "A1": (594.0, 841.0),
    "A0": (841.0, 1189.0),
}
"""upright, from small to large"""

EDGE = 5.0  # margin of printers: no marker and no text is put there
FOOT, STRIP = 12.0, 5.0  # heights of the scale bar's row at the foot of a page, and of the text under a marker
SLACK = 1e-6  # rounding of a sheet that fills its page


class Sheet(NamedTuple):
    """A marker with its white margin, to be cut out, and the text under it."""

    name: int
    side: float
    black: NDArray[np.bool_]  # (m, m) the modules, black border included
    words: tuple[str, str]  # which it is, and of which dictionary

    @property
    def rim(self) -> float:
        """Returns the margin of the marker: one module, the least that detectors need."""
        return self.side / len(self.black)

    @property
    def width(self) -> float:
        """Returns the width with both margins."""
        return self.side + 2 * self.rim

    @property
    def height(self) -> float:
        """Returns the height with both margins and the text."""
        return self.width + STRIP


class Placed(NamedTuple):
    """A sheet on a page, and its lower left corner."""

    sheet: Sheet
    x: float
    y: float


def sheets(markers: Markers, names: Sequence[int]) -> list[Sheet]:
    """Makes a sheet for each marker, the largest first; InputError for an id that the dictionary lacks."""
    words, made = markers.opencv, list[Sheet]()
    for name in names:
        if not 0 <= name < len(words.bytesList):
            last = len(words.bytesList) - 1
            raise InputError(f"marker {name}: there is none in {markers.dictionary}, expected ids from 0 to {last}")
        drawn = np.asarray(words.generateImageMarker(name, words.markerSize + 2, borderBits=1))
        side = 1000 * markers.side_of(name)
        made.append(Sheet(name, side, drawn == 0, (f"id {name}   {side:g} mm", markers.dictionary)))
    return sorted(made, key=lambda sheet: (-sheet.side, sheet.name))


def lay_out(made: Sequence[Sheet], page: str) -> list[list[Placed]]:
    """Lays out the sheets in rows on pages of the format `page`; InputError names the page for one too large."""
    width, height = PAGES[page]
    margin = max(0.0, EDGE - min(sheet.rim for sheet in made))  # the sheet's margin may be in the printer's
    for sheet in made:
        spare = min(width - 2 * margin, height - margin - FOOT - STRIP) / sheet.width
        most = f"; on {page} a side of {int(sheet.side * spare) / 1000:g} m does"
        check_fits(f"marker {sheet.name} with its white rim", sheet.width, sheet.height, margin, page, most)
    pages: list[list[Placed]] = []
    top = floor = 0.0
    for row in _rows(made, width - 2 * margin):
        if not pages or top - row[0].height < floor - SLACK:
            pages.append([])
            top, floor = height - margin, FOOT
        x = (width - row[0].width * _columns(row[0], width - 2 * margin)) / 2
        for sheet in row:
            pages[-1].append(Placed(sheet, x, top - sheet.height))
            x += sheet.width
        top -= row[0].height
    return pages


def _columns(sheet: Sheet, width: float) -> int:
    return int((width + SLACK) // sheet.width)


def _rows(made: Sequence[Sheet], width: float) -> Iterator[list[Sheet]]:
    row: list[Sheet] = []
    for sheet in made:
        if row and (sheet.side != row[0].side or len(row) == _columns(row[0], width)):
            yield row
            row = []
        row.append(sheet)
    if row:
        yield row


def check_fits(what: str, width: float, height: float, margin: float, page: str, advice: str = "") -> None:
    """Raises InputError where `what` and the scale bar do not fit on `page`; names the smallest page that does."""

    def fits(size: tuple[float, float]) -> bool:
        return width <= size[0] - 2 * margin + SLACK and height <= size[1] - margin - FOOT + SLACK

    if not fits(PAGES[page]):
        larger = next((name for name, size in PAGES.items() if fits(size)), None)
        expected = f"; --page {larger} is large enough" if larger else ", nor any other page up to A0"
        raise InputError(f"{what} is {width:.0f} x {height:.0f} mm and does not fit on {page}{expected}{advice}")
