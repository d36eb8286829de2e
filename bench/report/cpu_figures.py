"""Figures of CPU time: along a run, over all of a run's steps, and against the growing log or map."""

from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...core.se2 import Array, Ints
from ..drawing.axes import fitted, legend, stretches
from ..drawing.figure import ReportFigure
from ..drawing.figure_maker import curve, of, report_figure
from ..drawing.legend import ROW, named
from ..drawing.rows import height, rows
from ..drawing.svg import INK
from ..measure.growth import NO_GROWTH, Slope, binned
from ..verdict.cost_words import slope, whole_map
from ..verdict.costs import cost, costs_by_round
from ..words.columns import DEADLINES_MS
from ..words.names import tags
from ..words.numerals import number, raised
from ..words.styles import Look
from .drawn_log import DrawnLog, Trace
from .time_curves import HEIGHT, Series, along

STRETCHES = 60

SHORTEST_US = 0.1  # µs; lower costs are drawn at it: a step below it is lost in the clock's noise
FAR = 20  # times the slowest step; the time between steps is not drawn where it is longer


def over_time(name: str, log: DrawnLog) -> ReportFigure | None:
    """Draws means of stretches, and the slowest step of each."""
    series: list[Series] = []
    for trace in _timed(log):
        t, us = trace.arrays["t"], _us(trace)
        middle, mean = stretches(t, us, STRETCHES)
        peaks = None if len(t) <= STRETCHES else _highest(t, us, STRETCHES)
        series.append(Series(trace.label, trace.look, middle, mean, peaks=peaks, marked=not trace.alone))
    caption = "Line: mean of short stretches. Dots: the slowest step of each."
    title, unit = "Step cost along the log", "CPU time a step, µs"
    return along(name, log, title, unit, caption + _beside(log), series, group="cost")


def spread(name: str, log: DrawnLog) -> ReportFigure | None:
    """Draws the distribution of the steps' costs."""
    timed = _timed(log)
    if not timed:
        return None
    called = tags(trace.label for trace in log.traces)
    names = [called[trace.label] + "*" * (not trace.alone) for trace in timed]
    interval = _interval(log, timed[0])
    beyond = interval is not None and interval > FAR * max(float(_us(trace).max()) for trace in timed)

    def draw(figure: Figure) -> None:
        axes = rows(figure, [(name, trace.look) for name, trace in zip(names, timed, strict=True)])
        ends: list[float] = []
        for k, trace in enumerate(timed):
            low, p5, p50, p95, p99, high = np.percentile(_us(trace), (0, 5, 50, 95, 99, 100)).tolist()
            ends += [low, high]
            at = k + 0.12
            look: dict[str, Any] = {"color": trace.look.colour, "gid": of(trace.look)}
            axes.plot([low, high], [at, at], linewidth=1, **look)
            axes.plot([p5, p95], [at, at], linewidth=5, alpha=0.45, solid_capstyle="butt", **look)
            axes.plot([p99], [at], "|", markersize=8, markeredgewidth=1.4, **look)
            axes.plot([p50], [at], "o", markersize=4.5, markeredgewidth=0, **look)
        if interval is not None and not beyond:
            axes.axvline(interval, color=INK, linewidth=0.8, linestyle=(0, (4, 2)))
            ends.append(interval)
        fitted("x", axes, ends)
        axes.set_xlabel("CPU time a step, µs")

    caption = "Dot: median step. Bar: middle 90 %. Tick: 99 %. Thin line: cheapest to slowest."
    if interval is not None:
        caption += (
            f" {'Far to the right' if beyond else 'Dashed'}: {number(interval / 1e3)} ms, the time between steps."
        )
    caption += _beside(log)
    curves = [
        curve(trace.label, np.percentile(_us(trace), (50, 99, 100)), np.full(3, k + 0.12))
        for k, trace in enumerate(timed)
    ]
    return report_figure(name, "CPU time of a step", caption, height(names), draw, group="cost", curves=curves)


