"""Draws claims into figures of their measure: bounds, a slope, or a crossing."""

from collections.abc import Iterable, Mapping, Sequence
from math import isfinite, nan
from typing import Any, NamedTuple

from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.text import Annotation

from ..claims.answer import Answer
from ..claims.curves import Medians, Place
from ..drawing.svg import INK
from ..verdict.consistency import CAUTIOUS, OVERCONFIDENT
from ..words.columns import about
from ..words.numerals import number, plain

DASHED: dict[str, Any] = {"color": INK, "linewidth": 0.9, "linestyle": (0, (4, 3)), "alpha": 0.8}

LOWER = 0.13  # share of the axis by which the text of a crossing is lower than that of the one before
HALF = 0.045  # share of the axis: half of a bound on one value of x


class Bound(NamedTuple):
    """A claimed bound, and its cells."""

    value: float
    below: bool  # or else above
    x: Any  # None: of all
    by: Any  # likewise

    @property
    def words(self) -> str:
        """Writes the bound."""
        return f"claimed: {'below' if self.below else 'above'} {plain(self.value)}"


class Crossing(NamedTuple):
    """The x from which on one line is below another, with its interval."""

    value: float
    low: float
    high: float
    words: str


class Marks(NamedTuple):
    """The marks of a figure beside the medians."""

    bounds: Sequence[Bound]
    crossings: Sequence[Crossing]
    slopes: Mapping[Any, float]  # by the value of `by`: the exponent with which the measure grows along x

    @property
    def values(self) -> list[float]:
        """The values of the measure that the axis has to include."""
        return [bound.value for bound in self.bounds]


def marks(found: Medians, answers: Iterable[Answer]) -> Marks:
    """Collects the marks of the claims on the figure's measure and cells."""
    figure = found.figure
    bounds: list[Bound] = []
    crossings: list[Crossing] = []
    slopes: dict[Any, float] = {}
    for answer in answers:
        claim, chosen = answer.claim, {**answer.claim.where, **answer.claim.first}
        if claim.measure != figure.y or not _shown(found, chosen):
            continue
        if claim.kind == "value":
            of = chosen.get(figure.x), chosen.get(figure.by)
            ends = Bound(claim.low, False, *of), Bound(claim.high, True, *of)
            printed = [values.get(of[0]) for values in figure.printed.values()]  # drawn as such
            bounds += [bound for bound in ends if isfinite(bound.value) and bound.value not in printed]
        if claim.kind == "crosses" and claim.along == figure.x:
            crossings += _crossing(found, answer)
        if claim.kind == "grows" and claim.along == figure.x:
            slopes |= _slopes(found, answer, chosen)
    return Marks(tuple(dict.fromkeys(bounds)), tuple(dict.fromkeys(crossings)), slopes)


def _shown(found: Medians, chosen: Mapping[str, Any]) -> bool:
    figure = found.figure
    drawn = ((figure.x, found.xs), (figure.by, found.bys))
    return all(chosen[name] == value for name, value in figure.where.items() if name in chosen) and all(
        chosen[name] in values for name, values in drawn if name in chosen
    )


def _crossing(found: Medians, answer: Answer) -> list[Crossing]:
    value, low, high = (float(answer.figures.get(name, nan)) for name in ("estimate", "low", "high"))
    if not isfinite(value):
        return []
    who = found.called.get(answer.claim.first.get(found.figure.by), "")
    return [
        Crossing(value, low, high, f"{who} is less\nfrom {number(value)} on" if who else f"cross at {plain(value)}")
    ]


def _slopes(found: Medians, answer: Answer, chosen: Mapping[str, Any]) -> dict[Any, float]:
    by = found.figure.by
    if answer.claim.each == by:
        known = {part.value: part.found.estimate for part in answer.parts}
    else:
        line = chosen.get(by, found.bys[0] if len(found.bys) == 1 else None)
        known = {line: float(answer.figures.get("estimate", nan))}
    return {value: slope for value, slope in known.items() if value in found.bys and isfinite(slope)}


