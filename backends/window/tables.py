"""The tables of a window's sightings and fixes, as `incremental/parts.py` fills them."""

from ...core.se2 import Array
from ..sighting_tables import Seen
from ._window import FIRST, FIXED, LAST, OLD_POSES, OLD_SIGHTINGS, POSES, SIGHTINGS, SLOT, Window
from .arrays import row_of_new, with_fix


class WindowTables:
    """A window, which is another one whenever it grows; rows keep their numbers when old ones leave."""

    def __init__(self, window: Window) -> None:
        self.window = window

    @property
    def stored(self) -> int:
        """The number of rows of sightings so far."""
        return int(self.window.state[SIGHTINGS] + self.window.state[OLD_SIGHTINGS])

    def first(self, k: int) -> int:
        """The first row of a step that is in the window, or of the next one."""
        w = self.window
        return int(w.rows[k - w.state[OLD_POSES], FIRST] + w.state[OLD_SIGHTINGS])

    def row(self, row: int) -> tuple[int, Seen]:
        """Part and sighting of a row."""
        at = row - self.window.state[OLD_SIGHTINGS]
        return int(self.window.parts[at]), tuple(self.window.seen[at].tolist())

    def name(self, row: int, landmark: int, part: int) -> None:
        """Gives a row its landmark, and its part: constant errors then stay as if the last pose had used them."""
        w = self.window
        at = row - w.state[OLD_SIGHTINGS]
        w.sightings[at], w.parts[at] = landmark, part
        if part >= 0:
            w.marks[part, LAST] = w.state[POSES] - 1

    def add_pair(self, *, free: bool) -> int:
        """Adds a pair of constant errors at zero, held there unless `free`; returns its row among the landmarks."""
        self.window, row = row_of_new(self.window, 0.0, 0.0)
        if not free:
            self.window.marks[row, SLOT] = FIXED
        return row

    def add_fix(self, fix: Array) -> int:
        """Adds a row (11,) of the table of fixes; returns its part in the sightings."""
        self.window, part = with_fix(self.window, fix)
        return part
