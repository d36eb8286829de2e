"""Writes a replay as one HTML page that needs no network; without scripts it shows the end of the run.

Every panel is an SVG of UNITS across. The script has whole numbers of these units, and of a map only what has changed
since the frame before; it draws what `_still` draws here of the last frame.
"""

import base64
import json
from collections.abc import Iterable, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from ...core.files import write_whole
from ...core.se2 import Array
from ...frontend.maps.occupancy import FREE, WALL
from ..drawing.page import rendered
from ..words.numerals import number
from ..words.styles import BASELINE
from .grids import Sketch
from .view import Panel, View, ellipses, grid_at, said, when

UNITS = 1000  # across a panel
CHART = 150  # units that the chart of errors is high
WALLS, FLOOR = (85, 255), (128, 34)  # grey and opacity of a grid's walls and free cells, on light and dark paper
SEEN = 3  # units that an ellipse's longer half axis is at least
MARK, NEEDLE = 9, 90  # units of a position's half diagonal, of a heading's arrow


def write_page(path: Path, view: View) -> None:
    """Writes it, whole or not at all."""
    last = len(view.steps) - 1
    panels = [_panel(view, panel) for panel in view.panels]
    top = _top(view)
    places = np.array(_pairs(view, view.places)).reshape(-1, 2).tolist()
    run: dict[str, Any] = {
        "when": [when(view, k) for k in range(len(view.steps))],
        "at": view.at.tolist(),
        "truth": _pairs(view, view.truth),
        "reckoned": _pairs(view, view.reckoned),
        "robot": _pairs(view, view.robot[:, :2]),
        "panels": panels,
        **({"positions": _positions(view)} if view.fixed else {}),
    }
    page = {
        "view": view,
        "height": round(UNITS * (view.high - view.low)[1] / (view.high - view.low)[0]),
        "known": _line(run["truth"]),
        "reckoned": _line(run["reckoned"]),
        "places": "".join(f"M{u - 9} {v}h18M{u} {v - 9}v18" for u, v in places),
        "positions": _positions_drawn(run["positions"], last) if view.fixed else ("", ""),
        "there": _dot(_pairs(view, view.robot[last, None, :2])),
        "stills": [_still(panel, last) for panel in panels],
        "now": when(view, last),
        "top": None if top is None else number(top),
        "chart": CHART,
        "mark": MARK,
        "needle": NEEDLE,
        "curves": [] if top is None else [_curve(view, panel, top) for panel in view.panels],
        "grids": [_images(view, panel, last) for panel in view.panels],
        "run": json.dumps(run, separators=(",", ":"), ensure_ascii=False).replace("<", "\\u003c"),
    }
    write_whole(path, rendered("replay.html.jinja", page))


def _pairs(view: View, xy: Array) -> list[Any]:
    """Returns u0, v0, u1, v1, ... in whole units; None where not known, clipped far outside."""
    scale = UNITS / (view.high[0] - view.low[0])
    uv = np.stack(((xy[..., 0] - view.low[0]) * scale, (view.high[1] - xy[..., 1]) * scale), axis=-1)
    return [None if c != c else round(c) for c in np.clip(uv, -9999, 9999).ravel().tolist()]


def _panel(view: View, panel: Panel) -> dict[str, Any]:
    pose = _pairs(view, panel.pose[:, :2])
    degrees = np.rint(-np.degrees(panel.pose[:, 2])).astype(int).tolist()
    units = UNITS / (view.high[0] - view.low[0])
    rings = {"rings": [np.rint(s.rings * units).clip(0, 20 * UNITS).astype(int).tolist() for s in panel.sighted]}
    scanned = {"grids": [grid.frame for grid in panel.grids], "hits": [_pairs(view, hits) for hits in panel.hits]}
    return {
        "trail": _pairs(view, panel.trail),
        "pose": [[*pose[2 * k : 2 * k + 2], degree] for k, degree in enumerate(degrees)],
        "belief": [_shape(view, shape) for shape in panel.ellipse],
        "seen": [_pairs(view, np.concatenate((s.origin[None], s.ends))) for s in panel.sighted],
        "maps": list(_changes(view, panel)),
        **({"open": [_opened(view, some) for some in panel.places]} if view.open else {}),
        **({"pointed": _pointed(view, panel)} if view.pointed else {}),
        "said": [said(view, panel, k) for k in range(min(len(panel.pose) + 1, len(view.steps)))],
        **(scanned if view.cells is not None else {}),
        **(rings if view.rings else {}),
    }


