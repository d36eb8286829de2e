"""Draws the figures of a report on a depth camera: paths, levelling, places seen again."""

from collections.abc import Mapping

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from ...core.dead_reckoning import dead_reckoned
from ...core.se2 import Array
from ..drawing.axes import legend
from ..drawing.figure import ReportFigure
from ..drawing.figure_maker import report_figure
from ..drawing.svg import INK, Draw
from ..words.styles import COLOURS
from .findings import DepthFindings

HEIGHT = 225  # points
MOST_LOOPS = 1500  # drawn; of more, every n-th


def path_figure(f: DepthFindings) -> ReportFigure:
    """Draws the path by the log's odometry, the front end's own, and the known one."""
    reckoned = dead_reckoned(f.log)
    step, to = f.again[:: _every(f)].T
    source = "wheels" if f.log.notes["depth"]["settings"]["odometry"] == "wheels" else "frame to frame"

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        axes.set_aspect("equal", adjustable="datalim")
        lines = np.stack((f.path[to, :2], f.path[step, :2]), axis=1)
        axes.add_collection(LineCollection(list(lines), colors=COLOURS[3], linewidths=0.6))
        axes.plot(*reckoned[:, :2].T, color=COLOURS[1], linewidth=0.9, linestyle=(0, (1, 1.5)), label=source)
        if f.truth is not None and len(f.truth.t):
            axes.plot(*f.truth.poses[:, :2].T, color=INK, linewidth=1, label=f.truth.kind)
        axes.plot(*f.path[:, :2].T, color=COLOURS[2], linewidth=1.4, label="front end")
        axes.plot(*f.path[0, :2], "o", color=COLOURS[2], markersize=4)
        axes.set_xlabel("x, m")
        axes.set_ylabel("y, m")
        legend(figure, axes, 3)

    caption = "From the prior's pose (dot)."
    if len(f.again):
        caption += (
            " The front end's own path takes the shortcut over an earlier place wherever that is surer than the way "
            "since; thin lines lead there. Backends make more of the log."
        )
    return _figure("paths", "Paths", _few(f, caption), draw)


def tilt_figure(f: DepthFindings) -> ReportFigure:
    """Draws pitch and roll along the drive."""
    pitch, roll, _ = np.degrees(f.levels.tilts.T)
    caption = "The body by the floor in each depth image, against the stated mounting."
    return _along(f, "tilt", "Levelling: pitch and roll", caption, "degrees", {"forward": pitch, "to the right": roll})


def height_figure(f: DepthFindings) -> ReportFigure:
    """Draws the height along the drive."""
    caption = "The robot's origin above the floor by each depth image: 0 where the stated mounting has it."
    return _along(f, "height", "Levelling: height", caption, "height, mm", {"": 1000 * f.levels.tilts[:, 2]})


def _along(
    f: DepthFindings, name: str, title: str, caption: str, unit: str, values: Mapping[str, Array]
) -> ReportFigure:
    """Draws values (k,) of the steps over time, with crosses where no floor was found."""
    t, lost = f.log.t - f.log.t[0], ~f.levels.found

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for colour, (label, shown) in zip(COLOURS, values.items(), strict=False):
            axes.plot(t, np.where(lost, np.nan, shown), color=colour, linewidth=1, label=label)
        if lost.any():
            axes.plot(t[lost], np.zeros(lost.sum()), "x", color=COLOURS[4], markersize=4, label="no floor")
        axes.set_xlabel("time, s")
        axes.set_ylabel(unit)
        if any(values) or lost.any():
            legend(figure, axes, 3)

    return _figure(name, title, caption, draw)


def again_figure(f: DepthFindings) -> ReportFigure:
    """Draws which earlier step each place that was seen again is of."""
    step, to = f.again[:: _every(f)].T

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        axes.plot([0, len(f.log)], [0, len(f.log)], color=INK, linewidth=0.5)
        axes.plot(step, to, ".", color=COLOURS[0], markersize=3)
        axes.set_xlabel("step")
        axes.set_ylabel("shows the place of step")

    caption = (
        "Each dot is a loop closure." if len(f.log.loop_to) else "At each dot features got back their earlier ids."
    )
    return _figure("again", "Places seen again", _few(f, caption), draw)


def _every(f: DepthFindings) -> int:
    return max(1, -(-len(f.again) // MOST_LOOPS))


def _few(f: DepthFindings, caption: str) -> str:
    return caption if _every(f) == 1 else f"{caption} One of {_every(f)} is drawn."


def _figure(name: str, title: str, caption: str, draw: Draw) -> ReportFigure:
    return report_figure(f"detection-{name}", title, caption, HEIGHT, draw)._replace(name=name)
