"""A figure of a report with its caption, and the plot data that its page's script needs."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from ...core.files import write_whole

GROUPS = ("accuracy", "consistency", "cost", "inside")  # the subjects of figures, in the order of a report


class Axis(NamedTuple):
    """An axis of a plot."""

    name: str  # with its unit
    low: float
    high: float
    log: bool = False


class Curve(NamedTuple):
    """A backend's points in a plot, NaN where there is none."""

    label: str  # of the backend, as in tables
    x: Sequence[float]
    y: Sequence[float]
    t: Sequence[float] = ()  # s since the log began of each point, where x is not time
    final: bool = False  # of the path smoothed at the end


class Plot(NamedTuple):
    """The position of the axes in the picture, and what is drawn on them."""

    box: tuple[float, float, float, float]  # left, top, right, bottom, in the units of the picture's viewBox
    x: Axis
    y: Axis
    curves: Sequence[Curve]
    timed: bool = False  # x is the time since the log began (s), or the step, as in every other timed plot of the log


class ReportFigure(NamedTuple):
    """A figure with its title and caption."""

    name: str  # of its file
    title: str
    caption: str
    svg: str  # with stand-in colours; a backend's elements are in groups of the class of-K, K its place in looks
    group: str = "accuracy"
    plot: Plot | None = None
    printed: Callable[[str], bytes] | None = None  # makes a file for print: "pdf", or "png" with 300 dpi


def write_figures(folder: Path, figures: Iterable[ReportFigure], forms: Sequence[str]) -> None:
    """Writes figures as SVG, and in the formats `forms`, into `folder`, each file whole."""
    from .svg import alone  # matplotlib: a run does not wait for it

    folder.mkdir(exist_ok=True)
    for figure in figures:
        write_whole(folder / f"{figure.name}.svg", alone(figure.svg))
        if figure.printed is not None:
            for form in forms:
                write_whole(folder / f"{figure.name}.{form}", figure.printed(form))
