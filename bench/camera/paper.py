"""Writes pages of markers and calibration boards at their true size, as a PDF.

Lengths are millimetres, from a page's lower left corner. Ink is filled outlines: modules that touch are one shape, so
that no viewer shows a hairline between them.
"""

from collections.abc import Callable, Sequence
from io import BytesIO
from itertools import pairwise
from pathlib import Path as File
from typing import Any

import cv2
import numpy as np
from matplotlib import style
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.transforms import Affine2D, Transform
from numpy.typing import NDArray

from ...core.files import write_whole
from ...core.se2 import Array
from .ink_strip import ink_strip
from .sheets import EDGE, FOOT, PAGES, STRIP, Placed, check_fits

BAR = 100.0  # mm, length of the scale bar

APART = 5.0  # mm, between the scale bar and the strip beside it

TICK = 3.0  # mm, length of a cut mark

POINT = 25.4 / 72  # mm, a point of a font's size

_STYLE: dict[str, Any] = {"pdf.fonttype": 42, "text.parse_math": False, "font.size": 6, "patch.linewidth": 0.25}

Draw = Callable[[Figure, Transform], None]  # draws on a page; the second argument is the transform from millimetres


def markers(placed: Sequence[Placed], page: str) -> Draw:
    """Draws markers with cut marks at the corners of each sheet; a whole frame would be one more square to detect.

    Beside the page's scale bar is a strip that shows how far black spreads, see `ink_strip`.
    """
    left = 2 * EDGE + BAR + APART
    side = max((sheet.side for sheet, _, _ in placed), default=BAR)
    strip = ink_strip(PAGES[page][0] - EDGE - left, side)

    def draw(figure: Figure, scale: Transform) -> None:
        for sheet, x, y in placed:
            top = y + sheet.height
            figure.add_artist(
                PathPatch(_ticks(x, y, sheet.width, sheet.height), transform=scale, fill=False, edgecolor="0.6")
            )
            corner = np.array([x + sheet.rim, top - sheet.rim])
            _fill(figure, scale, [corner + loop * [sheet.rim, -sheet.rim] for loop in outlines(sheet.black)])
            for line, (words, largest) in enumerate(zip(sheet.words, (7.0, 5.0), strict=True)):
                size = min(largest, sheet.side / (0.6 * len(words)) / POINT)
                up = y + STRIP * (0.7 - 0.45 * line)
                figure.text(x + sheet.rim, up, words, transform=scale, fontsize=size, va="center")
        _fill(figure, scale, [_rectangle(left + x, EDGE + y, width, height) for x, y, width, height in strip.boxes])
        for x, y, words in strip.labels:
            figure.text(left + x, EDGE + y, words, transform=scale, fontsize=4.5, ha="center", va="center")

    return draw


