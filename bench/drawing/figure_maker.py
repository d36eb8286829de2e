"""Makes report figures: drawn once for the page, and again for print on request."""

from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from ...core.se2 import Array
from ..words.styles import Look
from .figure import Axis, Curve, Plot, ReportFigure
from .svg import Draw, drawn, printed

WIDTH = 252  # points: a column of a two-column paper
MOST_POINTS = 200  # points of a curve in a page's plot data


def of(look: Look) -> str:
    """The mark of a backend's elements in a figure, for `set_gid` and `gid`."""
    return f"of-{look.place}"


def report_figure(
    name: str,
    title: str,
    caption: str,
    height: float,
    draw: Draw,
    *,
    group: str = "accuracy",
    curves: Sequence[Curve] = (),
    timed: bool = False,
    width: float = WIDTH,
) -> ReportFigure:
    """Makes the figure that `draw` draws, with plot data for its page where there are `curves`."""
    svg, figure = drawn(name, width, height, draw)
    plot = _plot(figure, width, height, curves, timed) if curves else None
    return ReportFigure(name, title, caption, svg, group, plot, partial(printed, width, height, draw))


def curve(
    label: str, x: Array, y: Array, *, t: Array | None = None, final: bool = False, most: int = MOST_POINTS
) -> Curve:
    """Thins data for a plot to `most` points, of four digits each."""
    at = np.unique(np.linspace(0, len(x) - 1, min(most, len(x))).round().astype(int)) if len(x) else np.zeros(0, int)
    return Curve(label, _rounded(x[at]), _rounded(y[at]), () if t is None else _rounded(t[at]), final)


def _plot(figure: Figure, width: float, height: float, curves: Sequence[Curve], timed: bool) -> Plot:
    axes = figure.axes[0]
    where = axes.get_position()
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    return Plot(
        (where.x0 * width, (1 - where.y1) * height, where.x1 * width, (1 - where.y0) * height),
        Axis(axes.get_xlabel(), left, right, axes.get_xscale() == "log"),
        Axis(axes.get_ylabel(), bottom, top, axes.get_yscale() == "log"),
        curves,
        timed,
    )


def _rounded(values: Array) -> list[float]:
    return [float(f"{value:.4g}") for value in values.tolist()]
