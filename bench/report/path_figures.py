"""Figures of paths: one panel per backend over the same known path, and all in one."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure

from ...core.se2 import Array
from ..drawing.axes import legend, short
from ..drawing.figure import ReportFigure
from ..drawing.figure_maker import WIDTH, of, report_figure
from ..drawing.legend import ROW, named
from ..drawing.strokes import strokes
from ..drawing.svg import INK
from ..words.numerals import listed, number
from .aligned_paths import Frame, Panel, framed, panels
from .drawn_log import DrawnLog

PANEL = 200  # points that a panel is wide: four fit side by side on a page and stay legible
TITLE = 34  # characters that fit above a panel
TITLE_ROW = 11  # points that a line of it is high
VISIBLE = 0.012  # ellipses are left out where their longer half axis is a smaller share of the frame


def trajectories(name: str, log: DrawnLog) -> Iterator[ReportFigure]:
    """Draws a panel for each backend that has a path; its caption says what the frame cuts off."""
    every = panels(log)
    if not every:
        return
    frame = framed(log, every)
    for panel in every:
        yield report_figure(
            f"{name}-{panel.trace.slug}",
            panel.trace.label,
            f"Leaves the frame by up to {number(far)} m."
            if (far := beyond(frame, panel.online, panel.final)) > 0
            else "",
            TITLE_ROW * (1 + _title(log, panel).count("\n")) + tall(frame, PANEL),
            lambda figure, panel=panel: _draw(figure, log, panel, frame),
            curves=panel.curves,
            width=PANEL,
        )


def tall(frame: Frame, width: float) -> float:
    """The points that a picture of the frame is high, without what is above it."""
    return 34 + (width - 36) * float(np.clip(frame.size[1] / frame.size[0], 0.35, 1.3))


def beyond(frame: Frame, *paths: Array | None) -> float:
    """Returns how far the paths (n, 2) leave the frame, m; 0 or less where they do not."""
    return max(float(np.maximum(frame.low - path, path - frame.high).max()) for path in paths if path is not None)


def _draw(figure: Figure, log: DrawnLog, panel: Panel, frame: Frame) -> None:
    axes = plane(figure, log, frame)
    look = panel.trace.look
    gid = of(look)
    if panel.online is not None:
        axes.plot(*_line(panel.online, frame), color=look.colour, linewidth=1.2, gid=gid)
    if panel.final is not None:
        dash = (0, (4, 2)) if panel.online is not None else "-"
        axes.plot(*_line(panel.final, frame), color=look.colour, linewidth=1.2, linestyle=dash, gid=gid)
    seen = panel.map[((panel.map >= frame.low) & (panel.map <= frame.high)).all(axis=1)]
    style: dict[str, Any] = {"markerfacecolor": "none", "markersize": 4, "markeredgewidth": 0.9, "gid": gid}
    axes.plot(*seen.T, "o", markeredgecolor=look.colour, **style)
    axes.set_title(_title(log, panel), loc="left", gid=gid)
    _draw_ellipses(axes, panel, frame)


def plane(figure: Figure, log: DrawnLog, frame: Frame) -> Axes:
    """Makes axes over the frame, with what is known drawn on them."""
    axes = figure.subplots()
    axes.set_aspect("equal")
    axes.set_xlim(frame.low[0], frame.high[0])
    axes.set_ylim(frame.low[1], frame.high[1])
    axes.set_xlabel("x, m")
    axes.set_ylabel("y, m")
    if log.known:
        axes.plot(*_line(log.known["poses"][:, :2], frame), color=INK, linewidth=0.9, alpha=0.75)
        if "xy" in log.known:
            axes.plot(*log.known["xy"].T, "+", color=INK, markersize=5, markeredgewidth=0.7, alpha=0.75)
    return axes


def _line(path: Array, frame: Frame) -> Array:
    """Returns x and y (2, m) of a path's line."""
    return strokes(path, frame.low, frame.high).T


def _title(log: DrawnLog, panel: Panel) -> str:
    title = short(panel.trace.label, TITLE - 2)
    if panel.error is not None:
        error = f"{number(panel.error)} m " + ("from reference" if log.kind == "reference" else "ATE")
        title += (" · " if len(title + error) < TITLE else "\n") + error
    return title


def _draw_ellipses(axes: Axes, panel: Panel, frame: Frame) -> None:
    e = panel.ellipses[panel.ellipses[:, 2] > VISIBLE * frame.size.max()]
    look = {"facecolors": panel.trace.look.colour, "edgecolors": "none", "alpha": 0.22, "gid": of(panel.trace.look)}
    axes.add_collection(
        EllipseCollection(
            2 * e[:, 2], 2 * e[:, 3], e[:, 4], units="xy", offsets=e[:, :2], offset_transform=axes.transData, **look
        )
    )


def overlay(name: str, log: DrawnLog) -> ReportFigure | None:
    """Draws online paths, and final ones of backends without; None with fewer than two."""
    every = panels(log)
    if len(every) < 2:
        return None
    frame = framed(log, every)
    key = named([panel.trace.label for panel in every], log.order)

    def draw(figure: Figure) -> None:
        axes = plane(figure, log, frame)
        for panel in every:
            look, path = panel.trace.look, panel.final if panel.online is None else panel.online
            if path is not None:
                style: dict[str, Any] = {"linestyle": look.dash, "linewidth": 1.1, "gid": of(look)}
                label, alpha = key.called(panel.trace.label), key.alpha(panel.trace.label)
                axes.plot(*_line(path, frame), color=look.colour, label=label, alpha=alpha, **style)
        key.others(axes)
        legend(figure, axes, key.columns)

    caption = f"{log.which.capitalize()}." * bool(log.which)
    if log.known:
        caption += f" Plain line: {log.kind}" + ("; crosses: landmarks." if "xy" in log.known else ".")
    caption += " Online paths; of a backend without one, the path smoothed at the end." * any(
        panel.online is None for panel in every
    )
    far = {panel.trace.label: beyond(frame, panel.final if panel.online is None else panel.online) for panel in every}
    cut = [f"{key.tags[label]} (by up to {number(by)} m)" for label, by in far.items() if by > 0]
    caption += f" Beyond the frame: {listed(cut)}." if cut else ""
    curves = [curve for panel in every for curve in panel.curves if curve.final == (panel.online is None)]
    height = tall(frame, WIDTH) + ROW * key.rows
    return report_figure(name, "All paths", caption.strip(), height, draw, curves=curves)
