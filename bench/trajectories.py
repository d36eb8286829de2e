"""The paths: a panel a backend, all over the same known path and cut to the same frame."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure
from scipy.special import chdtri

from ..frontend.se2 import Array, act, rotation
from .axes import short
from .exhibit import Exhibit
from .looks import BASELINE
from .numerals import number
from .scene import Scene, Trace
from .svg import INK, drawn

WIDTH = 225
"""Points, of a panel."""

TITLE = 38
"""Characters that fit above a panel."""

ELLIPSE_95 = float(np.sqrt(chdtri(2, 0.05)))
"""Half axes of a 95 % ellipse of two coordinates, in standard deviations."""

VISIBLE = 0.012
"""Ellipses are left out where their longer half axis is a smaller share of the frame."""

POSES, LANDMARKS = 8, 40
"""The most ellipses that a panel has."""


class Panel(NamedTuple):
    """One backend's paths, in the frame of the known one."""

    trace: Trace
    online: Array | None  # (m, 2)
    final: Array | None  # (m, 2)
    map: Array  # (n, 2)
    ellipses: Array  # (k, 5) x, y, half axes (m), angle (degrees)
    error: float | None  # root mean square distance from the known path, m, of the online path where there is one


class Frame(NamedTuple):
    """What every panel shows of the plane."""

    low: Array  # (2,)
    high: Array  # (2,)

    @property
    def size(self) -> Array:
        """(2,) m."""
        return self.high - self.low


def trajectories(name: str, scene: Scene) -> Iterator[Exhibit]:
    """A panel for each backend that has a path; its caption says what the frame cuts off."""
    panels = [panel for trace in scene.traces if (panel := _panel(scene, trace)) is not None]
    if not panels:
        return
    frame = _frame(scene, panels)
    for panel in panels:
        file = f"{name}-{panel.trace.slug}"
        margins = 46 + 11 * _title(scene, panel).count("\n")
        height = margins + (WIDTH - 40) * float(np.clip(frame.size[1] / frame.size[0], 0.35, 1.5))
        picture = drawn(file, WIDTH, height, lambda figure, panel=panel: _draw(figure, scene, panel, frame))
        yield Exhibit(file, panel.trace.label, _cut(panel, frame), picture)


def _panel(scene: Scene, trace: Trace) -> Panel | None:
    """None for a backend without any path."""
    a = trace.arrays
    online, final = (a.get(name, a.get(plain)) for name, plain in (("aligned", "online"), ("final_aligned", "final")))
    if online is None and final is None:
        return None
    prefix = "" if online is not None and "map_xy" in a else "final_"
    motion = a.get(f"{prefix}alignment", np.zeros(3))
    landmarks = act(motion, a.get(f"{prefix}map_xy", np.zeros((0, 2))).reshape(-1, 2))
    nearest = online if online is not None else final
    error = None
    if scene.known and nearest is not None and nearest.shape == scene.known["poses"].shape:
        error = float(np.sqrt(((nearest - scene.known["poses"])[:, :2] ** 2).sum(axis=1).mean()))
    return Panel(
        trace,
        None if online is None else online[:, :2],
        None if final is None else final[:, :2],
        landmarks,
        np.concatenate((_pose_ellipses(trace), _map_ellipses(a, prefix, landmarks, motion))),
        error,
    )


def _pose_ellipses(trace: Trace) -> Array:
    a = trace.arrays
    if "online" not in a or "cov" not in a:
        return np.zeros((0, 5))
    known = np.flatnonzero(np.isfinite(a["cov"]).all(axis=(1, 2)))
    at = known[np.linspace(0, len(known) - 1, min(POSES, len(known))).astype(int)] if len(known) else known
    motion = a.get("alignment", np.zeros(3))
    return _ellipses(act(motion, a["online"][at][:, :2]), a["cov"][at][:, :2, :2], motion)


def _map_ellipses(a: Any, prefix: str, landmarks: Array, motion: Array) -> Array:
    covs = a.get(f"{prefix}map_cov")
    if covs is None or not len(landmarks):
        return np.zeros((0, 5))
    at = np.linspace(0, len(landmarks) - 1, min(LANDMARKS, len(landmarks))).astype(int)
    return _ellipses(landmarks[at], covs[at], motion)


