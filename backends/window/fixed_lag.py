"""Fixed-lag smoothing in the plane: Gauss-Newton on J over the last seconds, with a Gaussian prior for the rest.

A pose leaves the window `lag` seconds after its step. A landmark leaves `lag` seconds after its last sighting, with all
information on it: sighted again it is a new one, so a step's cost is bounded and loops are not closed. The last
estimates of variables that have left are kept. A landmark of a given map never leaves.

The poses are eliminated oldest first (see `_chain`), so a step eliminates one, and the prior after the oldest ones have
left exists already: it is only computed when linearisation points are moved, and then without variables that have left,
whose linearisation points stay. Constant errors of the sensors are landmarks that never leave.
"""

import math
from collections import defaultdict, deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...core.factors import Map, Odometry, Prior, RangeBearing, Step
from ...core.fixes import NO_FIXES
from ...core.gyro import Bias
from ...core.options import option
from ...core.partial import NO_PARTIAL
from ...core.se2 import Array, Ints
from .. import common_options
from ..api import Belief, Diverged, Expected, Pose, Solution
from ..common_options import LOSSES
from ..incremental.parts import NO_ROWS, Parts, Rows
from ..incremental.smoother import NEAREST, SETTLING
from ..newcomers import Newcomers
from ..smoothing._graph import ALONE
from ..smoothing.arrays import as_rows
from ..smoothing.forest import INDEFINITE_J, TOLERANCE
from ..vicinity import Vicinity, first_expected, with_held
from . import _estimates, _marginals, _step
from ._chain import DONE, RETURNS
from ._renewal import free, renew
from ._window import BOTTOM, HELD, LEFT, OLD_POSES, POINT, PRESENCE
from .arrays import look_at_landmark, made, offsets, row_of_new, solve, with_all, with_steps
from .biases import WindowBiases
from .tables import WindowTables

OVER = 32
"""The prior advances when more poses have left than this, and than there are in the window."""

KEEP = 8  # number of poses that a landmark stays in the front after its last sighting


@dataclass(frozen=True)
class Options:
    """Length of the window, relinearisation, and robust loss of the sightings."""

    lag: float = option(20.0, "length of the window, s; a loop that takes longer is not closed", minimum=1e-3)
    relinearize_threshold: float = common_options.relinearize_threshold()
    relinearize_skip: int = option(
        10, "steps between checks for variables to relinearize; each step with a gyro's bias in the state", minimum=1
    )
    final_checks: int = option(10, "checks for variables to relinearize at the end of the log", minimum=0)
    loss: str = common_options.loss("the sightings")
    loss_scale: float = common_options.loss_scale()
    gyro: str = common_options.gyro()


