"""The picture of an overview: backends against datasets, each cell coloured by its error beside the best one's."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.textpath import TextPath

from ..drawing.axes import short
from ..drawing.figure import ReportFigure
from ..drawing.figure_maker import report_figure
from ..drawing.svg import RULE
from ..words.names import called, tags
from ..words.styles import BASELINE
from .overview import Score

WIDE, HIGH = 35.0, 15.5  # points of a cell
SMALL = 7.5  # points of the letters of cells and legend
NAMES, EDGE = 132.0, 6.0  # points of the names on the left, and around all
TILTED = 2.8  # points by which a letter of a tilted name makes the picture higher
LETTER = 4.9  # points of a letter of a block's name
APART = 12.0  # points between two blocks of columns
TITLE = 44.0  # points of the title above all
BLOCK = 15.0  # points of a block's name
MOST = 24  # columns of a band
NARROWEST = 620.0  # points: a picture
LONGEST_ROW, LONGEST_COLUMN = 30, 30  # letters of a backend's and of a dataset's name

DARKEST = 10.0  # times the best error from which on a cell is as dark as can be
TICKS = (1.2, 1.5, 2.0, 3.0, 5.0, DARKEST)
COLOURS = colormaps["YlGnBu"]  # from ColorBrewer, safe for every kind of colour vision
LIGHTEST, LAST = 0.06, 0.95  # the part of it that is used
DIFFERENT = ("worse", "better")  # standings of a significant difference from the best
FRAME = "#d55e00"  # of the one to use

MARKS = {"consistent": ("o", 3.6), "overconfident": ("^", 4.4), "cautious": ("v", 4.4), "not a covariance": ("x", 3.6)}
"""Markers of covariances, and their sizes in points, by the word of consistency; cautious is hollow."""

TITLES = {
    "online": ("Online", "The path as it was known while the robot drove"),
    "final": ("Afterwards", "The path after the last step, with all that was measured"),
    "map": ("The map", "Landmarks' places, aligned by themselves, where paths are known of few logs or none"),
}

Place = tuple[float, float]


class Column(NamedTuple):
    """A dataset of the picture."""

    suite: str
    run: str
    dataset: str
    name: str


class Band(NamedTuple):
    """Columns that stand beside each other, and the backends that are on any of them."""

    columns: Sequence[Column]
    rows: Sequence[str]

    @property
    def blocks(self) -> list[tuple[str, list[Column]]]:
        """The columns by suite."""
        suites = dict.fromkeys(column.suite for column in self.columns)
        return [(suite, [column for column in self.columns if column.suite == suite]) for suite in suites]

    @property
    def below(self) -> float:
        """The height of the columns' names, points."""
        return 10 + TILTED * max(len(short(column.name, LONGEST_COLUMN)) for column in self.columns)

    @property
    def height(self) -> float:
        """The height, points."""
        return BLOCK + HIGH * len(self.rows) + self.below


def matrix(name: str, scores: Sequence[Score], purpose: str) -> ReportFigure | None:
    """Draws the scores of a purpose; None where there are none."""
    mine = {(*_place(score), score.backend): score for score in scores if score.purpose == purpose}
    bands = list(_bands(list(mine.values()), list(dict.fromkeys(score.backend for score in scores))))
    if not bands:
        return None
    width = max(NAMES + sum(_width(*block) + APART for block in band.blocks) for band in bands) - APART + 2 * EDGE
    width = max(width, NARROWEST)
    key = _key(list(mine.values()))
    places = _legend_places(key, width)
    legend = places[-1][1] + HIGH + 8
    height = TITLE + legend + sum(band.height for band in bands) + EDGE
    backends = tags(dict.fromkeys(score.backend for score in scores))  # the same in all pictures of a page

    def draw(figure: Figure) -> None:
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set(xlim=(0, width), ylim=(height, 0))
        axes.set_axis_off()
        head, line = TITLES[purpose]
        axes.text(EDGE, 15, head, fontsize=12, fontweight="bold", va="center")
        axes.text(EDGE, 31, f"{line}: its error, as a multiple of the best one's on the same logs", va="center")
        _legend(axes, key, places, TITLE)
        top = TITLE + legend
        for band in bands:
            _draw(axes, top, band, backends, mine)
            top += band.height

    title = f"{TITLES[purpose][0]}: errors as multiples of the best"
    return report_figure(name, title, CAPTION, height, draw, width=width)


