"""Draws accuracy against cost: every backend's error and CPU time, and the Pareto front."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rcParams
from matplotlib.figure import Figure

from ...backends.api import COMPILED_HERE
from ..drawing.axes import fits, fitted, logarithmic
from ..drawing.figure import ReportFigure
from ..drawing.figure_maker import curve, of, report_figure
from ..drawing.labels import Point, name_points
from ..drawing.svg import INK
from ..verdict.costs import cost
from ..verdict.implementations import foreign
from ..verdict.ranking import ERRORS, path_errors
from ..verdict.summary import Line, Typical, typical
from ..words.names import tags
from ..words.numerals import listed
from ..words.styles import Look
from .accuracy_figures import bars
from .drawn_log import DrawnLog

HEIGHT = 200

NAMED = 7  # the most points with names: those of the fronts, and the most accurate of the others


RING: dict[str, Any] = {"markersize": 11, "markerfacecolor": "none", "markeredgewidth": 0.8}  # not compiled here


class _Choice(NamedTuple):
    """A backend's online path, or its final one."""

    label: str
    look: Look
    us: float
    error: Typical
    final: bool
    ringed: bool  # not compiled here, where others are
    ends: tuple[float, float] | None  # of the cost's interval, µs, where there are repeats


def pareto(name: str, log: DrawnLog) -> ReportFigure | None:
    """Draws error over cost; None with fewer than two backends."""
    return trade_off(name, log.kind, log.lines, log.looks)


def trade_off(name: str, kind: str, lines: Sequence[Line], looks: Mapping[str, Look]) -> ReportFigure | None:
    """Draws the lines of a dataset, `kind` being what is known of the path; None where there are no two."""
    choices = list(_choices(lines, looks))
    choices.sort(key=lambda choice: (any(_before(c, choice) for c in choices), choice.error.value))
    if len({choice.label for choice in choices}) < 2:
        return None
    called = tags(choice.label for choice in choices)
    what = ERRORS[kind]
    both = len({choice.final for choice in choices}) > 1

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        fitted("x", axes, [us for choice in choices for us in (choice.us, *(choice.ends or ())) if fits(us)])
        least = min(choice.error.value for choice in choices)
        ends = [max(end, least / 3) for choice in choices for end in choice.error[:3] if fits(end)]
        logarithmic("y", axes, min(ends), max(ends))  # every point is in it, however accurate one is
        for final, front in _fronts(choices).items():
            x, y = [choice.us for choice in front], [choice.error.value for choice in front]
            axes.step(x, y, where="post", color=INK, linewidth=0.6 if final and both else 1, alpha=0.45, zorder=1)
        edge = {"markeredgewidth": 0.6, "markeredgecolor": rcParams["figure.facecolor"]}
        for choice in choices:
            gid, colour = of(choice.look), choice.look.colour
            ends = np.clip((choice.error.low, choice.error.high), *axes.get_ylim())
            axes.plot([choice.us] * 2, ends, color=colour, linewidth=1.2, alpha=0.6, gid=gid)
            if choice.ends is not None:
                axes.plot(choice.ends, [choice.error.value] * 2, color=colour, linewidth=1.2, alpha=0.6, gid=gid)
            style: dict[str, Any] = {"color": colour, "markersize": 6, "gid": gid}
            style |= {"markerfacecolor": "none", "markeredgewidth": 1.3} if choice.final else edge
            axes.plot([choice.us], [choice.error.value], choice.look.marker, **style)
            if choice.ringed:
                axes.plot([choice.us], [choice.error.value], "o", color=colour, gid=gid, **RING)
        axes.set_xlabel("CPU time a step, µs")
        axes.set_ylabel(f"{what}, m")
        online = {choice.label for choice in choices if not choice.final}
        points = [
            Point(choice.us, choice.error.value, _name(choice, called, online), of(choice.look)) for choice in choices
        ]
        ends = [(choice.us, choice.error.low, choice.error.high) for choice in choices]
        name_points(figure, axes, points[:NAMED], ends, points[NAMED:])

    fronts = _fronts(choices)
    caption = "Lower left is better. " * (kind in ("truth", "relations"))
    if fronts:
        caption += "Line: those that none beats in both" + "; thin: of final paths" * (True in fronts and both) + "."
    if any(choice.error.n > 1 for choice in choices):
        caption += f" Bar: {bars([choice.error for choice in choices])}."
    if any(choice.ends is not None for choice in choices):
        caption += " Bar to the sides: 95 % interval of the cost, for the machine as it was."
    whole = "the whole log's time over its steps"
    if both:
        caption += f" Filled: online path at its median step. Open: final path at {whole}."
    elif choices[0].final:
        caption += f" Cost: {whole}."
    if any(choice.ringed for choice in choices):
        caption += f" Ringed: {_ringed(lines, choices)}."
    if len(choices) > NAMED:
        caption += f" Of {len(choices)} points, {NAMED} are named."
    curves = [
        curve(choice.label, np.array([choice.us]), np.array([choice.error.value]), final=choice.final)
        for choice in choices
    ]
    return report_figure(
        name, f"{what[0].upper()}{what[1:]} against cost", caption.strip(), HEIGHT, draw, curves=curves
    )


def _ringed(lines: Sequence[Line], choices: Sequence[_Choice]) -> str:
    ringed = {choice.label for choice in choices if choice.ringed}
    kinds = dict.fromkeys(line.implementation for line in lines if line.backend in ringed)
    return f"{listed(list(kinds))}; the others are {COMPILED_HERE}"


def _choices(lines: Sequence[Line], looks: Mapping[str, Look]) -> Iterator[_Choice]:
    others = foreign(lines)
    for line in lines:
        look, values = looks[line.backend], line.values
        online, final = path_errors(line.truth_kind).values()
        if online in values and "step_us_p50" in values:
            us = values["step_us_p50"].median
            yield from _choice(line, look, us, online, line.backend in others, _ends(line, "step_us_p50", 1.0))
        if final in values and "cpu_s" in values:
            scale = 1e6 / values["steps"].median
            us = scale * values["cpu_s"].median
            yield from _choice(line, look, us, final, line.backend in others, _ends(line, "cpu_s", scale))


def _ends(line: Line, column: str, scale: float) -> tuple[float, float] | None:
    found = cost(line, column)
    return None if found is None or np.isnan(found.low) else (scale * found.low, scale * found.high)


def _choice(
    line: Line, look: Look, us: float, column: str, ringed: bool, ends: tuple[float, float] | None
) -> Iterator[_Choice]:
    error = typical(line, column)
    if fits(us) and fits(error.value):
        yield _Choice(line.backend, look, us, error, column.startswith("final_"), ringed, ends)


def _name(choice: _Choice, called: Mapping[str, str], online: Collection[str]) -> str:
    return called[choice.label] + (", final" if choice.final and choice.label in online else "")


def _fronts(choices: Sequence[_Choice]) -> dict[bool, list[_Choice]]:
    """The Pareto fronts of online and of final paths, the cheapest first; none with a single point."""
    fronts: dict[bool, list[_Choice]] = {}
    for final in (False, True):
        front = [choice for choice in choices if choice.final == final and not any(_before(c, choice) for c in choices)]
        if len(front) > 1:
            fronts[final] = sorted(front, key=lambda choice: choice.us)
    return fronts


def _before(one: _Choice, other: _Choice) -> bool:
    """True if `one` is cheaper and more accurate, for the same kind of path."""
    a, b = (one.us, one.error.value), (other.us, other.error.value)
    return one.final == other.final and a != b and a[0] <= b[0] and a[1] <= b[1]