class FixedLag:
    """Fixed-lag smoothing, by this package: poses and landmarks of the last seconds, with a Gaussian prior."""

    def __init__(self, prior: Prior, options: Options, rng: np.random.Generator) -> None:
        del rng
        names = list(LOSSES)
        self._options = options
        self._skip = 1 if prior.gyro is not None else options.relinearize_skip
        loss_scale = options.loss_scale or LOSSES[options.loss]
        self._tables = WindowTables(made(prior, names.index(options.loss), loss_scale))
        self._robust = options.loss != "none"
        self._newcomers = Newcomers(two=self._robust)
        self._times = deque[float]()  # of the poses in the window
        self._left = self._since = 0  # poses that have left; steps since the last check
        self._path, self._covs = np.zeros((64, 3)), np.zeros((64, 3, 3))  # of poses that have left
        self._row: dict[int, int] = {} if prior.map is None else {i: k for k, i in enumerate(prior.map.ids.tolist())}
        self._given = frozenset(self._row)
        self._sighted: dict[int, float] = {}  # landmark -> time of its last sighting, in this order
        self._gone: dict[int, Array] = {}  # landmark -> (2,) position when it last left
        self._held: defaultdict[int, list[int]] = defaultdict(list)  # held-back sightings
        self._motion = np.zeros((4, 3))
        self._seen = np.zeros((16, 6))  # range, bearing, and their covariance
        self._pose, self._cov = prior.pose.copy(), prior.cov.copy()
        self._prior, self._vicinity = prior, Vicinity(follows=True)
        self._parts = Parts(self._tables, prior, self._row, self._start, self._hold)
        self._biases = None if prior.gyro is None else WindowBiases(self._tables, prior.gyro)
        self._careful = False  # such a one has started
        self._late = False  # a landmark of partial sightings starts at this step
        self._anew = False  # everything must be eliminated again

    def step(self, step: Step) -> Pose:
        """Drops variables older than the lag, propagates by the motion and adds the sightings."""
        k, ids = self._left + len(self._times), step.sightings.ids.tolist()
        if self._robust:
            self._newcomers.move(step.odometry)
        if self._vicinity.used:
            self._vicinity.move(step.odometry)
        if self._parts.waits:
            self._parts.move(step.odometry)
        if step.odometry is not None:
            self._motion[0], self._motion[1:] = step.odometry
        if ids:
            self._seen = as_rows(step.sightings, self._seen)
        if self._biases is not None:
            self._parts.rows += self._biases.take(step.gyro, self._motion, step.t)
        rows = [self._row.get(i, HELD) for i in ids]
        tables, more, self._anew = self._tables, NO_ROWS, k == 0
        if HELD in rows:
            self._name(k, step.sightings, rows)
        if step.partial is not NO_PARTIAL or step.fixes is not NO_FIXES or self._parts.rows:
            more = self._partly(k, step)
            rows = [self._row.get(i, HELD) for i in ids]  # it may have started some
            self._refresh(step.t, step.partial.ids.tolist())
        self._refresh(step.t, ids)
        leaving = self._let_go(step.t - self._options.lag)
        tables.window = window = with_steps(tables.window, len(ids) + (0 if more is NO_ROWS else len(more.parts)))
        self._times.append(step.t)
        a, b, first = self._left, self._left + leaving, self._left - int(window.state[OLD_POSES])
        path, covs, landmarks = self._path[a:b], self._covs[a:b], np.array(rows, np.int64)
        if self._biases is not None:
            by = self._biases
            ended = _step.turned_step(
                window, first, path, covs, by.motion, by.slope, by.turning, by.start, landmarks, self._seen, *more,
                self._pose, self._cov,
            )  # fmt: skip
        elif more is NO_ROWS:
            ended = _step.step(window, first, path, covs, self._motion, landmarks, self._seen, self._pose, self._cov)
        else:
            ended = _step.parts_step(
                window, first, path, covs, self._motion, landmarks, self._seen, *more, self._pose, self._cov
            )
        self._left += leaving
        if ended == RETURNS or self._anew:
            tables.window = window = with_all(window)
            ended, _ = renew(window, -1, KEEP, 0.0, False)
            if ended == DONE:
                ended = solve(window, self._pose, self._cov)
        if ended != DONE:
            raise Diverged(INDEFINITE_J)
        if self._late:
            self._late, self._careful = False, True
            self._settle()
        self._check()
        pose = self._pose.copy()
        if not math.isfinite(pose[0] + pose[1] + pose[2]):
            raise Diverged("the latest pose is not finite")
        return pose

    def expected(self, odometry: Odometry | None, seen: RangeBearing, gate: float) -> Expected:
        """Landmarks of the window that one of the sightings may be of, by joint marginals; also those held back."""
        if not self._times:
            return first_expected(self._prior, seen, gate)
        new = [landmark for landmark in self._row if landmark not in self._vicinity]
        found = self._vicinity.expected(self._pose, None, odometry, seen, gate, new, self._marginals)
        held = self._newcomers.alone() if self._robust else {}
        if held:
            found = with_held(found, held, self._newcomers, odometry, self._left + len(self._times) - 1)
        return found

    def belief(self) -> Belief:
        """The latest pose and its marginal covariance."""
        return Belief(self._pose.copy(), self._cov.copy())

    @property
    def gyro_bias(self) -> Bias | None:
        """The gyro's bias at the last step; None without a gyro."""
        return None if self._biases is None else self._biases.last

    def map(self) -> Map:
        """Landmarks in the window at the current estimate, the others at their position when they last left."""
        at = self._places()
        places = self._gone | {i: at[row] for i, row in self._row.items()}
        return Map(np.fromiter(places, np.int64, len(places)), np.array([*places.values()]).reshape(-1, 2), None)

    def finish(self) -> Solution:
        """Each pose as it left the window, the last ones at the final estimate, relinearized until nothing moves.

        Rounding moves all of them together by the more, the less is known of where they are: the condition of the
        information grows with the variance of the position.
        """
        converged = None
        for _ in range(self._options.final_checks):
            moved = self._relinearise(0.0, anyway=False)
            converged = moved <= TOLERANCE * max(1.0, self._cov[0, 0], self._cov[1, 1])
            if converged:
                break
        n, inside = self._left, len(self._times)
        path, covs = np.zeros((n + inside, 3)), np.zeros((n + inside, 3, 3))
        path[:n], covs[:n] = self._path[:n], self._covs[:n]
        for k in range(n, n + inside):
            w = self._tables.window
            _estimates.look_at_pose(w, k - int(w.state[OLD_POSES]), path[k], covs[k])
        landmarks = self.map()
        if not (np.isfinite(path).all() and np.isfinite(landmarks.xy).all()):
            raise Diverged("the optimum is not finite")
        landmarks = self._newcomers.added_to(self._parts.added_to(landmarks, path), path)
        constant = self._parts.constant(self._places(), landmarks.ids, self._joint_of)
        return Solution(path, landmarks, covs, converged, constant=constant, gyro_bias=self.gyro_bias)

    def _marginals(self, landmarks: list[int]) -> tuple[Array, Array, Array]:
        """The last pose, the landmarks' places and their joint covariance, the pose last."""
        return self._joint(np.array([self._row[landmark] for landmark in landmarks], np.int64))

    def _joint_of(self, rows: Ints) -> Array:
        """The joint covariance (2n, 2n) of the landmarks or constant errors of these rows."""
        return self._joint(rows)[2][:-3, :-3]

    def _joint(self, rows: Ints) -> tuple[Array, Array, Array]:
        n = len(rows)
        pose, at, cov = np.empty(3), np.empty((n, 2)), np.empty((2 * n + 3, 2 * n + 3))
        _marginals.joint(self._tables.window, rows, pose, at, cov)
        return pose, at, cov

    def _places(self) -> Array:
        """(v, 2) the estimates of all landmarks and constant errors, by their rows."""
        w = self._tables.window
        return w.places + offsets(w)[1] if self._times else w.places.copy()

    def _ahead(self) -> tuple[float, float, float]:
        """The pose of the next step by its motion alone."""
        x, y, heading = self._pose.tolist()
        by = self._motion[0] if self._biases is None else self._biases.start
        (dx, dy, turn), c, s = by.tolist(), math.cos(heading), math.sin(heading)
        return x + c * dx - s * dy, y + s * dx + c * dy, heading + turn

    def _poses(self, steps: Sequence[int]) -> Array:
        """(n, 3) the poses of n steps in the window, the next one included, at the present estimate."""
        w, here = self._tables.window, np.array([self._ahead()])
        if not self._times:
            return here[[0] * len(steps)]
        off, _ = offsets(w)
        path = w.poses[: len(off), POINT : POINT + 3] + off
        return np.concatenate((path, here))[np.array(steps) - int(w.state[OLD_POSES])]

    def _name(self, k: int, sightings: RangeBearing, rows: list[int]) -> None:
        """Writes the rows of new landmarks to `rows`; HELD stays for one that is held back."""
        x, y, heading = self._ahead()
        first = self._tables.stored
        for i, landmark in enumerate(sightings.ids.tolist()):
            if rows[i] != HELD or landmark in self._row:
                rows[i] = self._row[landmark]
                continue
            if not self._newcomers.sighted(landmark, (k, sightings.z[i], sightings.cov[i]), self._left):
                self._hold(landmark, first + i)
                continue
            r, bearing = self._seen[i, :2].tolist()
            r, angle = max(r, NEAREST), heading + bearing
            self._start(landmark, x + r * math.cos(angle), y + r * math.sin(angle))
            rows[i] = self._row[landmark]

    def _partly(self, k: int, step: Step) -> Rows:
        """The rows of a step's partial sightings and fixes."""
        self._parts.add(k, step, self._poses, self._left)
        return self._parts.taken()

    def _start(self, landmark: int, x: float, y: float) -> None:
        """Puts a landmark on the map, with its sightings that were held back, from the poses of the window."""
        self._tables.window, self._row[landmark] = row_of_new(self._tables.window, x, y)
        held = self._inside(self._held.pop(landmark, []))
        self._anew = self._anew or any(row < self._tables.stored for row in held)
        self._late = self._late or any(row < self._tables.stored and self._tables.row(row)[0] == ALONE for row in held)
        self._parts.release(landmark, held)

    def _hold(self, landmark: int, row: int) -> None:
        """Keeps a sighting for when its landmark starts."""
        self._held[landmark] = [*self._inside(self._held[landmark]), row]

    def _inside(self, rows: list[int]) -> list[int]:
        """Those of the rows of sightings that are from poses of the window."""
        first = self._tables.first(self._left) if rows else 0
        return [row for row in rows if row >= first]

    def _refresh(self, t: float, ids: list[int]) -> None:
        """Records a sighting of these landmarks."""
        for landmark in ids:
            if landmark in self._row and landmark not in self._given:
                self._sighted.pop(landmark, None)
                self._sighted[landmark] = t

    def _let_go(self, before: float) -> int:
        """Drops every landmark not sighted since `before`; returns the number of poses older than that."""
        leaving = 0
        while leaving < len(self._times) and self._times[0] < before:
            self._times.popleft()
            leaving += 1
        while self._left + leaving > len(self._path):
            self._path = np.concatenate((self._path, np.zeros_like(self._path)))
            self._covs = np.concatenate((self._covs, np.zeros_like(self._covs)))
        for landmark in self._old(before):
            self._forget(landmark)
        if self._biases is not None:
            self._biases.let_go(before)
        return leaving

    def _old(self, before: float) -> list[int]:
        """The landmarks not sighted since `before`."""
        old = list[int]()
        for landmark, t in self._sighted.items():
            if t >= before:
                break
            old.append(landmark)
        return old

    def _forget(self, landmark: int) -> None:
        """Stores a landmark's position and drops it; sighted again it is a new one."""
        w, row = self._tables.window, self._row.pop(landmark)
        self._vicinity.forget(landmark)
        del self._sighted[landmark]
        self._gone.pop(landmark, None)
        self._gone[landmark] = look_at_landmark(w, row)
        w.marks[row, PRESENCE] = LEFT

    def _settle(self) -> None:
        """Relinearises what a start has moved: its sightings were held back, from poses that may be far off by them."""
        threshold = self._options.relinearize_threshold
        for _ in range(SETTLING):
            if self._relinearise(threshold, anyway=False) <= threshold:
                break

    def _furthest(self) -> float:
        """m, rad; the largest offset of a variable that may move."""
        w = self._tables.window
        poses, places = offsets(w)
        return free(w, self._left - int(w.state[OLD_POSES]), poses, places, 0.0)

    def _check(self) -> None:
        """Relinearises when due, or when much has left."""
        self._since += 1
        state = self._tables.window.state
        inside, start = len(self._times), self._left - int(state[OLD_POSES])
        much = start - int(state[BOTTOM]) > max(OVER, inside)
        if self._since >= self._skip:
            self._since = 0
            self._relinearise(self._options.relinearize_threshold, anyway=much)
        elif much:
            self._relinearise(np.inf, anyway=True)

    def _relinearise(self, threshold: float, *, anyway: bool) -> float:
        """Moves what is off by more than `threshold` (m, rad); returns the largest offset.

        Variables that have left are first absorbed by the prior. Nothing is done if nothing is off so far, unless
        `anyway`. Once a landmark has started late, points are moved only if that leaves the largest offset no larger.
        """
        self._tables.window = w = with_all(self._tables.window)
        before = (w.copied(), self._pose.copy(), self._cov.copy()) if self._careful and threshold < np.inf else None
        ended, furthest = renew(w, self._left - int(w.state[OLD_POSES]), KEEP, threshold, anyway)
        if ended == DONE and (furthest > threshold or anyway):
            ended = solve(w, self._pose, self._cov)
        if before is not None and (ended != DONE or (furthest > threshold and self._furthest() > furthest)):
            self._tables.window, self._pose, self._cov = before
            return self._relinearise(np.inf, anyway=anyway)
        if ended != DONE:
            raise Diverged(INDEFINITE_J)
        return furthest
