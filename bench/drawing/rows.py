"""Figures with one row per backend, its name on the left, or above its row where names are long."""

from collections.abc import Sequence
from typing import Any

from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..words.styles import Look
from .axes import short
from .figure_maker import of

ROW, TALL_ROW, MARGINS = 21, 29, 34  # points of a row with its name beside it and above it, and of the axis below
BESIDE = 17  # characters of a line of a name that fit on the left
LONGEST = 58  # characters that fit above a row
MIDDLE = 0.12  # where a row's data are, below the row's place


def rows(figure: Figure, names: Sequence[tuple[str, Look]]) -> Axes:
    """Makes axes with a row at 0, 1, ... from the top for each name; what is after " · " may have its own line."""
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
    """The height in points of a figure with these rows."""
    return MARGINS + (ROW if _beside(names) else TALL_ROW) * len(names)


def _beside(names: Sequence[str]) -> bool:
    return max(len(line) for name in names for line in name.split(" · ")) <= BESIDE
