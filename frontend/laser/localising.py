"""Localisation on a finished grid: each step's scan is matched with it, and gives the pose on the map.

From an unknown start, the last metres of scans are looked for everywhere on the map by branch and bound. A place counts
once no other one is nearly as good, and the steps that follow are where it has them.
"""

from collections import Counter
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...core.se2 import Array, compose, compose_jacobians
from ...core.small_matrices import inverse
from ..maps.occupancy import Occupancy
from ._matching import Hold, match
from ._search import Search
from .loops import FARTHEST, WEAK, searched
from .scanner import Scan, Scanner
from .settings import Settings
from .submap import Submap

AT_FIRST, ITERATIONS = 6, 25

ENOUGH = 0.6
"""Share of a scan's points on walls of the map from which on a match counts: people are in the way, and new things."""

SLACK, TURN_SLACK = 0.05, 0.02  # m and rad that a prediction may be off beyond its covariance

WINDOW, TURN_WINDOW = 0.5, 0.15
"""m and rad around the prediction in which a step that does not match is searched for at least; then it grows."""

NEAR = np.diag([0.01, 0.01, 0.0025])
"""m² and rad²; covariance, of 10 cm and 0.05 rad, that holds a scan where a search or the last steps have it.

Chosen, not measured: some cells, which is how fine the search is.
"""

SEVERAL = 3.0  # standard deviations of the prediction that the search goes to
CLOUD = 2.0  # m of path before the first search from an unknown start

RIVAL, APART, TURNED = 0.9, 1.0, 0.5
"""Share of the best place's score that another one, so many m or rad away, must not reach."""

CONFIRMED = 3  # steps that have to be where a place found on the map has them

MAP_SD, MAP_TURN_SD, SHARED = 0.012, 0.002, 5.0
"""m and rad, errors of the map, and the m of path over which matches share them.

A backend counts each match as new, so each is stated with the error of all of them together.
"""


class Fix(NamedTuple):
    """The pose of a step on the map."""

    step: int
    pose: Array  # (3,)
    cov: Array  # (3, 3) in the axes of the map
    inside: float  # share of the scan's points on walls of the map


class Localiser:
    """Places the steps of a drive on a map, one after another."""

    def __init__(
        self, known: Occupancy, scanner: Scanner, settings: Settings, start: tuple[Array, Array] | None
    ) -> None:
        """`start` is the pose (3,) at step 0 and its covariance (3, 3) on the map; None if unknown."""
        self.map = Submap.finished(known.cells, known.origin, replace(settings, cell=known.size), scanner)
        self.fixes: list[Fix] = []
        self.first: int | None = None if start is None else 0  # the step at which the robot was found
        self.missed = self.moved = self.seen = self.searches = 0  # steps without a fix; points not of the map, and all
        self.why: Counter[str] = Counter()
        self._settings, self._known = settings, known
        self._pose, self._cov = start if start is not None else (np.zeros(3), np.zeros((3, 3)))
        self._trail = list[Array]()  # poses of the last steps that confirm a place
        self._way = 0.0

    def place(self, k: int, delta: Array, cov: Array, scan: Scan, cloud: Array) -> None:
        """Takes step k: `delta` (3,) since the last one with its covariance, the scan, and the last metres (n, 2)."""
        self._way += float(np.hypot(delta[0], delta[1]))
        if self.first is None:
            self._find(k, delta, scan, cloud)
            return
        if k:
            by_pose, by_delta = compose_jacobians(self._pose, delta)
            self._cov = by_pose @ self._cov @ by_pose.T + by_delta @ cov @ by_delta.T
            self._pose = compose(self._pose, delta)
        fix = self._fixed(k, scan, cloud)
        if fix is None:
            self.missed += 1
            return
        self.fixes.append(fix)
        self._pose, self._cov = fix.pose, fix.cov

    def _fixed(self, k: int, scan: Scan, cloud: Array) -> Fix | None:
        """Matches the scan near the prediction, else searches for it."""
        s, submap = self._settings, self.map
        sd = np.sqrt(np.diag(self._cov))
        found = self._matched(scan, self._pose, self._cov + np.diag([SLACK**2, SLACK**2, TURN_SLACK**2]))
        if found is None:
            window = min(max(WINDOW, SEVERAL * float(max(sd[0], sd[1]))), s.window)
            turn = min(max(TURN_WINDOW, SEVERAL * float(sd[2])), s.turn_window)
            self.searches += 1
            place = searched(submap, scan, cloud, self._pose, window, turn, self.why)
            found = None if place is None else self._matched(scan, place.pose, NEAR)
        if found is None:
            return None
        pose, information, inside = found
        self.seen += len(scan.few)
        self.moved += round((1 - inside) * len(scan.few))
        return Fix(k, pose, _cov(information, s.step), inside)

    def _matched(self, scan: Scan, near: Array, cov: Array) -> tuple[Array, Array, float] | None:
        """The scan on the map, held near a pose; None where too few of its points are on walls."""
        if not len(scan.few):
            return None
        hold = Hold(near, inverse(cov))
        pose, information, inside = match(self.map.grid, scan.few, near, hold, self._settings.sd, AT_FIRST, ITERATIONS)
        return (pose, information, inside) if inside >= ENOUGH else None

    def _find(self, k: int, delta: Array, scan: Scan, cloud: Array) -> None:
        """Looks for an unknown start."""
        s = self._settings
        if self._trail:
            expected = compose(self._trail[-1], delta)
            found = self._matched(scan, expected, NEAR)
            if found is None:
                self.why["not where the steps before were"] += 1
                self._trail = []
            else:
                self._trail.append(found[0])
                if len(self._trail) > CONFIRMED:
                    self._pose, information, inside = found
                    self._cov, self.first = _cov(information, s.step), k
                    self.fixes.append(Fix(k, self._pose, self._cov, inside))
                return
        if self._way < CLOUD:
            return
        pose = self._everywhere(scan, cloud)
        self._trail = [] if pose is None else [pose]

    def _everywhere(self, scan: Scan, cloud: Array) -> Array | None:
        """The one place on the map where the last metres fit; None where there is none, or several."""
        s, submap = self._settings, self.map
        self.searches += 1
        shape = self._known.cells.shape[:2]
        far = min(float(np.percentile(np.hypot(*cloud.T), 90)), FARTHEST)
        points = cloud[:: max(1, len(cloud) // s.searched)]
        centre = np.array([*(self._known.origin + 0.5 * self._known.size * np.array(shape)), 0.0])
        window = 0.5 * self._known.size * max(shape)
        step = 1.5 * self._known.size / far
        everywhere = Search(points, centre, window, np.pi, step)
        pose, score = submap.best(everywhere, s.score)
        if score <= 0:
            self.why["no place"] += 1
            return None
        _, other = submap.best(everywhere, RIVAL * score, np.array([*pose, APART, TURNED]))
        if other > 0:
            self.why["several places"] += 1
            return None
        found = searched(submap, scan, cloud, pose, 4 * self._known.size, 2 * step, self.why)
        return None if found is None else found.pose


def _cov(information: Array, step: float) -> Array:
    """The covariance (3, 3) of a match, `step` (m) after the last, with that information."""
    together = max(1.0, SHARED / step)
    return inverse(information + WEAK) + together * np.diag([MAP_SD**2, MAP_SD**2, MAP_TURN_SD**2])
