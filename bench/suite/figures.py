"""The site's figures of a suite: how far each backend is from the best, and what a step costs, dataset by dataset."""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from ..drawing.axes import drawable, fits, fitted, legend, legend_columns, short
from ..drawing.figure import ReportFigure
from ..drawing.figure_maker import of, report_figure
from ..drawing.svg import INK
from ..verdict.ranking import PATHS, RELATIONS, judged_by, ranking
from ..verdict.summary import representative, typical
from ..words.names import tags
from ..words.styles import BASELINE, Look
from .standing import Standing

WIDTH = 500  # points: a page's width
ROW, MARGINS = 11.0, 62.0  # points of a backend's place in a dataset's row, and of axis and legend
LONGEST = 26  # letters of a dataset's name
ONLINE = (PATHS["online"], RELATIONS["online"])


class Dot(NamedTuple):
    """A backend's value on a dataset, with the ends of its interval."""

    backend: str
    value: float
    low: float
    high: float


def gaps(name: str, found: Sequence[Standing], looks: Mapping[str, Look], purpose: str) -> ReportFigure | None:
    """Draws the errors of a purpose as multiples of the best one's; None where no two backends are compared."""
    groups = [(one.name, dots) for one in found if len(dots := _gaps(one, purpose)) > 1]
    if not groups:
        return None
    what = "online" if purpose == "online" else "afterwards"
    caption = (
        "1: the best. Bar: the 95 % interval of the ratio, paired by log; where it contains 1, no difference from "
        "the best is claimed. Dead reckoning is not drawn."
    )
    return _dots(name, f"Error {what}, as a multiple of the best", caption, groups, looks, "times the best error", 1.0)


def _gaps(found: Standing, purpose: str) -> list[Dot]:
    column = judged_by(representative(found.lines)).get(purpose, "")
    ranked = ranking(found.lines, column) if column else None
    if ranked is None or len(ranked.lines) < 2:
        return []
    best, *others = ranked.lines
    dots = [Dot(best.backend, 1.0, np.nan, np.nan)]
    for line in others:
        c = ranked.between(best, line)
        dots.append(Dot(line.backend, c.ratio, c.low, c.high))
    return dots


def costs(name: str, found: Sequence[Standing], looks: Mapping[str, Look]) -> ReportFigure | None:
    """Draws the median CPU time of a step; None where there is none."""
    groups = [(one.name, dots) for one in found if (dots := _costs(one))]
    if not groups:
        return None
    caption = "Median over logs of a log's median step; bar: 95 % interval, the range of fewer than six logs."
    return _dots(name, "CPU time of a step", caption, groups, looks, "µs", None)


def _costs(found: Standing) -> list[Dot]:
    """Lists the steps of those that have an online path: a batch method does nothing in its steps."""
    column = "step_us_p50"
    having = [
        line
        for line in found.lines
        if column in line.values and line.backend != BASELINE and {*line.values} & {*ONLINE}
    ]
    return [Dot(line.backend, *typical(line, column)[:3]) for line in having]


def _dots(
    name: str,
    title: str,
    caption: str,
    groups: Sequence[tuple[str, Sequence[Dot]]],
    looks: Mapping[str, Look],
    unit: str,
    at: float | None,
) -> ReportFigure:
    backends = [label for label in looks if any(dot.backend == label for _, dots in groups for dot in dots)]
    called = tags(backends)
    columns = legend_columns([called[label] for label in backends], WIDTH)
    rows = sum(len(dots) + 0.8 for _, dots in groups)

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        axes.grid(visible=False, axis="y")
        axes.spines["left"].set_visible(False)
        if at is not None:
            axes.axvline(at, color=INK, linewidth=0.8, alpha=0.6)
        place, names = 0.0, list[tuple[float, str]]()
        seen: set[str] = set()
        for group, dots in groups:
            names.append((place + (len(dots) - 1) / 2, short(group, LONGEST)))
            for dot in dots:
                look = looks[dot.backend]
                ends = drawable(np.array((dot.low, dot.high)))
                if np.isfinite(ends).all() and min(ends) > 0:
                    axes.plot(ends, [place] * 2, color=look.colour, linewidth=1.2, alpha=0.7, gid=of(look))
                if fits(dot.value):
                    label = None if dot.backend in seen else called[dot.backend]
                    seen.add(dot.backend)
                    axes.plot(
                        [dot.value], [place], look.marker, color=look.colour, markersize=4.6, label=label, gid=of(look)
                    )
                place += 1
            place += 0.8
        axes.set_ylim(place - 0.8, -0.8)
        axes.set_yticks([height for height, _ in names], [text for _, text in names])
        fitted("x", axes, _sizes(groups))
        axes.set_xlabel(unit)
        if seen:
            legend(figure, axes, columns)

    high = MARGINS + 11.5 * -(-len(backends) // columns) + ROW * rows
    return report_figure(name, title, caption, high, draw, group="cost" if at is None else "accuracy", width=WIDTH)


def _sizes(groups: Iterable[tuple[str, Sequence[Dot]]]) -> list[float]:
    values = [value for _, dots in groups for dot in dots for value in (dot.value, dot.low, dot.high)]
    return [float(value) for value in values if np.isfinite(value)]
