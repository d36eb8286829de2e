"""ChArUco boards, chessboards with markers in their white squares, and the detection of their corners."""

import re
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import cv2
import numpy as np

from ...core.errors import InputError
from ...core.options import option
from ...core.se2 import Array, Ints
from ..markers.aruco import Image
from ..markers.markers import find
from ..plausible import SIDE
from .chessboard import Chessboard
from .view import View

FEWEST_CORNERS = 8  # fewest corners of a usable image; they must not be collinear


@dataclass(frozen=True)
class Board:
    """A printed ChArUco board: `charuco[columns=5,rows=7,square=0.04,marker=0.02,dictionary=6X6_250]`."""

    columns: int = option(5, "squares across", minimum=2)
    rows: int = option(7, "squares down", minimum=2)
    square: float = option(0.04, "side of a square, m", minimum=1e-6)
    marker: float = option(0.02, "side of a marker, m", minimum=1e-6)
    dictionary: str = option("6X6_250", "the markers' dictionary")
    legacy: bool = option(False, "printed with OpenCV before 4.6: a marker, not a black square, in the first corner")

    def check(self) -> None:
        """Raises InputError for impossible dimensions."""
        _ = self.opencv

    def find(self, name: str, image: Image) -> View | str:
        """Detects the corners in a grey or BGR `image`, or returns in a few words why it is unusable."""
        return find_corners(self, name, image)

    @cached_property
    def opencv(self) -> cv2.aruco.CharucoBoard:
        """OpenCV's board; InputError for impossible dimensions."""
        if not 0 < self.marker < self.square < np.inf:
            raise InputError(
                f"board: found markers of {self.marker:g} m in squares of {self.square:g} m, expected them smaller"
            )
        for name, side in (("square", self.square), ("marker", self.marker)):
            if (odd := SIDE.odd(side)) is not None:
                raise InputError(f"board: {name}: {odd}")
        words = find(self.dictionary)
        needed, there = self.columns * self.rows // 2, len(words.bytesList)
        if self.columns < 2 or self.rows < 2 or needed > there:
            raise InputError(
                f"board: found {self.columns} x {self.rows} squares, expected at least 2 x 2 and at most as many as "
                f"the {there} markers of {self.dictionary} fill"
            )
        board = cv2.aruco.CharucoBoard((self.columns, self.rows), self.square, self.marker, words)
        board.setLegacyPattern(self.legacy)
        return board


def read_board(text: str) -> Board | Chessboard:
    """Parses a board such as charuco[columns=5,rows=7] or chessboard[columns=8,rows=6]; InputError if it is invalid."""
    form = re.fullmatch(r"\s*(charuco|chessboard)\s*(?:\[(.*)\])?\s*", text)
    if form is None:
        raise InputError(
            f"--board: found {text!r}, expected charuco[columns=5,rows=7,square=0.04,marker=0.02,...] or "
            "chessboard[columns=8,rows=6,square=0.025]"
        )
    pairs = re.split(r",(?![^\[]*\])", form[2]) if form[2] else []  # a dictionary may have brackets of its own
    kind = Chessboard if form[1] == "chessboard" else Board
    known = [one.name for one in fields(kind)]
    given: dict[str, str] = {}
    for pair in pairs:
        name, equals, value = (part.strip() for part in pair.partition("="))
        if not equals or name not in known:
            raise InputError(f"--board: found {pair.strip()!r}, expected one of {', '.join(known)}, as name=value")
        given[name] = value
    values = {}
    for name, value in given.items():
        read, expected = _READERS[name]
        try:
            values[name] = read(value)
        except (KeyError, ValueError):
            raise InputError(f"--board: {name}: found {value!r}, expected {expected}") from None
    board = kind(**values)  # ty: ignore[invalid-argument-type]
    try:
        board.check()
    except InputError as error:
        raise InputError(f"--board: {error}") from None
    return board


_TRUTH = {"true": True, "false": False}
_READERS = {
    "columns": (int, "a whole number"),
    "rows": (int, "a whole number"),
    "square": (float, "a length in m"),
    "marker": (float, "a length in m"),
    "dictionary": (str, "a name"),
    "legacy": (lambda text: _TRUTH[text.lower()], "true or false"),
}


def find_corners(board: Board, name: str, image: Image) -> View | str:
    """Detects the board's corners in a grey or BGR `image`, or returns in a few words why it is unusable."""
    corners, ids, markers = _detect(board, image)
    found = len(ids)
    if found == 0 and markers:
        turned = replace(board, columns=board.rows, rows=board.columns)
        for other in (replace(board, legacy=not board.legacy), turned, replace(turned, legacy=not board.legacy)):
            if len(_detect(other, image)[1]):
                return f"only fits a board with {_difference(board, other)}"
        return f"{markers} of the dictionary's markers but no corner between them"
    if found == 0:
        return f"no marker of {board.dictionary}"
    order = np.argsort(ids)
    numbers = ids[order]
    points = np.asarray(board.opencv.getChessboardCorners(), float)[numbers]
    if found < FEWEST_CORNERS:
        return f"{found} corners, fewer than {FEWEST_CORNERS}"
    if np.linalg.matrix_rank(points[:, :2] - points[0, :2]) < 2:
        return "all corners are collinear"
    return View(name, numbers, corners[order], points)


def _difference(board: Board, other: Board) -> str:
    """The options of another board that are not those of `board`."""
    named = {"columns": other.columns, "rows": other.rows} if board.columns != other.columns else {}
    named |= {"legacy": str(other.legacy).lower()} if board.legacy != other.legacy else {}
    return ",".join(f"{name}={value}" for name, value in named.items())


def _detect(board: Board, image: Image) -> tuple[Array, Ints, int]:
    """Corners (n, 2), px, their ids (n,), and the number of markers found; OpenCV returns None for none."""
    parts: tuple[Any, ...] = cv2.aruco.CharucoDetector(board.opencv).detectBoard(image)
    corners, ids, markers = (np.zeros(0) if part is None else np.asarray(part) for part in (*parts[:2], parts[3]))
    return corners.reshape(-1, 2).astype(float), ids.ravel().astype(np.int64), markers.size
