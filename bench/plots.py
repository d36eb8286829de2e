"""Figures of errors, beliefs and costs: along a run, a step and a seed."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..frontend.se2 import Array
from .axes import legend, legend_columns, logarithmic, short, stretches
from .exhibit import Exhibit
from .looks import Look
from .numerals import number
from .scene import Scene, Trace
from .summary import Line
from .svg import INK, drawn

WIDTH, HEIGHT = 300, 195
"""Points, of a figure along a run, without its legend."""

ROW, LEGEND_ROW = 24, 12
"""Points that a backend has in a figure with a row for each, and in a legend."""

STRETCHES, COST_STRETCHES = 100, 40
SHORTEST_US = 0.1
"""µs; costs are drawn from here on: below it a step is lost in the clock's own noise."""


class _Curve(NamedTuple):
    label: str
    look: Look
    t: Array  # s
    values: Array
    final: bool = False


def exhibits(name: str, scene: Scene, lines: Sequence[Line], looks: Mapping[str, Look]) -> list[Exhibit]:
    """The figures for which a dataset has what they show; `name` begins their files'."""
    made = (
        _errors(f"{name}-error", scene),
        _nees(f"{name}-nees", scene),
        _costs_along(f"{name}-cost-along", scene),
        _costs(f"{name}-cost", scene),
        _errors_by_seed(f"{name}-seeds", scene, lines, looks),
    )
    return [exhibit for exhibit in made if exhibit is not None]


def _errors_by_seed(name: str, scene: Scene, lines: Sequence[Line], looks: Mapping[str, Look]) -> Exhibit | None:
    """None where no backend has two seeds."""
    shown = [line for line in lines if "ate_m" in line.values]
    if all(line.values["ate_m"].n == 1 for line in shown):
        return None
    what = "distance from reference" if scene.kind == "reference" else "ATE"

    def draw(figure: Figure) -> None:
        axes = _rows(figure, [line.backend for line in shown])
        for k, line in enumerate(shown):
            errors = [row.columns["ate_m"] for row in line.rows if row.columns["status"] == "done"]
            errors = [error for error in errors if error is not None]
            colour = looks[line.backend].colour
            axes.plot(errors, [k] * len(errors), "o", color=colour, markersize=5.5, markeredgewidth=0, alpha=0.8)
            axes.plot([line.values["ate_m"].median], [k], "|", color=INK, markersize=13, markeredgewidth=1.2)
        _logarithmic("x", axes, [v for line in shown for v in (line.values["ate_m"].low, line.values["ate_m"].high)])
        axes.set_xlabel(f"{what}, m, online path")

    caption = "A dot is a seed, the line their median."
    return Exhibit(name, f"{what[0].upper()}{what[1:]} by seed", caption, drawn(name, WIDTH, _height(shown), draw))


def _errors(name: str, scene: Scene) -> Exhibit | None:
    curves: list[_Curve] = []
    paths = {"aligned": False} if scene.kind == "reference" else {"aligned": False, "final_aligned": True}
    for trace in scene.traces:
        for path, final in paths.items():
            if path in trace.arrays:
                t = trace.arrays["t"][trace.arrays["at"]]
                squared = ((trace.arrays[path] - scene.known["poses"])[:, :2] ** 2).sum(axis=1)
                middle, mean = stretches(t, squared, STRETCHES)
                label = f"{trace.label}, final" if final else trace.label
                curves.append(_Curve(label, trace.look, middle, np.sqrt(mean), final))
    where = "distance from reference" if scene.kind == "reference" else "position error"
    caption = f"Root mean square over each of up to {STRETCHES} stretches of the log, after alignment."
    if any(curve.final for curve in curves):
        caption += " Thin with dots: the path smoothed at the end."
    return _along(name, scene, f"{where.capitalize()} along the log", f"{where}, m", caption, curves)


def _nees(name: str, scene: Scene) -> Exhibit | None:
    curves = [
        _Curve(trace.label, trace.look, *stretches(a["t"][a["at"]], a["nees"] / 3, STRETCHES))
        for trace in scene.traces
        if "nees" in (a := trace.arrays) and np.isfinite(a["nees"]).any()
    ]
    caption = (
        f"Mean over each of up to {STRETCHES} stretches; 1 is as it should be, above is overconfident, below cautious. "
        "No band is drawn: errors along one run hang together, so chi-square has none for them."
    )
    return _along(name, scene, "NEES along the log", "NEES / 3", caption, curves, level=1.0)


def _costs_along(name: str, scene: Scene) -> Exhibit | None:
    curves = [
        _Curve(trace.timed_label, trace.look, middle, np.maximum(mean / 1e3, SHORTEST_US))
        for trace in _timed(scene)
        for middle, mean in [stretches(trace.arrays["t"], trace.arrays["step_ns"].astype(float), COST_STRETCHES)]
    ]
    caption = f"Mean CPU time of a step over each of up to {COST_STRETCHES} stretches of the log.{_beside(scene)}"
    return _along(name, scene, "Step cost along the log", "CPU time a step, µs", caption, curves)


