"""Draws a log in one picture: map, sightings over time, returns, field of view and noise."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import SubFigure

from ...core.arrays import numbered
from ...core.factors import Log
from ...core.se2 import Array, Ints
from ..drawing.picture import GRID, picture
from ..measure.landmark_places import judge, sighted
from .facts import headline
from .numbers import Subject
from .panels import FIRST, INK, SOFT, noise, part_noise, returns, seen, sensor
from .part_errors import part_errors
from .shown_path import Shown

ASTRAY = "#d00000"

MOST_POSES, MOST_LANDMARKS, MOST_RAYS, MOST_LOOPS = 1_000_000, 4_000, 160, 400  # drawn at most, evenly
VECTOR = 20_000  # poses up to which a path is lines in a vector format, and not pixels
CROSSINGS = 60.0  # crossings of the map by a path beyond which its line becomes thinner
PIECES = 160  # stretches of the path with a colour of their own
OUTSIDE = 0.002  # share of landmarks on either side that may lie outside the map: one outlier would shrink it
WIDEST = 70  # letters of a line of the legend

_STYLE: dict[str, Any] = {
    **GRID,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "axes.formatter.useoffset": False,
    "svg.fonttype": "none",
    **dict.fromkeys(("text.color", "axes.labelcolor", "axes.edgecolor", "xtick.color", "ytick.color"), INK),
}


def write_picture(path: Path, subject: Subject) -> None:
    """Draws into `path`, whole or not at all; its suffix is the format."""
    with picture(path, (13, 8.6), _STYLE | {"svg.hashsalt": subject.label}) as figure:
        figure.set_layout_engine("constrained", rect=(0, 0, 1, 0.93))
        left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=(1.2, 1))[0]
        panels = right.subplot_mosaic(
            [["seen", "seen"], ["returns", "returns"], ["sensor", "noise"]], height_ratios=(0.75, 1.35, 1.2)
        )
        log, shown, found = subject.dataset.log, subject.shown, subject.returns
        _map(left, subject)
        seen(panels["seen"], log)
        returns(panels["returns"], log, found)
        sensor(panels["sensor"], log)
        right = judge(log, subject.dataset.truth, shown.places)
        if not len(log.z) and log.partial is not None and len(log.partial):
            part_noise(panels["noise"], log.partial, part_errors(log, subject.dataset.truth))
        else:
            noise(panels["noise"], log, right, medians=subject.numbers.known.medians)
        figure.text(0.008, 0.99, subject.label, ha="left", va="top", fontsize=13, fontweight="bold")
        figure.text(0.008, 0.96, headline(subject.numbers), ha="left", va="top", fontsize=10.5)


def _map(figure: SubFigure, subject: Subject) -> None:
    axes = figure.subplots()
    log, shown = subject.dataset.log, subject.shown
    axes.set_aspect("equal")
    rays = _rays(log, shown)
    _limit(axes, shown.poses[:, :2], shown.xy if len(shown.xy) else rays[:, 1])
    if shown.poses is not shown.reckoned and len(log) <= VECTOR:  # of a larger log it would be a grey carpet
        path = shown.reckoned[:, :2].T
        axes.plot(*path, color="#b0b0b0", linewidth=0.7, linestyle=(0, (3, 1.5)), label="odometry alone")
    if len(rays):
        lines = LineCollection(list(rays), colors=FIRST, linewidths=0.6, alpha=0.5, label="some sightings")
        axes.add_collection(lines, autolim=False)
    _loops(axes, log, shown)
    marks = shown.xy[_some(len(shown.xy), MOST_LANDMARKS)]
    size = float(np.clip(60 / np.sqrt(max(len(marks), 1)), 2, 5))
    plus = len(marks) <= 600
    axes.plot(
        *(marks.T if len(marks) else ([], [])),
        "+" if plus else ".",
        color=INK,
        markersize=size + 2 * plus,
        markeredgewidth=0.9 if plus else 0,
        linestyle="",
        label=shown.mark if len(marks) else None,
    )
    if shown.places is not None and shown.places.scattered.any():
        wild = shown.places.xy[shown.places.scattered]
        axes.plot(*wild.T, "x", color=ASTRAY, markersize=8, markeredgewidth=2, linestyle="", label="not in one place")
    _path(figure, axes, log, shown)
    axes.set_xlabel("x, m")
    axes.set_ylabel("y, m")
    axes.set_title(f"Path: {shown.words}", wrap=True)
    handles, labels = axes.get_legend_handles_labels()
    columns = 6 if sum(map(len, labels)) < WIDEST else 4
    figure.legend(handles, labels, loc="outside lower center", ncols=columns, columnspacing=1.2)


def _path(figure: SubFigure, axes: Axes, log: Log, shown: Shown) -> None:
    """Draws the path coloured by time, in pieces, with gaps where poses are unknown."""
    some = _some(len(shown.step), MOST_POSES)
    xy, step = shown.poses[some][:, :2], shown.step[some]
    pieces = [piece for piece in np.array_split(np.arange(len(xy) - 1), PIECES) if len(piece)]
    hole = np.diff(shown.step) > 1
    before = np.concatenate((np.zeros(1, np.int64), np.cumsum(hole)))[some]
    lines: list[Array] = []
    at: list[float] = []
    for piece in pieces:
        rows = np.append(piece, piece[-1] + 1)
        line = xy[rows].astype(float)
        line[1:][np.diff(before[rows]) > 0] = np.nan
        lines.append(line)
        at.append(float(log.t[step[rows[0]]] - log.t[0]))
    spread = float(np.hypot(*(xy.max(axis=0) - xy.min(axis=0))))
    crossings = float(np.hypot(*np.diff(xy, axis=0).T).sum()) / max(spread, 1e-9)
    width = float(np.clip(1.5 * np.sqrt(CROSSINGS / max(crossings, 1e-9)), 0.25, 1.5))
    drawn = LineCollection(lines, cmap="viridis", linewidths=width, capstyle="round", zorder=3)
    drawn.set_rasterized(len(xy) > VECTOR)
    drawn.set_array(np.array(at))
    drawn.set_clim(0, max(float(log.t[-1] - log.t[0]), 1e-9))
    axes.add_collection(drawn, autolim=False)
    axes.plot(
        *xy[0], "o", color="#440154", markersize=8, markeredgecolor="white", label="start", zorder=4, linestyle=""
    )
    axes.plot(*xy[-1], "s", color="#e0c81c", markersize=8, markeredgecolor=INK, label="end", zorder=4, linestyle="")
    if len(lines) > 1:
        bar = figure.colorbar(drawn, ax=axes, orientation="horizontal", shrink=0.5, aspect=45, pad=0.02)
        bar.set_label("step" if numbered(log.t) else "time, s")
        bar.outline.set_visible(False)


def _rays(log: Log, shown: Shown) -> Array:
    """A few sightings (m, 2, 2), each from the robot's place to the landmark's."""
    pose = shown.pose_at(len(log))
    row = _some(len(log.ids), 4 * MOST_RAYS)
    step = log.sighting_step[row]
    at = pose[step]
    row, at = row[at >= 0], at[at >= 0]
    thin = _some(len(row), MOST_RAYS)
    poses = shown.poses[at[thin]]
    return np.stack((poses[:, :2], sighted(poses, log.z[row[thin]])), axis=1)


def _loops(axes: Axes, log: Log, shown: Shown) -> None:
    pose = shown.pose_at(len(log))
    here, there = pose[log.loop_step], pose[log.loop_to]
    row = np.flatnonzero((here >= 0) & (there >= 0))
    row = row[_some(len(row), MOST_LOOPS)]
    if not len(row):
        return
    ends = np.stack((shown.poses[here[row], :2], shown.poses[there[row], :2]), axis=1)
    axes.add_collection(
        LineCollection(list(ends), colors=SOFT, linewidths=0.8, alpha=0.8, label="loop closures"), autolim=False
    )


def _limit(axes: Axes, path: Array, marks: Array) -> None:
    """Sets the axes' limits: all of the path, and of many landmarks all but the outermost."""
    low, high = path.min(axis=0), path.max(axis=0)
    if len(marks):
        out = 100 * OUTSIDE if len(marks) * OUTSIDE > 1 else 0
        ends = np.percentile(marks, (out, 100 - out), axis=0)
        low, high = np.minimum(low, ends[0]), np.maximum(high, ends[1])
    room = 0.05 * max(*(high - low), 0.5)
    low, high = low - room, high + room
    thin = np.maximum(0, 0.6 * (high - low).max() - (high - low)) / 2  # a straight drive still has a height
    axes.set_xlim(low[0] - thin[0], high[0] + thin[0])
    axes.set_ylim(low[1] - thin[1], high[1] + thin[1])


def _some(count: int, most: int) -> Ints:
    """Returns at most `most` of `count` rows, evenly, with the first and the last."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(np.int64)) if count else np.zeros(0, np.int64)