def board(charuco: cv2.aruco.CharucoBoard, words: str, page: str) -> Draw:
    """Draws a ChArUco board in the middle of a page, `words` at its foot; InputError where it is too large."""
    columns, rows = charuco.getChessboardSize()
    square, side = 1000 * charuco.getSquareLength(), 1000 * charuco.getMarkerLength()
    width, height = columns * square, rows * square
    check_fits("the board", width, height, EDGE, page)
    dictionary = charuco.getDictionary()
    modules = dictionary.markerSize + 2
    black = np.ones((rows, columns), bool)
    loops: list[Array] = []
    for name, corners in zip(np.ravel(charuco.getIds()), charuco.getObjPoints(), strict=True):
        corner = 1000 * np.asarray(corners, float)[:, :2].min(axis=0)  # x to the right, y down
        column, row = ((corner + side / 2) // square).astype(int)
        black[row, column] = False
        drawn = np.asarray(dictionary.generateImageMarker(int(name), modules, borderBits=1))
        loops += [corner + loop * side / modules for loop in outlines(drawn == 0)]
    loops += [square * loop for loop in outlines(black)]
    return _in_the_middle(loops, width, height, words, page)


def chessboard(corners: tuple[int, int], side: float, words: str, page: str) -> Draw:
    """Draws a chessboard with inner `corners` across and down, of squares of `side` m, as `board` does."""
    columns, rows = corners[0] + 1, corners[1] + 1
    width, height = 1000 * side * columns, 1000 * side * rows
    check_fits("the board", width, height, EDGE, page)
    black = np.indices((rows, columns)).sum(axis=0) % 2 == 0
    return _in_the_middle([1000 * side * loop for loop in outlines(black)], width, height, words, page)


def _in_the_middle(loops: Sequence[Array], width: float, height: float, words: str, page: str) -> Draw:
    """Draws outlines of black (n, 2), x to the right and y down, of that size, in the middle of a page."""
    page_width, page_height = PAGES[page]
    origin = np.array([(page_width - width) / 2, (page_height - EDGE + FOOT + height) / 2])

    def draw(figure: Figure, scale: Transform) -> None:
        _fill(figure, scale, [origin + loop * [1, -1] for loop in loops])
        figure.text(page_width - 2 * EDGE, EDGE, words, transform=scale, ha="right")

    return draw


def write_pdf(path: File, page: str, drawings: Sequence[Draw], title: str) -> None:
    """Writes the pages to a file, whole or not at all."""
    made = BytesIO()
    about = {"Title": title, "Creator": "slamduel", "CreationDate": None}
    with style.context(["default", _STYLE]), PdfPages(made, metadata=about) as pdf:
        for draw in drawings:
            pdf.savefig(drawn(page, draw))
    write_whole(path, made.getvalue())


def drawn(page: str, draw: Draw) -> Figure:
    """Makes a page with its scale bar and what `draw` draws."""
    width, height = PAGES[page]
    figure = Figure(figsize=(width / 25.4, height / 25.4))
    scale = Affine2D().scale(1 / 25.4) + figure.dpi_scale_trans
    left, low, thin = 2 * EDGE, EDGE + 4.0, 0.3
    ticks = [(left, low - 1, thin, 2 + thin), (left + BAR - thin, low - 1, thin, 2 + thin)]
    for x, y, w, h in [(left, low, BAR, thin), *ticks]:
        _fill(figure, scale, [_rectangle(x, y, w, h)])
    figure.text(left + BAR / 2, EDGE, "print at 100 %, this bar is 100 mm", transform=scale, ha="center")
    draw(figure, scale)
    return figure


def outlines(black: NDArray[np.bool_]) -> list[Array]:
    """Traces the outlines (n, 2) of the black cells, holes the other way round: (column, row) of cell corners."""
    edges: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for row, column in np.argwhere(black).tolist():
        ring = [(column, row), (column + 1, row), (column + 1, row + 1), (column, row + 1), (column, row)]
        for start, end in pairwise(ring):
            if start in edges.get(end, []):
                edges[end].remove(start)  # between two black cells
            else:
                edges.setdefault(start, []).append(end)
    loops: list[Array] = []
    for start, ends in edges.items():
        while ends:
            loop = [start, ends.pop()]
            while loop[-1] != start:
                loop.append(edges[loop[-1]].pop())
            corners = np.array(loop[:-1])
            before, after = corners - np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0) - corners
            loops.append(corners[(before != after).any(axis=1)].astype(float))
    return loops


def _ticks(x: float, y: float, width: float, height: float) -> Path:
    """Cut marks at the corners of a rectangle, inwards."""
    lines: list[tuple[float, float]] = []
    for corner_x, inwards in ((x, TICK), (x + width, -TICK)):
        for corner_y, upwards in ((y, TICK), (y + height, -TICK)):
            lines += [(corner_x + inwards, corner_y), (corner_x, corner_y), (corner_x, corner_y + upwards)]
    return Path(lines, [Path.MOVETO, Path.LINETO, Path.LINETO] * 4)


def _rectangle(x: float, y: float, width: float, height: float) -> Array:
    """(4, 2) its corners, from the lower left one."""
    return np.array([[x, y], [x + width, y], [x + width, y + height], [x, y + height]])


def _fill(figure: Figure, scale: Transform, loops: Sequence[Array]) -> None:
    """Fills what is within the outlines (n, 2), as one shape."""
    shape = Path.make_compound_path(*(Path([*loop, loop[0]], closed=True) for loop in loops))
    figure.add_artist(PathPatch(shape, transform=scale, facecolor="black", edgecolor="none", linewidth=0))
