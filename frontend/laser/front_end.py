"""The laser front end: scans one after another become steps with odometry factors and loop closures.

Hess, Kohler, Rapp and Andor, Real-time loop closure in 2D LIDAR SLAM, ICRA 2016. Scans are matched with a submap of the
last metres, steps with submaps of earlier ones. The matcher's path is never corrected; the front end's own pose graph
only says where to look for loops.
"""

from collections import Counter, deque

import numpy as np

from ...core.se2 import Array, between, compose, rotation, wrap
from ...core.small_matrices import inverse
from ._matching import Hold, match
from ._search import Search, correlated
from .estimate import ScanStep, StepPoses
from .finished import Finished
from .localising import Localiser
from .loops import Match, ScanLoop, Surprises, cloud, contradicted, loop_of, searched
from .rows import Rows
from .scanner import Scan, Scanner
from .settings import Settings
from .submap import Submap
from .wheels_check import WheelsCheck, contradicts

AT_FIRST, AGAIN = 6, 4
"""Cells around a point in which its wall is looked for at first: from the prediction, and after a search."""

ITERATIONS = 20

REACH, FIELD_SD = 14.0, 0.08
"""m around the prediction in which a lost scan is searched for, and the width of the field."""

FEW = 80  # points of a scan that are searched with
SEARCH, SEARCH_TURN = 0.3, 0.35  # m and rad that a search goes beyond the odometry's motion
STEP, TURN_STEP = 0.08, 0.03  # m and rad between poses that are tried
TRUST, TRUST_TURN = 0.6, 0.6  # sd, m and rad, of the search's prior, beside the motion

COST, BETTER = 0.02, 0.03
"""Share of points that a unit of squared distance from the odometry costs; by how much a search has to be better."""

HELD = 25.0
"""Times the information of the wheels' motion with which a scan is held where they say that it is."""

OFTEN = 0.1  # s; scans in a burst are taken to be that far apart where a speed is computed


