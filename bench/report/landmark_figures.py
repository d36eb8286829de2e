"""Figures of where maps are wrong: a line from each known place to the estimate, a panel for each backend."""

from collections.abc import Iterator
from functools import partial

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ...core.se2 import Array
from ..drawing.axes import short
from ..drawing.figure import ReportFigure
from ..drawing.figure_maker import of, report_figure
from ..drawing.labels import Point, name_points
from ..drawing.svg import INK
from ..words.numerals import listed, number
from .aligned_paths import Frame
from .landmark_errors import BackendMap, LandmarkErrors
from .path_figures import PANEL, TITLE, TITLE_ROW, tall

NAMED = 5  # landmarks of a panel whose ids are written
CROSSES = 200  # landmarks up to which places have crosses; above, thin lines alone
THICK, THIN = 1.3, 0.7  # points
LONGEST = 0.12  # of the frame, for the largest error, where it is drawn larger
FACTORS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1_000)
ASIDE = 6.0  # times the distance of most places from their middle, beyond which one is outside the frame


def landmark_panels(name: str, found: LandmarkErrors) -> Iterator[ReportFigure]:
    """Draws a panel for each backend that has a map, all in one frame; captions say by how much errors are larger."""
    frame, cut = _framed(found.xy)
    beyond = f" Outside: {listed([str(one) for one in found.ids[cut].tolist()], NAMED)}." * bool(cut.any())
    for one in found.maps:
        largest = float(np.nanmax(np.hypot(*one.off(found.xy).T)))
        factor = max((size for size in FACTORS if size * largest <= LONGEST * frame.size.max()), default=1)
        drawn = f"Lines {factor:,} times as long as the errors." if factor > 1 else "Lines as long as the errors."
        yield report_figure(
            f"{name}-{one.trace.slug}",
            one.trace.label,
            drawn + beyond,
            TITLE_ROW * (1 + _title(found, one).count("\n")) + tall(frame, PANEL),
            partial(_draw, found=found, one=one, frame=frame, factor=factor),
            width=PANEL,
        )


def _framed(xy: Array) -> tuple[Frame, NDArray[np.bool_]]:
    """Frames the places, without those far from all others, which are told (n,)."""
    off = np.hypot(*(xy - np.median(xy, axis=0)).T)
    cut = np.asarray(off > ASIDE * np.quantile(off, 0.75))
    low, high = xy[~cut].min(axis=0), xy[~cut].max(axis=0)
    room = 0.12 * max(*(high - low), 0.5)
    low, high = low - room, high + room
    thin = np.maximum(0, 0.35 * (high - low).max() - (high - low)) / 2
    return Frame(low - thin, high + thin), cut


def _draw(figure: Figure, found: LandmarkErrors, one: BackendMap, frame: Frame, factor: int) -> None:
    axes, gid, look = figure.subplots(), of(one.trace.look), one.trace.look
    axes.set_aspect("equal")
    axes.set_xlim(frame.low[0], frame.high[0])
    axes.set_ylim(frame.low[1], frame.high[1])
    axes.set_xlabel("x, m")
    axes.set_ylabel("y, m")
    few = len(found.ids) <= CROSSES
    if few:
        axes.plot(*found.xy.T, "+", color=INK, markersize=5, markeredgewidth=0.7, alpha=0.75)
    ends = found.xy + factor * one.off(found.xy)
    lines = np.stack((found.xy, ends, np.full_like(ends, np.nan)), axis=1).reshape(-1, 2)
    axes.plot(*lines.T, color=look.colour, linewidth=THICK if few else THIN, solid_capstyle="round", gid=gid)
    axes.set_title(_title(found, one), loc="left", gid=gid)
    size = np.hypot(*one.off(found.xy).T)
    inside = ((found.xy >= frame.low) & (found.xy <= frame.high)).all(axis=1) & np.isfinite(size)
    worst = np.flatnonzero(inside)[np.argsort(-size[inside], kind="stable")][:NAMED]
    name_points(
        figure,
        axes,
        [Point(x, y, str(one), gid) for (x, y), one in zip(found.xy[worst].tolist(), found.ids[worst], strict=True)],
    )


def _title(found: LandmarkErrors, one: BackendMap) -> str:
    title = short(one.trace.label, TITLE - 2)
    error = f"{number(float(np.sqrt(np.nanmean(one.off(found.xy) ** 2) * 2)))} m map RMS"
    return title + (" · " if len(title + error) < TITLE else "\n") + error
