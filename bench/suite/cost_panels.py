"""Pictures of cost against error beside the best: a small panel for the datasets of each run of the suites."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from ..drawing.axes import fits, logarithmic, short
from ..drawing.figure import ReportFigure
from ..drawing.figure_maker import of, report_figure
from ..drawing.labels import Point, name_points
from ..drawing.svg import INK
from ..words.names import tags
from ..words.numerals import listed, plain
from ..words.styles import BASELINE, Look, looks
from .matrix import TITLES
from .overview import Score

ACROSS = 4  # panels beside each other
WIDE, HIGH = 217.0, 148.0  # points of a panel with its margins
LEFT, RIGHT, TOP, BOTTOM = 30.0, 6.0, 30.0, 22.0  # points of its margins
TITLE, EDGE = 38.0, 6.0  # points of the title above all, and around it
AXIS = 14.0  # points of the axis' name below all
MARGIN = 0.24  # of the upright axis, on a logarithmic scale, that stays free at either end
LEAST = 1.5  # times the best error that every panel shows, so that small differences look small


class Dot(NamedTuple):
    """A backend's place in a panel: geometric means over the datasets."""

    backend: str
    us: float  # of CPU a step
    times: float  # the best error


class Panel(NamedTuple):
    """The backends of a run."""

    title: str
    dots: Sequence[Dot]
    off: Sequence[str]  # backends that failed


def cost_panels(name: str, scores: Sequence[Score], purpose: str) -> ReportFigure | None:
    """Draws the scores of a purpose; None where no two backends are compared on any dataset."""
    panels = _panels([score for score in scores if score.purpose == purpose and score.backend != BASELINE])
    if not panels:
        return None
    look = looks(score.backend for score in scores)
    called = _brief(score.backend for score in scores)
    across, down = min(ACROSS, len(panels)), -(-len(panels) // ACROSS)
    width, height = max(across * WIDE, 2 * WIDE) + 2 * EDGE, TITLE + down * HIGH + AXIS + EDGE

    def draw(figure: Figure) -> None:
        head, _ = TITLES[purpose]
        at = EDGE / width, 1 - 15 / height
        figure.text(*at, f"{head}: cost against error", fontsize=12, fontweight="bold", va="center")
        figure.text(at[0], 1 - 31 / height, f"Upwards: {LINE}. Lower left is better.", va="center")
        for k, panel in enumerate(panels):
            row, column = divmod(k, ACROSS)
            left, top = EDGE + column * WIDE + LEFT, TITLE + row * HIGH + TOP
            wide, high = WIDE - LEFT - RIGHT, HIGH - TOP - BOTTOM
            place = left / width, 1 - (top + high) / height, wide / width, high / height
            _draw(figure, figure.add_axes(place), panel, look, called)
        axis = (EDGE + 2) / height
        figure.text(0.5, axis, f"{COSTS[purpose]}, µs", ha="center", va="bottom")

    return report_figure(name, f"{TITLES[purpose][0]}: cost against error", CAPTION, height, draw, width=width)


COSTS = {"online": "CPU time of a step", "final": "CPU time of the whole log over its steps"}
LINE = "times the best error"
CAPTION = (
    "Each point is the geometric mean over the datasets of a run. Failing: on half of the logs of one, or more. Dead "
    "reckoning is not drawn."
)


def _brief(backends: Iterable[str]) -> dict[str, str]:
    """Names for a small panel: of options their values alone, as in ekf[jcbb], where that tells them apart."""
    full = tags(backends)
    brief = {label: re.sub(r"\w+=", "", name) for label, name in full.items()}
    known = [*brief.values()]
    return {label: name if known.count(name) == 1 else full[label] for label, name in brief.items()}


def _panels(scores: Sequence[Score]) -> list[Panel]:
    found: list[Panel] = []
    for suite, run in dict.fromkeys((score.suite, score.run) for score in scores):
        mine = [score for score in scores if (score.suite, score.run) == (suite, run)]
        by_backend: dict[str, list[Score]] = {}
        for score in mine:
            by_backend.setdefault(score.backend, []).append(score)
        dots = [_dot(backend, of_backend) for backend, of_backend in by_backend.items()]
        drawn = [dot for dot in dots if fits(dot.us) and fits(dot.times)]
        if len(drawn) > 1:
            off = [dot.backend for dot in dots if math.isinf(dot.times)]
            found.append(Panel(f"{suite}: {run}", drawn, off))
    return found


def _dot(backend: str, scores: Sequence[Score]) -> Dot:
    return Dot(backend, _mean([score.cost_us for score in scores]), _mean([score.times for score in scores]))


def _mean(values: Sequence[float]) -> float:
    """The geometric mean of those that are known, infinite where one is; NaN without any."""
    known = [value for value in values if not math.isnan(value) and value > 0]
    return math.exp(sum(math.log(value) for value in known) / len(known)) if known else math.nan


def _ticks(long: float) -> Sequence[float]:
    """The numbers of an axis whose ends have that ratio."""
    if long < 4:
        return 0.5, 0.6, 0.8, 1.0, 1.2, 1.5, 2.0, 3.0
    digits = (1, 2, 5) if long < 200 else (1,)
    return [digit * 10.0**power for power in range(-2, 9) for digit in digits]


def _draw(figure: Figure, axes: Axes, panel: Panel, look: Mapping[str, Look], called: Mapping[str, str]) -> None:
    times, us = [dot.times for dot in panel.dots], [dot.us for dot in panel.dots]
    logarithmic("x", axes, min(us) / 1.6, max(us) * 1.1)  # names need room, most of all on the left
    low, high = min(*times, 1.0), max(*times, LEAST)
    room = (high / low) ** MARGIN
    low, high = low / room, high * room
    axes.set(yscale="log", ylim=(low, high))
    ticks = [tick for tick in _ticks(high / low) if low <= tick <= high]
    axes.set_yticks(ticks, [plain(tick) for tick in ticks])
    axes.yaxis.set_minor_locator(NullLocator())
    axes.axhline(1, color=INK, linewidth=0.8, alpha=0.5, zorder=1)
    axes.set_title(short(panel.title, 30), loc="left", fontsize=8, fontweight="bold", pad=13 if panel.off else 4)
    paper = rcParams["figure.facecolor"]
    for dot in panel.dots:
        mark = look[dot.backend]
        axes.plot(
            [dot.us], [dot.times], mark.marker, color=mark.colour, markersize=6, gid=of(mark),
            markeredgewidth=0.6, markeredgecolor=paper,
        )  # fmt: skip
    if panel.off:
        said = f"failing: {listed([called[backend] for backend in panel.off])}"
        axes.annotate(said, (0, 1), (0, 3), xycoords="axes fraction", textcoords="offset points", fontsize=7)
    points = [Point(dot.us, dot.times, called[dot.backend], of(look[dot.backend])) for dot in panel.dots]
    name_points(figure, axes, points, apart=10)
    for text in axes.texts:
        if text.get_text():
            text.set_zorder(2.1)  # under the axes' lines
            text.set_bbox({"facecolor": paper, "edgecolor": "none", "pad": 0.3})  # over the grid
