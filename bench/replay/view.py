"""Computes what a replay shows at each of its frames, for film, page and Rerun alike."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.partial import RANGE
from ...core.se2 import Array, Ints, act
from ...core.truth.doubts import judges
from ..measure.nees import nees
from ..words.numerals import number
from ..words.styles import BASELINE, Look
from .course import Course, Landmarks
from .grids import Hits, Raster, Sketch, around, newest, raster, sketches
from .open_places import OpenPlaces
from .replay import Part, Replay

ELLIPSE_95 = 2.4477  # half axes of a 95 % ellipse, in standard deviations: root of chi-square's 95 % point
TRAIL = 1500  # points up to which a path is drawn without thinning, roughly
ASTRAY = 0.15  # share of the known path's extent that the frame leaves for dead reckoning beyond it
ACROSS = 0.1  # share of the picture that the robot goes between two points of a thinned path, at most
LAST = 10  # steps before each frame that are drawn where it goes further
FLATTEST, TALLEST = 0.3, 1.4  # bounds of a panel's height, in its widths: a straight drive is no line


class Sighted(NamedTuple):
    """The newest sightings since the frame before, from the backend's pose then."""

    origin: Array  # (2,)
    ends: Array  # (k, 2), of a bearing alone beyond the plane
    rings: Array  # (j,) m, the ranges alone: as measured, or less the errors that the backend has estimated


class Positions(NamedTuple):
    """The newest position that was measured in the world since the frame before, f frames; NaN where there is none."""

    xy: Array  # (f, 2) of the antenna; one of the two is NaN where the other alone was measured
    ellipse: Array  # (f, 3) as in Panel


class Panel(NamedTuple):
    """One backend's part; g frames of it, as far as it got."""

    label: str
    look: Look
    remark: str
    trail: Array  # (q, 2) the path at the trail's steps, as far as it came
    pose: Array  # (g, 3)
    ellipse: Array  # (g, 3) half axes (m) and angle (rad) of its position's covariance, NaN where not known
    maps: Sequence[Landmarks]  # (g,) without landmarks that are still open
    places: Sequence[Sequence[Array]]  # (g,) the lines (k, 2) on which each open landmark may be, NaN in gaps
    sighted: Sequence[Sighted]  # (g,)
    pointed: Array  # (g, 3) the newest heading measured since the frame before, at its step's position; else NaN
    error: Array  # (g,) m from the known path, not aligned
    nees: Array  # (g,) over its 3 degrees of freedom: 1 is consistent
    step_us: Array  # (g,) recorded CPU time of the frame's step
    grids: Sequence[Sketch]  # of a laser log, in the order of their frames
    hits: Hits  # (g,) of a laser log, the newest scan's returns (k, 2) at every frame


class View(NamedTuple):
    """A replay in numbers; f frames."""

    title: str
    known: str  # as in Replay
    low: Array  # (2,) of the plane that every panel shows
    high: Array  # (2,)
    steps: Ints  # (f,)
    t: Array  # (f,) s since the log began
    timed: bool  # the log has times, and does not number its steps
    at: Ints  # (f,) number of the trail's points up to the frame
    pieces: bool  # the trail is the last steps before each frame, as those between would be lines across the picture
    truth: Array  # (q, 2) along the trail, NaN where not known
    robot: Array  # (f, 3) the known pose, NaN where there is none
    places: Array  # (l, 2) the known landmarks
    positions: Positions
    reckoned: Array  # (q, 2)
    panels: Sequence[Panel]
    cells: Raster | None  # of the grids, None without laser scans
    rings: bool  # the log has ranges alone
    corrected: bool  # of some backend less the scale and offset that it has estimated

    @property
    def rays(self) -> bool:
        """True where a sighting is drawn as a ray, at some frame."""
        return any(len(one.ends) for panel in self.panels for one in panel.sighted)

    @property
    def mapped(self) -> bool:
        """True where a backend has landmarks, at some frame."""
        return any(len(one.ids) for panel in self.panels for one in panel.maps)

    @property
    def fixed(self) -> bool:
        """True where a position was measured in the world."""
        return bool(np.isfinite(self.positions.xy).any())

    @property
    def pointed(self) -> bool:
        """True where a heading was measured in the world."""
        return any(np.isfinite(panel.pointed).any() for panel in self.panels)

    @property
    def open(self) -> bool:
        """True where a landmark is open, at some frame."""
        return any(len(some) for panel in self.panels for some in panel.places)


