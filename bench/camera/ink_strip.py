"""A strip on a page of markers that shows to the eye how far the printer's black spreads; lengths are mm.

A vernier: at each step the right edge of an upper black bar and the left edge of a lower one are apart by twice the
step's spread. Black that has grown by as much at every edge brings the two in line there, and only there: eyes see
edges out of line that are much closer than lines they can tell apart. Beside it, lines with gaps as wide as themselves:
black that has spread by half of a gap closes it.
"""

from typing import NamedTuple

FINE, COARSE = tuple(k / 40 for k in range(-2, 9)), tuple(k / 20 for k in range(5))
"""Spread of each step: every 0.025 from -0.05 to 0.2, or where there is less room every 0.05 from 0 to 0.2."""

STEP, BAR, HEIGHT = 5.0, 2.0, 1.6  # from one step to the next, length of a bar, and height of it

LINES, PAIRS, GAP = (0.1, 0.2, 0.3, 0.4, 0.5), 3, 2.4
"""Widths of the lines, black lines of each, and the space before the next width."""

LABEL, HEADING = 0.8, 2.0
"""Heights of the labels' and the headings' middles, below the lower bars and above the upper ones."""


class Box(NamedTuple):
    """A black rectangle."""

    x: float
    y: float
    width: float
    height: float


class Label(NamedTuple):
    """A text, centred at x."""

    x: float
    y: float
    words: str


class Strip(NamedTuple):
    """A strip with its lower left corner at the origin, its bars `LABEL` and more above it."""

    boxes: list[Box]
    labels: list[Label]


def ink_strip(room: float, side: float) -> Strip:
    """The strip for a page with `room` beside the scale bar, and markers of `side`; coarse, without lines, if short."""
    spreads = FINE if room >= STEP * len(FINE) + _lines_width() else COARSE
    low, high = 2 * LABEL, 2 * LABEL + HEIGHT
    boxes, labels = list[Box](), list[Label]()
    for k, spread in enumerate(spreads):
        middle = STEP * (k + 0.5)
        boxes += [Box(middle - spread - BAR, high, BAR, HEIGHT), Box(middle + spread, low, BAR, HEIGHT)]
        labels.append(Label(middle, LABEL, f"{spread:g}"))
    top = high + HEIGHT + HEADING / 2
    words = "edges in line: spread, mm"
    if spreads is FINE:
        words += f" (0.1 is {10 / side:.2g} % of {side:g} mm)"
    labels.append(Label(STEP * len(spreads) / 2, top, words))
    if spreads is COARSE:
        return Strip(boxes, labels)
    x = STEP * len(spreads) + GAP
    for width in LINES:
        boxes += [Box(x + 2 * k * width, low, width, 2 * HEIGHT) for k in range(PAIRS)]
        labels.append(Label(x + (PAIRS - 0.5) * width, LABEL, f"{width:g}"))
        x += 2 * PAIRS * width + GAP
    labels.append(Label(x - _lines_width() / 2, top, "lines, mm"))
    return Strip(boxes, labels)


def _lines_width() -> float:
    return sum(2 * PAIRS * width + GAP for width in LINES) + GAP
