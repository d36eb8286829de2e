"""Loop closures: a step's view is searched for in submaps that the robot drew earlier, and what is found is verified.

What is searched with is not one scan, which looks alike between any two doors, but the last metres of path together.
A loop far from where the estimate has it counts once several steps ask for the same correction (`Surprises`).
"""

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.se2 import Array, between, compose, rotation, wrap
from ...core.small_matrices import inverse
from ..maps._grid import one_a_cell, seen_through
from ._matching import USUAL, Hold, match, spread
from ._search import Search
from .scanner import Scan
from .settings import Settings
from .submap import Submap

LEAST_POINTS = 30  # points of a scan that is searched for

REFINED, ALONE = 4, 3
"""Cells around a point in which its wall is looked for at first: of the cloud, and of the scan alone."""

SLACK = 0.25  # m before its end from which on a beam may pass through a wall

WEAK = np.diag([4.0, 4.0, 25.0])
"""Information that a match has at least, of x, y (1/m²) and heading (1/rad²): along a corridor the points have none."""

HELD = np.diag([100.0, 100.0, 400.0])
"""Information with which the single scan is held where the cloud was matched."""

NOTHING = np.zeros((3, 3))

CONTRADICTED = 21.1
"""Squared distance from the optimum, in its own covariance, of a loop that is left out: 1 in 10,000 right ones."""

FARTHEST = 12.0  # m; how far a point may be at most to set the step of the search in heading


class ScanLoop(NamedTuple):
    """The pose of a step in the frame of an earlier one, as backends get it."""

    to: int
    step: int
    delta: Array  # (3,)
    cov: Array  # (3, 3) in the axes of delta
    score: float


class Match(NamedTuple):
    """A scan placed on a submap."""

    pose: Array  # (3,) in the axes of the matcher's path
    cov: Array  # (3, 3) of that place, by the points
    score: float


def cov_by_points(slope: Array, scatter: Array, settings: Settings) -> Array:
    """The covariance (3, 3) of a place by its points alone, in the axes of the path; see `_matching.spread`.

    WEAK is in the units of a score, in which points that err as is usual have USUAL times their information.
    """
    own = inverse(slope + USUAL * WEAK)
    return own @ ((1 + settings.map_share) * scatter + USUAL**2 * WEAK) @ own


def cov_between(before: Array, after: Array, before_cov: Array, after_cov: Array) -> Array:
    """The covariance (3, 3) of the motion between two places (3,) on one submap, each with its own error."""
    R = rotation(float(before[2])).T
    by_before = -R
    by_before[:2, 2] = (R @ (after - before))[[1, 0]] * (1.0, -1.0)
    return R @ after_cov @ R.T + by_before @ before_cov @ by_before.T


