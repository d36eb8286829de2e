"""The colour, line and marker of each backend, the same in every figure and table of a report.

The colours are those of Okabe and Ito (Color Universal Design, 2008), distinct for every kind of colour vision.
"""

from collections.abc import Iterable
from itertools import count
from typing import NamedTuple

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#e69f00", "#cc79a7", "#56b4e9")
DASHES = ("-", (0, (6, 1.5)), (0, (2, 1)), (0, (6, 1.5, 1.5, 1.5)), (0, (9, 2, 2, 2, 2, 2)))
MARKERS = ("o", "s", "D", "^", "v", "P", "X")

USUAL = ("ekf", "fastslam", "isam2", "graph", "fixed-lag", "invariant-ekf", "ukf")  # have fixed looks
BASELINE = "dead-reckoning"  # the baseline: grey, and not ranked by cost


class Look(NamedTuple):
    """A backend's colour, line and marker."""

    colour: str
    dash: str | tuple[int, tuple[float, ...]]  # a matplotlib line style
    marker: str
    place: int  # among the report's backends: what belongs to this one in a page is of the class of-PLACE


def looks(backends: Iterable[str]) -> dict[str, Look]:
    """Assigns a look to every label: a fixed one to those in USUAL, what is left in turn to the others."""
    labels = list(dict.fromkeys(backends))
    taken = {USUAL.index(label) for label in labels if label in USUAL}
    free = (k for k in count() if k not in taken)
    return {
        label: GREY._replace(place=place)
        if label == BASELINE
        else _look(USUAL.index(label) if label in USUAL else next(free), place)
        for place, label in enumerate(labels)
    }


def _look(k: int, place: int) -> Look:
    """The k-th look; colours, dashes and markers cycle with different periods."""
    return Look(COLOURS[k % len(COLOURS)], DASHES[k % len(DASHES)], MARKERS[k % len(MARKERS)], place)


GREY = Look("#8c8c8c", (0, (1, 1)), ".", 0)  # the baseline's
