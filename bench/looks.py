"""How a backend looks: one colour, line and marker in every figure and table of a report.

The colours are those of Okabe and Ito (Color Universal Design, 2008), which tell apart for every kind of colour vision.
"""

from collections.abc import Iterable
from typing import NamedTuple

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#e69f00", "#cc79a7", "#56b4e9")
DASHES = ("-", (0, (6, 1.5)), (0, (2, 1)), (0, (6, 1.5, 1.5, 1.5)), (0, (9, 2, 2, 2, 2, 2)))
MARKERS = ("o", "s", "D", "^", "v", "P", "X")

BASELINE = "dead-reckoning"
"""What every backend has to beat: grey, and out of the ranking of costs."""


class Look(NamedTuple):
    """One backend's."""

    colour: str
    dash: str | tuple[int, tuple[float, ...]]  # a matplotlib line style
    marker: str
    index: int  # pyright: ignore[reportIncompatibleMethodOverride] - nobody looks for a value in a look. Its place among the report's backends: what belongs to it in a page is of the class of-INDEX


def looks(backends: Iterable[str]) -> dict[str, Look]:
    """A look for every label, the plainest first. Dashes and markers go round in steps of their own."""
    chosen: dict[str, Look] = {}
    k = 0
    for label in dict.fromkeys(backends):
        if label == BASELINE:
            chosen[label] = Look("#8c8c8c", (0, (1, 1)), ".", len(chosen))
        else:
            colour, dash, marker = COLOURS[k % len(COLOURS)], DASHES[k % len(DASHES)], MARKERS[k % len(MARKERS)]
            chosen[label] = Look(colour, dash, marker, len(chosen))
            k += 1
    return chosen
