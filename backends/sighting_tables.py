"""A solver's tables of sightings and fixes, as partial sightings and fixes are stored there."""

from typing import Protocol

from ..core.se2 import Array

Seen = tuple[float, float, float, float, float]
"""Range, bearing, and their information: rr, rb, bb."""

Row = tuple[int, int, Seen]
"""Variable of a landmark, part and sighting, as in the tables of `smoothing._graph`."""


class Tables(Protocol):
    """The tables of a solver; rows keep their numbers even where old ones leave."""

    @property
    def stored(self) -> int:
        """The number of rows of sightings so far."""
        ...

    def row(self, row: int) -> tuple[int, Seen]:
        """Part and sighting of a row."""
        ...

    def name(self, row: int, landmark: int, part: int) -> None:
        """Gives a row the variable of its landmark, and its part."""
        ...

    def add_pair(self, *, free: bool) -> int:
        """Adds a pair of constant errors at zero, held there unless `free`; returns its variable."""
        ...

    def add_fix(self, fix: Array) -> int:
        """Adds a row (11,) of the table of fixes; returns its part in the sightings."""
        ...