def _images(view: View, panel: Panel, last: int) -> list[dict[str, Any]]:
    """The grids as images in the panel's units, the one of the frame `last` shown."""
    if view.cells is None:
        return []
    (n, m), (low, high) = view.cells.shape, (view.low[1], view.high[1])
    tall = m * view.cells.size
    unit = UNITS / (n * view.cells.size)
    now = grid_at(panel, last)
    return [
        {
            "y": round((high - low - tall) * unit, 2),
            "height": round(tall * unit, 2),
            "shown": grid is now,
            "url": _url(grid),
        }
        for grid in panel.grids
    ]


def _url(grid: Sketch) -> str:
    """Encodes a grid as a PNG of a few colours, what is unknown being transparent."""
    from PIL import Image

    image = Image.fromarray(np.ascontiguousarray(grid.states.T[::-1]), "P")
    colours = {FREE: FLOOR, WALL: WALLS}
    image.putpalette([grey for state in range(3) for grey in 3 * [colours.get(state, (0, 0))[0]]])
    opacity = bytes(colours.get(state, (0, 0))[1] for state in range(3))
    content = BytesIO()
    image.save(content, "PNG", bits=2, transparency=opacity, optimize=True)
    return f"data:image/png;base64,{base64.b64encode(content.getvalue()).decode()}"


def _shape(view: View, shape: Array) -> list[int]:
    """Returns half axes in units and angle in degrees, clockwise; zeros where unknown or too small to be seen."""
    half = shape[:2] * UNITS / (view.high[0] - view.low[0])
    if not np.isfinite(half).all() or half[0] < SEEN or half[0] > 20 * UNITS:
        return [0, 0, 0]
    a, b = (max(round(float(axis)), 1) for axis in half)
    return [a, b, 0 if a - b < 2 else round(-float(np.degrees(shape[2])))]


def _positions(view: View) -> list[list[int | None]]:
    """Place and shape of each frame's position, [] without; None for the coordinate that is not measured."""
    places, shapes = _pairs(view, view.positions.xy), view.positions.ellipse
    pairs = [places[2 * k : 2 * k + 2] for k in range(len(shapes))]
    return [
        [] if pair == [None, None] else [*pair, *_shape(view, shape)] for pair, shape in zip(pairs, shapes, strict=True)
    ]


def _positions_drawn(positions: Sequence[list[Any]], last: int) -> tuple[str, str]:
    """Marks of all positions up to a frame, and the ellipse of the newest; a line where one coordinate is measured."""
    marks, shape = "", ""
    for one in positions[: last + 1]:
        if not one:
            continue
        u, v, *shape_of = one
        shape = "" if None in (u, v) else _ring(u, v, *shape_of)
        if v is None:
            marks += f"M{u} 0V9999"
        elif u is None:
            marks += f"M0 {v}H{UNITS}"
        else:
            marks += f"M{u} {v - MARK}l{MARK} {MARK}l-{MARK} {MARK}l-{MARK} -{MARK}z"
    return marks, shape


def _opened(view: View, places: Sequence[Array]) -> list[int | None]:
    """The lines of all open landmarks in one, None in gaps."""
    return _pairs(view, np.concatenate(places)) if places else []


def _pointed(view: View, panel: Panel) -> list[list[int]]:
    """Place and direction of each frame's heading, [] without."""
    places = _pairs(view, panel.pointed[:, :2])
    return [
        [] if heading != heading else [*places[2 * k : 2 * k + 2], round(-float(np.degrees(heading)))]
        for k, heading in enumerate(panel.pointed[:, 2].tolist())
    ]


def _changes(view: View, panel: Panel) -> Iterable[list[list[int]]]:
    """Yields, for every frame, landmarks that are gone, and place and shape of new or changed ones."""
    slots: dict[int, int] = {}
    known: dict[int, list[int]] = {}
    for k, landmarks in enumerate(panel.maps):
        if k and landmarks is panel.maps[k - 1]:
            yield [[], []]
            continue
        places, shapes = _pairs(view, landmarks.xy), ellipses(landmarks.cov)
        now = {
            slots.setdefault(i, len(slots)): [*places[2 * j : 2 * j + 2], *_shape(view, shapes[j])]
            for j, i in enumerate(landmarks.ids.tolist())
        }
        gone = [slot for slot in known if slot not in now]
        changed = {slot: mark for slot, mark in now.items() if _differs(mark, known.get(slot))}
        for slot in gone:
            del known[slot]
        known |= changed
        yield [gone, [value for slot, mark in changed.items() for value in (slot, *mark)]]


def _differs(mark: list[int], before: list[int] | None) -> bool:
    """True if a change is visible: more than a unit, or 3 degrees."""
    if before is None or any(abs(a - b) > 1 for a, b in zip(mark[:4], before[:4], strict=True)):
        return True
    return 3 < (mark[4] - before[4]) % 180 < 177