def _costs(name: str, scene: Scene) -> Exhibit | None:
    timed = _timed(scene)
    if not timed:
        return None
    costs = [np.maximum(trace.arrays["step_ns"] / 1e3, SHORTEST_US) for trace in timed]
    interval = _interval(scene, timed[0])

    def draw(figure: Figure) -> None:
        axes = _rows(figure, [trace.timed_label for trace in timed])
        for k, (trace, us) in enumerate(zip(timed, costs, strict=True)):
            low, p5, p50, p95, p99, high = np.percentile(us, (0, 5, 50, 95, 99, 100))
            colour = trace.look.colour
            axes.plot([low, high], [k, k], color=colour, linewidth=1)
            axes.plot([p5, p95], [k, k], color=colour, linewidth=6, alpha=0.45, solid_capstyle="butt")
            axes.plot([p99], [k], "|", color=colour, markersize=9, markeredgewidth=1.4)
            axes.plot([p50], [k], "o", color=colour, markersize=5, markeredgewidth=0)
        ends = [float(end) for us in costs for end in (us.min(), us.max())]
        if interval is not None:
            axes.axvline(interval, color=INK, linewidth=0.9, linestyle=(0, (4, 2)))
        _logarithmic("x", axes, ends + ([] if interval is None else [interval]))
        axes.set_xlabel("CPU time a step, µs")

    caption = "Dot: median. Bar: the middle 90 % of steps. Tick: 99 %. Thin line: from the cheapest to the slowest."
    if interval is not None:
        caption += f" Dashed: a new step arrives every {number(interval / 1e3)} ms."
    return Exhibit(name, "What a step costs", caption + _beside(scene), drawn(name, WIDTH, _height(timed), draw))


def _along(
    name: str,
    scene: Scene,
    title: str,
    unit: str,
    caption: str,
    curves: Sequence[_Curve],
    level: float | None = None,
) -> Exhibit | None:
    """Curves over the time since the log began, over steps where it has no times; None without any."""
    curves = [curve for curve in curves if len(curve.t)]
    if not curves:
        return None
    start = min(curve.t[0] for curve in curves)

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for curve in curves:
            alone = curve.look.marker if len(curve.t) == 1 else ""
            axes.plot(
                curve.t - start,
                curve.values,
                color=curve.look.colour,
                label=curve.label,
                linestyle="-" if curve.final else curve.look.dash,
                linewidth=0.7 if curve.final else 1.3,
                marker="." if curve.final else alone,
                markersize=2.5 if curve.final else 5,
            )
        values = [float(value) for curve in curves for value in curve.values if np.isfinite(value)]
        if level is not None:
            axes.axhline(level, color=INK, linewidth=0.9, linestyle=(0, (4, 2)))
            values.append(level)
        _logarithmic("y", axes, values)
        axes.set_xlabel("step" if scene.lengths.get(scene.seed) is None else "time, s")
        axes.set_ylabel(unit)
        legend(figure, axes, columns)

    columns = legend_columns([curve.label for curve in curves], WIDTH)
    height = HEIGHT + LEGEND_ROW * -(-len(curves) // columns)
    return Exhibit(name, title, caption, drawn(name, WIDTH, height, draw))


def _logarithmic(axis: str, axes: Axes, values: Sequence[float]) -> None:
    """Over the positive ones of `values`, five decades at most; errors of nothing at all do not stretch the axis."""
    positive = [value for value in values if 0 < value < np.inf]
    if positive:
        high = max(positive)
        low = min(positive) if axis == "x" else max(min(positive), 1e-5 * high)
        logarithmic(axis, axes, low, high)


def _rows(figure: Figure, labels: Sequence[str]) -> Axes:
    """Axes with a named row for each label, the first on top."""
    axes = figure.subplots()
    axes.set_ylim(len(labels) - 0.4, -0.6)
    axes.set_yticks(range(len(labels)), [short(label) for label in labels])
    axes.tick_params(axis="y", length=0)
    axes.grid(visible=False, axis="y")
    axes.spines["left"].set_visible(False)
    return axes


def _height(rows: Sequence[object]) -> float:
    return 42 + ROW * len(rows)


def _timed(scene: Scene) -> list[Trace]:
    return [trace for trace in scene.traces if len(trace.arrays.get("step_ns", ()))]


def _beside(scene: Scene) -> str:
    return "" if all(trace.alone for trace in scene.traces) else " * timed while other cells ran beside it."


def _interval(scene: Scene, trace: Trace) -> float | None:
    """µs from step to step, the median; None where the log has no real times."""
    if scene.lengths.get(scene.seed) is None:
        return None
    return float(np.median(np.diff(trace.arrays["t"]))) * 1e6