class _Trail(NamedTuple):
    """The steps that paths are drawn through, in order."""

    steps: Ints  # (q,)
    gap: NDArray[np.bool_]  # (q,) the line is broken here, and goes on with the next

    def along(self, path: Array) -> Array:
        """The points (p, 2) of a path (n, 2 or 3) as far as it came, NaN in gaps."""
        there = self.steps < len(path)
        return np.where(self.gap[there, None], np.nan, path[self.steps[there], :2])


def _trail(replay: Replay, size: float) -> _Trail:
    """Thins paths in a picture whose longer side is `size` m."""
    log, frames = replay.log.log, replay.frames
    n = len(log)
    thinned = np.unique(np.concatenate((frames, np.linspace(0, n - 1, min(n, TRAIL)).round().astype(np.int64))))
    way = float(np.hypot(*log.delta[1:, :2].T).sum())
    if n <= TRAIL or way / len(thinned) <= ACROSS * size:
        return _Trail(thinned, np.zeros(len(thinned), bool))
    first = np.maximum(frames - LAST, np.append(-1, frames[:-1]) + 1)
    pieces = [np.append(begin, np.arange(begin, end + 1)) for begin, end in zip(first, frames, strict=True)]
    begins = np.cumsum([0, *map(len, pieces[:-1])])
    steps = np.concatenate(pieces)
    return _Trail(steps, np.isin(np.arange(len(steps)), begins))


def view(replay: Replay) -> View:
    """Computes the view."""
    log, truth = replay.log
    n = len(log)
    poses = np.full((n, 3), np.nan)
    if truth is not None and len(truth.t):
        poses[np.searchsorted(log.t, truth.t)] = truth.poses
    known = None if truth is None else truth.map
    places = np.zeros((0, 2)) if known is None else known.xy
    seconds = log.t - log.t[0]
    low, high = _box(replay, poses, places)
    cells = None if log.scans is None else raster(low, high)
    trail = _trail(replay, float((high - low).max()))
    return View(
        title=f"{replay.dataset} · seed {replay.seed}",
        known=replay.known,
        low=low,
        high=high,
        steps=replay.frames,
        t=seconds[replay.frames],
        timed=replay.timed,
        at=np.searchsorted(trail.steps, replay.frames, "right"),
        pieces=bool(trail.gap.any()),
        truth=trail.along(poses),
        robot=poses[replay.frames],
        places=places,
        positions=_positions(replay),
        reckoned=trail.along(replay.reckoned),
        panels=[_panel(replay, part, poses, trail, cells, float(np.hypot(*(high - low)))) for part in replay.parts],
        cells=cells,
        rings=log.partial is not None and bool((log.partial.kind == RANGE).any()),
        corrected=any(part.course.constant is not None for part in replay.parts),
    )


def grid_at(panel: Panel, frame: int) -> Sketch | None:
    """The newest grid at a frame; None before the first one, and without any."""
    return next((grid for grid in reversed(panel.grids) if grid.frame <= frame), None)


def ellipses(cov: Array) -> Array:
    """Returns (k, 3) half axes (m), longer first, and angle (rad) of 95 % ellipses of (k, 2, 2); NaN if unknown."""
    found = np.full((len(cov), 3), np.nan)
    known = np.isfinite(cov).all(axis=(1, 2))
    if known.any():
        values, vectors = np.linalg.eigh(cov[known])
        half = ELLIPSE_95 * np.sqrt(np.maximum(values, 0))
        found[known] = np.column_stack((half[:, 1], half[:, 0], np.arctan2(vectors[:, 1, 1], vectors[:, 0, 1])))
    return found