def draw_across(axes: Axes, found: Medians, drawn: Marks) -> None:
    """Draws bounds as level lines, crossings as upright ones, and the range of consistency."""
    y = about(found.figure.y).kind
    if y.is_nees:
        axes.axhspan(CAUTIOUS, OVERCONFIDENT, color=INK, alpha=0.07, linewidth=0)
    if y.expected is not None:
        axes.axhline(y.expected, color=INK, linewidth=0.8, alpha=0.6)
    for bound in drawn.bounds:
        middle = 0.5 if bound.x is None else _place(axes, float(bound.x))
        first, last = (0.0, 1.0) if bound.x is None else (max(middle - HALF, 0), min(middle + HALF, 1))
        axes.plot([first, last], [bound.value] * 2, **DASHED, transform=axes.get_yaxis_transform())
        height = _place(axes, bound.value, up=True)
        above = height < 0.94 if bound.below else height < 0.06  # where what is claimed is not, if there is room
        at, side = (0.0, "left") if bound.x is None else (last, "left") if middle < 0.3 else (first, "right")
        off = (2 if bound.x is None else 0, 2.5 if above else -2.5)  # of one x: beside its bars, over the lines alone
        _say(axes, bound.words, (at, bound.value), off, zorder=0.9 if bound.x is None else 3.5,
             xycoords=axes.get_yaxis_transform(), ha=side, va="bottom" if above else "top")  # fmt: skip
    for k, crossing in enumerate(drawn.crossings):
        _draw_crossing(axes, crossing, 0.97 - LOWER * k)


def _draw_crossing(axes: Axes, crossing: Crossing, height: float) -> None:
    low, high = axes.get_xlim()
    first, last = max(crossing.low, low), min(crossing.high, high)
    if first < last and isfinite(crossing.high - crossing.low):
        axes.axvspan(first, last, color=INK, alpha=0.08, linewidth=0)
    if low <= crossing.value <= high:
        axes.axvline(crossing.value, **DASHED)
        left = _place(axes, crossing.value) < 0.6
        _say(axes, crossing.words, (crossing.value, height), (3 if left else -3, 0),
             xycoords=axes.get_xaxis_transform(), ha="left" if left else "right", va="top")  # fmt: skip


def draw_upright(axes: Axes, found: Medians, drawn: Marks, rows: Sequence[Place]) -> None:
    """Draws the same where the measure runs along x, with a row for each of `rows`, bounds in their rows."""
    y = about(found.figure.y).kind
    if y.is_nees:
        axes.axvspan(CAUTIOUS, OVERCONFIDENT, color=INK, alpha=0.07, linewidth=0)
    if y.expected is not None:
        axes.axvline(y.expected, color=INK, linewidth=0.8, alpha=0.6)
    for k, place in enumerate(rows):
        for bound in drawn.bounds:
            if bound.x in (None, place.x) and bound.by in (None, place.by):
                axes.plot([bound.value] * 2, [k - 0.08, k + 0.32], **DASHED)
                room = _place(axes, bound.value)
                left = room < 0.75 if bound.below else room < 0.22
                _say(axes, bound.words, (bound.value, k + 0.12), (3 if left else -3, 0),
                     ha="left" if left else "right", va="center")  # fmt: skip


def _place(axes: Axes, value: float, *, up: bool = False) -> float:
    """The position along the axis to the right, or the one `up`: 0 is its start, 1 its end."""
    point = (axes.get_xlim()[1], value) if up else (value, axes.get_ylim()[1])
    return float((axes.transScale + axes.transLimits).transform(point)[int(up)])


def _say(axes: Axes, words: str, at: tuple[float, float], off: tuple[float, float], **how: Any) -> None:
    """Writes text beside a point, offset by points, on a background of paper; under the data by default."""
    how = {"zorder": 0.9, "textcoords": "offset points", "fontsize": 6.5, **how}
    text: Annotation = axes.annotate(words, at, off, **how)
    text.set_bbox({"facecolor": rcParams["figure.facecolor"], "edgecolor": "none", "pad": 0.4})
