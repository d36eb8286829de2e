"""A whole log as one forest: all its factors, each variable at its initial value.

Initial values from dead reckoning suffice where odometry is good. Chunks of the log give better ones: each chunk is
solved and relinearised before odometry continues from its end.
"""

import contextlib
from functools import partial

import numpy as np

from ...core.factors import Log, Map
from ...core.se2 import Array, Ints, compose
from ..api import Constant, Diverged, Solution
from ..common_options import LOSSES
from ..constant_errors import CovOf, fitted, fitted_biases
from ..incremental.smoother import LEAST, PATIENCE
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
from ..smoothing.maps import add_map, joint_map, joint_of
from ..smoothing.valleys import descend
from ._whole_log import Columns, linearise_at, write_steps
from .distances import of_partial, of_sightings
from .first_values import by_headings, first_values
from .gauss_newton import Fit, eliminate, minimise
from .parts import Parts

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
        prior, n, s = log.prior, len(log), len(log.ids)
        alone = log.ids[:0] if log.partial is None else log.partial.ids
        ids, which = np.unique(np.concatenate((log.ids, alone)), return_inverse=True)
        self._which, self._alone = which[:s], which[s:]
        self.log, self._written, self._ids = log, 0, ids.tolist()
        forest = self.forest = Forest(loss, scale)
        given = 0 if prior.map is None else len(prior.map.ids)  # sighted or not
        looks = len(log.ids) + len(alone) + (0 if log.fixes is None else len(log.fixes))
        turns = 0 if log.gyro is None else len(log.gyro)
        forest.room(n, n + len(ids) + given + turns, looks + 3 * turns, n + len(log.loop_to) + turns, 0)
        self._columns = _columns(log)
        forest.pose[:], forest.cov[:] = prior.pose, prior.cov
        _log.move(forest.g, self._columns.motions[0], forest.pose, forest.cov)
        self._newest = _log.add_pose_after(forest.g, NO_VARIABLE, 0)
        self.variable: dict[int, int] = {} if prior.map is None else add_map(forest, prior.map)
        """Landmark id -> its variable, in order of first sighting."""
        self._variable_of = np.array([self.variable.get(i, NO_VARIABLE) for i in self._ids], np.int64)
        self._known: dict[int, Array] = {}  # places of landmarks to start at
        self.parts = Parts(log, forest)
        """Partial sightings and fixes."""
        forest.room(0, n + len(ids), 0, 0, 0)  # these may have variables of their own
        for landmark, variable in self.variable.items():
            self.parts.named(forest, landmark, variable, 0)
        self._columns = self._columns._replace(
            part_first=self.parts.first,
            part_landmarks=self.parts.landmarks,
            parts=self.parts.part,
            part_seen=self.parts.seen,
            biases=self.parts.biases.of_step,
        )

    def start_at(self, path: Array, landmarks: Map, constant: Constant | None = None) -> None:
        """Adds everything, poses at `path` (n, 3), landmarks as in the map; orders and eliminates it.

        Constant errors that are not given are those that fit best there.
        """
        self.write_at(path, landmarks, constant)
        self.order()

    def write_at(self, path: Array, landmarks: Map, constant: Constant | None = None) -> None:
        """Adds everything likewise, without ordering or eliminating."""
        self._columns = self._columns._replace(start=path)
        self._known = dict(zip(landmarks.ids.tolist(), landmarks.xy, strict=True))
        if len(self.parts.constant.all):
            constant = fitted(self.log, path, landmarks) if constant is None else constant
            self.parts.constant.write(self.forest.g.values, landmarks.ids, constant)
        if self.log.gyro is not None:
            self.parts.biases.at = fitted_biases(self.log.gyro, path)
        self._write(len(path))
        values = self.forest.g.values
        for landmark, xy in zip(landmarks.ids.tolist(), landmarks.xy, strict=True):
            if landmark in self.variable:
                values[self.variable[landmark], :2] = xy

    def start_by_odometry(self, along: Array | None = None) -> None:
        """Adds everything, with poses from dead reckoning, or from the path `along` (n, 3)."""
        self._start_along(np.zeros((0, 3)) if along is None else along)

    def start_by_headings(self) -> None:
        """Adds everything, with poses from dead reckoning along headings that loop closures have a part in."""
        self._start_along(by_headings(self.log))

    def _start_along(self, path: Array) -> None:
        """Adds everything along a path, or, if that is empty, along dead reckoning.

        A landmark starts where its first chunk has it: later ones may have drifted away.
        """
        self._columns = self._columns._replace(start=path)
        for end in chunks(self.log) if self._ids else [len(self.log)]:
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
        of_loops = np.flatnonzero(g.links[: g.state[LINKS], LOOP] == 1)
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

    def distances(self) -> Array:
        """(s,) squared Mahalanobis distances of the forest's sightings at the linearisation points; 0 of fixes."""
        path, landmarks = self.place()
        if not len(self.parts.step):
            return of_sightings(self.log, path, landmarks)
        out = np.zeros(len(self.log.ids) + len(self.parts.step))
        whole = np.arange(len(self.log.ids)) + self.parts.first[self.log.sighting_step]
        out[whole] = of_sightings(self.log, path, landmarks)
        out[self.parts.partial_rows] = of_partial(self.log, path, landmarks, self.constant(landmarks.ids))
        return out

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
        bias = None if self.log.gyro is None else self.parts.biases.last(forest, curved=curved)
        cov_of = partial(joint_of, forest, values=forest.g.values) if curved else None
        return Solution(
            path, landmarks, cov, converged, constant=self.constant(landmarks.ids, cov_of), gyro_bias=bias
        )  # fmt: skip

    def constant(self, landmarks: Ints, cov_of: CovOf | None = None) -> Constant | None:
        """The constant errors at the linearisation points, a gyro's aside; None without any."""
        return self.parts.constant.read(self.forest.g.values, landmarks, cov_of)

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
        touching = self.parts.begin_biases(forest, first, end)
        self._newest = write_steps(g, columns, first, end, last, forest.pose, forest.cov)
        if self._newest == NO_VARIABLE:
            raise Diverged(NO_COVARIANCE)
        named = self._name(end)
        self._written = end
        if len(fresh):
            step = np.repeat(np.arange(first, end), np.diff(columns.sighting_first[first : end + 1]))
            mine = np.isin(which, fresh)
            log, of = self.log, np.searchsorted(fresh, which[mine])
            xy = first_values(g.steps[step[mine], POINT:], log.z[rows][mine], log.z_cov[rows][mine], of, len(fresh))
            g.values[self._variable_of[fresh], :2] = xy
        loops = columns.loop_to[columns.loop_first[first] : columns.loop_first[end]]
        own = g.at[first:end][columns.poses[first:end]]
        parts = columns.part_landmarks[self.parts.first[first] : self.parts.first[end]]
        touched = np.unique(np.concatenate((own, [last], columns.landmarks[rows], g.at[loops], parts, named, touching)))
        touched = touched[touched >= 0]
        return touched[g.variables[touched, WIDTH] > 0]

    def _name(self, end: int) -> Ints:
        """Gives landmarks of partial sightings alone a place once these determine one, at the last step in any case.

        Returns the variables that are new or have new factors of steps before `end`, and those of constant errors.
        """
        forest, touched = self.forest, [self.parts.constant.all] if len(self.parts.step) else list[Ints]()
        if not len(self._alone):
            return np.concatenate([*touched, np.zeros(0, np.int64)])
        path = forest.g.steps[:end, POINT:]
        for k in np.unique(self._alone).tolist():
            landmark, variable = self._ids[k], int(self._variable_of[k])
            if variable == NO_VARIABLE:
                xy = self._known.get(landmark)
                if xy is None:
                    xy = self.parts.place(landmark, path, last=end == len(self.log))
                if xy is None:
                    continue
                variable = _log.add_variable(forest.g, 2, float(xy[0]), float(xy[1]), 0.0)
                self._variable_of[k] = self.variable[landmark] = variable
            elif not self.parts.waits(landmark):
                continue
            touched += [self.parts.named(forest, landmark, variable, end), np.array([variable])]
        return np.concatenate(touched)


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
    for table in (log.partial, log.fixes):
        if table is not None:
            poses |= np.diff(table.first) > 0
    turns = np.zeros((n, 3))
    if (gyro := log.gyro) is not None:
        poses[gyro.step] = poses[gyro.step - 1] = True
        turns[gyro.step] = np.column_stack((gyro.turn, gyro.dt, 1 / gyro.var))
    poses[log.loop_to] = poses[0] = True
    return Columns(
        motions,
        poses,
        log.sighting_first.copy(),
        np.full(s, NO_VARIABLE),
        np.concatenate((log.z, log.z_cov.reshape(s, 4)), axis=1),
        np.zeros(n + 1, np.int64),
        np.zeros(0, np.int64),
        np.zeros(0, np.int64),
        np.zeros((0, 5)),
        log.loop_first.copy(),
        log.loop_to.copy(),
        log.loop_delta.copy(),
        log.loop_cov.copy(),
        np.zeros((0, 3)),
        turns,
        np.full(n, NO_VARIABLE),
    )
