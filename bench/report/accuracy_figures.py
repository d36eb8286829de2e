"""Figures of errors: by log, between backends, and along a run."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ...core.se2 import Array, wrap
from ..drawing.axes import drawable, fitted, stretches
from ..drawing.figure import ReportFigure
from ..drawing.figure_maker import curve, of, report_figure
from ..drawing.rows import height, rows
from ..drawing.svg import INK
from ..measure.locating import poses_judged
from ..verdict.ranking import ERRORS, path_errors
from ..verdict.statistics import FEWEST, Comparison
from ..verdict.summary import Typical, typical
from ..words.names import tags
from ..words.numerals import number
from ..words.styles import Look
from .drawn_log import DrawnLog, Trace
from .time_curves import Series, along

STRETCHES = 100  # of a log, each drawn as one point


def bars(found: Iterable[Typical]) -> str:
    """Names the ends of these bars."""
    known = {one.interval for one in found if one.n > 1}
    if True not in known:
        return "range"
    return "95 % interval" + f", the range of fewer than {FEWEST} logs" * (False in known)


def by_log(name: str, log: DrawnLog) -> ReportFigure | None:
    """None where no backend ran on two logs."""
    looks, columns = log.looks, tuple(path_errors(log.kind).values())
    shown = [line for line in log.lines if any(column in line.values for column in columns)]
    shown.sort(key=lambda line: log.order.index(line.backend))
    if not any(line.values[column].n > 1 for line in shown for column in columns if column in line.values):
        return None
    what = ERRORS[log.kind]
    drawn = [
        (k + 0.12 + (0.12 if column == columns[1] else -0.12) * (len(having) - 1), line, column)
        for k, line in enumerate(shown)
        for having in [[column for column in columns if column in line.values]]
        for column in having
    ]
    runs = log.logs == 1
    errors = {
        (line.backend, column): [value for _, value in line.runs(column)] if runs else [*line.by_log(column).values()]
        for _, line, column in drawn
    }
    failed = any(np.isinf(error) for values in errors.values() for error in values)
    called = tags(looks)
    names = [
        called[line.backend]
        + f" · {len(line.rows) - line.done} of {len(line.rows)} not done" * (line.done < len(line.rows))
        for line in shown
    ]
    both = any(column == columns[1] for _, _, column in drawn)

    def draw(figure: Figure) -> None:
        axes = rows(figure, [(name, looks[line.backend]) for name, line in zip(names, shown, strict=True)])
        for at, line, column in drawn:
            look, values = looks[line.backend], np.array(errors[line.backend, column])
            style: dict[str, Any] = {"color": look.colour, "markersize": 4.2, "gid": of(look)}
            style |= {"markerfacecolor": "none"} if column == columns[1] else {"markeredgewidth": 0, "alpha": 0.75}
            finite = values[np.isfinite(drawable(values))]
            axes.plot(finite, np.full(len(finite), at), "o", **style)
            found = typical(line, column)
            middle, low, high = drawable(np.array(found[:3]))
            if np.isfinite(low + high) and len(values) > 1:
                axes.plot([low, high], [at, at], color=INK, linewidth=1, alpha=0.8, gid=of(look))
            if np.isfinite(middle):
                axes.plot([middle], [at], "|", color=INK, markersize=9, markeredgewidth=1.4, gid=of(look))
        fitted("x", axes, [error for values in errors.values() for error in values])
        axes.set_xlabel(f"{what}, m")

    caption = (
        f"Dot: a {'run' if runs else 'log'}; tick: median; bar: "
        f"{'range' if runs else bars([typical(line, column) for _, line, column in drawn])}."
    )
    caption += " Filled: online path. Open: final path." * both + " What failed counts as the worst." * failed
    curves = [
        curve(line.backend, np.array(values), np.full(len(values), at), final=column == columns[1])
        for at, line, column in drawn
        for values in [[error for error in errors[line.backend, column] if np.isfinite(error)]]
    ]
    title = f"{what[0].upper()}{what[1:]} by {'run' if runs else 'log'}"
    return report_figure(name, title, caption, height(names), draw, curves=curves)


def _against_the_best(name: str, log: DrawnLog, path: str) -> ReportFigure | None:
    """The most accurate path of a kind against every other one; None where no two are compared.

    A path on which only two are compared is no figure, but a sentence below that of the other path.
    """
    found = _compared(log) if log.kind in ("truth", "relations") else {}
    called = tags(log.looks)
    said = "".join(f" {_said(path, called, against[0])}" for path, (_, against) in found.items() if len(against) == 1)
    best, against = found.get(path, ("", ()))
    return _pairs(name, path, best, against, log.looks, said) if len(against) > 1 else None


online_pairs, final_pairs = (partial(_against_the_best, path=path) for path in ("online", "final"))


def _compared(log: DrawnLog) -> dict[str, tuple[str, Sequence[Comparison]]]:
    """By path: the most accurate backend, and its comparisons with the others for which there are intervals."""
    found: dict[str, tuple[str, Sequence[Comparison]]] = {}
    for path, column in path_errors(log.kind).items():
        compared = [c for c in log.comparisons.get(column, ()) if 0 < c.ratio < np.inf and not np.isnan(c.low)]
        known = {label for c in compared for label in (c.first, c.second)}
        able = [line for line in log.lines if line.backend in known]
        if not able:
            continue
        best = min(able, key=lambda line: typical(line, column).value).backend
        against = sorted((_over(best, c) for c in compared if best in (c.first, c.second)), key=lambda c: c.ratio)
        found[path] = best, against
    return found


def _said(path: str, called: Mapping[str, str], c: Comparison) -> str:
    ratio, low, high = (number(value) for value in (c.ratio, c.low, c.high))
    return (
        f"{path.capitalize()} paths: {called[c.second]}'s error is {ratio} times {called[c.first]}'s ({low} to {high})."
    )


def _over(best: str, c: Comparison) -> Comparison:
    """Turns the comparison so that `best` is first; an end of its interval may be 0 or infinite, where runs failed."""
    if c.first == best:
        return c
    low, high = (1 / end if end else np.inf for end in (c.high, c.low))
    return c._replace(first=c.second, second=c.first, ratio=1 / c.ratio, low=low, high=high)


def _pairs(
    name: str, path: str, best: str, against: Sequence[Comparison], looks: Mapping[str, Look], said: str
) -> ReportFigure:
    called = tags(looks)

    def draw(figure: Figure) -> None:
        axes = rows(figure, [(called[c.second], looks[c.second]) for c in against])
        fitted("x", axes, [1, *[end for c in against for end in (c.low, c.ratio, c.high)]])
        for k, c in enumerate(against):
            look = looks[c.second]
            ends = np.clip((c.low, c.high), *axes.get_xlim())
            axes.plot(ends, [k + 0.12] * 2, color=look.colour, linewidth=2, gid=of(look))
            style: dict[str, Any] = {"color": look.colour, "markersize": 5.5, "gid": of(look)}
            style |= {} if c.holds else {"markerfacecolor": "none"}
            axes.plot([c.ratio], [k + 0.12], "D", **style)
        axes.axvline(1, color=INK, linewidth=0.8, linestyle=(0, (4, 2)))
        axes.set_xlabel(f"times the error of {called[best]}")

    caption = "Median ratio of the errors on the same logs, with its 95 % interval."
    caption += " Filled: a difference is shown." * any(c.holds for c in against)
    caption += " Open: none is shown." * any(not c.holds for c in against) + said
    curves = [curve(c.second, np.array([c.ratio]), np.array([k + 0.12])) for k, c in enumerate(against)]
    title = f"Errors relative to {called[best]}'s, {path} path"
    return report_figure(name, title, caption, height([called[c.second] for c in against]), draw, curves=curves)


def errors(name: str, log: DrawnLog) -> ReportFigure | None:
    """Draws position errors along the log."""

    def squared(error: Array) -> Array:
        return (error[:, :2] ** 2).sum(axis=1)

    where = "distance from reference" if log.kind == "reference" else "position error"
    caption = "Root mean square over short stretches, after alignment."
    return _errors(name, log, f"{where.capitalize()} along the log", f"{where}, m", caption, squared)


def headings(name: str, log: DrawnLog) -> ReportFigure | None:
    """Draws heading errors along the log; None without ground truth."""

    def squared(error: Array) -> Array:
        return np.degrees(wrap(error[:, 2])) ** 2

    caption = "Root mean square over short stretches, after alignment."
    if log.kind != "truth":
        return None
    return _errors(name, log, "Heading error along the log", "heading error, degrees", caption, squared)


def _errors(
    name: str, log: DrawnLog, title: str, unit: str, caption: str, squared: Callable[[Array], Array]
) -> ReportFigure | None:
    paths = {"aligned": False} if log.kind == "reference" else {"aligned": False, "final_aligned": True}
    series = [
        _mean(trace, squared(trace.arrays[path] - poses_judged(log.known, trace.arrays)), final)
        for trace in log.traces
        for path, final in paths.items()
        if path in trace.arrays
    ]
    if any(one.final for one in series):
        caption += " Thin, with dots: final path."
    return along(name, log, title, unit, caption, series, group="accuracy")


def _mean(trace: Trace, squared: Array, final: bool) -> Series:
    t, mean = stretches(trace.arrays["t"][trace.arrays["at"]], squared, STRETCHES)
    return Series(trace.label, trace.look, t, np.sqrt(mean), final)
