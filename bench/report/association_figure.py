"""Figure of data association: which landmark was taken for which other one, along the log."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from ...core.factors import UNKNOWN
from ...core.se2 import Array, Ints
from ..drawing.axes import legend
from ..drawing.figure import ReportFigure
from ..drawing.figure_maker import of, report_figure
from ..drawing.legend import ROW, named
from ..drawing.svg import INK
from ..measure.association import majority
from ..words.numerals import listed, number
from .drawn_log import DrawnLog, Trace

HEIGHT = 220  # points, without the legend
PLACES = 400  # of two marks on one row within that share of the log, one is drawn
GAP = 0.01  # share of the log without a sighting that ends a landmark's line


class Mistakes(NamedTuple):
    """One backend's mistakes: of sightings by their row in the log."""

    trace: Trace
    wrong: Ints  # (w,) taken for another landmark
    other: Ints  # (w,) its true id
    double: Ints  # (d,) the first of each landmark that is on the map already
    dropped: int  # sightings that are of a known landmark and not used
    used: int

    @property
    def words(self) -> str:
        """Counts the mistakes."""
        share = number(100 * len(self.wrong) / self.used) if self.used else "0"
        return f"{share} % wrong, {len(self.double):,} double, {self.dropped:,} dropped"


def taken(name: str, log: DrawnLog) -> ReportFigure | None:
    """Draws every landmark's sightings and each backend's mistakes; None without data association."""
    if "sighted" not in log.known:
        return None
    true, at = log.known["sighted"], log.known["sighted_at"]
    found = [mistakes(trace, true) for trace in log.traces if _assigned(trace) is not None]
    if not found or not (true != UNKNOWN).any():
        return None
    rows, t = _rows(true), found[0].trace.arrays["t"]
    when = (t - t[0])[at]
    key = named([one.trace.label for one in found], log.order)
    seen = _lines(true, rows, when, GAP * (t[-1] - t[0]))

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        axes.plot(*seen, color=INK, linewidth=0.8, alpha=0.3, solid_capstyle="butt")
        for one in sorted(found, key=lambda one: -len(one.wrong)):  # the fewest on top
            look, loud = one.trace.look, key.alpha(one.trace.label)
            x, y, other = _apart(when[one.wrong], rows(true[one.wrong]), rows(one.other), t[-1] - t[0])
            link = np.stack((y, other, np.full(len(x), np.nan)), axis=1).ravel()
            axes.plot(np.repeat(x, 3), link, color=look.colour, linewidth=0.5, alpha=0.35 * loud, gid=of(look))
            style: dict[str, Any] = {"linestyle": "none", "color": look.colour, "alpha": loud, "gid": of(look)}
            axes.plot(x, y, marker=look.marker, markersize=3, label=key.called(one.trace.label), **style)
            axes.plot(
                when[one.double], rows(true[one.double]), marker=look.marker, markersize=5.5, markerfacecolor="none",
                markeredgewidth=0.9, **style,
            )  # fmt: skip
        key.others(axes)
        axes.set_xlabel(log.clock)
        axes.set_ylabel("landmark, by first sighting")
        axes.margins(x=0.02)
        legend(figure, axes, key.columns)

    caption = f"{log.which.capitalize()}. " * bool(log.which)
    caption += (
        "Grey: where each landmark is sighted. Dots: a sighting taken for another landmark, with a line to that one. "
        "Rings: a landmark that is on the map is taken for a new one. "
    )
    caption += listed([f"{key.tags[one.trace.label]}: {one.words}" for one in found]) + "."
    return report_figure(name, "Data association", caption, HEIGHT + ROW * key.rows, draw)


def mistakes(trace: Trace, true: Ints) -> Mistakes:
    """Finds a backend's mistakes in its association online, or the final one where there is no other."""
    assigned = _assigned(trace)
    assert assigned is not None
    found, real = majority(assigned, true), true != UNKNOWN
    used = assigned != UNKNOWN
    row = np.searchsorted(found.ids, assigned[used])
    other = np.full(len(true), UNKNOWN)
    other[used] = found.true[row]
    wrong = np.flatnonzero(used & real & (other != UNKNOWN) & (other != true))
    first = np.unique(assigned[used], return_index=True)[1]  # the first sighting of every id
    begun = np.flatnonzero(used)[first]
    begun = begun[np.argsort(begun)]
    begun = begun[other[begun] != UNKNOWN]
    again = np.ones(len(begun), bool)
    again[np.unique(other[begun], return_index=True)[1]] = False
    return Mistakes(trace, wrong, other[wrong], begun[again], int((real & ~used).sum()), int(used.sum()))


def _assigned(trace: Trace) -> Ints | None:
    return trace.arrays.get("assigned", trace.arrays.get("final_assigned"))


def _rows(true: Ints) -> Callable[[Ints], Ints]:
    """The function that numbers true ids in the order of their first sightings, from 1."""
    ids, first = np.unique(true[true != UNKNOWN], return_index=True)
    place = np.empty(len(ids), np.int64)
    place[np.argsort(first)] = np.arange(1, len(ids) + 1)
    return lambda asked: place[np.searchsorted(ids, asked)]


def _lines(true: Ints, rows: Callable[[Ints], Ints], when: Array, gap: float) -> tuple[Array, Array]:
    """Returns x and y of a line per landmark over the times of its sightings, broken where there is none for `gap`."""
    known = np.flatnonzero(true != UNKNOWN)
    order = known[np.lexsort((when[known], true[known]))]
    x, y = when[order], rows(true[order])
    ends = np.flatnonzero((np.diff(y) != 0) | (np.diff(x) > gap))
    first, last = np.concatenate(([0], ends + 1)), np.concatenate((ends, [len(x) - 1]))
    lines = np.full((len(first), 3), np.nan)
    lines[:, 0], lines[:, 1] = x[first], x[last]
    return lines.ravel(), np.repeat(y[first], 3).astype(float)


def _apart(x: Array, y: Ints, other: Ints, length: float) -> tuple[Array, Ints, Ints]:
    """The marks to draw: of those on the same rows and at nearly the same time, the first."""
    place = np.round(PLACES * x / length) if length else np.zeros(len(x))
    kept = np.unique(np.stack((place, y, other)), axis=1, return_index=True)[1]
    return x[kept], y[kept], other[kept]
