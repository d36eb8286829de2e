"""Incremental smoothing in the plane: Gauss-Newton on J by a multifrontal factor, updated at every step.

As iSAM2 (Kaess et al., IJRR 31(2), 2012) it stores the square root of the whole problem, and updates only what a step
changes. The last pose and the landmarks around it are the root, which is dense and factored again at every step; a step
that sees these alone eliminates the pose before and opens nothing else (see `_tree`). Another landmark opens the
cliques from it up to the root, which are reordered (`_ordering`). Steps without sightings are not variables: their
motions are composed (`_links`). Periodically, variables that are off by more than a threshold are relinearised.
"""

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice

import numpy as np

from ...core.factors import Map, Odometry, Prior, RangeBearing, Step
from ...core.fixes import NO_FIXES
from ...core.gyro import Bias
from ...core.options import option
from ...core.partial import NO_PARTIAL
from ...core.se2 import Array, Ints
from .. import common_options
from .._expected_arrays import ExpectedArrays
from ..api import Belief, Diverged, Expected, Pose, Solution
from ..common_options import LOSSES
from ..expected import as_expected, filled, room_for, roomier
from ..newcomers import Newcomers
from ..smoothing import _log, _opening, _step
from ..smoothing._graph import (
    CLOSEST,
    FULL,
    FURTHEST,
    LANDMARK,
    LAST,
    NO_VARIABLE,
    PART,
    PENDING,
    POSE,
    SIGHTINGS,
    STEPS,
    VARIABLES,
    WHOLE,
    WIDTH,
    WORK,
)
from ..smoothing._ordering import LARGE
from ..smoothing._step import FULL_ARRAYS, INDEFINITE, OUTSIDE, parts_step, plain_step
from ..smoothing.arrays import as_rows
from ..smoothing.forest import INDEFINITE_J, NO_COVARIANCE, NOBODY, Forest
from ..smoothing.maps import add_map, joint_map, joint_of
from ..smoothing.valleys import settled
from ..vicinity import Vicinity, first_expected, with_held
from ._turned import move, turned_step
from .biases import Biases
from .parts import NO_ROWS, Parts, Rows

CAP, REACH, PATIENCE, PATIENT = 48, 2.0, 15.0, 40.0
"""Limits of the root.

Most landmarks of a root, unless one step needs more; the radius around the pose they are taken from, in ranges of the
furthest sighting; and the multiple of a full elimination's work after which everything is reordered, and that of a
large graph, where ordering takes longer than eliminating. Measured: docs/settings.md and docs/smoothing.md.
"""

SMALL = 16.0
"""Distance of the nearest landmark over the most by which a linearisation point may be off.

A near one lowers the relinearize threshold, and has it checked at every step: see docs/settings.md.
"""

EARLY = 7.0  # offset of a root variable, in thresholds, that triggers a check early

ENOUGH = 0.3
"""Share of the relinearize threshold by which the last pose may be off when it is eliminated."""

JUMP = 0.3
"""m, rad; correction of a pose by partial sightings after which J is looked at."""

SETTLING = 10
"""Most relinearisations where a landmark of partial sightings starts."""

LEAST = 1e6  # least work (multiplications) between full orderings

NEAREST = 1e-3
"""m; least initial distance of a landmark from the robot: at zero distance its bearing has no derivative."""


@dataclass(frozen=True)
class Options:
    """Relinearisation, and robust loss of sightings and loop closures."""

    relinearize_threshold: float = common_options.relinearize_threshold()
    relinearize_skip: int = option(
        100,
        "steps between checks for variables to relinearize; a tenth if those near the robot are far off, "
        "and fewer with a gyro's bias in the state",
        minimum=1,
    )
    final_iterations: int = option(50, "most iterations at the end of the log", minimum=0)
    joint_up_to: int = common_options.joint_up_to()
    loss: str = common_options.loss("sightings and loops")
    loss_scale: float = common_options.loss_scale()
    gyro: str = common_options.gyro()
    keep: float = option(
        0.0,
        "length of the stretches of the way, m, that are marginalised where nothing new is seen: "
        "cost and memory follow the area and not the time; 0: none is",
        minimum=0,
        maximum=1_000_000,
        pointless=True,
    )