class FrontEnd:
    """Takes scans in the order of time."""

    def __init__(
        self, scanner: Scanner, settings: Settings, wheels: bool = True, localiser: Localiser | None = None
    ) -> None:
        """With a `localiser`, steps are placed on its map instead of being searched for in earlier submaps."""
        self.scanner, self.settings, self.wheels, self.localiser = scanner, settings, wheels, localiser
        self.steps: list[ScanStep] = []
        self.loops: list[ScanLoop] = []
        self.t: list[float] = []
        self.finished = Finished(settings)
        self.turned_down: Counter[str] = Counter()
        self.tried = self.lost = self.found_again = self.by_wheels = self.confirmed = 0
        self._active: list[Submap] = []
        self._way = 0.0  # m, with turning
        self._drawn: deque[tuple[Array, Scan]] = deque(maxlen=settings.cloud)
        self._path = Rows(3)
        self._poses = Rows(3)  # of the steps, on the matcher's path
        self._rates = Rows(2)  # m/s, rad/s at the steps
        self._estimate = StepPoses(settings)
        self._surprises = Surprises(settings)
        self._wheels_check, self._wheels_only = WheelsCheck(), False  # the step is by the wheels alone
        self._corrected, self._loops_then = 0.0, 0  # the way, and the number of loops, at the last correction

    def scan(self, t: float, motion: Array | None, ranges: Array) -> None:
        """Takes a scan; `motion` (3,) is the odometry's since the one before, None at first or without wheels."""
        scan = Scan(self.scanner.points(ranges), self.settings.spacing)
        if not self.t:
            self._record(t, np.zeros(3))
            self._draw(np.zeros(3), scan)
            self._new_step(t, np.zeros(3), np.zeros((3, 3)), scan, np.zeros(2))
            return
        delta, cov = self._predicted(t, motion)
        pose, information = self._matched(scan, delta, cov)
        if motion is not None:
            pose = self._checked(scan, pose, motion)
        moved = between(self.path[-1], pose) / max(t - self.t[-1], OFTEN)
        rate = np.array([np.hypot(moved[0], moved[1]), abs(moved[2])])
        s = self.settings
        if _beyond(between(self._drawn[-1][0], pose), s.insert_step, s.insert_turn):
            self._draw(pose, scan)
        new = _beyond(between(self._poses.array[-1], pose), s.step, s.turn)
        self._record(t, pose)
        if new:
            self._new_step(t, pose, information, scan, rate)

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
        """Optimises the estimate once more, and leaves out the loops that all others contradict."""
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

    def _predicted(self, t: float, motion: Array | None) -> tuple[Array, Array]:
        """The motion since the last scan, and its covariance, both in the axes of the last pose."""
        s = self.settings
        if motion is not None:
            return motion, _wheels_cov(motion, s)
        if len(self.t) < 2:
            return np.zeros(3), np.eye(3) * s.blind**2
        before = max(self.t[-1] - self.t[-2], 1e-3)
        return between(self.path[-2], self.path[-1]) * min((t - self.t[-1]) / before, 2.0), np.eye(3) * s.blind**2

    def _matched(self, scan: Scan, delta: Array, cov: Array) -> tuple[Array, Array]:
        """The pose of a scan on the submap, and the information of its points."""
        s, submap, last = self.settings, self._active[0], self.path[-1]
        predicted = compose(last, delta)
        if not len(scan.few):
            self.lost += 1
            return predicted, np.zeros((3, 3))
        R = rotation(float(last[2]))
        grid, hold = submap.grid, Hold(predicted, inverse(R @ cov @ R.T))
        pose, information, inside = match(grid, scan.few, predicted, hold, s.sd, AT_FIRST, ITERATIONS)
        if inside >= s.lost:
            return pose, information
        self.lost += 1
        way = float(np.hypot(delta[0], delta[1]))
        field, origin = submap.field_around(predicted, REACH, FIELD_SD)
        few, turned = scan.few[:: max(1, len(scan.few) // FEW)], abs(delta[2])
        search = Search(few, predicted, SEARCH + way, SEARCH_TURN + turned, TURN_STEP)
        guess = correlated(field, origin, s.cell, search, STEP, TRUST + way, TRUST_TURN + turned)
        other, its, others_inside = match(grid, scan.few, guess, hold, s.sd, AGAIN, ITERATIONS)
        if others_inside - COST * _distance(other, hold) > inside - COST * _distance(pose, hold) + BETTER:
            self.found_again += 1
            return other, its
        return pose, information

    def _checked(self, scan: Scan, pose: Array, motion: Array) -> Array:
        """The pose of a scan, by the wheels from half a metre back where they contradict it and explain more points."""
        s, submap = self.settings, self._active[0]
        start, moved = self._wheels_check.motion(self.path[-1], motion)
        information = inverse(_wheels_cov(moved, s))
        if not contradicts(between(start, pose), moved, information) or not len(scan.few):
            return pose
        grid, by_wheels, R = submap.grid, compose(start, moved), rotation(float(start[2]))
        hold, free = Hold(by_wheels, HELD * R @ information @ R.T), Hold(pose, np.zeros((3, 3)))
        other, _, explained = match(grid, scan.few, by_wheels, hold, s.sd, AGAIN, ITERATIONS)
        if explained < match(grid, scan.few, pose, free, s.sd, AGAIN, ITERATIONS)[2] + BETTER:
            return pose
        self._wheels_check.forget()
        self.by_wheels += 1
        self._wheels_only = True
        return other

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

    def _new_step(self, t: float, pose: Array, information: Array, scan: Scan, rate: Array) -> None:
        """Ends a step: its odometry factor, and its loops."""
        s, k = self.settings, len(self.steps)
        self._rates.append(rate)
        if k == 0:
            self.steps.append(ScanStep(t, 0, pose, np.zeros(3), np.zeros((3, 3))))
            self._estimate.append(pose, 0)
        else:
            last = self._poses.array[-1]
            delta, R = between(last, pose), rotation(float(last[2]))
            fused = inverse(_wheels_cov(delta, s)) + (0 if self._wheels_only else R.T @ information @ R)
            self._wheels_only = False
            cov = s.explained * inverse(fused) + np.diag([s.floor**2, s.floor**2, s.turn_floor**2])
            cov += self._stale(k) + self._stale(k - 1)
            self.steps.append(ScanStep(t, len(self.t) - 1, pose, delta, (cov + cov.T) / 2))
            self._estimate.append(compose(self.estimate[-1], delta), len(self.loops))
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
            self._corrected, self._loops_then = self._way, len(self.loops)

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
            if _beyond(off - matches[0][3], s.alone, s.alone_turn):
                self.turned_down["submaps disagree"] += 1
                continue
            self._take(loop_of(found, submap, k, poses, s, self._stale(k)), off, since)

    def _seen(self, k: int) -> Array:
        """The points (n, 2) that the last scans saw, in the frame of step k."""
        poses, scans = [pose for pose, _ in self._drawn], [scan for _, scan in self._drawn]
        return cloud(self._poses.array[k], poses, scans, self.settings.cloud_cell)

    def _take(self, loop: ScanLoop, off: Array, since: float) -> None:
        """Takes a loop that is where it was expected, or that enough others agree with; `off` is how far it is off."""
        if self._surprises.is_expected(off, since):
            self.loops.append(loop)
            self._surprises.agreed()
            return
        confirmed = self._surprises.add(loop, self._way, self.estimate)
        if confirmed:
            self.loops += confirmed
            self.confirmed += len(confirmed)
            self._estimate.move(self.steps, self.loops, 15)
            self._corrected, self._loops_then = self._way, len(self.loops)
        else:
            self.turned_down["surprises not confirmed"] += 1


def _beyond(motion: Array, way: float, turn: float) -> bool:
    return bool(np.hypot(motion[0], motion[1]) > way or abs(motion[2]) > turn)


def _wheels_cov(motion: Array, s: Settings) -> Array:
    """Covariance of a motion by the wheels: wide enough for slipping ones."""
    way, turned = float(np.hypot(motion[0], motion[1])), abs(float(motion[2]))
    sd = s.still + s.by_way * way
    turn_sd = s.turn_still + s.by_turn * turned + s.turn_by_way * way
    return np.diag([sd**2, sd**2, turn_sd**2])


def _distance(pose: Array, hold: Hold) -> float:
    """Squared Mahalanobis distance of a pose from the one it is held to."""
    off = pose - hold.pose
    off[2] = wrap(off[2])
    return float(off @ hold.information @ off)
