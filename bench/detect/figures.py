"""Draws the figures that reports on several sensors have: paths, places that were seen again, values over time."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ...core.se2 import Array, Ints
from ..drawing.axes import labelled, legend
from ..drawing.figure import ReportFigure
from ..drawing.figure_maker import report_figure
from ..drawing.svg import INK, Draw
from ..words.styles import COLOURS
from .findings import Findings

HEIGHT = 225  # points
MOST = 1500  # points or loops drawn in a figure; of more, every n-th


class Path(NamedTuple):
    """A path in a figure."""

    poses: Array  # (n, 3)
    label: str
    colour: str
    width: float  # points
    dash: Any = "-"


def path_figure(f: Findings, title: str, caption: str, *paths: Path, loops: Ints | None = None) -> ReportFigure:
    """Draws paths and the truth, the last path with a dot at its start and thin lines for its `loops` (l, 2)."""
    *others, last = paths
    pairs = np.zeros((0, 2), np.int64) if loops is None else loops
    every = thinning(len(pairs))

    def draw(figure: Figure) -> None:
        axes = labelled(figure, "x, m", "y, m", equal=True)
        axes.add_collection(LineCollection(list(last.poses[pairs[::every], :2]), colors=COLOURS[3], linewidths=0.6))
        for path in others:
            _plot(axes, path)
        if f.truth is not None and len(f.truth.t):
            axes.plot(*f.truth.poses[:, :2].T, color=INK, linewidth=1, label=f.truth.kind)
        if f.truth is not None and f.truth.map is not None:
            axes.plot(*f.truth.map.xy.T, "+", color=INK, markersize=5, markeredgewidth=0.8, label="marker")
        _plot(axes, last)
        axes.plot(*last.poses[0, :2], "o", color=last.colour, markersize=4)
        legend(figure, axes, 3)

    return drawn(title, caption + thinned(every), draw)


def again_figure(f: Findings, pairs: Ints, title: str, caption: str, unit: str) -> ReportFigure:
    """Draws `pairs` (l, 2) of a step and the earlier one that it leads back to."""
    every = thinning(len(pairs))

    def draw(figure: Figure) -> None:
        axes = labelled(figure, "step", unit)
        axes.plot([0, len(f.log)], [0, len(f.log)], color=INK, linewidth=0.5)
        axes.plot(*pairs[::every].T, ".", color=COLOURS[0], markersize=3)

    return drawn(title, caption + thinned(every), draw)


def time_figure(
    t: Array, values: Mapping[str, Array], found: NDArray[np.bool], without: str, title: str, caption: str, unit: str
) -> ReportFigure:
    """Draws `values` (n,) by their labels at the times `t`, s; crosses `without` in place of those not `found`."""

    def draw(figure: Figure) -> None:
        axes, since = labelled(figure, "time, s", unit), t - t[0]
        for colour, (label, shown) in zip(COLOURS, values.items(), strict=False):
            axes.plot(since, np.where(found, shown, np.nan), color=colour, linewidth=1, label=label)
        if not found.all():
            axes.plot(since[~found], np.zeros((~found).sum()), "x", color=COLOURS[4], markersize=4, label=without)
        if any(values) or not found.all():
            legend(figure, axes, 3)

    return drawn(title, caption, draw)


def drawn(title: str, caption: str, draw: Draw, height: float = HEIGHT) -> ReportFigure:
    """Makes a figure of the page, which has none other of its title."""
    return report_figure(title, title, caption, height, draw)


def thinning(count: int) -> int:
    """Returns n where every n-th of `count` points is drawn."""
    return max(1, -(-count // MOST))


def thinned(every: int) -> str:
    """Says so, after a caption."""
    return "" if every == 1 else f" One of {every} is drawn."


def _plot(axes: Axes, path: Path) -> None:
    axes.plot(*path.poses[:, :2].T, color=path.colour, linewidth=path.width, linestyle=path.dash, label=path.label)
