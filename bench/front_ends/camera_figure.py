"""Draws what each effect of a real camera does to sightings: bias, spread, consistency and refusals, by distance."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from ..drawing.axes import logarithmic
from ..drawing.picture import picture
from ..words.styles import looks
from .cameras import COMPARED, CameraAccuracy
from .corner_figure import CONSISTENT
from .corners import Accuracy


def write_camera_figure(path: Path, rows: Sequence[CameraAccuracy]) -> None:
    """Draws the rows of the last refinement into `path`, a PNG, whole or not at all: cameras downwards."""
    drawn = [row for row in rows if row.accuracy.refinement == COMPARED[-1]]
    cameras = list(dict.fromkeys(row.camera for row in drawn))
    with picture(path, (13, 1.2 + 0.26 * len(cameras))) as figure:
        bias, spread, consistency, refusals = figure.subplots(1, 4, sharey=True, width_ratios=(1.3, 1, 1, 0.7))
        _dots(bias, drawn, cameras, lambda row: 100 * row.bias / row.distance)
        bias.axvline(0, color="#8c8c8c", linewidth=0.8)
        bias.set_title("Bias of the distance, % of it")
        _dots(spread, drawn, cameras, lambda row: 1e3 * row.sd, positive=True)
        spread.set_title("Its standard deviation, mm")
        consistency.axvspan(*CONSISTENT, color="#e8f0e8", zorder=0)
        _dots(consistency, drawn, cameras, lambda row: row.nees, positive=True)
        consistency.set_title("NEES; 1 is exact")
        _dots(refusals, drawn, cameras, lambda row: 100 * row.refused)
        refusals.set_xlim(-5, 105)
        refusals.set_title("Refused, %")
        bias.set_yticks(range(len(cameras)), cameras)
        bias.invert_yaxis()
        handles, labels = bias.get_legend_handles_labels()
        labels = [f"{COMPARED[-1]}, {label} away" for label in labels]
        figure.legend(handles, labels, loc="outside upper left", ncols=len(labels), frameon=False)


def _dots(
    axes: Axes,
    rows: Sequence[CameraAccuracy],
    cameras: Sequence[str],
    value: Callable[[Accuracy], float],
    positive: bool = False,
) -> None:
    """One dot for each camera and distance; `positive` values are on a logarithmic axis."""
    distances = list(dict.fromkeys(row.accuracy.distance for row in rows))
    for place, (distance, look) in enumerate(zip(distances, looks(f"{d:g}" for d in distances).values(), strict=True)):
        mine = [row for row in rows if row.accuracy.distance == distance]
        up = [cameras.index(row.camera) + 0.16 * (place - (len(distances) - 1) / 2) for row in mine]
        axes.plot(
            [value(row.accuracy) for row in mine],
            up,
            color=look.colour,
            marker=look.marker,
            linestyle="none",
            markersize=4,
            label=f"{distance:g} m",
        )
    values = np.array([value(row.accuracy) for row in rows])
    known = values[np.isfinite(values) & (values > 0)]
    if positive and len(known):
        logarithmic("x", axes, known.min(), known.max())
    for line in range(len(cameras) - 1):
        axes.axhline(line + 0.5, color="#eeeeee", linewidth=0.6, zorder=0)
