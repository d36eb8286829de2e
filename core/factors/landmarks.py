"""Landmarks: a map of them, and the id of one that is not known."""

from typing import NamedTuple

from ..se2 import Array, Ints

UNKNOWN = -1
"""The id of a sighting without data association."""


class Map(NamedTuple):
    """Landmarks."""

    ids: Ints  # (n,)
    xy: Array  # (n, 2) m
    cov: Array | None  # (2n, 2n) joint, of x0, y0, x1, y1, ...; None: unknown
