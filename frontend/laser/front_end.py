"""The laser front end: scans one after another become steps with odometry factors and loop closures.

Hess, Kohler, Rapp and Andor, Real-time loop closure in 2D LIDAR SLAM, ICRA 2016. Scans are matched with a submap of the
last metres, steps with submaps of earlier ones. The matcher's path is never corrected; the front end's own pose graph
only says where to look for loops.
"""

from collections import Counter, deque
from typing import NamedTuple

import numpy as np

from ...core.se2 import Array, between, compose, rotation
from ...core.small_matrices import inverse
from ._matching import Hold, spread
from .estimate import ScanStep, StepPoses
from .finished import Finished
from .guesses import beyond, wheels_cov
from .localising import Localiser
from .loops import (
    Match,
    ScanLoop,
    Surprises,
    cloud,
    contradicted,
    cov_between,
    cov_by_points,
    loop_of,
    loop_to,
    searched,
)
from .rows import Rows
from .scanner import Scan, Scanner
from .settings import Settings
from .submap import Submap
from .tracking import Placed, Tracker

NOTHING = np.zeros((3, 3)), np.zeros((3, 3))
"""Slope and scatter of a scan that was not matched."""

OFTEN = 0.1
"""s; scans in a burst are taken to be that far apart where a speed is computed."""


class KeyScan(NamedTuple):
    """The match of a step's scan on the matcher's path."""

    pose: Array  # (3,) by its points and by what it was held to
    slope: Array  # (3, 3) the information of its points alone, in the axes of the path
    scatter: Array  # (3, 3) the covariance of what they ask for; see `_matching.spread`
    hold: Hold | None  # None: it was not matched
    base: int  # an earlier step, the first one that the submap has in which it was matched
    counts: bool  # it was placed by its points, and so were all scans since the step before
    doubt: Array  # (3, 3) in the axes of the step before: other places that the scans did not tell from theirs
    stale: Array  # (3, 3) the covariance by its age


