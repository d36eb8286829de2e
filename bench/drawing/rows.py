"""Figures with a row for each backend, its name left of what is drawn of it; above it where names are long."""

from collections.abc import Sequence
from typing import Any

from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..words.styles import Look
from .axes import short
from .figure_maker import of

ROW, TALL_ROW, MARGINS = 21, 29, 34
"""Points that a row has, beside its name and below it, and that the axis below has."""

BESIDE = 17
"""Characters of a line of a name that there is room for on the left."""

LONGEST = 58
"""Characters for which a figure is wide enough."""

MIDDLE = 0.12
"""Where a row's own things are, from its place downwards."""


def rows(figure: Figure, names: Sequence[tuple[str, Look]]) -> Axes:
    """Axes with a row at 0, 1, ... from the top for each name; what is after " · " may have its own line."""
    axes = figure.subplots()
    axes.grid(visible=False, axis="y")
    axes.spines["left"].set_visible(False)
    if _beside([name for name, _ in names]):
        axes.set_ylim(len(names) - 0.5 + MIDDLE, MIDDLE - 0.5)
        axes.set_yticks([k + MIDDLE for k in range(len(names))], [name.replace(" · ", "\n") for name, _ in names])
        for text, (_, look) in zip(axes.get_yticklabels(), names, strict=True):
            text.set_gid(of(look))
        return axes
    axes.set_ylim(len(names) - 0.6, -0.45)
    axes.set_yticks([])
    paper = rcParams["figure.facecolor"]
    place: dict[str, Any] = {"transform": axes.get_yaxis_transform(), "va": "bottom", "fontsize": 7.5}
    for k, (name, look) in enumerate(names):
        text = axes.text(0, k - 0.13, short(name, LONGEST), gid=of(look), **place)
        text.set_bbox({"facecolor": paper, "edgecolor": "none", "pad": 0.5})  # over upright lines
    return axes


def height(names: Sequence[str]) -> float:
    """Points, of a figure with a row for each of these."""
    return MARGINS + (ROW if _beside(names) else TALL_ROW) * len(names)


def _beside(names: Sequence[str]) -> bool:
    return max(len(line) for name in names for line in name.split(" · ")) <= BESIDE
