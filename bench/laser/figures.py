"""Draws the figures of a report on scans: the paths with the loop closures, and the loops over the way."""

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from ...core.dead_reckoning import dead_reckoned
from ...core.se2 import between, compose
from ..drawing.axes import legend
from ..drawing.figure import ReportFigure
from ..drawing.figure_maker import report_figure
from ..drawing.svg import INK, Draw
from ..words.styles import COLOURS
from .findings import LaserFindings

HEIGHT = 225  # points
MOST_LOOPS = 1500  # loops drawn; of more, every n-th


def path_figure(f: LaserFindings) -> ReportFigure:
    """Draws the path by wheels, by matched scans, and corrected by loop closures."""
    matched, prior = dead_reckoned(f.log), f.log.prior.pose
    every = max(1, -(-len(f.log.loop_to) // MOST_LOOPS))
    step, to = f.log.loop_step[::every], f.log.loop_to[::every]

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        axes.set_aspect("equal", adjustable="datalim")
        axes.add_collection(
            LineCollection(
                list(np.stack((f.path[to, :2], f.path[step, :2]), axis=1)), colors=COLOURS[3], linewidths=0.6
            )
        )
        if f.recording.odometry is not None:
            wheels = compose(prior, between(f.recording.odometry[0], f.recording.odometry))
            axes.plot(*wheels[:, :2].T, color=COLOURS[1], linewidth=0.8, linestyle=(0, (1, 1.5)), label="wheels")
        axes.plot(*matched[:, :2].T, color=COLOURS[0], linewidth=1.0, linestyle=(0, (4, 1.5)), label="matched scans")
        if f.truth is not None and len(f.truth.t):
            axes.plot(*f.truth.poses[:, :2].T, color=INK, linewidth=1, label=f.truth.kind)
        axes.plot(*f.path[:, :2].T, color=COLOURS[2], linewidth=1.4, label="with loops")
        axes.plot(*f.path[0, :2], "o", color=COLOURS[2], markersize=4)
        axes.set_xlabel("x, m")
        axes.set_ylabel("y, m")
        legend(figure, axes, 4)

    caption = (
        "From the prior's pose (dot). The front end's own pose graph gives the path with loops; a loop is a thin line."
    )
    return _figure("paths", "Paths", caption if every == 1 else f"{caption} One of {every} is drawn.", draw)


def loop_figure(f: LaserFindings) -> ReportFigure:
    """Draws which step each loop closure leads back to."""
    every = max(1, -(-len(f.log.loop_to) // MOST_LOOPS))

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        axes.plot([0, len(f.log)], [0, len(f.log)], color=INK, linewidth=0.5)
        axes.plot(f.log.loop_step[::every], f.log.loop_to[::every], ".", color=COLOURS[0], markersize=3)
        axes.set_xlabel("step")
        axes.set_ylabel("leads back to step")

    return _figure("loops", "Loop closures", "Each dot is one; a line of them is a stretch driven again.", draw)


def _figure(name: str, title: str, caption: str, draw: Draw) -> ReportFigure:
    return report_figure(f"detection-{name}", title, caption, HEIGHT, draw)._replace(name=name)
