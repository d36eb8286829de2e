"""Draws the figures of a detection report: sightings over range, time and place, errors, and odometry."""

from collections.abc import Callable, Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from ...core.dead_reckoning import dead_reckoned
from ...core.factors import Log, Truth
from ...core.se2 import Array, Ints
from ..drawing.axes import legend
from ..drawing.figure import ReportFigure
from ..drawing.figure_maker import report_figure
from ..drawing.svg import INK
from ..words.numerals import plain
from ..words.styles import COLOURS
from .sightings import AMBIGUOUS, Sightings, TrueErrors, in_log

HEIGHT = 180  # points
MOST_POINTS = 1500  # points drawn in a figure; of more, every n-th
LEAST_BIN = 5  # sightings; a range bin with fewer shows no mean

KEPT, FAR = COLOURS[2], COLOURS[1]


def range_bins(ranges: Array, most: int = 10) -> Array:
    """Returns edges (k + 1,) of at most `most` bins of round width from 0 to beyond the farthest of `ranges`."""
    top = float(ranges.max()) if len(ranges) else 1.0
    width = next(w for w in (0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0, np.inf) if top / w < most)
    width = width if np.isfinite(width) else top / (most - 1)
    return np.arange(int(top / width) + 2.0) * width


def seen_figures(sightings: Sightings, t: Array, max_range: float) -> Iterator[ReportFigure]:
    """Draws sightings over range, time and place, for recordings with any."""
    yield _ranges(sightings, max_range)
    yield _raster(sightings, t)
    yield _places(sightings, max_range)
    yield _fit(sightings)


def true_figures(sightings: Sightings, true: TrueErrors) -> Iterator[ReportFigure]:
    """Draws the errors of the log's sightings against the truth, where any is known."""
    s = in_log(sightings)
    at, errors = true.known[sightings.kept], true.errors[sightings.kept[true.known]]
    z, sd = s.z[at], np.sqrt(np.diagonal(s.cov[at], axis1=1, axis2=2))
    yield _errors(
        "range-error", "Range error against range", "measured - true range, mm", z, 1e3 * errors[:, 0], 1e3 * sd[:, 0]
    )
    degrees = np.degrees(errors[:, 1]), np.degrees(sd[:, 1])
    yield _errors("bearing-error", "Bearing error against range", "measured - true bearing, degrees", z, *degrees)


def path_figure(log: Log, truth: Truth | None) -> ReportFigure:
    """Draws the path by odometry alone, and the known one."""
    reckoned = dead_reckoned(log)

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        axes.set_aspect("equal", adjustable="datalim")
        if truth is not None and len(truth.t):
            axes.plot(*truth.poses[:, :2].T, color=INK, linewidth=1, label=truth.kind)
        if truth is not None and truth.map is not None:
            axes.plot(*truth.map.xy.T, "+", color=INK, markersize=5, markeredgewidth=0.8, label="marker")
        axes.plot(*reckoned[:, :2].T, color=COLOURS[0], linewidth=1.2, linestyle=(0, (4, 1.5)), label="dead reckoning")
        axes.plot(*reckoned[0, :2], "o", color=COLOURS[0], markersize=4)
        axes.set_xlabel("x, m")
        axes.set_ylabel("y, m")
        legend(figure, axes, 3)

    caption = "The odometry alone, from the prior's pose (dot): the markers correct its drift."
    return _figure("path", "Path by odometry", caption, draw, 1.25 * HEIGHT)


def _ranges(sightings: Sightings, max_range: float) -> ReportFigure:
    edges = range_bins(sightings.z[:, 0], 24)
    kept, far = sightings.z[sightings.kept, 0], sightings.z[~sightings.kept, 0]

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        labels = ["in the log", f"beyond {max_range:g} m"]
        values, colours = ([kept, far], [KEPT, FAR]) if len(far) else ([kept], [KEPT])
        axes.hist(values, bins=list(edges), stacked=True, color=colours, label=labels[: len(values)], rwidth=0.92)
        axes.set_xlabel("range, m")
        axes.set_ylabel("sightings")
        axes.grid(visible=False, axis="x")
        if len(far):
            legend(figure, axes, 2)

    caption = f"Bars are {plain(float(edges[1]))} m wide."
    return _figure("ranges", "Ranges of the markers", caption, draw)