def _ellipses(centres: Array, covs: Array, motion: Array) -> Array:
    """(k, 5), turned with the alignment."""
    turn = rotation(motion[2])[:2, :2]
    values, vectors = np.linalg.eigh(turn @ covs @ turn.T)
    half = ELLIPSE_95 * np.sqrt(np.maximum(values, 0))
    angle = np.degrees(np.arctan2(vectors[:, 1, 1], vectors[:, 0, 1]))
    return np.column_stack((centres, half[:, 1], half[:, 0], angle))


def _frame(scene: Scene, panels: list[Panel]) -> Frame:
    """The known path and map with some room; with nothing known, where the middle 98 % of all paths are."""
    if scene.known:
        points = np.concatenate((scene.known["poses"][:, :2], scene.known.get("xy", np.zeros((0, 2)))))
        low, high = points.min(axis=0), points.max(axis=0)
    else:
        able = [p for p in panels if p.trace.label != BASELINE] or panels
        ends = [np.percentile(path, (1, 99), axis=0) for p in able for path in (p.online, p.final) if path is not None]
        ends += [np.percentile(p.map, (1, 99), axis=0) for p in able if len(p.map)]
        low, high = np.min([low for low, _ in ends], axis=0), np.max([high for _, high in ends], axis=0)
    room = 0.08 * max(*(high - low), 0.5)
    low, high = low - room, high + room
    thin = np.maximum(0, 0.35 * (high - low).max() - (high - low)) / 2  # a straight drive still has a height
    return Frame(low - thin, high + thin)


def _cut(panel: Panel, frame: Frame) -> str:
    beyond = [
        float(np.maximum(frame.low - path, path - frame.high).max())
        for path in (panel.online, panel.final)
        if path is not None
    ]
    return f"Leaves the frame by up to {number(max(beyond))} m." if max(beyond) > 0 else ""


def _draw(figure: Figure, scene: Scene, panel: Panel, frame: Frame) -> None:
    axes = figure.subplots()
    axes.set_aspect("equal")
    axes.set_xlim(frame.low[0], frame.high[0])
    axes.set_ylim(frame.low[1], frame.high[1])
    axes.set_xlabel("x, m")
    axes.set_ylabel("y, m")
    if scene.known:
        axes.plot(*scene.known["poses"][:, :2].T, color=INK, linewidth=0.9, alpha=0.75)
        if "xy" in scene.known:
            axes.plot(*scene.known["xy"].T, "+", color=INK, markersize=5, markeredgewidth=0.7, alpha=0.75)
    look = panel.trace.look
    if panel.online is not None:
        axes.plot(*panel.online.T, color=look.colour, linewidth=1.2)
    if panel.final is not None:
        style = (0, (4, 2)) if panel.online is not None else "-"
        axes.plot(*panel.final.T, color=look.colour, linewidth=1.2, linestyle=style)
    seen = panel.map[((panel.map >= frame.low) & (panel.map <= frame.high)).all(axis=1)]
    axes.plot(*seen.T, "o", markeredgecolor=look.colour, markerfacecolor="none", markersize=4, markeredgewidth=0.9)
    axes.set_title(_title(scene, panel), loc="left")
    _draw_ellipses(axes, panel, frame)


def _title(scene: Scene, panel: Panel) -> str:
    """Name and error, on two lines where one has no room."""
    title = short(panel.trace.label)
    if panel.error is not None:
        error = f"{number(panel.error)} m " + ("from reference" if scene.kind == "reference" else "ATE")
        title += (" · " if len(title + error) < TITLE else "\n") + error
    return title


def _draw_ellipses(axes: Axes, panel: Panel, frame: Frame) -> None:
    e = panel.ellipses[panel.ellipses[:, 2] > VISIBLE * frame.size.max()]
    look = {"facecolors": panel.trace.look.colour, "edgecolors": "none", "alpha": 0.22}
    axes.add_collection(
        EllipseCollection(
            2 * e[:, 2], 2 * e[:, 3], e[:, 4], units="xy", offsets=e[:, :2], offset_transform=axes.transData, **look
        )
    )
