"""Places names beside points so that none covers another name or a point."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Annotation

from ...core.se2 import Array
from .axes import short
from .svg import lay_out

SIZE = 7  # points, of the letters
POINT = 4.0  # points, half of what a marker takes
NEARER = 12.0  # square points of overlap that one point of nearness to another's marker is worth
ON_ANOTHER = 30.0  # points by which a name on another's marker counts as nearer to that

_BOX = tuple[float, float, float, float]


class Point(NamedTuple):
    """A point of a plot, with its name and its backend's mark."""

    x: float
    y: float
    name: str
    gid: str


def name_points(
    figure: Figure,
    axes: Axes,
    points: Sequence[Point],
    bars: Sequence[tuple[float, float, float]] = (),
    others: Sequence[Point] = (),
    *,
    apart: float = 1.0,
) -> None:
    """Writes the names, not over `others` and `bars` (x, low, high), once the axes' limits and labels are final.

    With a larger `apart` a name is rather far from its point than over something.
    """
    lay_out(figure)  # so that the axes stand where they will
    scale = 72 / figure.dpi
    at = axes.transData.transform([(point.x, point.y) for point in (*points, *others)]) * scale
    room = axes.get_window_extent()
    frame = (room.x0 * scale, room.y0 * scale, room.x1 * scale, room.y1 * scale)
    taken: list[_BOX] = [(x - POINT, y - POINT, x + POINT, y + POINT) for x, y in at.tolist()]
    ends = np.array([axes.transData.transform([(x, low), (x, high)]) for x, low, high in bars]).reshape(-1, 4) * scale
    taken += [(x - 1, low, x + 1, high) for x, low, _, high in np.clip(ends, -1e4, 1e4).tolist()]
    for k in _crowded_first(at[: len(points)]):
        point = points[k]
        text = axes.annotate(
            short(point.name), (point.x, point.y), (0, 0), textcoords="offset points", fontsize=SIZE, gid=point.gid
        )
        text.set_in_layout(False)
        size = text.get_window_extent()
        wide, high = size.width * scale, size.height * scale
        own = at[k]
        boxes = [(own[0] + dx, own[1] + dy, own[0] + dx + wide, own[1] + dy + high) for dx, dy in _offsets(wide, high)]
        rest = np.delete(at, k, axis=0)
        bad = [apart * _bad(box, taken, frame) + NEARER * _nearer(box, own, rest) for box in boxes]
        best = min(range(len(boxes)), key=lambda i: (round(bad[i], 1), i))
        taken.append(boxes[best])
        _put(axes, text, boxes[best], own)


def _put(axes: Axes, text: Annotation, box: _BOX, own: Array) -> None:
    offset = box[0] - own[0], box[1] - own[1]
    text.set_position(offset)
    gap = np.maximum(0, np.maximum((box[0] - own[0], box[1] - own[1]), (own[0] - box[2], own[1] - box[3])))
    if np.hypot(*gap) > 2.5 * POINT:
        near = np.clip(own, box[:2], box[2:])
        line = {"arrowstyle": "-", "color": text.get_color(), "linewidth": 0.4, "alpha": 0.6, "gid": text.get_gid()}
        lead = axes.annotate("", text.xy, tuple(near - own), textcoords="offset points", arrowprops=line)
        lead.set_in_layout(False)


def _offsets(wide: float, high: float) -> Iterator[tuple[float, float]]:
    """Yields offsets of a name's lower left corner from its point, the best first."""
    for far in (1.0, 2.0, 3.5, 5.0, 7.0, 9.0):
        gap = far * POINT + 2
        yield from (
            (gap, -high / 2),
            (-gap - wide, -high / 2),
            (-wide / 2, gap),
            (-wide / 2, -gap - high),
            (gap * 0.7, gap * 0.7),
            (gap * 0.7, -gap * 0.7 - high),
            (-gap * 0.7 - wide, gap * 0.7),
            (-gap * 0.7 - wide, -gap * 0.7 - high),
        )


def _bad(box: _BOX, taken: Sequence[_BOX], frame: _BOX) -> float:
    """The square points of a box that overlap something else or leave the frame."""
    inside = _shared(box, frame)
    return sum(_shared(box, other) for other in taken) + 4 * ((box[2] - box[0]) * (box[3] - box[1]) - inside)


def _nearer(box: _BOX, own: Array, rest: Array) -> float:
    """Returns how much nearer a name is to the nearest other point (n, 2) than to its own, points."""
    if not len(rest):
        return 0.0
    other = _gap(box, rest)
    return max(0.0, _gap(box, own[None]) + POINT / 2 - other) + ON_ANOTHER * (other < POINT)


def _gap(box: _BOX, points: Array) -> float:
    """The distance from a name to the nearest of some points (n, 2)."""
    return float(np.hypot(*np.maximum(0, np.maximum(box[:2] - points, points - box[2:])).T).min())


def _shared(a: _BOX, b: _BOX) -> float:
    wide, high = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    return max(0.0, wide) * max(0.0, high)


def _crowded_first(at: Array) -> list[int]:
    """Orders points with the nearest neighbours first: they have the least choice."""
    apart = np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1)) + np.diag(np.full(len(at), np.inf))
    return np.argsort(apart.min(axis=1), kind="stable").tolist()
