"""Figures of maps: the log's laser scans or a depth camera's clouds along every backend's path, side by side."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from ...frontend.maps.occupancy import Occupancy, occupancy
from ...frontend.maps.top_view import TopView, top_view
from ..drawing.axes import short
from ..drawing.figure import ReportFigure
from ..drawing.figure_maker import of, report_figure
from ..words.styles import BASELINE
from .aligned_paths import Frame
from .drawn_log import DrawnLog, Trace
from .path_figures import PANEL, TITLE, TITLE_ROW, tall

FINEST = 0.05
"""m of a cell in a picture, or more where the frame has more than MOST cells on a side."""

MOST = 600


class Map(NamedTuple):
    """A backend's map."""

    trace: Trace
    which: str  # of its paths
    drawn: Occupancy | TopView


def grids(name: str, log: DrawnLog) -> Iterator[ReportFigure]:
    """Draws a map for each backend that has a path, all in the best one's frame; none without scans or clouds."""
    every = [grid for trace in log.traces if (grid := _grid(log, trace)) is not None]
    if not every:
        return
    frame = _frame(log, every)
    for grid in every:
        yield report_figure(
            f"{name}-{grid.trace.slug}",
            grid.trace.label,
            f"By the {grid.which} path.",
            TITLE_ROW + tall(frame, PANEL),
            lambda figure, grid=grid: _draw(figure, grid, frame),
            width=PANEL,
        )


def _grid(log: DrawnLog, trace: Trace) -> Map | None:
    a = trace.arrays
    which = "final" if "final" in a else "online"
    if which not in a or not np.isfinite(a[which]).all():
        return None
    cell = max(FINEST, (float(np.ptp(a[which][:, :2], axis=0).max()) + 20.0) / MOST)
    if log.scans is not None:
        return Map(trace, which, occupancy(log.scans, a[which], cell))
    return None if log.clouds is None else Map(trace, which, top_view(log.clouds, a[which], cell))


def _frame(log: DrawnLog, every: list[Map]) -> Frame:
    """Frames the grid of the backend with the least error; dead reckoning's only where there is no other."""
    able = [grid for grid in every if grid.trace.label != BASELINE] or every
    best = min(able, key=lambda grid: log.order.index(grid.trace.label)).drawn
    return Frame(*best.corners)


def _draw(figure: Figure, grid: Map, frame: Frame) -> None:
    axes, drawn = figure.subplots(), grid.drawn
    (left, bottom), (right, top) = drawn.corners
    extent = (left, right, bottom, top)
    axes.imshow(drawn.picture, cmap="gray", vmin=0, vmax=255, extent=extent, interpolation="none")
    axes.set_xlim(frame.low[0], frame.high[0])
    axes.set_ylim(frame.low[1], frame.high[1])
    axes.grid(visible=False)
    axes.set_xlabel("x, m")
    axes.set_ylabel("y, m")
    axes.set_title(short(grid.trace.label, TITLE - 2), loc="left", gid=of(grid.trace.look))
