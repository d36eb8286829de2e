"""Draws the study of the backends' speed: µs per step against landmarks and particles, both logarithmic.

A point is the median step, the line up from it ends at the 99th percentile, and the dot above is the slowest; every
curve is named at its end, with its exponent. References are grey.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes

from ...core.se2 import Array
from ..drawing.axes import logarithmic, short
from ..drawing.picture import GRID, picture
from ..words.styles import Look, looks
from .ratios import exponent
from .timing import TimingRow

GREY = "#777777"
ASIDE = 1.04  # ratio of one backend's abscissas to the next one's, at the same size
SHORTEST_US = 0.1  # µs; shorter times are not drawn at their height
LINE = 11.5  # points from one name to the next at least
HEIGHT = 6.6  # inches


class _Curve(NamedTuple):
    name: str
    look: Look
    at: Array  # (n,) landmarks or particles
    p50: Array  # (n,) µs
    p99: Array
    slowest: Array
    letter: str  # of what it is drawn against

    @property
    def label(self) -> str:
        """Returns its name and exponent."""
        power = exponent(self.at.tolist(), self.p50.tolist())
        return short(self.name) + ("" if np.isnan(power) else f"  {self.letter}^{power:z.1f}")


def write_figure(path: Path, rows: Sequence[TimingRow], what: str) -> bool:
    """Draws the rows into `path`, a PNG, with a description of a step; False where nothing was timed."""
    backends = [row for row in rows if row.kind == "backend"]  # those of a panel first: colours go round
    shown = looks(row.name for row in sorted(backends, key=lambda row: row.particles is not None))
    timed = [row for row in rows if row.timing is not None and row.kind != "part"]
    by_map = _curves([row for row in timed if row.particles is None], shown, "landmarks")
    particles = [row for row in timed if row.particles is not None]
    panels = [(by_map, "landmarks on the map, N")] if by_map else []
    if particles:
        least, landmarks = min(row.particles or 0 for row in particles), _common(particles)
        few = [row for row in particles if row.particles == least]
        panels.append((_curves(few, shown, "landmarks"), f"landmarks, N; {least:,} particles"))
        some = [row for row in particles if row.landmarks == landmarks]
        panels.append((_curves(some, shown, "particles"), f"particles, M; {landmarks:,} landmarks"))
    if not panels:
        return False
    costs = [us for curves, _ in panels for curve in curves for us in (*curve.p50, *curve.slowest)]
    wide = [1.6 if curves is by_map else 1.0 for curves, _ in panels]
    with picture(path, (1.0 + 4.2 * sum(wide), HEIGHT), GRID) as figure:
        every = figure.subplots(1, len(panels), squeeze=False, width_ratios=wide)[0]
        for axes, (curves, along) in zip(every, panels, strict=True):
            _scale(axes, curves, costs)
            backends = [curve.name for curve in curves if curve.look.colour != GREY]
            for curve in curves:
                _draw(axes, curve, backends)
            _name(axes, curves)
            axes.set_xlabel(along)
            if axes is not every[0]:
                axes.tick_params(labelleft=False)
        every[0].set_ylabel("CPU time a step, µs")
        figure.suptitle(
            f"CPU time of a step: {what}\nPoint: median step; the line up from it ends at the 99th percentile; "
            "dot: the slowest.\nGrey: references. N^2: twice the landmarks cost 2² times as much; fitted to the three "
            "largest sizes.",
            x=0.01,
            ha="left",
            fontsize=10,
        )
    return True


def _common(rows: Sequence[TimingRow]) -> int:
    """The number of landmarks of most rows, the largest of several: references are not timed everywhere."""
    counts = {n: sum(row.landmarks == n for row in rows) for n in {row.landmarks for row in rows}}
    return max(counts, key=lambda n: (counts[n], n))


def _curves(rows: Sequence[TimingRow], shown: dict[str, Look], along: str) -> list[_Curve]:
    """Makes one curve per name; of a reference beside several backends, the one beside the first."""
    curves: list[_Curve] = []
    letter = "N" if along == "landmarks" else "M"
    for name in dict.fromkeys(row.name for row in rows):
        mine = [row for row in rows if row.name == name]
        mine = sorted((row for row in mine if row.beside == mine[0].beside), key=lambda row: getattr(row, along))
        look = shown.get(name, Look(GREY, (0, (2, 1.5)), ".", len(shown)))
        at = np.array([float(getattr(row, along)) for row in mine])
        timings = [row.timing for row in mine if row.timing is not None]
        p50, p99, slowest = np.array([(t.p50, t.p99, t.max) for t in timings]).T
        curves.append(_Curve(name, look, at, p50, p99, slowest, letter))
    return curves


def _scale(axes: Axes, curves: Sequence[_Curve], costs: Sequence[float]) -> None:
    sizes = sorted({float(size) for curve in curves for size in curve.at})
    logarithmic("x", axes, sizes[0], sizes[-1])
    logarithmic("y", axes, max(min(costs), SHORTEST_US), max(costs))
    axes.set_xticks(sizes, [f"{size:,.0f}" for size in sizes])


def _draw(axes: Axes, curve: _Curve, backends: Sequence[str]) -> None:
    """Draws a reference, or one of the `backends`, offset so that percentiles do not hide each other."""
    look = curve.look
    if look.colour == GREY:
        axes.plot(curve.at, curve.p50, color=GREY, linestyle=look.dash, linewidth=1, marker=look.marker, markersize=5)
        return
    at = curve.at * ASIDE ** (backends.index(curve.name) - (len(backends) - 1) / 2)
    axes.plot(at, curve.p50, color=look.colour, linestyle=look.dash, linewidth=1.5, marker=look.marker, markersize=4.5)
    axes.vlines(at, curve.p50, curve.p99, color=look.colour, linewidth=0.9, alpha=0.8)
    axes.plot(at, curve.slowest, ".", color=look.colour, markersize=3, markeredgewidth=0, alpha=0.8)
    axes.plot(at, curve.p99, "_", color=look.colour, markersize=4, markeredgewidth=0.9, alpha=0.8)


def _name(axes: Axes, curves: Sequence[_Curve]) -> None:
    """Writes every curve's name right of the axes at its last point's height, moved apart where they would touch."""
    low, high = np.log10(axes.get_ylim())
    room = 0.82 * HEIGHT * 72  # points, about what the axes are high
    wanted = [(np.log10(curve.p50[-1]) - low) / (high - low) * room for curve in curves]
    for curve, height in zip(curves, apart(wanted, LINE), strict=True):
        axes.annotate(
            curve.label,
            (curve.at[-1], curve.p50[-1]),
            xytext=(1.03, height / room),
            textcoords="axes fraction",
            color=curve.look.colour,
            va="center",
            fontsize=8.5,
            annotation_clip=False,
            arrowprops={"arrowstyle": "-", "color": curve.look.colour, "linewidth": 0.5, "alpha": 0.5, "shrinkA": 1},
        )


def apart(wanted: Sequence[float], distance: float) -> list[float]:
    """Returns heights near those `wanted`, in the same order, no two nearer than `distance`."""
    order = np.argsort(wanted, kind="stable")
    blocks: list[list[float]] = []  # [sum of wanted heights, how many]
    for index in order:
        blocks.append([wanted[index], 1.0])
        while len(blocks) > 1 and (
            _middle(blocks[-1]) - _middle(blocks[-2]) < distance * (blocks[-1][1] + blocks[-2][1]) / 2
        ):
            total, count = blocks.pop()
            blocks[-1][0] += total
            blocks[-1][1] += count
    heights = [
        _middle(block) + distance * (place - (block[1] - 1) / 2) for block in blocks for place in range(int(block[1]))
    ]
    return [heights[rank] for rank in np.argsort(order)]


def _middle(block: Sequence[float]) -> float:
    return block[0] / block[1]