def _raster(sightings: Sightings, t: Array) -> ReportFigure:
    names = np.unique(sightings.ids)
    start = t[0]
    gap = float(np.median(np.diff(t))) if len(t) > 1 else 1.0

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        thick = float(np.clip(0.6 * 0.75 * height / len(names), 0.8, 6))
        for row, name in enumerate(names):
            for frames, colour in (
                (sightings.frame[(sightings.ids == name) & sightings.kept], KEPT),
                (sightings.frame[(sightings.ids == name) & ~sightings.kept], FAR),
            ):
                bars = [((t[a] - start - gap / 2, row), (t[b] - start + gap / 2, row)) for a, b in _runs(frames)]
                axes.add_collection(LineCollection(bars, colors=colour, linewidths=thick, capstyle="butt"))
        axes.set_xlim(-gap, t[-1] - start + gap)
        axes.set_ylim(len(names) - 0.4, -0.6)
        every = -(-len(names) // int(height / 10))
        axes.set_yticks(range(0, len(names), every), [str(name) for name in names[::every]])
        axes.set_xlabel("time, s")
        axes.set_ylabel("id")
        axes.grid(visible=False, axis="y")

    height = float(np.clip(60 + 8 * len(names), HEIGHT, 2 * HEIGHT))
    return _figure(
        "raster", "When each marker was seen", "One row per marker; a gap is a time without a detection.", draw, height
    )


def _runs(frames: Ints) -> list[tuple[int, int]]:
    """Returns the first and last of each run of consecutive numbers in `frames`."""
    if not len(frames):
        return []
    cuts = np.flatnonzero(np.diff(frames) > 1)
    return list(zip(frames[np.r_[0, cuts + 1]].tolist(), frames[np.r_[cuts, len(frames) - 1]].tolist(), strict=True))


def _places(sightings: Sightings, max_range: float) -> ReportFigure:
    every = _every(len(sightings.ids))
    z, kept = sightings.z[::every], sightings.kept[::every]
    ahead, left = z[:, 0] * np.cos(z[:, 1]), z[:, 0] * np.sin(z[:, 1])

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        axes.set_aspect("equal", adjustable="datalim")
        for colour, which in ((KEPT, kept), (FAR, ~kept)):
            _dots(axes, -left[which], ahead[which], colour)
        turn = np.linspace(-np.pi / 2, np.pi / 2, 60)
        axes.plot(max_range * np.sin(turn), max_range * np.cos(turn), color=INK, linewidth=0.8, linestyle=(0, (4, 2)))
        axes.plot([0], [0], "^", color=INK, markersize=6)
        axes.set_xlabel("left - right of the robot, m")
        axes.set_ylabel("ahead, m")

    caption = f"From above, the robot at the triangle looking up; dashed: {max_range:g} m, the farthest that is kept."
    return _figure("places", "Places relative to the robot", caption + _thinned(every), draw, 1.25 * HEIGHT)


def _fit(sightings: Sightings) -> ReportFigure:
    every = _every(len(sightings.ids))
    doubtful = sightings.ambiguity[::every] > AMBIGUOUS
    ranges, error = sightings.z[::every, 0], sightings.error[::every]

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for colour, which, label in ((COLOURS[0], ~doubtful, "one pose fits"), (COLOURS[4], doubtful, "ambiguous")):
            _dots(axes, ranges[which], error[which], colour)
            axes.plot([], [], "o", color=colour, markersize=4.5, markeredgewidth=0, label=label)
        axes.set_ylim(bottom=0)
        axes.set_xlim(left=0)
        axes.set_xlabel("range, m")
        axes.set_ylabel("reprojection error, px")
        legend(figure, axes, 2)

    caption = (
        "Distance of the corners from their places by the marker's pose. Ambiguous: two poses fit almost equally; "
        "range and bearing hardly change."
    )
    return _figure("fit", "Reprojection error of the corners", caption + _thinned(every), draw)


def _errors(name: str, title: str, unit: str, z: Array, errors: Array, sd: Array) -> ReportFigure:
    every = _every(len(errors))
    edges = range_bins(z[:, 0])
    place = np.digitize(z[:, 0], edges) - 1

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        _dots(axes, z[::every, 0], errors[::every], COLOURS[0])
        for k in range(len(edges) - 1):
            mine = place == k
            if mine.sum() < LEAST_BIN:
                continue
            low, high = edges[k], edges[k + 1]
            stated = 2 * float(np.sqrt((sd[mine] ** 2).mean()))
            axes.fill_between([low, high], -stated, stated, color=COLOURS[3], alpha=0.25, linewidth=0)
            axes.plot([low, high], [errors[mine].mean()] * 2, color=INK, linewidth=1.2)
        reach = 1.15 * max(float(np.quantile(np.abs(errors), 0.995)), 2 * float(np.median(sd)))
        axes.set_ylim(-reach, reach)  # a single outlier does not stretch it
        axes.axhline(0, color=INK, linewidth=0.5)
        axes.set_xlim(left=0)
        axes.set_xlabel("range, m")
        axes.set_ylabel(unit)

    caption = "Band: two standard deviations, as the log states them. Line: the mean error."
    return _figure(name, title, caption + _thinned(every), draw)


def _dots(axes: Axes, x: Array, y: Array, colour: str) -> None:
    axes.plot(x, y, ".", color=colour, markersize=3.5, alpha=0.6, markeredgewidth=0)


def _every(count: int) -> int:
    return max(1, -(-count // MOST_POINTS))


def _thinned(every: int) -> str:
    return "" if every == 1 else f" One of {every} is drawn."


def _figure(
    name: str, title: str, caption: str, draw: Callable[[Figure], None], height: float = HEIGHT
) -> ReportFigure:
    return report_figure(f"detection-{name}", title, caption, height, draw)._replace(name=name)
