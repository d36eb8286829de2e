"""Draws the frames of a replay with OpenCV's anti-aliased lines on a background drawn once."""

from collections.abc import Iterator
from functools import cache
from typing import Any

import cv2
import numpy as np

from ...core.se2 import Array
from ...frontend.maps.occupancy import FREE, WALL
from .view import Panel, View, ellipses, grid_at, said, when

WIDTH = 420  # px, of a panel
HEAD, FOOT, KEY, GAP = 30, 26, 40, 10  # px above and below a plane, of the line below all, between panels

PAPER, INK, SOFT, RULE = (255, 255, 255), (33, 30, 28), (107, 99, 92), (227, 223, 220)
FLOOR = (241, 239, 237)  # free cells of a grid, half of RULE; its walls are SOFT
RECKONED, BAD = (140, 140, 140), (0, 59, 168)  # colours, as blue, green, red: those of the report in light mode
NEEDLE = 38  # px, of a measured heading
DASH = 6  # px, of the dashes of a reference
_SHIFT = 4  # fractional bits of OpenCV's coordinates


def columns(panels: int) -> int:
    """Returns how many panels stand side by side."""
    return panels if panels <= 3 else -(-panels // 2) if panels <= 8 else 4


def pictures(view: View) -> Iterator[Any]:
    """Yields every frame, (h, w, 3) uint8 in the order blue, green, red; width and height are even."""
    plane = _Plane(view)
    wide = columns(len(view.panels))
    rows = -(-len(view.panels) // wide)
    cell = (HEAD + plane.height + FOOT + GAP, WIDTH + GAP)
    sheet = np.full((rows * cell[0] + KEY + GAP, wide * cell[1] + GAP, 3), PAPER, np.uint8)
    sheet = np.pad(sheet, ((0, sheet.shape[0] % 2), (0, sheet.shape[1] % 2), (0, 0)), constant_values=255)
    tops = [(GAP + k // wide * cell[0], GAP + k % wide * cell[1]) for k in range(len(view.panels))]
    for panel, (top, left) in zip(view.panels, tops, strict=True):
        _name(sheet[top : top + HEAD, left : left + WIDTH], panel)
    canvases = [_Canvas(view, panel, plane) for panel in view.panels]
    bottom = rows * cell[0] + GAP
    for frame in range(len(view.steps)):
        for panel, canvas, (top, left) in zip(view.panels, canvases, tops, strict=True):
            inside = top + HEAD
            sheet[inside : inside + plane.height, left : left + WIDTH] = canvas.drawn(frame)
            strip = sheet[inside + plane.height : inside + plane.height + FOOT, left : left + WIDTH]
            strip[:] = PAPER
            _write(strip, said(view, panel, frame), (2, 18), SOFT, 15)
        sheet[bottom:] = PAPER
        _key(sheet[bottom:], view, frame)
        yield sheet


class _Plane:
    def __init__(self, view: View) -> None:
        size = view.high - view.low
        self.scale = WIDTH / size[0]
        self.height = round(size[1] * self.scale)
        self._low, self._high = view.low, view.high

    def pixels(self, xy: Array) -> Any:
        """Returns (k, 2) int32 with fractional bits, clipped far outside."""
        u = (xy[..., 0] - self._low[0]) * self.scale
        v = (self._high[1] - xy[..., 1]) * self.scale
        return np.clip(np.rint(np.stack((u, v), axis=-1) * (1 << _SHIFT)), -(1 << 24), 1 << 24).astype(np.int32)


class _Canvas:
    """One panel: its background, and a frame on top of it."""

    def __init__(self, view: View, panel: Panel, plane: _Plane) -> None:
        self._view, self._panel, self._plane = view, panel, plane
        self._ground = np.full((plane.height, WIDTH, 3), PAPER, np.uint8)
        self._colour = tuple(int(panel.look.colour[k : k + 2], 16) for k in (5, 3, 1))
        self._line(self._ground, view.truth, RULE, 3)
        for place in plane.pixels(view.places):
            self._cross(place)
        cv2.rectangle(self._ground, (0, 0), (WIDTH - 1, plane.height - 1), RULE, 1)
        self._sketched: tuple[int, Any] = (-1, None)  # frame and image of the last grid

    def drawn(self, frame: int) -> Any:
        """Draws the panel at that frame; frames are asked for in order."""
        view, panel, canvas = self._view, self._panel, self._ground.copy()
        if view.cells is not None:
            self._grid(canvas, frame)
        behind = slice(int(view.at[frame]))
        self._line(canvas, view.reckoned[behind], RECKONED, 1)
        known = view.truth[behind]
        self._line(canvas, _dashed(known, self._plane) if view.known == "reference" else known, SOFT, 1)
        self._positions(canvas, frame)
        self._line(canvas, panel.trail[behind], self._colour, 2)
        if np.isfinite(view.robot[frame]).all():
            centre = self._plane.pixels(view.robot[frame, :2])
            cv2.circle(canvas, centre.tolist(), 5 << _SHIFT, INK, 1, cv2.LINE_AA, _SHIFT)
        if len(panel.pose):
            self._estimate(canvas, min(frame, len(panel.pose) - 1), stopped=frame >= len(panel.pose))
        return canvas

    def _grid(self, canvas: Any, frame: int) -> None:
        """Darkens what the grid of the frame has: walls, and a little what is free."""
        cells, sketch = self._view.cells, grid_at(self._panel, frame)
        if cells is None or sketch is None:
            return
        if self._sketched[0] != sketch.frame:
            values = np.full((3, 3), 255, np.uint8)
            values[FREE], values[WALL] = FLOOR, SOFT
            height = round(cells.shape[1] * cells.size * self._plane.scale)
            image = cv2.resize(values[sketch.states.T[::-1]], (WIDTH, height), interpolation=cv2.INTER_AREA)
            self._sketched = sketch.frame, image
        image = self._sketched[1][-len(canvas) :]
        np.minimum(canvas[-len(image) :], image, out=canvas[-len(image) :])

    def _estimate(self, canvas: Any, frame: int, *, stopped: bool) -> None:
        panel, plane = self._panel, self._plane
        known = panel.maps[frame]
        places, shapes = plane.pixels(known.xy), ellipses(known.cov)
        for place, shape in zip(places, shapes, strict=True):
            self._ellipse(canvas, place, shape)
            cv2.circle(canvas, place.tolist(), 2 << _SHIFT, self._colour, -1, cv2.LINE_AA, _SHIFT)
        if stopped:
            x, y = (plane.pixels(panel.pose[frame, :2]) >> _SHIFT).tolist()
            cv2.drawMarker(canvas, (x, y), BAD, cv2.MARKER_TILTED_CROSS, 14, 2)
            return
        seen = panel.sighted[frame]
        origin = plane.pixels(seen.origin).tolist()
        for end in plane.pixels(seen.ends):
            cv2.line(canvas, origin, end.tolist(), _paler(self._colour), 1, cv2.LINE_AA, _SHIFT)
        for radius in np.rint(np.minimum(seen.rings * plane.scale, 20 * WIDTH) * (1 << _SHIFT)).astype(int).tolist():
            cv2.circle(canvas, origin, radius, _paler(self._colour), 1, cv2.LINE_AA, _SHIFT)
        for line in panel.places[frame]:
            self._line(canvas, line, _paler(self._colour), 3)
        for hit in plane.pixels(panel.hits[frame]) if panel.hits else ():
            cv2.circle(canvas, hit.tolist(), 1 << _SHIFT, self._colour, -1, cv2.LINE_AA, _SHIFT)
        self._ellipse(canvas, plane.pixels(panel.pose[frame, :2]), panel.ellipse[frame], 2)
        x, y, heading = panel.pose[frame]
        turned = heading + np.array((0, 2.5, np.pi, -2.5))
        reach = np.array((11, 8, 3, 8)) / plane.scale
        corners = np.column_stack((x + reach * np.cos(turned), y + reach * np.sin(turned)))
        cv2.fillPoly(canvas, [plane.pixels(corners)], self._colour, cv2.LINE_AA, _SHIFT)
        x, y, heading = panel.pointed[frame]
        if np.isfinite(heading):
            end = panel.pointed[frame, :2] + NEEDLE / plane.scale * np.array((np.cos(heading), np.sin(heading)))
            origin, tip = (point.tolist() for point in plane.pixels(np.stack((panel.pointed[frame, :2], end))))
            cv2.arrowedLine(canvas, origin, tip, INK, 2, cv2.LINE_AA, _SHIFT, 0.25)

    def _positions(self, canvas: Any, frame: int) -> None:
        """Draws the positions up to the frame, and the newest one's ellipse; a line where one coordinate is known."""
        plane, view = self._plane, self._view
        xy, there = view.positions.xy[: frame + 1], np.isfinite(view.positions.xy[: frame + 1])
        for place in plane.pixels(xy[there.all(axis=1)]):
            x, y = (place >> _SHIFT).tolist()
            cv2.drawMarker(canvas, (x, y), SOFT, cv2.MARKER_DIAMOND, 7, 1, cv2.LINE_AA)
        for x, y in xy[there.any(axis=1) & ~there.all(axis=1)]:
            ends = [(x, y), (x, y)]
            self._line(canvas, np.where(np.isnan(ends), (view.low, view.high), ends), SOFT, 1)
        last = np.flatnonzero(there.any(axis=1))
        if len(last) and there[last[-1]].all():
            self._ellipse(canvas, plane.pixels(xy[last[-1]]), view.positions.ellipse[last[-1]], 1, INK)

    def _line(self, canvas: Any, xy: Array, colour: tuple[int, ...], width: int) -> None:
        """Draws a line through the points, broken where one is not known."""
        gaps = np.flatnonzero(~np.isfinite(xy).all(axis=1))
        pieces = [piece[np.isfinite(piece).all(axis=1)] for piece in np.split(xy, gaps)]
        lines = [self._plane.pixels(piece) for piece in pieces if len(piece) > 1]
        if lines:
            cv2.polylines(canvas, lines, False, colour, width, cv2.LINE_AA, _SHIFT)

    def _cross(self, place: Any) -> None:
        x, y = (place >> _SHIFT).tolist()
        cv2.drawMarker(self._ground, (x, y), SOFT, cv2.MARKER_CROSS, 9, 1)

    def _ellipse(self, canvas: Any, centre: Any, shape: Array, width: int = 1, colour: Any = None) -> None:
        """Draws an ellipse of half axes and angle, unless unknown, or too small or too large to be seen."""
        half = shape[:2] * self._plane.scale
        if not np.isfinite(half).all() or half[0] < 2 or half[0] > 20 * WIDTH:
            return
        axes = np.maximum(np.rint(half * (1 << _SHIFT)), 1).astype(int).tolist()
        turned = -float(np.degrees(shape[2]))
        cv2.ellipse(canvas, centre.tolist(), axes, turned, 0, 360, colour or self._colour, width, cv2.LINE_AA, _SHIFT)


def _paler(colour: tuple[int, ...]) -> tuple[int, ...]:
    return tuple((value + 255) // 2 for value in colour)


def _name(strip: Any, panel: Panel) -> None:
    """Draws a panel's head: the backend's name in its colour, and a remark."""
    colour = tuple(int(panel.look.colour[k : k + 2], 16) for k in (5, 3, 1))
    x = _write(strip, panel.label, (2, 20), colour, 19, 700)
    if panel.remark:
        _write(strip, panel.remark, (x + 10, 20), BAD if "NOT" in panel.remark else SOFT, 13)


def _key(strip: Any, view: View, frame: int) -> None:
    width = strip.shape[1]
    cv2.rectangle(strip, (GAP, 0), (width - GAP, 3), RULE, -1)
    done = frame / max(len(view.steps) - 1, 1)
    cv2.rectangle(strip, (GAP, 0), (GAP + round(done * (width - 2 * GAP)), 3), SOFT, -1)
    x = _write(strip, f"{view.title}  ·  {when(view, frame)}", (GAP + 2, 24), INK, 15, 600) + 24
    if width < 800:
        return
    for words, colour, thick in _lines(view):
        cv2.line(strip, (x, 19), (x + 20, 19), colour, thick, cv2.LINE_AA)
        x = _write(strip, words, (x + 26, 24), SOFT, 14) + 16


def _lines(view: View) -> Iterator[tuple[str, tuple[int, int, int], int]]:
    if view.known:
        yield view.known, SOFT, 1
    yield "dead reckoning", RECKONED, 1
    yield "in colour: the estimate", RULE, 2


def _write(strip: Any, text: str, at: tuple[int, int], colour: tuple[int, ...], size: int, weight: int = 400) -> int:
    """Writes on one line, cut off where there is no room; returns its end."""
    font, room = _font(), strip.shape[1] - at[0]
    while text and cv2.getTextSize((0, 0), text, (0, 0), font, size, weight)[2] > room:
        text = text[:-2].rstrip("… ") + "…" if len(text) > 2 else ""
    end, _ = cv2.putText(strip, text, at, colour, font, size, weight)
    return int(end[0])


def _dashed(xy: Array, plane: _Plane) -> Array:
    """Removes every other stretch of DASH pixels from the path."""
    along = np.nancumsum(np.hypot(*np.diff(xy, axis=0, prepend=xy[:1]).T)) * plane.scale
    return np.where((along // DASH % 2 == 0)[:, None], xy, np.nan)


@cache
def _font() -> Any:
    return cv2.FontFace("sans")
