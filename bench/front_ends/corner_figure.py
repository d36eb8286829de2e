"""Draws the front end's study: bias, spread and consistency by distance, one line per refinement."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from ..drawing.axes import logarithmic
from ..drawing.picture import picture
from ..words.styles import looks
from .corners import Accuracy

CONSISTENT = (0.8, 1.2)  # band of the mean NEES over its degrees of freedom that counts as consistent


def write_figure(path: Path, rows: Sequence[Accuracy]) -> None:
    """Draws a still camera's rows into `path`, a PNG, whole or not at all; the last panel is a moving one's."""
    still = [row for row in rows if row.streak == 0]
    with picture(path, (12.5, 4.2)) as figure:
        bias, spread, consistency = figure.subplots(1, 3)
        _lines(bias, still, lambda row: 1e3 * abs(row.bias))
        bias.set_title("Bias of the distance, without its sign, mm")
        _lines(spread, still, lambda row: 1e3 * row.sd)
        spread.set_title("Standard deviation of the distance, mm")
        _consistency(consistency, [row for row in rows if row.refinement == rows[-1].refinement])
        handles, labels = bias.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper left", ncols=len(labels), handlelength=2.6)
        for axes in (bias, spread, consistency):
            axes.set_xlabel("distance, m")


def _lines(axes: Axes, rows: Sequence[Accuracy], value: Callable[[Accuracy], float]) -> None:
    shown = looks(row.refinement for row in rows)
    values = np.array([value(row) for row in rows])
    for name, look in shown.items():
        mine = np.array([row.refinement == name for row in rows])
        distances = [row.distance for row in rows if row.refinement == name]
        axes.plot(distances, values[mine], color=look.colour, linestyle=look.dash, marker=look.marker, label=name)
    known = values[np.isfinite(values) & (values > 0)]
    distances = [row.distance for row in rows]
    logarithmic("x", axes, min(distances), max(distances))
    if len(known):
        logarithmic("y", axes, known.min(), known.max())


def _consistency(axes: Axes, rows: Sequence[Accuracy]) -> None:
    """Draws NEES of one refinement, still and moving, with intervals."""
    axes.axhspan(*CONSISTENT, color="#e8f0e8", zorder=0)
    axes.axhline(1, color="#8c8c8c", linewidth=0.8)
    for look, streak in zip(looks("ab").values(), dict.fromkeys(row.streak for row in rows), strict=False):
        mine = [row for row in rows if row.streak == streak]
        axes.errorbar(
            [row.distance for row in mine],
            [row.nees for row in mine],
            [row.nees_half for row in mine],
            color=look.colour,
            linestyle=look.dash,
            marker=look.marker,
            capsize=2,
            label=f"streaks up to {streak:g} px" if streak else "still camera",
        )
    axes.set_ylim(bottom=0)
    axes.legend(frameon=False)
    axes.set_title(f"NEES of {rows[-1].refinement}; 1 is exact")