def search_of(cloud: Array, guess: Array, window: float, turn: float, settings: Settings) -> Search:
    """The search for a cloud (k, 2) around `guess`; a turn's step moves all but the farthest points by 1.5 cells."""
    far = min(float(np.percentile(np.hypot(*cloud.T), 90)), FARTHEST)
    few = cloud[:: max(1, len(cloud) // settings.searched)]
    return Search(few, guess, window, turn, 1.5 * settings.cell / far)


def searched(
    submap: Submap, scan: Scan, cloud: Array, guess: Array, window: float, turn: float, why: Counter[str]
) -> Match | None:
    """Looks for a scan, seen from within `window` (m) and `turn` (rad) of `guess`, in a finished submap.

    `cloud` (k, 2) are the points of the last scans in this one's frame. The first test that is not passed is counted in
    `why`.
    """
    s = submap.settings
    if len(scan.few) < LEAST_POINTS:
        why["too few points"] += 1
        return None
    pose, score = submap.best(search_of(cloud, guess, window, turn, s), s.score)
    if score <= 0:
        why["no place"] += 1
        return None
    grid = submap.grid
    pose, _, inside = match(grid, cloud, pose, Hold(pose, NOTHING), s.sd, REFINED, 25)
    if inside < s.inside:
        why["too few points on walls"] += 1
        return None
    through, free = seen_through(grid, pose, submap.scanner.pose[:2], scan.few, SLACK)
    if through > s.through:
        why["beams through walls"] += 1
        return None
    if free > s.free:
        why["ends in free space"] += 1
        return None
    alone, _, inside = match(grid, scan.few, pose, Hold(pose, HELD), s.sd, ALONE, 25)
    off = between(pose, alone)
    if inside < s.inside or np.hypot(off[0], off[1]) > s.alone or abs(off[2]) > s.alone_turn:
        why["the scan alone disagrees"] += 1
        return None
    return Match(alone, cov_by_points(*spread(grid, scan.few, alone, s.sd), s), score)


def cloud(pose: Array, poses: Sequence[Array], scans: Sequence[Scan], size: float) -> Array:
    """The points of scans taken at `poses`, in the frame of `pose`, one a cell of that size: (k, 2)."""
    parts = list[Array]()
    for at, scan in zip(poses, scans, strict=True):
        x, y, turned = between(pose, at)
        c, s = np.cos(turned), np.sin(turned)
        parts.append(scan.few @ np.array([[c, s], [-s, c]]) + (x, y))
    return one_a_cell(np.concatenate(parts), size)


def loop_to(found: Match, submap: Submap, poses: Array) -> int:
    """The step of the submap nearest to a match: least of the submap's own bend enters; `poses` are of all steps."""
    at = poses[submap.steps]
    return submap.steps[int(np.argmin(np.hypot(*(at[:, :2] - found.pose[:2]).T)))]


def loop_of(found: Match, to: int, step: int, place: Array, place_cov: Array, stale: Array) -> ScanLoop:
    """A match as a loop to a step of the submap at `place` (3,) on the matcher's path, with its covariance there.

    `stale` (3, 3) is the covariance by the age of both scans.
    """
    cov = cov_between(place, found.pose, place_cov, found.cov) + stale
    return ScanLoop(to, step, between(place, found.pose), cov, found.score)


def contradicted(loops: Sequence[ScanLoop], estimate: Array) -> NDArray[np.bool_]:
    """Which loops all others and the odometry contradict, at their optimum `estimate` (k, 3)."""
    to, step = (np.array([getattr(loop, name) for loop in loops], np.int64) for name in ("to", "step"))
    off = np.array([loop.delta for loop in loops]).reshape(-1, 3) - between(estimate[to], estimate[step])
    off[:, 2] = wrap(off[:, 2])
    information = inverse(np.array([loop.cov for loop in loops]).reshape(-1, 3, 3))
    return np.einsum("ni,nij,nj->n", off, information, off) > CONTRADICTED


class Surprises:
    """Loops that lie far from where the estimate has them, until enough of them agree."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._waiting: list[tuple[ScanLoop, float]] = []  # and the path when it was found

    def is_expected(self, off: Array, since: float) -> bool:
        """Tells if a match may be `off` (3,) the estimate, `since` metres after the last correction."""
        s = self._settings
        return bool(
            np.hypot(off[0], off[1]) < s.expected + s.expected_by_path * since
            and abs(off[2]) < s.expected_turn + s.expected_turn_by_path * since
        )

    def agreed(self) -> None:
        """Forgets all: a loop where it was expected says that the estimate is right."""
        self._waiting.clear()

    def add(self, loop: ScanLoop, path: float, estimate: Array) -> list[ScanLoop]:
        """Adds a loop; returns all that ask for the same correction once they are enough, else none."""
        s = self._settings
        self._waiting = [(one, at) for one, at in self._waiting if path - at < s.confirm_within]
        self._waiting.append((loop, path))
        now = estimate[loop.step]
        mine = _corrected(loop, now, estimate)
        same = list[tuple[ScanLoop, float]]()
        for one, at in self._waiting:
            off = between(mine, _corrected(one, now, estimate))
            if np.hypot(off[0], off[1]) < s.same and abs(off[2]) < s.same_turn:
                same.append((one, at))
        enough = len({one.step for one, _ in same}) >= s.confirm
        if not enough or path - min(at for _, at in same) <= s.confirm_path:
            return []
        self._waiting.clear()
        return [one for one, _ in same]


def _corrected(loop: ScanLoop, now: Array, estimate: Array) -> Array:
    """The pose `now` as a loop would have it."""
    return compose(compose(estimate[loop.to], loop.delta), between(estimate[loop.step], now))
