"""A whole log as one forest: all its factors, each variable at its initial value.

Initial values from dead reckoning suffice where odometry is good. Chunks of the log give better ones: each chunk is
solved and relinearised before odometry continues from its end.
"""

import contextlib

import numpy as np

from ...core.factors import Log, Map
from ...core.se2 import Array, Ints, compose
from ..api import Diverged, Solution
from ..common_options import LOSSES
from ..smoothing import _log, _opening
from ..smoothing._factors import HUBER, NONE
from ..smoothing._graph import (
    DAMPING,
    FULL,
    LAST,
    LINKS,
    LOOP,
    LOSS,
    NO_VARIABLE,
    POINT,
    SCALE,
    STEP,
    STEPS,
    WEIGHT,
    WIDTH,
    WORK,
)  # fmt: skip
from ..smoothing.forest import FIRST_DAMPING, NO_COVARIANCE, Forest
from ..smoothing.maps import add_map, joint_map
from ..smoothing.smoother import LEAST, PATIENCE
from ..smoothing.valleys import descend
from ._whole_log import Columns, linearise_at, write_steps
from .first_values import first_values
from .gauss_newton import Fit, eliminate, minimise
from .headings import by_headings

CHUNK = 100  # most steps of a chunk

TURNED = 0.1
"""rad; chunks end where odometry alone leaves the heading less certain than this (1 sd).

Worse initial values are useless: on Huang's circle, where odometry loses 2 degrees a second, chunks of 100 steps
converge to a J two thousand times its minimum.
"""

EVERY, THRESHOLD = 20, 0.03
"""Steps between relinearisations at a chunk's end, and the offset (m, rad) above which a variable is relinearised."""


