"""Draws a study's figure: medians with intervals over x, one line per value of `by`; or rows, where x is a word."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from textwrap import fill, wrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.ticker import FixedFormatter, FixedLocator, NullLocator

from ...core.se2 import Array
from ..claims.answer import Answer
from ..claims.curves import Medians, Place
from ..drawing.axes import logarithmic, short
from ..drawing.figure import ReportFigure
from ..drawing.figure_maker import report_figure
from ..verdict.statistics import FEWEST
from ..words.columns import about
from ..words.numerals import TIMES, counted, plain
from ..words.styles import Look
from .line_looks import line_looks
from .marks import Marks, draw_across, marks
from .rows import draw_rows, rows_height

WIDTH, HEIGHT = 310, 205  # points
LETTERS = 18  # letters of a line of a name at the end of its curve
LABEL = 52  # letters of a line below the axis
MOST_MARKS = 8  # values of x that each have a tick, where there is room
LEVEL = (0, (1, 1.5))  # line style of what has no value of x
EDGE = 1e-3  # share of the axis: a tick nearer to its end may not be drawn
TIGHT = 0.07  # share of the axis between two ticks at least


def study_figure(name: str, found: Medians, backends: Iterable[Any], answers: Iterable[Answer], x: str) -> ReportFigure:
    """Draws the figure; `x` labels its axis."""
    looks, drawn = line_looks(found, backends), marks(found, answers)
    measure = about(found.figure.y)
    y = measure.with_unit
    plain = f"{measure.called} over {found.figure.x.replace('_', ' ')}"
    title = found.figure.title or f"{plain[:1].upper()}{plain[1:]}"
    if not found.numeric:
        height = rows_height(found)
        return report_figure(
            name, title, _caption(found, drawn), height, lambda c: draw_rows(c, found, looks, drawn, y), width=WIDTH
        )

    def draw(canvas: Canvas) -> None:
        _draw_lines(canvas.subplots(), found, looks, drawn, named, height)
        canvas.axes[0].set_xlabel(fill(_together(x), LABEL))
        canvas.axes[0].set_ylabel(y)

    slopes = drawn.slopes if found.figure.log == "xy" else {}
    named = {by: _lines(found.called[by], slopes.get(by)) for by in found.bys}
    height = max(HEIGHT, 60 + 10 * sum(len(lines) for lines in named.values()))
    return report_figure(name, title, _caption(found, drawn), height, draw, width=WIDTH)


def _draw_lines(
    axes: Axes,
    found: Medians,
    looks: Mapping[Any, Look],
    drawn: Marks,
    named: Mapping[Any, Sequence[str]],
    height: float,
) -> None:
    xs = [float(x) for x in found.xs if x is not None]
    _set_x(axes, xs, log="x" in found.figure.log)
    _set_y(axes, found, drawn)
    draw_across(axes, found, drawn)
    if len(xs) <= MOST_MARKS:
        _mark_values(axes, xs)
    ends: list[tuple[Any, float]] = []
    for k, by in enumerate(found.bys):
        places = found.line(by)
        at = _dodged(axes, [float(p.x) for p in places if p.x is not None], k - (len(found.bys) - 1) / 2)
        last = _draw_line(axes, looks[by], [p for p in places if p.x is not None], at)
        if (None, by) in found.places:
            level = _draw_level(axes, looks[by], found.places[None, by])
            last = level if np.isnan(last) else last
        if np.isfinite(last):
            ends.append((by, last))
    _name_ends(axes, [(looks[by], named[by], y) for by, y in ends], height - 45)


def _draw_line(axes: Axes, look: Look, places: Sequence[Place], at: Array) -> float:
    """Draws one value of `by`; returns the height at which it ends, NaN where nothing is drawn."""
    value = np.array([place.value for place in places])
    low, high = (np.clip([getattr(place, end) for place in places], *axes.get_ylim()) for end in ("low", "high"))
    shown = np.isfinite(value)
    style: dict[str, Any] = {"color": look.colour, "linestyle": look.dash, "marker": look.marker, "markersize": 4}
    axes.plot(at[shown], value[shown], **style, markeredgewidth=0, zorder=3)
    axes.vlines(at[shown], low[shown], high[shown], color=look.colour, linewidth=1, alpha=0.75)
    failing = np.array([place.failed > 0 for place in places], bool)
    top = np.full(failing.sum(), 0.975)
    axes.plot(at[failing], top, "x", color=look.colour, markersize=4.5, transform=axes.get_xaxis_transform())
    return float(value[shown][-1]) if shown.any() else np.nan


def _draw_level(axes: Axes, look: Look, place: Place) -> float:
    """Draws what has no value of the figure's parameter across it; returns its height, NaN where there is none."""
    if not np.isfinite(place.value):
        return np.nan
    axes.axhline(place.value, color=look.colour, linestyle=LEVEL, linewidth=1)
    return place.value


