"""Draws a study's figure where x is a word: one row per x and `by`, with runs, median and interval."""

from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..claims.curves import Medians, Place, names
from ..drawing.axes import fitted
from ..drawing.rows import height, rows
from ..drawing.svg import INK
from ..words.numerals import TIMES
from ..words.styles import Look
from .marks import Marks, draw_upright

MARKERS = ("D", "s", "^", "v", "o", "P")  # of published values, each hollow, by whose they are
LEGEND = 13  # points of a line of the legend
MOST_DOTS = 60  # dots of a row; of more runs some, evenly along their order


def rows_height(found: Medians) -> float:
    """The height in points."""
    lines = len(found.figure.printed)
    return height([name for name, _ in _rows(found)]) + LEGEND * (lines + (lines > 0))


def draw_rows(figure: Figure, found: Medians, looks: Mapping[Any, Look], drawn: Marks, measure: str) -> None:
    """Draws it; `measure` labels the axis."""
    named = _rows(found)
    axes = rows(figure, [(name, looks[_whose(found, place)]) for name, place in named])
    shown = [value for _, place in named for value in (*_some(place), place.low, place.high, *drawn.values)]
    shown += [value for values in found.figure.printed.values() for value in values.values()]
    shown = [value for value in shown if np.isfinite(value)]
    if "y" in found.figure.log and min(shown, default=0) > 0:
        fitted("x", axes, shown)
    elif shown:
        low, high = min(shown), max(shown)
        low = 0.0 if 0 <= low < 0.7 * high else low
        room = 0.05 * (high - low) or 0.5
        axes.set_xlim(low - room * (low != 0), high + room)
    draw_upright(axes, found, drawn, [place for _, place in named])
    for k, (_, place) in enumerate(named):
        look, dots = looks[_whose(found, place)], _some(place)
        across = k + 0.12 + 0.34 * ((np.arange(len(dots)) * 0.618) % 1 - 0.5)
        axes.plot(dots, across, "o", color=look.colour, markersize=3, markeredgewidth=0, alpha=0.4)
        ends = np.clip((place.low, place.high), *axes.get_xlim())
        axes.plot(ends, [k + 0.12] * 2, color=INK, linewidth=1.1)
        axes.plot([place.value], [k + 0.12], "|", color=INK, markersize=10, markeredgewidth=1.6)
        if place.failed:
            axes.annotate(
                f"{TIMES} {place.failed} of {place.ended} failed", (1, k - 0.3), xycoords=axes.get_yaxis_transform(),
                ha="right", va="center", fontsize=6.5,
            )  # fmt: skip
        if k and place.x != named[k - 1][1].x and len(found.bys) > 1 and found.figure.x != found.figure.by:
            axes.axhline(k - 0.4, color=INK, linewidth=0.5, alpha=0.4)
    axes.set_xlabel(measure)
    if found.figure.printed:
        _draw_printed(axes, found, named)
        figure.legend(loc="upper left", frameon=False, fontsize=7.5, handletextpad=0.4, borderpad=0)


def _draw_printed(axes: Axes, found: Medians, named: Sequence[tuple[str, Place]]) -> None:
    """Draws published values in their rows, and names the markers for a legend."""
    axes.plot([], [], "|", color=INK, markersize=10, markeredgewidth=1.6, label="measured here")
    for (whose, values), marker in zip(found.figure.printed.items(), cycle(MARKERS)):
        style: dict[str, Any] = {"marker": marker, "markersize": 5, "color": INK, "markerfacecolor": "none"}
        places = [(values[place.x], k + 0.12) for k, (_, place) in enumerate(named) if place.x in values]
        axes.plot(*zip(*places, strict=True), linestyle="none", label=whose, **style)


def _rows(found: Medians) -> list[tuple[str, Place]]:
    """Lists (name, its cells) from the top, those with a value or a failure."""
    places = [found.places[x, by] for x in found.xs for by in found.bys if (x, by) in found.places]
    places = [place for place in places if place.n or place.failed] or places
    named = names(found.figure.x, found.xs)
    if found.figure.x == found.figure.by:
        return [(found.called[place.by], place) for place in places]
    if len(found.bys) == 1:
        return [(named[place.x], place) for place in places]
    return [(f"{named[place.x]} · {found.called[place.by]}", place) for place in places]


def _whose(found: Medians, place: Place) -> Any:
    """The key of its look: a backend where there are any."""
    return place.x if found.figure.x == "backend" else place.by


def _some(place: Place) -> Any:
    finite = place.values[np.isfinite(place.values)]
    if len(finite) <= MOST_DOTS:
        return finite
    return finite[np.linspace(0, len(finite) - 1, MOST_DOTS).round().astype(int)]