class Smoother:
    """Incremental smoothing, by this package: a causal pose each step, the smoothed path and map at the end."""

    def __init__(self, prior: Prior, options: Options, rng: np.random.Generator) -> None:
        del rng
        self._options = options
        names = list(LOSSES)
        enough = ENOUGH * options.relinearize_threshold
        self._forest = Forest(names.index(options.loss), options.loss_scale or LOSSES[options.loss], enough)
        self._newcomers = Newcomers(two=options.loss != "none")
        self._robust = options.loss != "none"
        self._held: defaultdict[int, list[int]] = defaultdict(list)  # rows of held-back sightings
        self._variable: dict[int, int] = {}  # landmark id -> its variable
        self._steps = self._since = 0
        self._seen = np.zeros((16, 6))  # range, bearing, and their covariance
        self._motion = np.concatenate((prior.pose[None], prior.cov))  # (4, 3)
        forest = self._forest
        forest.pose[:], forest.cov[:] = prior.pose, prior.cov
        _log.move(forest.g, self._motion, forest.pose, forest.cov)
        self._newest = _log.add_pose_after(forest.g, NO_VARIABLE, 0)
        self._prior, self._vicinity = prior, Vicinity(follows=True)
        self._expected = room_for(CAP)
        self._near = np.zeros(0, np.int64)  # variables of the landmarks in the vicinity, by its rows
        self._given = prior.map is not None and len(prior.map.ids) > 0
        if prior.map is not None:
            self._variable = add_map(forest, prior.map)
        self._parts = Parts(forest, prior, self._variable, self._start, self._hold)
        self._biases = None if prior.gyro is None else Biases(forest, prior.gyro)
        self._turns = False  # the step's pose has a bias
        self._late = False  # a landmark of partial sightings starts at this step
        self._touched = list[int]()  # poses with sightings of landmarks that this step starts
        self._gone = set[int]()  # landmarks that are others

    def step(self, step: Step) -> Pose:
        """Propagates by the motion; where anything is sighted, or a loop closed, the pose becomes a variable."""
        forest, k, sightings = self._forest, self._steps, step.sightings
        looks, closes = len(sightings.ids) > 0, len(step.loops.to) > 0
        if self._robust:
            self._newcomers.move(step.odometry)
        if self._vicinity.used:
            self._vicinity.move(step.odometry)
        if self._parts.waits:
            self._parts.move(step.odometry)
        if step.odometry is not None:
            self._motion[0], self._motion[1:] = step.odometry
        if looks:
            self._seen = as_rows(sightings, self._seen)
        touched = [] if self._biases is None else self._turned(k, step, self._biases)
        ahead = (0.0, 0.0, 0.0)
        found = [self._variable.get(i, NO_VARIABLE) for i in sightings.ids.tolist()]
        if NO_VARIABLE in found:
            touched += self._name(k, sightings, found)
        rows = NO_ROWS
        if step.partial is not NO_PARTIAL or step.fixes is not NO_FIXES or self._parts.rows:
            ahead = self._ahead(k)
            rows = self._partly(k, step, touched)
            looks = looks or len(rows.parts) > 0
            found = [self._variable.get(i, NO_VARIABLE) for i in sightings.ids.tolist()]  # these may have started some
        if k == 0 or closes or touched:
            self._any_step(step, np.array(found, np.int64), rows, touched)
        else:
            self._plain_step(np.array(found, np.int64), rows)
        self._steps += 1
        self._since += 1
        if self._late or (len(rows.parts) and self._jumped(ahead)):
            self._late, self._since = False, 0
            self._settle()
        if (looks or closes) and self._due():
            self._since = 0
            forest.relinearise(self._threshold())
        x, y, heading = forest.pose.tolist()
        if not math.isfinite(x + y + heading):
            raise Diverged("the latest pose is not finite")
        return forest.pose.copy()

    def expected(self, odometry: Odometry | None, seen: RangeBearing, gate: float) -> Expected:
        """Landmarks that one of the sightings may be of, by joint marginals; one that is held back is offered, too."""
        self._expected = self.expected_into(odometry, seen, gate, self._expected)
        return as_expected(self._expected)

    def expected_into(
        self, odometry: Odometry | None, seen: RangeBearing, gate: float, into: ExpectedArrays
    ) -> ExpectedArrays:
        """The same, in compiled arrays."""
        if self._steps == 0:
            return filled(into, first_expected(self._prior, seen, gate), seen)
        forest, around = self._forest, self._vicinity
        new = list(islice(reversed(self._variable), len(self._variable) - around.count))[::-1]
        moves = around.ready(odometry, new)
        if new:
            self._near = np.fromiter(self._variable.values(), np.int64, len(self._variable))
        while (
            missing := _step.ask(
                forest.g.address, around.address, around.count, self._near, forest.pose, forest.cov, moves,
                around.motion, seen.z, seen.cov, gate, into.address,
            )
        ) < 0:  # fmt: skip
            into = roomier(into, -2 * missing)
        held = self._newcomers.alone() if self._robust else {}
        if held:
            found = with_held(as_expected(into), held, self._newcomers, odometry, self._steps - 1)
            into = filled(into, found, seen)
        return into

    def unite(self, pairs: list[tuple[int, int]]) -> Pose:
        """Gives the sightings of the first landmarks to the second: the factors are those of right ids from then on."""
        forest, g = self._forest, self._forest.g
        of = g.sightings[: g.state[SIGHTINGS], LANDMARK]
        for gone, kept in pairs:
            a, b = self._variable[kept], self._variable[gone]
            of[of == b] = a
            g.variables[b, WIDTH], g.values[b] = 0, g.values[a]
            self._gone.add(gone)
        self._reorganise(_opening.sighted(g, int(g.state[LAST])), NOBODY, everything=True)
        self._settle()
        return forest.pose.copy()

    def belief(self) -> Belief:
        """The latest pose and its marginal covariance, from the root's last rows."""
        return Belief(self._forest.pose.copy(), self._forest.cov.copy())

    @property
    def gyro_bias(self) -> Bias | None:
        """The gyro's bias at the last step; None without a gyro."""
        return None if self._biases is None else self._biases.last

    def map(self) -> Map:
        """Landmarks at the current estimate with, up to `joint_up_to` of them, their joint covariance."""
        ids, variables = self._landmarks()
        forest = self._forest
        if self._steps == 0 or len(ids) == 0:
            return Map(ids, forest.g.values[variables, :2].copy(), None)
        return self._map(forest.estimate().values)

    def finish(self) -> Solution:
        """Relinearises until nothing moves; returns the path with the covariances of its poses, and the map.

        Landmarks that partial sightings have not started are now, with all of their sightings.
        """
        forest = self._forest
        if self._parts.waits:
            self._start_all()
        estimate, converged = settled(forest, self._options.final_iterations)
        values = estimate.values
        if not (np.isfinite(estimate.path).all() and np.isfinite(values).all()):
            raise Diverged("the optimum is not finite")
        path, covs = self._whole(estimate.path, values)
        landmarks = self._newcomers.added_to(self._parts.added_to(self._map(values), path), path)
        constant = self._parts.constant(values, landmarks.ids, partial(joint_of, forest, values=values))
        bias = self.gyro_bias
        return Solution(path, landmarks, covs, converged, constant=constant, gyro_bias=bias)

    def joint(self, landmarks: list[int]) -> Array:
        """The joint covariance of landmarks with these ids and the last pose that is a variable."""
        return self._forest.joint(np.array([self._variable[i] for i in landmarks], np.int64))

    def _whole(self, path: Array, values: Array) -> tuple[Array, Array]:
        """The `path` (n, 3) of all steps, and their covariances (n, 3, 3), with all variables at `values` (v, 3)."""
        del values
        return path, self._forest.pose_covariances()

    def _due(self) -> bool:
        """Tells if a relinearisation check is due, by the steps since the last and the root's offsets.

        With a gyro's bias, which moves all headings since the start, these are looked at at every step.
        """
        skip, tenth = self._options.relinearize_skip, max(1, self._options.relinearize_skip // 10)
        if self._since >= skip:
            return True
        threshold = self._threshold()
        if self._turns or threshold < self._options.relinearize_threshold:
            return _step.root_offset(self._forest.g.address) > threshold
        early = EARLY * self._options.relinearize_threshold
        return self._since % tenth == 0 and _step.root_offset(self._forest.g.address) > early

    def _jumped(self, ahead: tuple[float, float, float]) -> bool:
        """Tells if a step has moved the pose far from where its motion led."""
        dx, dy, turn = (self._forest.pose - ahead).tolist()
        return max(abs(dx), abs(dy), abs(math.remainder(turn, math.tau))) > JUMP

    def _settle(self) -> None:
        """Relinearises what a start has moved: its sightings were held back, from poses that may be far off by them."""
        for _ in range(SETTLING):
            if self._forest.relinearise(0.0).furthest <= self._threshold():
                break

    def _threshold(self) -> float:
        """The relinearize threshold (m, rad), lower where landmarks are near."""
        return min(self._options.relinearize_threshold, self._forest.g.settings.item(CLOSEST) / SMALL)

    def _plain_step(self, landmarks: Ints, rows: Rows) -> None:
        """A step that sees landmarks on the map and new ones only."""
        forest, n = self._forest, len(landmarks) + 2 * len(rows.parts)
        ended, newest = FULL_ARRAYS, self._newest
        while ended == FULL_ARRAYS:
            if self._turns and self._biases is not None:
                biases = self._biases
                ended, newest = turned_step(
                    forest.g.address, self._newest, CAP, self._motion, biases.start, biases.turn, biases.variable,
                    landmarks, self._seen, *rows, forest.pose, forest.cov,
                )  # fmt: skip
            elif len(rows.parts):
                ended, newest = parts_step(
                    forest.g.address, self._newest, CAP, self._motion, landmarks, self._seen, *rows,
                    forest.pose, forest.cov,
                )  # fmt: skip
            else:
                ended, newest = plain_step(
                    forest.g.address, self._newest, CAP, self._motion, landmarks, self._seen, forest.pose, forest.cov
                )
            if ended == FULL_ARRAYS:
                forest.room(1, 1, n, 2, n)
        self._newest = newest
        if ended == OUTSIDE:
            self._reorganise(self._seen_now(landmarks, rows), NOBODY)
        elif ended == INDEFINITE:
            raise Diverged(INDEFINITE_J)

    def _any_step(self, step: Step, landmarks: Ints, rows: Rows, touched: list[int]) -> None:
        """The first step, or one with factors of earlier poses: loops, or sightings that were held back."""
        forest, k, loops = self._forest, self._steps, len(step.loops.to)
        n = len(landmarks) + 2 * len(rows.parts)
        forest.room(1, 1 + loops, n, 3 + 3 * loops, n)
        g = forest.g
        turned = self._biases if self._turns else None
        if turned is not None:
            move(g, self._motion, turned.start, forest.pose, forest.cov)
        elif k > 0:
            _log.move(g, self._motion, forest.pose, forest.cov)
        ends = [self._pose_at(to, touched) for to in step.loops.to.tolist()]
        if k > 0:
            before, self._newest = self._newest, _checked(_log.add_pose_after(g, self._newest, int(g.state[STEPS]) - 1))
            if turned is not None and turned.turn[2] > 0:
                _log.add_turn(g, before, self._newest, turned.variable, *turned.turn.tolist())
        for a, delta, cov in zip(ends, step.loops.delta, step.loops.cov, strict=True):
            if not _log.add_loop(g, a, self._newest, np.array(delta), np.array(cov)):
                raise Diverged(NO_COVARIANCE)
        _log.add_sightings_of(g, self._newest, landmarks, self._seen)
        if len(rows.parts):
            _log.add_parts_of(g, self._newest, *rows)
        if k == 0 and not self._given:
            forest.start()
        else:
            self._reorganise(self._seen_now(landmarks, rows), np.array(touched, np.int64), everything=k == 0)

    def _turned(self, k: int, step: Step, biases: Biases) -> list[int]:
        """Takes a step's turn by the gyro, and has its pose name the bias; returns a pose made for this.

        From the first turn on all poses are variables.
        """
        touched = list[int]()
        if step.gyro is not None and int(self._forest.g.at[k - 1]) != self._newest:
            self._forest.room(0, 1, 0, 1, 0)
            self._pose_at(k - 1, touched)
        biases.take(step.gyro, self._motion, self._newest)
        self._turns = biases.variable != NO_VARIABLE
        if self._turns:
            self._parts.rows.append(biases.row)
        return touched

    def _seen_now(self, landmarks: Ints, rows: Rows) -> Ints:
        """The variables of this step's sightings; those of whole ones alone are at hand."""
        g = self._forest.g
        if len(rows.parts):
            return _opening.sighted(g, self._newest)
        seen = landmarks[landmarks >= 0]
        return seen[g.variables[seen, WIDTH] == 2]

    def _reorganise(self, seen: Ints, touched: Ints, *, everything: bool = False) -> None:
        """Makes the newest pose, the variables `seen` from it and others around them the root."""
        forest, g = self._forest, self._forest.g
        wanted = _opening.about(g, self._newest, REACH * g.settings[FURTHEST], 3 * CAP // 4, seen)
        patience = PATIENT if g.state[VARIABLES] > LARGE else PATIENCE
        everything = everything or bool(g.state[WORK] > patience * g.state[FULL] + LEAST)
        forest.reorganise(self._newest, wanted, touched, everything=everything)

    def _pose_at(self, step: int, touched: list[int]) -> int:
        """The variable of an earlier step's pose; if created, cliques to open are added to `touched`."""
        g = self._forest.g
        at = int(g.at[step])
        if at >= 0:
            touched.append(at)
            return at
        if at == PENDING:
            self._newest = at = _checked(_log.add_pose_after(g, self._newest, step))
            touched.append(at)
            return at
        a, b = g.links[NO_VARIABLE - 1 - at, :2].tolist()
        at = _checked(_log.split(g, step))
        touched += (a, at, b)
        return at

    def _name(self, k: int, sightings: RangeBearing, found: list[int]) -> list[int]:
        """Writes the variables of new landmarks to `found`; NO_VARIABLE stays for one that is held back.

        Returns the poses other than the root's from which these were sighted before.
        """
        row = int(self._forest.g.state[SIGHTINGS])
        x, y, heading = self._ahead(k)
        for i, landmark in enumerate(sightings.ids.tolist()):
            if found[i] >= 0:
                continue
            if not self._newcomers.sighted(landmark, (k, sightings.z[i], sightings.cov[i])):
                self._held[landmark].append(row + i)
                continue
            r, bearing = self._seen[i, :2].tolist()
            r, angle = max(r, NEAREST), heading + bearing
            self._start(landmark, x + r * math.cos(angle), y + r * math.sin(angle))
            found[i] = self._variable[landmark]
        touched, self._touched = self._touched, []
        return touched

    def _partly(self, k: int, step: Step, touched: list[int]) -> Rows:
        """The rows of a step's partial sightings and fixes; poses with those that were held back go to `touched`."""
        self._parts.add(k, step, self._poses)
        touched += self._touched
        self._touched = []
        return self._parts.taken()

    def _start(self, landmark: int, x: float, y: float) -> None:
        """Puts a landmark on the map, with its sightings that were held back."""
        self._forest.room(0, 1, 0, 0, 0)
        self._variable[landmark] = _log.add_variable(self._forest.g, 2, x, y, 0.0)
        held = self._held.pop(landmark, [])
        self._parts.release(landmark, held)
        g = self._forest.g
        last, rows = int(g.state[LAST]), g.sightings[[row for row in held if row < g.state[SIGHTINGS]]]
        self._late = self._late or bool((rows[:, PART] != WHOLE).any())
        self._touched += rows[(rows[:, POSE] != last) | (rows[:, PART] != WHOLE), POSE].tolist()

    def _start_all(self) -> None:
        """Puts landmarks that wait on the map at the end of the log."""
        forest, before = self._forest, len(self._variable)
        self._parts.ended(forest.estimate().path)
        touched, self._touched = self._touched, []
        if not touched:
            return
        rows = self._parts.taken()  # priors of constant errors
        n = len(rows.parts)
        forest.room(0, 0, n, 0, n + len(self._variable) - before)
        _log.add_parts_of(forest.g, self._newest, *rows)
        self._reorganise(_opening.sighted(forest.g, self._newest), np.array(touched, np.int64), everything=True)

    def _hold(self, landmark: int, row: int) -> None:
        self._held[landmark].append(row)

    def _ahead(self, k: int) -> tuple[float, float, float]:
        """The pose of step `k`, the next one, by its motion alone."""
        x, y, heading = self._forest.pose.tolist()
        if k > 0:
            by = self._biases.start if self._turns and self._biases is not None else self._motion[0]
            (dx, dy, turn), c, s = by.tolist(), math.cos(heading), math.sin(heading)
            x, y, heading = x + c * dx - s * dy, y + s * dx + c * dy, heading + turn
        return x, y, heading

    def _poses(self, steps: Sequence[int]) -> Array:
        """(n, 3) the poses of n steps so far, the next one included, at the present estimate."""
        k = self._steps
        path = self._forest.estimate().path if k else np.zeros((0, 3))
        return np.concatenate((path, [self._ahead(k)]))[list(steps)]

    def _landmarks(self) -> tuple[Ints, Ints]:
        """The ids of all landmarks and their variables."""
        known = self._variable
        if self._gone:
            known = {landmark: v for landmark, v in known.items() if landmark not in self._gone}
        return np.fromiter(known, np.int64, len(known)), np.fromiter(known.values(), np.int64, len(known))

    def _map(self, values: Array) -> Map:
        """All landmarks, at the variables' `values` (v, 3)."""
        return joint_map(self._forest, *self._landmarks(), values, self._options.joint_up_to)


def _checked(variable: int) -> int:
    """Returns `variable`; Diverged for NO_VARIABLE."""
    if variable < 0:
        raise Diverged(NO_COVARIANCE)
    return variable