def _set_x(axes: Axes, xs: Sequence[float], *, log: bool) -> None:
    """Sets the x axis over all of them with some room, logarithmic if requested and possible."""
    log = log and min(xs) > 0
    if log:
        axes.set_xscale("log")
    first, last = (np.log10(x) if log else x for x in (min(xs), max(xs)))
    room = 0.06 * (last - first) or 0.5 * abs(first) or 0.5
    axes.set_xlim(*(10**end if log else end for end in (first - room, last + room)))


def _set_y(axes: Axes, found: Medians, drawn: Marks) -> None:
    low, high, log = span(found, drawn)
    if log:
        logarithmic("y", axes, low, high)
        return
    low = 0.0 if 0 <= low < 0.7 * high else low
    room = 0.06 * (high - low) or 0.5 * abs(high) or 0.5
    axes.set_ylim(low - room * (low != 0), high + room)


def span(found: Medians, drawn: Marks) -> tuple[float, float, bool]:
    """The y axis's ends around all medians, and intervals as far as there is room; True if logarithmic."""
    values = [place.value for place in found.places.values()] + drawn.values
    values = [value for value in values if np.isfinite(value)] or [1.0]
    expected = about(found.figure.y).kind.expected
    values += [] if expected is None else [expected]
    ends = [end for place in found.places.values() for end in (place.low, place.high)]
    log = "y" in found.figure.log and min(values) > 0
    ends = [end for end in ends if np.isfinite(end) and (end > 0 or not log)] + values
    scaled, reach = (np.log10(values), np.log10(4)) if log else (np.array(values), 0.5 * max(map(abs, values)))
    reach = max(0.9 * float(np.ptp(scaled)), reach)
    low, high = ((10**end if log else end) for end in (scaled.min() - reach, scaled.max() + reach))
    return max(low, min(ends)), min(high, max(ends)), log


def _mark_values(axes: Axes, xs: Sequence[float]) -> None:
    """Sets ticks at the values themselves, as many as there is room for."""
    kept: list[float] = []
    places = axes.transLimits.transform(axes.transScale.transform([(x, axes.get_ylim()[1]) for x in xs]))[:, 0]
    last = -np.inf
    for x, place in zip(xs, places, strict=True):
        if place - last > TIGHT:
            kept.append(x)
            last = place
    axes.xaxis.set_major_locator(FixedLocator(kept))
    axes.xaxis.set_major_formatter(
        FixedFormatter([f"{x:,.0f}" if x % 1 == 0 else plain(x).removeprefix(f"1.00{TIMES}") for x in kept])
    )
    axes.xaxis.set_minor_locator(NullLocator())


def _dodged(axes: Axes, xs: Sequence[float], place: float) -> Array:
    """Offsets the points so that intervals stand beside each other."""
    low, high = axes.get_xlim()
    if axes.get_xscale() == "log":
        return np.array(xs) * (high / low) ** (0.009 * place)
    return np.array(xs) + 0.009 * place * (high - low)


def _name_ends(axes: Axes, ends: Sequence[tuple[Look, Sequence[str], float]], height: float) -> None:
    """Writes names right of the lines' ends, moved apart, as ticks of the right side, so that the layout has room."""
    if not ends:
        return
    scale = axes.transScale + axes.transLimits
    left = axes.get_xlim()[0]
    wanted = [float(np.clip(scale.transform((left, y))[1], 0, 1)) for *_, y in ends]
    heights = [(9.5 * len(lines)) / height for _, lines, _ in ends]
    places = _apart(wanted, heights)
    at = scale.inverted().transform([(0, place) for place in places])[:, 1]
    axes.yaxis.remove_overlapping_locs = False
    axes.yaxis.set_minor_locator(FixedLocator(at.tolist()))
    axes.yaxis.set_minor_formatter(FixedFormatter(["\n".join(lines) for _, lines, _ in ends]))
    axes.tick_params(axis="y", which="minor", left=False, labelleft=False, labelright=True, pad=17, labelsize=7.5)
    for (look, *_), start, place in zip(ends, wanted, places, strict=True):
        style: dict[str, Any] = {"color": look.colour, "transform": axes.transAxes, "clip_on": False}
        axes.plot([1, 1.022], [start, place], linewidth=0.7, alpha=0.7, **style)
        axes.plot([1.022, 1.065], [place, place], linewidth=1.3, linestyle=look.dash, **style)
        axes.plot([1.044], [place], look.marker, markersize=4, markeredgewidth=0, **style)