def by_round(name: str, log: DrawnLog) -> ReportFigure | None:
    """Draws every backend's median step in each round, over all logs, and its interval; None without repeats."""
    shown = [
        (line, found, each)
        for line in log.lines
        if (found := cost(line, "step_us_p50")) is not None and found.rounds > 1
        for each in [costs_by_round(line, "step_us_p50")]
    ]
    if not shown:
        return None
    called = tags(line.backend for line, _, _ in shown)
    names = [called[line.backend] for line, _, _ in shown]

    def draw(figure: Figure) -> None:
        axes = rows(figure, [(name, log.looks[line.backend]) for name, (line, _, _) in zip(names, shown, strict=True)])
        ends: list[float] = []
        for k, (line, found, each) in enumerate(shown):
            at, look = k + 0.12, log.looks[line.backend]
            style: dict[str, Any] = {"color": look.colour, "gid": of(look)}
            if np.isfinite(found.low):
                axes.plot([found.low, found.high], [at, at], linewidth=5, alpha=0.35, solid_capstyle="butt", **style)
                ends += [found.low, found.high]
            axes.plot(each, np.full(len(each), at), "o", markersize=4, markeredgewidth=0, alpha=0.8, **style)
            ends += each.tolist()
        fitted("x", axes, ends)
        axes.set_xlabel("CPU time a step, µs")

    caption = (
        "Dot: a round of all logs, geometric mean of their median steps. Bar: 95 % interval over logs and rounds, for "
        "the machine as it was."
    )
    curves = [curve(line.backend, each, np.full(len(each), k + 0.12)) for k, (line, _, each) in enumerate(shown)]
    title = "CPU time of a step, round by round"
    return report_figure(name, title, caption, height(names), draw, group="cost", curves=curves)


class _Growth(NamedTuple):
    trace: Trace
    size: Array
    us: Array
    power: float | None
    slope: Slope | None  # of a long log

    def said(self, letter: str) -> str:
        """The law behind a name, "" where none is known."""
        if self.slope is None:
            return "" if self.power is None else f", {_power(letter, self.power)}"
        if self.slope.high < NO_GROWTH:
            return ", flat"
        low, high = (round(end, 1) + 0.0 for end in self.slope[1:])  # never -0.0
        return f", {_power(letter, self.slope.exponent)} ({low:.1f} to {high:.1f})"