def _still(panel: dict[str, Any], last: int) -> dict[str, str]:
    """The paths of a panel at the last frame, by name; all empty for a backend that has none."""
    names = ("trail", "marks", "dots", "rays", "open", "pointed", "belief", "robot")
    if not panel["pose"]:
        return dict.fromkeys((*names, "hits"), "") | {"said": panel["said"][-1]}
    marks: dict[int, list[int]] = {}
    for gone, changed in panel["maps"]:
        for slot in gone:
            del marks[slot]
        marks |= {changed[k]: changed[k + 1 : k + 6] for k in range(0, len(changed), 6)}
    u, v, degree = panel["pose"][-1]
    stopped = len(panel["pose"]) <= last
    seen = [] if stopped else panel["seen"][-1]
    return {
        "trail": _line(panel["trail"]),
        "marks": "".join(_ring(*mark) for mark in marks.values()),
        "dots": "".join(_dot(mark[:2]) for mark in marks.values()),
        "rays": "".join(f"M{seen[0]} {seen[1]}L{seen[k]} {seen[k + 1]}" for k in range(2, len(seen), 2))
        + "".join(
            _ring(seen[0], seen[1], r, r, 0) for r in ([] if stopped or "rings" not in panel else panel["rings"][-1])
        ),
        "open": _line(panel["open"][-1]) if "open" in panel else "",
        "pointed": "" if stopped or "pointed" not in panel else _needle(*panel["pointed"][-1]),
        "hits": "" if stopped or "hits" not in panel else _dots(panel["hits"][-1]),
        "belief": "" if stopped else _ring(u, v, *panel["belief"][-1]),
        "robot": _robot(u, v, degree, stopped=stopped),
        "said": panel["said"][-1],
    }


def _line(pairs: Sequence[int | None]) -> str:
    d, pen = "", "M"
    for u, v in zip(pairs[::2], pairs[1::2], strict=True):
        d, pen = (d, "M") if u is None else (f"{d}{pen}{u} {v}", "L")
    return d


def _ring(u: int, v: int, a: int, b: int, degree: int) -> str:
    if not a:
        return ""
    x, y = a * np.cos(np.radians(degree)), a * np.sin(np.radians(degree))
    arc = f"A{a} {b} {degree} 1 0 "
    return f"M{u - x:.0f} {v - y:.0f}{arc}{u + x:.0f} {v + y:.0f}{arc}{u - x:.0f} {v - y:.0f}"


def _dot(pair: Sequence[int | None]) -> str:
    return "" if pair[0] is None else f"M{pair[0]} {pair[1]}h0"


def _dots(pairs: Sequence[int | None]) -> str:
    return "".join(_dot(pairs[k : k + 2]) for k in range(0, len(pairs), 2))


def _needle(*pointed: int) -> str:
    """An arrow from a place in a direction, clockwise in degrees; "" of none."""
    if not pointed:
        return ""
    u, v, degree = pointed
    turned = np.radians(degree + np.array((0, 150, -150)))
    x, y = np.array((NEEDLE, 22, 22)) * np.array((np.cos(turned), np.sin(turned)))
    tip, one, other = (f"{a:.0f} {b:.0f}" for a, b in zip(u + x[0] + (0, *x[1:]), v + y[0] + (0, *y[1:]), strict=True))
    return f"M{u} {v}L{tip}L{one}M{tip}L{other}"


def _robot(u: int, v: int, degree: int, *, stopped: bool) -> str:
    """An arrow; where it has stopped, a cross."""
    if stopped:
        return f"M{u - 16} {v - 16}l32 32m-32 0l32 -32"
    turned = np.radians(degree) + np.array((0, 2.5, np.pi, -2.5))
    reach = np.array((28, 20, 8, 20))
    points = zip(u + reach * np.cos(turned), v + reach * np.sin(turned), strict=True)
    return "M" + "L".join(f"{x:.0f} {y:.0f}" for x, y in points) + "Z"


def _top(view: View) -> float | None:
    able = [p for p in view.panels if p.label != BASELINE] or view.panels
    errors = np.concatenate([panel.error for panel in able])
    errors = errors[np.isfinite(errors)]
    return float(errors.max()) or None if len(errors) else None


def _curve(view: View, panel: Panel, top: float) -> str:
    u = UNITS * np.arange(len(panel.error)) / max(len(view.steps) - 1, 1)
    v = CHART - 4 - (CHART - 8) * np.minimum(panel.error / top, 2)
    pairs = np.where(np.isfinite(v)[:, None], np.column_stack((u, v)), np.nan).ravel().tolist()
    return _line([None if np.isnan(c) else round(c) for c in pairs])
