"""Chooses the backends that a figure draws in full and names; of many, the others are faint."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import NamedTuple

from matplotlib.axes import Axes

from ..words.names import tags
from ..words.styles import BASELINE
from .axes import legend_columns
from .figure_maker import WIDTH
from .svg import INK

ROW = 11.5  # points of a legend's row
LOUD, LEGEND_ROWS = 7, 4  # the most backends that are drawn in full and named, and the most rows of their names

FAINT = 0.28

OTHERS = "{} others, faint"


class Key(NamedTuple):
    """The backends drawn in full and named, and how."""

    tags: Mapping[str, str]
    loud: Collection[str]
    columns: int  # of the legend

    @property
    def rows(self) -> int:
        """The legend's rows."""
        return -(-(len(self.loud) + (self.faint > 0)) // self.columns)

    @property
    def faint(self) -> int:
        """Counts the backends that are drawn faintly and not named."""
        return len(self.tags) - len(self.loud)

    def called(self, label: str) -> str | None:
        """The name in the legend, if any."""
        return self.tags[label] if label in self.loud else None

    def alpha(self, label: str) -> float:
        """The opacity."""
        return 1.0 if label in self.loud else FAINT

    def others(self, axes: Axes) -> None:
        """Adds the number of faint ones to the legend."""
        if self.faint:
            axes.plot([], [], color=INK, linewidth=0.8, alpha=2 * FAINT, label=OTHERS.format(self.faint))


def named(labels: Iterable[str], order: Sequence[str], more: int = 0) -> Key:
    """Chooses the baseline and the first of `order` that fit; `more` letters follow each name."""
    called = tags(labels)
    places = {label: place for place, label in enumerate(order)}
    ranked = sorted(called, key=lambda label: (label != BASELINE, places.get(label, len(places))))
    for count in range(min(LOUD, len(ranked)), 1, -1):
        loud = ranked[:count]
        names = [called[label] + " " * more for label in loud] + [OTHERS] * (count < len(ranked))
        columns = legend_columns(names, WIDTH)
        if -(-len(names) // columns) <= LEGEND_ROWS:
            return Key(called, loud, columns)
    return Key(called, ranked[:1], 1)
