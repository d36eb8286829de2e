"""Prepares each backend's panel of paths: path and map in the frame of the known path, and ellipses."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from ...core.se2 import Array, act, rotation
from ..drawing.axes import drawable
from ..drawing.figure import Curve
from ..drawing.figure_maker import curve
from ..measure.locating import poses_judged
from ..words.styles import BASELINE
from .drawn_log import DrawnLog, Trace

ELLIPSE_95 = float(np.sqrt(chdtri(2, 0.05)))  # half axes of a 95 % ellipse of two coordinates, in standard deviations
POSES, LANDMARKS = 8, 40  # the most ellipses that a panel has
MOST_POINTS = 300  # points of a path in a page's plot data


class Panel(NamedTuple):
    """One backend's paths, in the frame of the known one."""

    trace: Trace
    t: Array  # (m,) s since the log began
    online: Array | None  # (m, 2)
    final: Array | None  # (m, 2)
    map: Array  # (n, 2)
    ellipses: Array  # (k, 5) x, y, half axes (m), angle (degrees)
    error: float | None  # root mean square distance from the known path, m, of the online path where there is one

    @property
    def curves(self) -> list[Curve]:
        """Returns its paths as plot data."""
        paths = {False: self.online, True: self.final}
        return [
            curve(self.trace.label, *path.T, t=self.t, final=final, most=MOST_POINTS)
            for final, path in paths.items()
            if path is not None
        ]


class Frame(NamedTuple):
    """The part of the plane that every panel shows."""

    low: Array  # (2,)
    high: Array  # (2,)

    @property
    def size(self) -> Array:
        """Returns its size (2,), m."""
        return self.high - self.low


def panels(log: DrawnLog) -> list[Panel]:
    """Prepares a panel for every backend that has a path."""
    return [panel for trace in log.traces if (panel := _panel(log, trace)) is not None]


def _panel(log: DrawnLog, trace: Trace) -> Panel | None:
    """Prepares a panel; None for a backend without any path."""
    a = trace.arrays
    online, final = (a.get(name, a.get(plain)) for name, plain in (("aligned", "online"), ("final_aligned", "final")))
    if online is None and final is None:
        return None
    prefix = "" if online is not None and "map_xy" in a else "final_"
    motion = a.get(f"{prefix}alignment", np.zeros(3))
    landmarks = act(motion, a.get(f"{prefix}map_xy", np.zeros((0, 2))).reshape(-1, 2))
    there: NDArray[np.bool] = np.asarray(np.isfinite(drawable(landmarks)).all(axis=1))
    nearest = online if online is not None else final
    error = None
    if log.known and nearest is not None and "at" in a:
        error = float(np.sqrt(((nearest - poses_judged(log.known, a))[:, :2] ** 2).sum(axis=1).mean()))
    t = a["t"][a["at"]] if "at" in a else a["t"]
    return Panel(
        trace,
        t - a["t"][0],
        None if online is None else online[:, :2],
        None if final is None else final[:, :2],
        landmarks[there],
        np.concatenate((_pose_ellipses(trace), _map_ellipses(a, prefix, landmarks, there, motion))),
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


def _map_ellipses(a: Any, prefix: str, landmarks: Array, there: NDArray[np.bool], motion: Array) -> Array:
    covs = a.get(f"{prefix}map_cov")
    if covs is None or not there.any():
        return np.zeros((0, 5))
    landmarks, covs = landmarks[there], covs[there]
    at = np.linspace(0, len(landmarks) - 1, min(LANDMARKS, len(landmarks))).astype(int)
    return _ellipses(landmarks[at], covs[at], motion)


def _ellipses(centres: Array, covs: Array, motion: Array) -> Array:
    """Returns ellipses (k, 5), turned with the alignment, of those covariances that can be drawn."""
    known = np.isfinite(drawable(covs)).all(axis=(1, 2))
    centres, covs = centres[known], covs[known]
    turn = rotation(motion[2])[:2, :2]
    values, vectors = np.linalg.eigh(turn @ covs @ turn.T)
    half = ELLIPSE_95 * np.sqrt(np.maximum(values, 0))
    angle = np.degrees(np.arctan2(vectors[:, 1, 1], vectors[:, 0, 1]))
    return np.column_stack((centres, half[:, 1], half[:, 0], angle))


def _finite(points: Array) -> Array:
    """The points (m, 2) of those (n, 2) that an axis can have."""
    return points[np.isfinite(drawable(points)).all(axis=1)]


def framed(log: DrawnLog, panels: Sequence[Panel]) -> Frame:
    """Frames the known path and map with some room; with nothing known, the middle 98 % of all paths."""
    if log.known:
        points = _finite(np.concatenate((log.known["poses"][:, :2], log.known.get("xy", np.zeros((0, 2))))))
        points = points if len(points) else np.zeros((1, 2))
        low, high = points.min(axis=0), points.max(axis=0)
    else:
        able = [p for p in panels if p.trace.label != BASELINE] or panels
        shown = [_finite(a) for p in able for a in (p.online, p.final, p.map) if a is not None]
        ends = [np.percentile(points, (1, 99), axis=0) for points in shown if len(points)] or [np.zeros((2, 2))]
        low, high = np.min([low for low, _ in ends], axis=0), np.max([high for _, high in ends], axis=0)
    room = 0.08 * max(*(high - low), 0.5)
    low, high = low - room, high + room
    thin = np.maximum(0, 0.35 * (high - low).max() - (high - low)) / 2  # a straight drive still has a height
    return Frame(low - thin, high + thin)
