"""A board in an image."""

from typing import NamedTuple

from ...core.se2 import Array, Ints


class View(NamedTuple):
    """An image's name and the board's corners in it."""

    name: str
    ids: Ints  # (n,) of the corners
    corners: Array  # (n, 2) px
    points: Array  # (n, 3) m, on the board
