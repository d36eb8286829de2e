"""What a claim draws into a figure of the measure that it is about: its bounds, or where two lines cross."""

from collections.abc import Iterable
from math import isfinite, nan
from typing import NamedTuple

from matplotlib.axes import Axes

from .beliefs import CAUTIOUS, OVERCONFIDENT
from .claim_test import Answer
from .column_words import CONSISTENCY
from .numerals import plain
from .study import Figure
from .svg import INK, PAPER


class Marks(NamedTuple):
    """What is drawn beside the medians."""

    bounds: tuple[tuple[float, str], ...]  # a value of the measure, and what is claimed of it
    crossings: tuple[tuple[float, float, float], ...]  # of x: estimate and the ends of its interval

    @property
    def values(self) -> list[float]:
        """Of the measure: what the axis has to have room for."""
        return [value for value, _ in self.bounds]


def marks(figure: Figure, answers: Iterable[Answer]) -> Marks:
    """Those of the claims that are about the figure's measure and agree with its choice of cells."""
    bounds: dict[float, str] = {}
    crossings: list[tuple[float, float, float]] = []
    for answer in answers:
        claim = answer.claim
        if claim.measure != figure.y or not _agree(figure, answer):
            continue
        if claim.kind == "value":
            bounds |= {claim.low: f"claimed: above {plain(claim.low)}"} if isfinite(claim.low) else {}
            bounds |= {claim.high: f"claimed: below {plain(claim.high)}"} if isfinite(claim.high) else {}
        if claim.kind == "crosses" and claim.along == figure.x:
            found = answer.figures
            value, low, high = (float(found.get(name, nan)) for name in ("estimate", "low", "high"))
            crossings += [(value, low, high)] if isfinite(value) else []
    return Marks(tuple(bounds.items()), tuple(dict.fromkeys(crossings)))


def _agree(figure: Figure, answer: Answer) -> bool:
    chosen = {**answer.claim.where, **answer.claim.first}
    return all(chosen[name] == value for name, value in figure.where.items() if name in chosen)


def draw_across(axes: Axes, figure: Figure, found: Marks) -> None:
    """Bounds as level lines and crossings as upright ones; where a belief is consistent, a band around 1."""
    if figure.y in CONSISTENCY:
        axes.axhspan(CAUTIOUS, OVERCONFIDENT, color=INK, alpha=0.07, linewidth=0)
        axes.axhline(1, color=INK, linewidth=0.8, alpha=0.6)
    for value, said in found.bounds:
        axes.axhline(value, color=INK, linewidth=0.8, linestyle=(0, (4, 3)), alpha=0.7)
        text = axes.annotate(
            said, (0, value), (3, 2), xycoords=axes.get_yaxis_transform(), textcoords="offset points", fontsize=6.5
        )
        text.set_bbox({"facecolor": PAPER, "edgecolor": "none", "pad": 0.4})
    for value, low, high in found.crossings:
        ends = axes.get_xlim()
        first, last = max(low, ends[0]), min(high, ends[1])
        if first < last and isfinite(high - low):
            axes.axvspan(first, last, color=INK, alpha=0.08, linewidth=0)
        if ends[0] <= value <= ends[1]:
            axes.axvline(value, color=INK, linewidth=0.9, linestyle=(0, (4, 3)), alpha=0.8)
            words = f"cross at {plain(value)}"
            right = axes.transLimits.transform(axes.transScale.transform((value, axes.get_ylim()[0])))[0] < 0.6
            text = axes.annotate(
                words, (value, 0.96), (3 if right else -3, 0), xycoords=axes.get_xaxis_transform(),
                textcoords="offset points", fontsize=7, va="top", ha="left" if right else "right",
            )  # fmt: skip
            text.set_bbox({"facecolor": PAPER, "edgecolor": "none", "pad": 0.4})


def draw_upright(axes: Axes, figure: Figure, found: Marks) -> None:
    """The same where the measure runs along x."""
    if figure.y in CONSISTENCY:
        axes.axvspan(CAUTIOUS, OVERCONFIDENT, color=INK, alpha=0.07, linewidth=0)
        axes.axvline(1, color=INK, linewidth=0.8, alpha=0.6)
    for value, _ in found.bounds:
        axes.axvline(value, color=INK, linewidth=0.8, linestyle=(0, (4, 3)), alpha=0.7)
