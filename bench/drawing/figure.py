"""A figure of a report with its caption, and the plot data that its page's script needs."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

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
    printed: Callable[[str], bytes] | None = (
        None  # the same figure as a file for print: of "pdf", or "png" with 300 dpi
    )