class Batch:
    """The factors of a log, all sightings at once, with a robust loss of sightings and loop closures."""

    def __init__(self, log: Log, loss: int, scale: float) -> None:
        prior, n = log.prior, len(log)
        ids, self._which = np.unique(log.ids, return_inverse=True)
        self.log, self._written, self._ids = log, 0, ids.tolist()
        forest = self.forest = Forest(loss, scale)
        given = 0 if prior.map is None else len(prior.map.ids)  # sighted or not
        forest.room(n, n + len(ids) + given, len(log.ids), n + len(log.loop_to), 0)
        self._columns = _columns(log)
        forest.pose[:], forest.cov[:] = prior.pose, prior.cov
        _log.move(forest.g, self._columns.motions[0], forest.pose, forest.cov)
        self._newest = _log.add_pose_after(forest.g, NO_VARIABLE, 0)
        self.variable: dict[int, int] = {} if prior.map is None else add_map(forest, prior.map)
        """Landmark id -> its variable, in order of first sighting."""
        self._variable_of = np.array([self.variable.get(i, NO_VARIABLE) for i in self._ids], np.int64)

    def start_at(self, path: Array, landmarks: Map) -> None:
        """Adds everything, poses at `path` (n, 3), landmarks as in the map; orders and eliminates it."""
        self.write_at(path, landmarks)
        self.order()

    def write_at(self, path: Array, landmarks: Map) -> None:
        """Adds everything likewise, without ordering or eliminating."""
        self._columns = self._columns._replace(start=path)
        self._write(len(path))
        values = self.forest.g.values
        for landmark, xy in zip(landmarks.ids.tolist(), landmarks.xy, strict=True):
            if landmark in self.variable:
                values[self.variable[landmark], :2] = xy

    def start_by_odometry(self) -> None:
        """Adds everything, with poses from dead reckoning."""
        self._start_along(np.zeros((0, 3)))

    def start_by_headings(self) -> None:
        """Adds everything, with poses from dead reckoning along headings that loop closures have a part in."""
        self._start_along(by_headings(self.log))

    def _start_along(self, path: Array) -> None:
        """Adds everything along a path, or, if that is empty, along dead reckoning.

        A landmark starts where its first chunk has it: later ones may have drifted away.
        """
        self._columns = self._columns._replace(start=path)
        for end in chunks(self.log) if len(self.log.ids) else [len(self.log)]:
            self._write(end)
        self.order()

    def start_by_chunks(self) -> None:
        """Adds everything chunk by chunk, each solved before the next is added, with occasional relinearisation.

        Huber's loss is used meanwhile if there is to be none. Without it gross errors lead chunks to different local
        minima: on MRCLAM 6, robot 3, from 1.9e4 to 1.3e5 by the chunks' ends; with it always to the same.
        """
        forest, relinearised = self.forest, 0
        loss = forest.g.settings[LOSS : SCALE + 1].copy()
        if loss[0] == NONE:
            forest.g.settings[LOSS : SCALE + 1] = HUBER, LOSSES["huber"]
        forest.g.settings[DAMPING] = FIRST_DAMPING  # a landmark sighted from its own position only has no curvature yet
        for end in chunks(self.log):
            touched, state = self._write(end), forest.g.state
            everything = int(state[LAST]) == 0 or bool(state[WORK] > PATIENCE * state[FULL] + LEAST)
            seen = _opening.sighted(forest.g, self._newest)
            forest.reorganise(self._newest, seen, touched, everything=everything)
            if end - relinearised >= EVERY:
                forest.relinearise(THRESHOLD)
                relinearised = end
            newest = int(forest.g.variables[self._newest, STEP])  # after a solution the latest pose is its
            for delta in self.log.delta[newest + 1 : end]:
                forest.pose[:] = compose(forest.pose, delta)
        forest.g.settings[LOSS : SCALE + 1] = loss
        self.weigh_loops(np.ones(len(self.log.loop_to)))
        self.order()

    def order(self) -> None:
        """Orders and eliminates everything; the forest's state reports an indefinite matrix."""
        forest = self.forest
        forest.g.settings[DAMPING] = 0.0
        with contextlib.suppress(Diverged):
            forest.reorganise(self._newest, _opening.sighted(forest.g, self._newest), everything=True)

    def weigh_loops(self, weights: Array) -> None:
        """Multiplies each loop closure's term of J by its weight (l,); 0 leaves it out. The elimination is then old."""
        if not len(weights):
            return
        g = self.forest.g
        of_loops = np.flatnonzero(g.links[: g.state[LINKS], LOOP])
        g.linked[of_loops, WEIGHT] = weights
        linearise_at(g, g.steps[: g.state[STEPS], POINT:].copy(), g.values.copy())

    def refit(self) -> None:
        """Eliminates everything again, after factors have changed."""
        eliminate(self.forest)

    def fit(self, tolerance: float, iterations: int) -> Fit:
        """Minimises J: see `minimise`."""
        return minimise(self.forest, tolerance, iterations)

    def place(self) -> tuple[Array, Map]:
        """The linearisation points: path (n, 3) and landmarks."""
        g, ids = self.forest.g, np.fromiter(self.variable, np.int64, len(self.variable))
        return g.steps[: len(self.log), POINT:].copy(), Map(ids, g.values[self._variables(), :2], None)

    def solution(self, joint_up_to: int, iterations: int, converged: bool) -> Solution:
        """The estimate and, if J is curved in every direction, the covariances of poses and map.

        The map's is joint, computed for at most that many landmarks. The fit, which `converged` or not, goes on in at
        most that many iterations where J is a narrow valley.
        """
        forest = self.forest
        curved = eliminate(forest)
        if curved:
            converged = descend(forest, iterations)
        path, landmarks = self.place()
        if not np.isfinite(path).all() or not np.isfinite(landmarks.xy).all():
            raise Diverged("the optimum is not finite")
        cov = None
        if curved:
            cov = forest.pose_covariances()
            landmarks = joint_map(forest, landmarks.ids, self._variables(), forest.g.values, joint_up_to)
        return Solution(path, landmarks, cov, converged)

    def _variables(self) -> Ints:
        """The landmarks' variables."""
        return np.fromiter(self.variable.values(), np.int64, len(self.variable))

    def _write(self, end: int) -> Ints:
        """Adds the steps up to `end`; returns the variables that are new or have new factors."""
        forest, columns, first = self.forest, self._columns, self._written
        g, last = forest.g, self._newest
        rows = slice(columns.sighting_first[first], columns.sighting_first[end])
        which = self._which[rows]
        fresh, at = np.unique(which[self._variable_of[which] == NO_VARIABLE], return_index=True)
        for k in fresh[np.argsort(at)].tolist():
            self._variable_of[k] = self.variable[self._ids[k]] = _log.add_variable(g, 2, 0.0, 0.0, 0.0)
        columns.landmarks[rows] = self._variable_of[which]
        self._newest = write_steps(g, columns, first, end, last, forest.pose, forest.cov)
        if self._newest == NO_VARIABLE:
            raise Diverged(NO_COVARIANCE)
        self._written = end
        if len(fresh):
            step = np.repeat(np.arange(first, end), np.diff(columns.sighting_first[first : end + 1]))
            mine = np.isin(which, fresh)
            log, of = self.log, np.searchsorted(fresh, which[mine])
            xy = first_values(g.steps[step[mine], POINT:], log.z[rows][mine], log.z_cov[rows][mine], of, len(fresh))
            g.values[self._variable_of[fresh], :2] = xy
        loops = columns.loop_to[columns.loop_first[first] : columns.loop_first[end]]
        own = g.at[first:end][columns.poses[first:end]]
        touched = np.unique(np.concatenate((own, [last], columns.landmarks[rows], g.at[loops])))
        return touched[g.variables[touched, WIDTH] > 0]


def chunks(log: Log) -> list[int]:
    """End of each chunk of the log: the step after its last one."""
    turned = np.concatenate(([0.0], np.cumsum(log.delta_cov[1:, 2, 2])))  # rad^2, the heading's variance at each step
    ends = [0]
    while ends[-1] < len(turned):
        first = ends[-1]
        known = int(np.searchsorted(turned, turned[max(first - 1, 0)] + TURNED**2, side="right"))
        ends.append(min(max(known, first + 1), first + CHUNK, len(turned)))
    return ends[1:]


def _columns(log: Log) -> Columns:
    """The compiled code's input, as writable arrays."""
    n, s = len(log), len(log.ids)
    motions = np.empty((n, 4, 3))
    motions[:, 0], motions[:, 1:] = log.delta, log.delta_cov
    motions[0, 0], motions[0, 1:] = log.prior.pose, log.prior.cov
    poses = np.diff(log.sighting_first) + np.diff(log.loop_first) > 0
    poses[log.loop_to] = poses[0] = True
    return Columns(
        motions,
        poses,
        log.sighting_first.copy(),
        np.full(s, NO_VARIABLE),
        np.concatenate((log.z, log.z_cov.reshape(s, 4)), axis=1),
        log.loop_first.copy(),
        log.loop_to.copy(),
        log.loop_delta.copy(),
        log.loop_cov.copy(),
        np.zeros((0, 3)),
    )