CAPTION = (
    "1 is the best backend on the dataset: of those that none is significantly better than, the one with the lowest "
    "median error. Dead reckoning is the baseline, and not ranked. A number is the typical ratio of two errors on the "
    "same log, so that it may be below 1. An asterisk stands where an interval and a test, corrected by Holm's method, "
    "both show a difference from the best. Covariances without a mark are not clear, or are not there."
)


def _bands(scores: Sequence[Score], order: Sequence[str]) -> Iterator[Band]:
    """Breaks the columns after whole suites where they are too many; backends are in that order."""
    by_suite: dict[str, list[Column]] = {}
    for suite in dict.fromkeys(score.suite for score in scores):
        there = dict.fromkeys(_place(score) for score in scores if score.suite == suite)
        by_suite[suite] = _columns([*there])
    held: list[Column] = []
    for columns in by_suite.values():
        if held and len(held) + len(columns) > MOST:
            yield _band(held, scores, order)
            held = []
        held = [*held, *columns]
    if held:
        yield _band(held, scores, order)


def _place(score: Score) -> tuple[str, str, str]:
    return score.suite, score.run, score.dataset


def _columns(places: Sequence[tuple[str, str, str]]) -> list[Column]:
    """Names the datasets of a suite; one that several runs have by its run, too, or by that alone."""
    runs, datasets = [run for _, run, _ in places], [dataset for _, _, dataset in places]
    names = called(datasets)
    return [
        Column(
            *place,
            names[dataset]
            if datasets.count(dataset) == 1
            else run
            if runs.count(run) == 1
            else f"{names[dataset]} ({run})",
        )
        for place, run, dataset in zip(places, runs, datasets, strict=True)
    ]


def _band(columns: Sequence[Column], scores: Sequence[Score], order: Sequence[str]) -> Band:
    """Orders the backends: variants below each other, dead reckoning last."""
    places = {column[:3] for column in columns}
    there = {score.backend for score in scores if _place(score) in places}
    bases = list(dict.fromkeys(_base(backend) for backend in order))
    rows = sorted(
        (backend for backend in order if backend in there),
        key=lambda backend: (backend == BASELINE, bases.index(_base(backend))),
    )
    return Band(columns, rows)


def _base(backend: str) -> str:
    return backend.partition("[")[0]


def _width(suite: str, columns: Sequence[Column]) -> float:
    return max(WIDE * len(columns), LETTER * len(suite))


def _draw(
    axes: Axes, top: float, band: Band, backends: Mapping[str, str], scores: Mapping[tuple[str, str, str, str], Score]
) -> None:
    first = top + BLOCK
    last = first + HIGH * len(band.rows)
    for k, backend in enumerate(band.rows):
        text = short(backends[backend], LONGEST_ROW)
        axes.text(EDGE + NAMES - 5, first + (k + 0.5) * HIGH, text, ha="right", va="center", fontsize=8)
    x = EDGE + NAMES
    for suite, columns in band.blocks:
        axes.text(x, top + BLOCK / 2 - 1.5, suite, fontsize=8.5, fontweight="bold", va="center")
        right = x + WIDE * len(columns)
        for k in range(len(band.rows) + 1):
            axes.plot((x, right), (first + k * HIGH,) * 2, color=RULE, linewidth=0.5, zorder=0)
        for k, column in enumerate(columns):
            for j, backend in enumerate(band.rows):
                score = scores.get((*column[:3], backend))
                if score is not None:
                    _cell(axes, (x + k * WIDE, first + j * HIGH), score)
            place = x + (k + 0.5) * WIDE + 3, last + 4
            tilted: dict[str, Any] = {"rotation": 38, "rotation_mode": "anchor", "ha": "right", "va": "top"}
            axes.text(*place, short(column.name, LONGEST_COLUMN), fontsize=SMALL, **tilted)
        x += _width(suite, columns) + APART


def _cell(axes: Axes, at: Place, score: Score, wide: float = WIDE) -> None:
    """Draws a cell with its number and its marks, `at` its upper left corner."""
    colour = _colour(score.times)
    ink = _ink(colour)
    x, y = at
    axes.add_patch(Rectangle((x + 0.5, y + 0.5), wide - 1, HIGH - 1, facecolor=colour, linewidth=0))
    star = "*" * (score.standing in DIFFERENT)
    bold = "bold" if score.standing == "best" else "normal"
    middle = y + HIGH / 2
    axes.text(x + 21, middle, written(score), color=ink, fontsize=SMALL, fontweight=bold, ha="right", va="center")
    axes.text(x + 21, middle, star, color=ink, fontsize=SMALL, ha="left", va="center")
    if score.consistency in MARKS:
        (mark, size), fill = MARKS[score.consistency], "none" if score.consistency == "cautious" else ink
        where = [x + wide - 5.5], [middle]
        axes.plot(*where, mark, color=ink, markersize=size, markeredgewidth=0.8, markerfacecolor=fill)
    if score.named:
        frame = Rectangle((x + 1, y + 1), wide - 2, HIGH - 2, fill=False, edgecolor=FRAME, linewidth=1.5, zorder=3)
        axes.add_patch(frame)


