"""Draws curves over the time since a log began, over steps where it is not timed."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...core.se2 import Array
from ..drawing.axes import drawable, fitted, legend
from ..drawing.figure import ReportFigure
from ..drawing.figure_maker import curve, of, report_figure
from ..drawing.legend import ROW, named
from ..drawing.svg import INK
from ..words.numerals import listed, number
from ..words.styles import Look
from .drawn_log import DrawnLog

HEIGHT = 165  # points, without the legend


class Series(NamedTuple):
    """A backend's curve."""

    label: str
    look: Look
    t: Array  # s
    values: Array
    final: bool = False
    peaks: Array | None = None  # the highest of what each value is the mean of
    marked: bool = False  # with *, for a time taken while other cells ran


class Band(NamedTuple):
    """The band in which values should be."""

    t: Array
    low: Array
    high: Array


def along(
    name: str,
    log: DrawnLog,
    title: str,
    unit: str,
    caption: str,
    series: Sequence[Series],
    *,
    group: str,
    level: float | None = None,
    most: float = np.inf,
    band: Band | None = None,
    start: float | None = None,
) -> ReportFigure | None:
    """Draws the curves; None without any.

    `start` is when the log began, if not with the first of the series. `level` is where values should be. Values above
    `most` are left out and listed in the caption, unless nothing would be left.
    """
    series = [one for one in series if not np.isnan(one.values).all()]
    if not series:
        return None
    begun = min(one.t[0] for one in series) if start is None else start
    most = max(most, 3 * min(_median(one.values) for one in series))
    beyond = {one.label: highest for one in series if (highest := float(np.nanmax(one.values))) > most}
    if beyond:
        caption += f" Beyond the top: {listed([f'{label}, up to {number(high)}' for label, high in beyond.items()])}."
    series = [one._replace(values=drawable(one.values)) for one in series]
    key = named((one.label for one in series), log.order)

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        if band is not None:
            axes.fill_between(band.t - begun, band.low, band.high, color=INK, alpha=0.12, linewidth=0)
        done: set[str] = set()
        for one in series:
            label = None if one.label in done else key.called(one.label)
            _draw(axes, one, begun, label and label + "*" * one.marked, key.alpha(one.label))
            done.add(one.label)
        key.others(axes)
        values = [value for one in series for value in one.values[np.isfinite(one.values)].tolist()]
        values += [max(one.peaks) for one in series if one.peaks is not None]
        if level is not None:
            axes.axhline(level, color=INK, linewidth=0.8, linestyle=(0, (4, 2)))
            values.append(level)
        fitted("y", axes, [min(value, most) for value in values])
        axes.margins(x=0.02)
        axes.set_xlabel(log.clock)
        axes.set_ylabel(unit)
        legend(figure, axes, key.columns)

    height = HEIGHT + ROW * key.rows
    curves = [curve(one.label, one.t - begun, one.values, final=one.final) for one in series]
    return report_figure(name, title, caption, height, draw, group=group, curves=curves, timed=True)


def _median(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else 0.0


def _draw(axes: Axes, one: Series, start: float, label: str | None, alpha: float) -> None:
    look, alone = one.look, one.look.marker if len(one.t) == 1 else ""
    axes.plot(
        one.t - start,
        one.values,
        color=look.colour,
        label=label,
        linestyle="-" if one.final else look.dash,
        linewidth=0.7 if one.final or alpha < 1 else 1.3,
        marker="." if one.final else alone,
        markersize=3 if one.final else 5,
        markevery=10 if one.final else 1,
        alpha=alpha,
        gid=of(look),
    )
    if one.peaks is not None:
        t, peaks = (np.repeat(values, 3) for values in (one.t - start, one.peaks))
        t[1::3] += 1e-9  # a line of no length has no end to make round
        peaks[2::3] = np.nan
        dots = axes.plot(t, peaks, color=look.colour, linewidth=2.2, alpha=0.8 * alpha, gid=of(look))
        dots[0].set_solid_capstyle("round")  # one path is a tenth of as many markers
