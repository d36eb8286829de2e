"""Tells which board pictures show that do not show the one that was asked for."""

from collections import Counter
from collections.abc import Sequence

import cv2
import numpy as np

from ..markers.aruco import Image
from ..markers.decoding import Reading, decode
from ..markers.diagnosis import as_expected
from ..markers.markers import Markers, find
from .board import Board
from .chessboard import Chessboard, inner_corners

MOST = 10  # pictures that are looked at

FEWEST = 4  # markers of a picture that are a board's

COMMON = "4X4_50"
"""The dictionary that is tried first where the board that was asked for has none."""


def other_board(images: Sequence[Image], board: Board | Chessboard) -> str | None:
    """Says which other board most of the `images`, grey or BGR, show; None where they show none, or the same."""
    if not images:
        return None
    chosen = [images[k] for k in np.linspace(0, len(images) - 1, min(MOST, len(images))).astype(int)]
    greys = [np.asarray(cv2.cvtColor(one, cv2.COLOR_BGR2GRAY), np.uint8) if one.ndim == 3 else one for one in chosen]
    pictures = f"of {len(greys)} picture{'s' * (len(greys) > 1)}"
    own = board.dictionary if isinstance(board, Board) else COMMON
    reading = next(iter(decode(greys, own, find(own)).readings), None)
    if reading is not None and len(reading.ids) >= FEWEST and not reading.inverted:
        return _charuco(reading, board, pictures)
    sizes = Counter(size for size in map(inner_corners, greys) if size is not None)
    if not sizes:
        return None
    (long, short), count = sizes.most_common(1)[0]
    if isinstance(board, Chessboard) and {long, short} == {board.columns, board.rows}:
        return None
    return f"found a chessboard of {long} x {short} inner corners in {count} {pictures}"


def _charuco(reading: Reading, board: Board | Chessboard, pictures: str) -> str | None:
    """The markers of a dictionary, which is not the board's own unless its image is mirrored."""
    mirrored = " mirrored" if reading.mirrored else ""
    if isinstance(board, Board) and as_expected(reading, Markers(board.dictionary, board.marker)):
        squares = 2 * (max(reading.ids) + 1)
        if squares <= board.columns * board.rows + 1:
            return None
        return (
            f"found a ChArUco board of {squares - 1} squares at least in {reading.frames} {pictures}, by its marker "
            f"{max(reading.ids)}"
        )
    return (
        f"found{mirrored} markers of the dictionary {reading.dictionary}, as of a ChArUco board, in {reading.frames} "
        f"{pictures} (ids {reading.ids[0]} to {reading.ids[-1]})"
    )