def said(view: View, panel: Panel, frame: int) -> str:
    """Writes a panel's numbers at the frame."""
    if frame >= len(panel.pose):
        return "stopped" if len(panel.pose) else "nothing to show"
    words: list[str] = []
    if np.isfinite(panel.error[frame]):
        words.append(f"{number(panel.error[frame])} m from {view.known}")
    if np.isfinite(panel.nees[frame]):
        words.append(f"NEES {number(panel.nees[frame])}")
    if np.isfinite(panel.step_us[frame]):
        words.append(f"{number(panel.step_us[frame])} µs")
    return "  ·  ".join(words)


def when(view: View, frame: int) -> str:
    """Writes the frame's time and step."""
    step = f"step {view.steps[frame]:,} of {view.steps[-1]:,}"
    return f"{view.t[frame]:,.1f} s  ·  {step}" if view.timed else step


def _panel(replay: Replay, part: Part, poses: Array, trail: _Trail, cells: Raster | None, across: float) -> Panel:
    """A part's panel, of a plane that is `across` m from corner to corner."""
    course, log = part.course, replay.log.log
    scans = log.scans if len(course.maps) else None
    frames = replay.frames[: len(course.maps)]
    path, cov = course.path[frames], course.cov[: len(frames)]
    true = poses[frames]
    seen = np.isfinite(true).all(axis=1)
    timed = len(part.step_us) == len(log) and not course.final  # a batch keeps the steps until the end
    consistency = np.full(len(frames), np.nan)
    if replay.log.truth is not None and judges(log, replay.log.truth) and seen.any():  # as in the record
        consistency[seen] = nees(path[seen], cov[seen], true[seen]) / 3
    open_places = OpenPlaces(log, course, across)
    online = not course.final
    still = [open_places.at(k, m) if online else (m, []) for k, m in zip(frames.tolist(), course.maps, strict=True)]
    return Panel(
        label=part.label,
        look=part.look,
        remark=part.remark,
        trail=trail.along(course.path),
        pose=path,
        ellipse=ellipses(cov[:, :2, :2]),
        maps=[known for known, _ in still],
        places=[some for _, some in still],
        sighted=[_sighted(replay, course, k, across) for k in range(len(frames))],
        pointed=_pointed(replay, course, len(frames)),
        error=np.hypot(*(path - true)[:, :2].T),
        nees=consistency,
        step_us=part.step_us[frames] if timed else np.full(len(frames), np.nan),
        grids=[] if scans is None or cells is None else sketches(scans, course, replay.frames, cells),
        hits=[] if scans is None else newest(scans, course.path, frames),
    )


def _sighted(replay: Replay, course: Course, frame: int, far: float) -> Sighted:
    """The newest sightings at the frame; bearings alone are rays of length `far`."""
    log, last, path = replay.log.log, int(replay.frames[frame]), course.path
    first = int(replay.frames[frame - 1]) + 1 if frame else 0
    rows = log.sighting_first
    parts = rows if log.partial is None else log.partial.first
    some = [k for k in range(last, first - 1, -1) if rows[k + 1] > rows[k] or parts[k + 1] > parts[k]]
    if not some:
        return Sighted(path[last, :2], np.zeros((0, 2)), np.zeros(0))
    k = some[0]
    distance, bearing = log.z[rows[k] : rows[k + 1]].T
    rings = np.zeros(0)
    if log.partial is not None:
        alone = log.partial.at(k)
        rings, rays = alone.z[alone.kind == RANGE], alone.z[alone.kind != RANGE]
        if course.constant is not None:
            rings = np.maximum(rings - course.constant.range_offset[0], 0) / (1 + course.constant.range_scale[0])
        distance, bearing = np.append(distance, np.full(len(rays), far)), np.append(bearing, rays)
    ends = act(path[k], np.column_stack((distance * np.cos(bearing), distance * np.sin(bearing))))
    return Sighted(path[k, :2], ends, rings)


