"""Figures with a row for each backend, its name above what is drawn of it: names may be long."""

from collections.abc import Sequence
from typing import Any

from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .axes import short
from .exhibit_figure import of
from .looks import Look

ROW, MARGINS = 22, 34
"""Points that a row has, and that the axis below has."""

LONGEST = 58
"""Characters for which a figure is wide enough."""


def rows(figure: Figure, names: Sequence[tuple[str, Look]]) -> Axes:
    """Axes with a row at 0, 1, ... from the top for each name."""
    axes = figure.subplots()
    axes.set_ylim(len(names) - 0.5, -0.6)
    axes.set_yticks([])
    axes.grid(visible=False, axis="y")
    axes.spines["left"].set_visible(False)
    paper = rcParams["figure.facecolor"]
    for k, (name, look) in enumerate(names):
        place: dict[str, Any] = {
            "transform": axes.get_yaxis_transform(),
            "va": "bottom",
            "fontsize": 7.5,
            "gid": of(look),
        }
        text = axes.text(0, k - 0.13, short(name, LONGEST), **place)
        text.set_bbox({"facecolor": paper, "edgecolor": "none", "pad": 0.5})  # over upright lines
    return axes


def height(names: Sequence[object]) -> float:
    """Points, of a figure with a row for each of these."""
    return MARGINS + ROW * len(names)
