"""Which square markers are in the world: their dictionary, and how large each is printed."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import cv2

from .errors import InputError


@dataclass(frozen=True, eq=False)
class Markers:
    """The markers of one dictionary; all of one size, but for those named in `sides`."""

    dictionary: str  # OpenCV's name without its prefix, such as 4X4_50
    side: float  # m, of the black square
    sides: Mapping[int, float] = field(default_factory=dict[int, float])  # id -> m, where it is another

    @cached_property
    def opencv(self) -> cv2.aruco.Dictionary:
        """The dictionary's words. InputError where there is none of that name."""
        return find(self.dictionary)

    def side_of(self, name: int) -> float:
        """m, the side of marker `name`."""
        return self.sides.get(name, self.side)


def find(name: str) -> cv2.aruco.Dictionary:
    """OpenCV's dictionary of that name, such as 4X4_50; InputError where there is none."""
    index = getattr(cv2.aruco, f"DICT_{name}", None)
    if index is None:
        names = ", ".join(sorted(known.removeprefix("DICT_") for known in dir(cv2.aruco) if known.startswith("DICT_")))
        raise InputError(f"marker dictionary: found {name!r}, expected one of {names}")
    return cv2.aruco.getPredefinedDictionary(index)