def _against(name: str, log: DrawnLog, along: str) -> ReportFigure | None:
    """Draws the cost of a step against the number of steps or landmarks known, both logarithmic.

    None where no power is to be seen: each fit is flat, or none is. Of a long log flat ones are shown, too.
    """
    column, steps = f"growth_{along}", along == "steps"
    powers = {line.backend: line.values[column].median for line in log.lines if column in line.values}
    slopes = {line.backend: slope(line) for line in log.lines} if steps else {}
    grown = [
        _Growth(trace, *binned(size, _us(trace))[:2], powers.get(trace.label), slopes.get(trace.label))
        for trace in _timed(log)
        if (size := _sizes(trace, along)) is not None
    ]
    grown = [one for one in grown if len(one.size) > 2]
    long = any(one.slope is not None for one in grown)
    if not long and all(one.power is None or abs(one.power) < NO_GROWTH for one in grown):
        return None
    letter, what = ("k", "step k") if steps else ("N", "landmarks known N")
    more = max(len(one.said(letter)) for one in grown)
    key = named((one.trace.label for one in grown), log.order, more=more)
    whole = whole_map(log.lines) if steps else 0

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for one in grown:
            look: Look = one.trace.look
            label = key.called(one.trace.label)
            if label is not None:
                label += "*" * (not one.trace.alone) + one.said(letter)
            style: dict[str, Any] = {
                "linestyle": look.dash,
                "marker": look.marker,
                "markersize": 3,
                "markevery": 3,
                "linewidth": 1.1,
            }
            alpha = key.alpha(one.trace.label)
            axes.plot(one.size, one.us, color=look.colour, label=label, alpha=alpha, gid=of(look), **style)
        key.others(axes)
        fitted("x", axes, [end for one in grown for end in (one.size[0], one.size[-1])])
        fitted("y", axes, [value for one in grown for value in one.us.tolist()])
        if long:
            _deadlines(axes)
        if whole:
            axes.axvline(whole, color=INK, linewidth=0.8, linestyle=(0, (4, 2)))
            _remark(axes, "map whole", (whole, 0), ("data", "axes fraction"))
        axes.set_xlabel(what)
        axes.set_ylabel("CPU time a step, µs")
        legend(figure, axes, key.columns)

    if long:
        caption = (
            "Means of bins. Behind a name: the slope of the line since the map is whole, or of all but its beginning "
            "where that is late, with its 95 % interval; flat: no growth."
        )
        caption += f" Dashed: step {whole:,}, where that begins." * (whole > 0)
    else:
        caption = (
            "Means of bins. Behind a name: the power fitted to them, a constant part aside (its median over logs); "
            "flat: hardly any growth."
        )
    curves = [curve(one.trace.label, one.size, one.us) for one in grown]
    title = f"How the cost of a step grows with {'the log' if steps else 'the map'}"
    return report_figure(
        name, title, caption + _beside(log), HEIGHT + ROW * key.rows, draw, group="cost", curves=curves
    )


def _deadlines(axes: Axes) -> None:
    """Draws those that the axes reach."""
    low, high = axes.get_ylim()
    for ms in DEADLINES_MS:
        if low < 1e3 * ms < high:
            axes.axhline(1e3 * ms, color=INK, linewidth=0.6, linestyle=(0, (1, 2)))
            _remark(axes, f"{ms} ms", (0, 1e3 * ms), ("axes fraction", "data"))


def _remark(axes: Axes, text: str, at: tuple[float, float], of: tuple[str, str]) -> None:
    axes.annotate(text, at, (3, 2), xycoords=of, textcoords="offset points", fontsize=7, color=INK)


growth_over_steps, growth_over_landmarks = (partial(_against, along=along) for along in ("steps", "landmarks"))


def _power(letter: str, power: float) -> str:
    return "flat" if abs(power) < NO_GROWTH else f"∝ {letter}{raised(f'{power:.1f}')}"


def _sizes(trace: Trace, along: str) -> Ints | None:
    if along == "steps":
        return np.arange(1, len(trace.arrays["step_ns"]) + 1)
    mapped = trace.arrays.get("mapped")
    return None if mapped is None else np.asarray(mapped, np.int64)


def _highest(t: Array, values: Array, count: int) -> Array:
    """Returns (count,) the highest value in each of `axes.stretches`; NaN where it has none."""
    edges = np.linspace(t[0], t[-1], count + 1)
    place = np.clip(np.searchsorted(edges, t, "right") - 1, 0, count - 1)
    highest = np.full(count, -np.inf)
    np.maximum.at(highest, place, values)
    return np.where(np.isfinite(highest), highest, np.nan)


def _us(trace: Trace) -> Array:
    return np.maximum(trace.arrays["step_ns"] / 1e3, SHORTEST_US)


def _timed(log: DrawnLog) -> list[Trace]:
    return [trace for trace in log.traces if len(trace.arrays.get("step_ns", ()))]


def _beside(log: DrawnLog) -> str:
    return "" if all(trace.alone for trace in log.traces) else " * timed while other cells ran beside it."


def _interval(log: DrawnLog, trace: Trace) -> float | None:
    """The median µs from step to step; None where the log has no real times."""
    if log.lengths.get(log.seed) is None:
        return None
    return float(np.median(np.diff(trace.arrays["t"]))) * 1e6
