"""Draws the figures of a report on markers: sightings over range, time and place, errors, and odometry."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from ...core.se2 import Array, Ints
from ..drawing.axes import labelled, legend
from ..drawing.figure import ReportFigure
from ..drawing.svg import INK
from ..words.numerals import plain
from ..words.styles import COLOURS
from .figures import Path, drawn, path_figure, thinned, thinning
from .markers import MarkerFindings
from .noise_calibration import range_bins
from .sightings import AMBIGUOUS, Sightings, TrueErrors, in_log

BY_ODOMETRY = "Path by odometry"
HEIGHT = 180  # points
LEAST_BIN = 5  # sightings; a range bin with fewer shows no mean

KEPT, FAR = COLOURS[2], COLOURS[1]


def figures(f: MarkerFindings) -> list[ReportFigure]:
    """Draws all for which there are sightings, and the path by odometry."""
    made = list[ReportFigure]()
    if len(f.sightings.ids):
        made += [_ranges(f), _raster(f), _places(f)]
        made += [] if np.isnan(f.sightings.error).all() else [_fit(f.sightings)]
    if f.true is not None and f.bins:
        made += _true_figures(f.sightings, f.true)
    caption = "The odometry alone, from the prior's pose (dot): the markers correct its drift."
    path = Path(f.log.dead_reckoned(), "dead reckoning", COLOURS[0], 1.2, (0, (4, 1.5)))
    return [*made, path_figure(f, BY_ODOMETRY, caption, path)]


def _ranges(f: MarkerFindings) -> ReportFigure:
    z, kept = f.sightings.z[:, 0], f.sightings.kept
    edges, far = range_bins(z, 24), bool((~kept).any())

    def draw(figure: Figure) -> None:
        axes = labelled(figure, "range, m", "sightings")
        labels, colours = ["in the log", f"beyond {f.reach}"], [KEPT, FAR]
        shown = slice(2 if far else 1)
        values = [z[kept], z[~kept]][shown]
        axes.hist(values, list(edges), stacked=True, color=colours[shown], label=labels[shown], rwidth=0.92)
        axes.grid(visible=False, axis="x")
        if far:
            legend(figure, axes, 2)

    return drawn("Ranges of the markers", f"Bars are {plain(float(edges[1]))} m wide.", draw, HEIGHT)


def _raster(f: MarkerFindings) -> ReportFigure:
    sightings, t = f.sightings, f.t
    names = np.unique(sightings.ids)
    start = t[0]
    gap = float(np.median(np.diff(f.log.t))) if len(f.log) > 1 else 1.0
    height = float(np.clip(60 + 8 * len(names), HEIGHT, 2 * HEIGHT))

    def draw(figure: Figure) -> None:
        axes = labelled(figure, "time, s", "id")
        thick = float(np.clip(0.6 * 0.75 * height / len(names), 0.8, 6))
        for row, name in enumerate(names):
            for kept, colour in ((sightings.kept, KEPT), (~sightings.kept, FAR)):
                runs = _runs(np.unique(sightings.frame[(sightings.ids == name) & kept]), len(f.cameras))
                bars = [((t[a] - start - gap / 2, row), (t[b] - start + gap / 2, row)) for a, b in runs]
                axes.add_collection(LineCollection(bars, colors=colour, linewidths=thick, capstyle="butt"))
        axes.set_xlim(-gap, t[-1] - start + gap)
        axes.set_ylim(len(names) - 0.4, -0.6)
        every = -(-len(names) // int(height / 10))
        axes.set_yticks(range(0, len(names), every), [str(name) for name in names[::every]])
        axes.grid(visible=False, axis="y")

    caption = "One row per marker; a gap is a time without a detection."
    return drawn("When each marker was seen", caption, draw, height)


def _runs(frames: Ints, cameras: int) -> list[tuple[int, int]]:
    """Returns the first and last of each run of consecutive numbers in `frames` of each of `cameras` in turn."""
    if not len(frames):
        return []
    cuts = np.flatnonzero(np.diff(frames) > cameras)
    return list(zip(frames[np.r_[0, cuts + 1]].tolist(), frames[np.r_[cuts, len(frames) - 1]].tolist(), strict=True))


def _places(f: MarkerFindings) -> ReportFigure:
    every = thinning(len(f.sightings.ids))
    z, kept = f.sightings.z[::every], f.sightings.kept[::every]
    ahead, left = z[:, 0] * np.cos(z[:, 1]), z[:, 0] * np.sin(z[:, 1])

    def draw(figure: Figure) -> None:
        axes = labelled(figure, "left - right of the robot, m", "ahead, m", equal=True)
        for colour, which in ((KEPT, kept), (FAR, ~kept)):
            _dots(axes, -left[which], ahead[which], colour)
        turn = np.linspace(-np.pi / 2, np.pi / 2, 60)
        if np.isfinite(f.max_range):
            axes.plot(f.max_range * np.sin(turn), f.max_range * np.cos(turn), color=INK, linewidth=0.8, dashes=(4, 2))
        axes.plot([0], [0], "^", color=INK, markersize=6)

    limit = f"; dashed: {f.max_range:g} m, the farthest that is kept" if np.isfinite(f.max_range) else ""
    caption = f"From above, the robot at the triangle looking up{limit}."
    return drawn("Places relative to the robot", caption + thinned(every), draw)


def _fit(sightings: Sightings) -> ReportFigure:
    every = thinning(len(sightings.ids))
    doubtful = sightings.ambiguity[::every] > AMBIGUOUS
    ranges, error = sightings.z[::every, 0], sightings.error[::every]

    def draw(figure: Figure) -> None:
        axes = labelled(figure, "range, m", "reprojection error, px")
        for colour, which, label in ((COLOURS[0], ~doubtful, "one pose fits"), (COLOURS[4], doubtful, "ambiguous")):
            _dots(axes, ranges[which], error[which], colour)
            axes.plot([], [], "o", color=colour, markersize=4.5, markeredgewidth=0, label=label)
        axes.set_ylim(bottom=0)
        axes.set_xlim(left=0)
        legend(figure, axes, 2)

    caption = (
        "Distance of the corners from their places by the marker's pose. Ambiguous: two poses fit almost equally; "
        "range and bearing hardly change."
    )
    return drawn("Reprojection error of the corners", caption + thinned(every), draw, HEIGHT)


def _true_figures(sightings: Sightings, true: TrueErrors) -> list[ReportFigure]:
    """Draws the errors of the log's sightings against the truth, where any is known."""
    s = in_log(sightings)
    at, errors = true.known[sightings.kept], true.errors[sightings.kept[true.known]]
    ranges, sd = s.z[at, 0], np.sqrt(np.diagonal(s.cov[at], axis1=1, axis2=2))
    parts = (("range", "mm", 1e3), ("bearing", "degrees", np.degrees(1.0)))
    return [
        _errors(name, unit, ranges, scale * errors[:, k], scale * sd[:, k])
        for k, (name, unit, scale) in enumerate(parts)
    ]


def _errors(name: str, unit: str, ranges: Array, errors: Array, sd: Array) -> ReportFigure:
    every = thinning(len(errors))
    edges = range_bins(ranges)
    place = np.digitize(ranges, edges) - 1

    def draw(figure: Figure) -> None:
        axes = labelled(figure, "range, m", f"measured - true {name}, {unit}")
        _dots(axes, ranges[::every], errors[::every], COLOURS[0])
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

    caption = "Band: two standard deviations, as the log states them. Line: the mean error."
    return drawn(f"{name.capitalize()} error against range", caption + thinned(every), draw, HEIGHT)


def _dots(axes: Axes, x: Array, y: Array, colour: str) -> None:
    axes.plot(x, y, ".", color=colour, markersize=3.5, alpha=0.6, markeredgewidth=0)