def _apart(wanted: Sequence[float], heights: Sequence[float]) -> list[float]:
    """Places names of these heights near where they are wanted, between 0 and 1 and without overlap."""
    order = sorted(range(len(wanted)), key=lambda k: wanted[k])
    places = list(wanted)
    for _ in range(40):
        for one, other in pairwise(order):
            lacking = (heights[one] + heights[other]) / 2 - (places[other] - places[one])
            if lacking > 0:
                places[one] -= lacking / 2
                places[other] += lacking / 2
        for k in order:
            low = max(heights[k] / 2 - 0.03, EDGE)
            places[k] = min(max(places[k], low), 1 - low)
    return places


def _together(label: str) -> str:
    """Keeps its last words in brackets on one line."""
    head, bracket, last = label.rpartition(" (")
    return head + bracket + last.replace(" ", "\N{NO-BREAK SPACE}")


def _lines(name: str, slope: float | None) -> list[str]:
    """Splits a name for the end of a line: a backend's options below it, text values without their keys."""
    head, _, inside = name.removesuffix("]").partition("[")
    said = [head]
    for key, _, value in (part.partition("=") for part in inside.split(",") if part):
        many = f"{int(value):,}" if value.isdecimal() else value
        called = value if value[:1].isalpha() else f"{key} {many}"
        said.append({"true": key, "false": f"no {key}"}.get(value, called).replace("_", " "))
    said += [] if slope is None else [f"slope {slope:.2f}"]
    return [short(line, LETTERS) for words in said for line in wrap(words, LETTERS)]


def _caption(found: Medians, drawn: Marks) -> str:
    figure, every = found.figure, list(found.places.values())
    measure = about(figure.y)
    places = [place for place in every if place.x is not None or np.isfinite(place.value)]  # those that are drawn
    counts = [place.n for place in places if place.n]
    few, most = (min(counts), max(counts)) if counts else (0, 0)
    ends = (
        "95 % interval" if few >= FEWEST else "range" if most < FEWEST else f"95 % interval, the range below {FEWEST}"
    )
    over = f"{few:,} to {counted(most, 'run')}" if few != most else counted(most, "run")
    said = [figure.caption, f"{'Marker' if found.numeric else 'Tick'}: median of {over}; bar: {ends}."]
    if not found.numeric:
        said.insert(1, "Dot: a run.")
    if found.numeric and found.without:
        said.append(f"Dotted, level: {found.without}, which has no {figure.x.replace('_', ' ')}.")
    failed = sum(place.failed for place in every)
    if failed:
        worst = "counted as the worst there is" if measure.kind.is_error else "without a value"
        said.append(f"{TIMES}: where runs failed, {failed:,} of {sum(place.ended for place in every):,}, {worst}.")
    if measure.kind.is_nees:
        said.append("Grey band: neither overconfident nor cautious.")
    elif measure.kind.expected is not None:
        said.append(f"Grey line: {measure.kind.expected:g}, where covariances match the errors.")
    if found.numeric:
        said += _told(found, drawn)
    said.append(measure.gist)
    return " ".join(filter(None, said))


def _told(found: Medians, drawn: Marks) -> list[str]:
    said: list[str] = []
    low, high, _ = span(found, drawn)
    if any(place.low < low or place.high > high for place in found.places.values() if np.isfinite(place.value)):
        said.append("A bar that reaches the edge continues beyond it.")
    if drawn.slopes and found.figure.log == "xy":
        said.append("Slope: the exponent with which the measure grows, median over the logs.")
    if any(np.isfinite(crossing.low) for crossing in drawn.crossings):
        said.append("Upright line: where the lines cross, with its 95 % interval.")
    return said