def _newest(replay: Replay, measured: NDArray[np.bool_]) -> Ints:
    """(f,) the last fix that is `measured` (m,) since the frame before; -1 where there is none."""
    fixes = replay.log.log.fixes
    newest = np.full(len(replay.frames), -1)
    if fixes is not None:
        rows = np.flatnonzero(measured)
        newest[np.searchsorted(replay.frames, fixes.step[rows])] = rows  # ascending: the last of a frame stays
    return newest


def _positions(replay: Replay) -> Positions:
    """The positions in the world, one for a frame at most."""
    xy, cov = np.full((len(replay.frames), 2), np.nan), np.full((len(replay.frames), 2, 2), np.nan)
    fixes = replay.log.log.fixes
    if fixes is not None:
        newest = _newest(replay, ~np.isnan(fixes.z[:, 0]) | ~np.isnan(fixes.z[:, 1]))
        xy[newest >= 0], cov[newest >= 0] = fixes.z[newest[newest >= 0], :2], fixes.cov[newest[newest >= 0], :2, :2]
    return Positions(xy, ellipses(cov))


def _pointed(replay: Replay, course: Course, frames: int) -> Array:
    """(g, 3) the headings in the world at the first frames, where the path was then, as measured."""
    found, fixes = np.full((frames, 3), np.nan), replay.log.log.fixes
    if fixes is not None:
        newest = _newest(replay, ~np.isnan(fixes.z[:, 2]))[:frames]
        rows = newest[newest >= 0]
        found[newest >= 0] = np.column_stack((course.path[fixes.step[rows], :2], fixes.z[rows, 2]))
    return found


def _box(replay: Replay, poses: Array, places: Array) -> tuple[Array, Array]:
    """Frames the known path and map with some room; with none known, the middle 98 % of all paths and maps."""
    if replay.known:
        points = np.concatenate((poses[np.isfinite(poses).all(axis=1), :2], places))
        low, high = points.min(axis=0), points.max(axis=0)
        more = ASTRAY * (high - low).max()
        also = [p.course.path[:, :2] for p in replay.parts if len(p.course.path)]
        also += [p.course.maps[-1].xy for p in replay.parts if p.course.maps]
        beyond = np.concatenate([replay.reckoned[:, :2], *also])
        low = np.maximum(np.minimum(low, beyond.min(axis=0)), low - more)
        high = np.minimum(np.maximum(high, beyond.max(axis=0)), high + more)
        paths = [poses] if np.isfinite(poses).all() else _smoothed(replay)
    else:
        able = [p for p in replay.parts if p.label != BASELINE] or replay.parts
        points = [p.course.path[:, :2] for p in able if len(p.course.path)] or [replay.reckoned[:, :2]]
        points += [p.course.maps[-1].xy for p in able if p.course.maps and len(p.course.maps[-1].xy)]
        ends = np.array([np.percentile(some, (1, 99), axis=0) for some in points])
        low, high = ends[:, 0].min(axis=0), ends[:, 1].max(axis=0)
        paths = _smoothed(replay)
    if replay.log.log.scans is not None:
        corners = around(replay.log.log.scans, paths)
        low, high = np.minimum(low, corners.min(axis=0)), np.maximum(high, corners.max(axis=0))
    room = 0.08 * max(*(high - low), 0.5)
    low, high = low - room, high + room
    width, height = high - low
    short = np.maximum(0, (height / TALLEST - width, FLATTEST * width - height)) / 2
    return low - short, high + short


def _smoothed(replay: Replay) -> list[Array]:
    """The paths of the whole log by backends that reached its end, smoothed ones where there are any."""
    ended = [p for p in replay.parts if p.label != BASELINE and len(p.course.path) == len(replay.log.log)]
    best = [p.course.revised[-1].path for p in ended if p.course.revised]
    return best or [p.course.path for p in ended] or [replay.reckoned]