class FrontEnd:
    """Takes scans in the order of time."""

    def __init__(
        self, scanner: Scanner, settings: Settings, wheels: bool = True, localiser: Localiser | None = None
    ) -> None:
        """With a `localiser`, steps are placed on its map instead of being searched for in earlier submaps."""
        self.scanner, self.settings, self.wheels, self.localiser = scanner, settings, wheels, localiser
        self.steps: list[ScanStep] = []
        self.loops: list[ScanLoop] = []
        self.keys: list[KeyScan] = []  # of the steps
        self.t: list[float] = []
        self.finished = Finished(settings)
        self.turned_down: Counter[str] = Counter()
        self.tried = self.confirmed = 0
        self.tracker = Tracker(settings)
        self._active: list[Submap] = []
        self._way = 0.0  # m, with turning
        self._drawn: deque[tuple[Array, Scan]] = deque(maxlen=settings.cloud)
        self._path = Rows(3)
        self._poses = Rows(3)  # of the steps, on the matcher's path
        self._rates = Rows(2)  # m/s, rad/s at the steps
        self._estimate = StepPoses(settings)
        self._surprises = Surprises(settings)
        self._doubts = list[Placed]()  # since the last step: scans or wheels that do not count, places not told apart
        self._looped = self._corrected = 0.0  # the way at the last loop, and at the last one that the estimate has
        self._loops_then = 0  # their number at the last correction

    def scan(self, t: float, motion: Array | None, ranges: Array, angles: Array | None = None) -> None:
        """Takes a scan; `motion` (3,) is the odometry's since the one before, None at first or without wheels.

        `angles` (b,) are those of its beams where they vary.
        """
        scan = Scan(self.scanner.points(ranges, angles), self.settings.spacing)
        if not self._active:
            first = self.tracker.start(t, scan)
            self._record(t, first.pose)
            self._draw(first.pose, scan)
            self._new_step(first, NOTHING, np.zeros(2), 0)
            return
        for placed in self.tracker.take(t, motion, scan, self._active[0]):
            self._place(placed)

    @property
    def path(self) -> Array:
        """(n, 3) of every scan, on the matcher's path."""
        return self._path.array

    @property
    def estimate(self) -> Array:
        """(k, 3) of the steps, by the pose graph."""
        return self._estimate.poses

    @property
    def first(self) -> int:
        """The first step of the log: on a map, the one at which the robot was found."""
        return 0 if self.localiser is None else self.localiser.first or 0

    @property
    def shift(self) -> int:
        """The offset of a step's number in the log: 1 on a map, as the log begins with the map's frame."""
        return 0 if self.localiser is None else 1 - self.first

    def finish(self) -> None:
        """Places the last scans, optimises the estimate once more, and leaves out loops that all others contradict."""
        for placed in self.tracker.decide():
            self._place(placed)
        while self.loops:
            self._estimate.move(self.steps, self.loops, 100)
            wrong = contradicted(self.loops, self.estimate)
            if not wrong.any():
                break
            self.turned_down["the others contradict it"] += int(wrong.sum())
            self.loops = [loop for loop, out in zip(self.loops, wrong.tolist(), strict=True) if not out]

    def _record(self, t: float, pose: Array) -> None:
        self.t.append(t)
        self._path.append(pose)

    def _place(self, placed: Placed) -> None:
        """Takes a scan whose pose is known: draws it, and ends a step."""
        s, pose = self.settings, placed.pose
        moved = between(self.path[-1], pose) / max(placed.t - self.t[-1], OFTEN)
        if not (placed.wheels and placed.points) or placed.off is not None:
            self._doubts.append(placed)
        matched_in, base = self._active[0].grid, self._active[0].steps[0]
        new = beyond(between(self._poses.array[-1], pose), s.step, s.turn)
        told = NOTHING  # before the scan is drawn itself
        if new and placed.points and placed.hold is not None:
            told = spread(matched_in, placed.scan.few, pose, s.sd)
        share = s.denser if self._way < s.dense_start else 1.0
        if beyond(between(self._drawn[-1][0], pose), share * s.insert_step, share * s.insert_turn):
            self._draw(pose, placed.scan)
        self._record(placed.t, pose)
        if new:
            self._new_step(placed, told, np.array([np.hypot(moved[0], moved[1]), abs(moved[2])]), base)

    def _draw(self, pose: Array, scan: Scan) -> None:
        """Draws a scan into the active submaps, and starts and ends them."""
        s = self.settings
        if self._drawn:
            moved = between(self._drawn[-1][0], pose)
            self._way += float(np.hypot(moved[0], moved[1]) + s.turn_path * abs(moved[2]))
        self._drawn.append((pose, scan))
        if not self._active or self._way - self._active[-1].born > s.submap_path:
            self._active.append(Submap(pose, s, self.scanner, self._way))
            self._active[-1].steps.append(max(len(self.steps) - 1, 0))
        for submap in self._active:
            submap.insert(pose, scan)
        if len(self._active) > 2:
            done = self._active.pop(0)
            done.finish(self._way)
            self.finished.add(done, self.estimate)

    def _new_step(self, placed: Placed, told: tuple[Array, Array], rate: Array, base: int) -> None:
        """Ends a step: its odometry factor, and its loops.

        `told` is the match's slope and scatter; `base` is the first step of the submap it was matched in.
        """
        s, k, pose, scan = self.settings, len(self.steps), placed.pose, placed.scan
        self._rates.append(rate)
        doubt, counts = np.zeros((3, 3)), all(one.points for one in self._doubts)
        if k == 0:
            self.steps.append(ScanStep(placed.t, 0, pose, np.zeros(3), np.zeros((3, 3))))
            self._estimate.append(pose, 0)
        else:
            last = self._poses.array[-1]
            delta = between(last, pose)
            wheels, points = (all(getattr(one, name) for one in self._doubts) for name in ("wheels", "points"))
            fused = inverse(wheels_cov(delta, s)) if wheels else np.eye(3) / s.blind**2
            if points:
                own = cov_by_points(*told, s)
                before = own if k == 1 else self._by_points(k - 1)  # the first scan is the submap
                fused = fused + inverse(cov_between(last, pose, before, own))
            cov = inverse(fused) + self._stale(k) + self._stale(k - 1)
            doubt += sum(np.outer(one.off, one.off) for one in self._doubts if one.off is not None)
            cov += doubt
            self._doubts = []
            self.steps.append(ScanStep(placed.t, len(self.t) - 1, pose, delta, (cov + cov.T) / 2))
            self._estimate.append(compose(self.estimate[-1], delta), len(self.loops))
        key = KeyScan(pose, *told, placed.hold, base, counts, doubt, self._stale(k))
        self.keys.append(key)
        self._poses.append(pose)
        for submap in self._active:
            if not submap.steps or submap.steps[-1] != k:
                submap.steps.append(k)
        if self.localiser is not None:
            step = self.steps[-1]
            self.localiser.place(k, step.delta, step.cov, scan, self._seen(k))
        elif s.loops and k % s.loop_every == 0:
            self._close(k, scan)
        if k % s.optimise_every == 0 and len(self.loops) > self._loops_then:
            self._estimate.correct(self.steps, self.loops)
            self._corrected, self._loops_then = self._looped, len(self.loops)

    def _by_points(self, k: int) -> Array:
        """The covariance (3, 3) of step k's place on its submap by its points; that of step 1 for the first."""
        key = self.keys[k or min(1, len(self.keys) - 1)]
        return cov_by_points(key.slope, key.scatter, self.settings)

    def _cov(self, k: int) -> Array:
        """The covariance (3, 3) of step k's place, by the wheels' motion to it, too."""
        cov, delta = self._by_points(k), self.steps[k].delta
        R = rotation(float(self.keys[max(k - 1, 0)].pose[2]))
        return inverse(inverse(cov) + inverse(R @ wheels_cov(delta, self.settings) @ R.T)) if k else cov

    def _stale(self, k: int) -> Array:
        """The covariance that a scan swept on the move, or a stamp that is off, adds."""
        v, w = self.settings.stamp_sd * self._rates.array[k]
        return np.diag([v * v, v * v, w * w])

    def _close(self, k: int, scan: Scan) -> None:
        """Looks for step k in the finished submaps nearest to its estimate."""
        s, estimate, poses = self.settings, self.estimate, self._poses.array
        here = estimate[k]
        near = self.finished.near(here, estimate, self._way - s.loop_path)
        if not near:
            return
        since = self._way - self._corrected
        window = min(s.window_start + s.window_by_path * since, s.window)
        turn = min(s.turn_start + s.turn_by_path * since, s.turn_window)
        seen = self._seen(k)
        matches = list[tuple[float, Match, Submap, Array]]()
        for _, submap, nearest in near:
            guess = compose(poses[nearest], between(estimate[nearest], here))
            self.tried += 1
            self.finished.use(submap)
            found = searched(submap, scan, seen, guess, window, turn, self.turned_down)
            if found is not None:
                off = between(guess, found.pose)
                matches.append((float(np.hypot(off[0], off[1])), found, submap, off))
        matches.sort(key=lambda one: one[0])  # nearest to the estimate first: the others have to agree with it
        for _, found, submap, off in matches:
            if beyond(off - matches[0][3], s.alone, s.alone_turn):
                self.turned_down["submaps disagree"] += 1
                continue
            to = loop_to(found, submap, poses)
            stale = self._stale(k) + self._stale(to)
            self._take(loop_of(found, to, k, poses[to], self._cov(to), stale), off, since)

    def _seen(self, k: int) -> Array:
        """The points (n, 2) that the last scans saw, in the frame of step k."""
        poses, scans = [pose for pose, _ in self._drawn], [scan for _, scan in self._drawn]
        return cloud(self._poses.array[k], poses, scans, self.settings.cloud_cell)

    def _take(self, loop: ScanLoop, off: Array, since: float) -> None:
        """Takes a loop that is where it was expected, or that enough others agree with; `off` is how far it is off."""
        if self._surprises.is_expected(off, since):
            self.loops.append(loop)
            self._looped = self._way
            self._surprises.agreed()
            return
        confirmed = self._surprises.add(loop, self._way, self.estimate)
        if confirmed:
            self.loops += confirmed
            self.confirmed += len(confirmed)
            self._estimate.move(self.steps, self.loops, 15, far=True)
            self._looped = self._corrected = self._way
            self._loops_then = len(self.loops)
        else:
            self.turned_down["surprises not confirmed"] += 1