def written(score: Score) -> str:
    """The number of a cell: 1 of the best one, 1.04, 2.3, 17 or 2k of others, ∞ of one that mostly failed."""
    times = score.times
    if score.standing == "best":
        return "1"
    if math.isnan(times):
        return ""
    if math.isinf(times):
        return "\N{INFINITY}"
    if times >= 999.5:
        return f"{times / 1000:.0f}k" if times < 999_500 else ">M"
    if times >= 1.995:
        return f"{times:.0f}" if times >= 9.95 else f"{times:.1f}"
    return f"{times:.2f}"


def _colour(times: float) -> str:
    if math.isnan(times):
        return to_hex(COLOURS(LIGHTEST))
    share = min(max(math.log(max(times, 1.0)) / math.log(DARKEST), 0.0), 1.0)
    return to_hex(COLOURS(LIGHTEST + (LAST - LIGHTEST) * share))


def _ink(colour: str) -> str:
    """Black or white, whichever has the larger contrast on the colour (WCAG 2, relative luminance)."""
    parts = (int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5))
    red, green, blue = (part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts)
    return "#111111" if 0.2126 * red + 0.7152 * green + 0.0722 * blue > 0.18 else "#ffffff"


NAN = math.nan
SAMPLE = Score("", "", "", "", "", "", 0, "", 1.0, NAN, NAN, NAN, NAN, NAN, NAN, "", NAN, 1, 1, 1)
Key = Sequence[tuple[Score | None, str]]  # cells of the legend, None an empty one, and what they say


def _key(scores: Sequence[Score]) -> Key:
    """The legend of a picture with these scores: a mark that is nowhere is not explained."""
    blank = SAMPLE._replace(times=NAN)
    said = {
        "consistent": "covariances honest", "overconfident": "overconfident", "cautious": "too cautious",
        "not a covariance": "no covariance at some steps",
    }  # fmt: skip
    found = {score.consistency for score in scores}
    return [
        (SAMPLE._replace(standing="best"), "the best"),
        *((SAMPLE._replace(times=times), "") for times in TICKS[:-1]),
        (SAMPLE._replace(times=TICKS[-1]), "times its error, or more"),
        *[(SAMPLE._replace(times=math.inf), "mostly failed")] * any(math.isinf(score.times) for score in scores),
        (blank._replace(named=1), "recommended"),
        (SAMPLE._replace(times=1.34, standing="worse"), "a significant difference from the best (Holm)"),
        *((blank._replace(consistency=word), words) for word, words in said.items() if word in found),
        (None, "not run, or no truth to compare with"),
    ]


def _legend_places(key: Key, width: float) -> list[Place]:
    """The upper left corners of the legend's cells in a picture that wide, points; rows break where they are full.

    Marks of covariances begin a row.
    """
    places: list[Place] = []
    x, y, marks = EDGE, 0.0, False
    for sample, words in key:
        wide = WIDE + (4 + _long(words) + 12 if words else 0)
        first = sample is not None and sample.consistency and not marks
        marks = marks or first
        if first or x + wide > width - EDGE:
            x, y = EDGE, y + HIGH + 3
        places.append((x, y))
        x += wide
    return places


def _long(words: str) -> float:
    """The width of words of the legend, points."""
    return float(TextPath((0, 0), words, size=SMALL).get_extents().width)


def _legend(axes: Axes, key: Key, places: Sequence[Place], top: float) -> None:
    """Draws the scale, and a cell for each of the marks with what it says."""
    for (sample, words), (x, y) in zip(key, places, strict=True):
        at = x, top + y
        if sample is None:
            empty = Rectangle((x + 0.5, at[1] + 0.5), WIDE - 1, HIGH - 1, fill=False, edgecolor=RULE, linewidth=0.6)
            axes.add_patch(empty)
        else:
            _cell(axes, at, sample)
        axes.text(x + WIDE + 4, at[1] + HIGH / 2, words, fontsize=SMALL, va="center")
