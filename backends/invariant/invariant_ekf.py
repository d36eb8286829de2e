"""Right-invariant EKF-SLAM: the EKF with its error defined on a group that rotates the whole map.

Pose and landmarks (R, p, f1, ..., fN) are one element of SE_{N+1}(2), and the true state is exp(xi) times the estimate:
an error of the heading rotates everything about the origin. Then xi is unchanged by motions (F = I), sightings depend
on f - p alone, and neither depends on the estimate along unobservable directions: these gain no information from
relinearisation, which makes the plain EKF overconfident (Barrau and Bonnabel, An EKF-SLAM Algorithm with Consistency
Properties, arXiv 1510.06263, 2015; Zhang, Wu, Song, Huang and Dissanayake, Convergence and Consistency Analysis for a
3-D Invariant-EKF SLAM, IEEE RA-L 2(2), 2017).

The models are those of ArUco EKF SLAM, eqs (2), (12) and (17), its sightings processed one by one. To first order a
plain error of position or landmark is its part of xi plus the heading's times J f, where J rotates by a right angle:
priors and beliefs are converted so.

On a log with loop closures the state also has the poses that these may come back to: see `kept_poses`. A kept pose X_k
is an element of SE(2) of its own, with the error that the pose had when it was cloned: true X_k = exp(xi_k) X_k, which
later motions do not change. A loop closure measures Z = X_k^-1 X, so that, for an exact one,

    X_k Z X^-1 = exp(-xi_k) exp(xi)         of the estimates X and X_k

whatever they are. Its logarithm eta is the innovation; to first order, with noise n of (dx, dy, dtheta),

    eta = xi - xi_k + N n,    N = [R_k  -J p; 0  1]

where p is the estimate's position. H = [1 -1] depends on nothing, N on the estimates.

Positions, headings and sightings of a range or a bearing alone come after the whole sightings of their step, and
landmarks that these leave open start late: see `late_starts`, and `_partial` for the Jacobians.

A gyro's bias is a number beside the group, as other constant errors are. The joint of state and motion is conditioned
on the turn before it moves: see `_turns`.
"""

from dataclasses import dataclass
from itertools import islice

import numpy as np

from ...core.factors import Map, Odometry, Prior, RangeBearing, RelativePoses, Step
from ...core.gyro import Turn
from ...core.options import option
from .. import common_options
from .._expected_arrays import ExpectedArrays
from ..api import COMPILED_HERE, Belief, Bias, Builder, Calibration, Diverged, Expected, Pose, Solution
from ..expected import as_expected, room_for, roomier
from ..gaussian.kept_poses import SUMMARY, KeptPoses
from ..gaussian.late_starts import NO_GATES, LateStarts
from ..vicinity import Vicinity
from . import _invariant, _invariant_loops, _plain, _turns
from .group import Group
from .group_parts import GroupParts

SIGHTINGS = 16  # expected landmarks that there is room for at first


@dataclass(frozen=True)
class Options:
    """Poses kept for loop closures, and what becomes of a gyro's bias."""

    poses: int = option(0, SUMMARY, minimum=0)
    gyro: str = common_options.gyro()


class InvariantEkf:
    """Right-invariant EKF-SLAM: heading, position and landmarks form one group element, and so does their error."""

    def __init__(self, prior: Prior, options: Options, rng: np.random.Generator) -> None:
        del rng
        self._group = Group(prior.pose, prior.cov)
        self._slot: dict[int, int] = {}  # landmark id -> its number, or -2 minus its number among those held fixed
        self._nis = np.zeros(0)  # of each sighting of the last step, -1 for none
        self._others_nis, self._others_dof, self._left_out = 0.0, 0, 0  # of loop closures, partial sightings and fixes
        self._follows = prior.gyro is None  # the odometry, which is not how the robot moves by wheels and gyro
        self._vicinity, self._expected = Vicinity(follows=self._follows), room_for(SIGHTINGS)
        self._near = np.zeros(0, np.int64)  # numbers of the landmarks in the vicinity, by its rows
        self._kept = KeptPoses(options.poses) if prior.loops else None
        if prior.map is not None:
            self._adopt(prior.map)
        parts = GroupParts(self._group)
        self._bias = None if prior.gyro is None else parts.constant(prior.gyro.sd, 0.0)
        if self._bias is not None and prior.gyro is not None:
            self._group.mean[self._bias] = prior.gyro.mean
        self._turn: Turn | None = None  # of the next step, where that has been told
        self._late: LateStarts | None = None
        if prior.partial or prior.fixes or prior.systematic.wheel_scale:
            self._late = LateStarts(parts, prior, self._slot)

    def step(self, step: Step) -> Pose:
        """Predicts with the odometry, then corrects by sightings one by one, adding new landmarks.

        Loop closures are next, and the pose is kept, on logs that have some.
        """
        group = self._group
        if self._vicinity.used and self._follows:
            self._vicinity.move(step.odometry)
        odometry = step.odometry if self._late is None else self._late.moved(step.odometry)
        self._turn = None
        if odometry is not None:
            if self._bias is not None and step.gyro is not None:
                odometry = _turned(group, odometry, self._bias, step.gyro)
            delta, cov = np.array(odometry.delta), np.array(odometry.cov)
            _invariant.move(group.arrays.address, group.n, group.kept, delta, cov)
        self._nis = np.empty(len(step.sightings.ids))
        if len(self._nis):
            self._take(step.sightings)
        self._others_nis, self._others_dof = 0.0, 0
        if self._late is not None:
            self._others_nis, self._others_dof, _ = self._late.step(step, NO_GATES)
            if self._kept is None and self._late.compacted():
                self._near = self._near[:0]
        if self._kept is not None:
            self._close(self._kept, step.loops)
        return group.placed()

    def foresee(self, turn: Turn | None) -> None:
        """Takes the next step's turn, by which sightings are expected."""
        self._turn = turn

    def expected(self, odometry: Odometry | None, seen: RangeBearing, gate: float) -> Expected:
        """Landmarks that one of the sightings may be of, by the joint belief in plain coordinates, to first order."""
        self._expected = self.expected_into(odometry, seen, gate, self._expected)
        return as_expected(self._expected)

    def expected_into(
        self, odometry: Odometry | None, seen: RangeBearing, gate: float, into: ExpectedArrays
    ) -> ExpectedArrays:
        """The same, in compiled arrays."""
        around, group = self._vicinity, self._group
        if odometry is not None and self._bias is not None and self._turn is not None:
            group = group.copy()
            odometry = _turned(group, odometry, self._bias, self._turn)
        new = list(islice(reversed(self._slot), len(self._slot) - around.count))[::-1]
        moves = around.ready(odometry, new)
        if len(self._near) < len(self._slot):
            self._near = np.fromiter(self._slot.values(), np.int64, len(self._slot))
        while (
            missing := _plain.ask(
                group.arrays.address, around.address, around.count, self._near, self._follows, moves, around.motion,
                seen.z, seen.cov, gate, into.address,
            )
        ) < 0:  # fmt: skip
            into = roomier(into, -2 * missing)
        return into

    def belief(self) -> Belief:
        """The pose's marginal in plain coordinates, and the NIS of all measurements but a landmark's first."""
        seen = self._nis[self._nis >= 0]
        nis, dof = float(seen.sum()) + self._others_nis, 2 * len(seen) + self._others_dof
        return Belief(self._group.placed(), self._group.pose_cov(), nis if dof else None, dof, left_out=self._left_out)

    def map(self) -> Map:
        """All landmarks with joint covariance in plain coordinates; fixed ones first, then in order of sighting."""
        group, ids = self._group, np.fromiter(self._slot, np.int64, len(self._slot))
        fixed = len(group.known)
        if self._kept is None and self._late is None and self._bias is None:
            places, block = group.mean[: group.n].reshape(-1, 2) + group.origin, group.landmarks_cov()
        else:  # some of the state's entries are of poses
            _, places, block = group.marginals(np.fromiter(self._slot.values(), np.int64, len(ids))[fixed:])
            block = block[:-3, :-3]
        cov = np.zeros((2 * len(ids), 2 * len(ids)))
        cov[2 * fixed :, 2 * fixed :] = block
        return Map(ids, np.concatenate((group.known + group.origin, places)), cov)

    def finish(self) -> Solution | None:
        """The path given all measurements, where the poses of all steps are kept; else None."""
        if self._kept is None or not self._kept.complete or not self._kept.steps:
            return None
        path, cov = np.empty((self._kept.steps, 3)), np.empty((self._kept.steps, 3, 3))
        _invariant_loops.marginals(self._group.arrays.address, self._group.loops, path, cov)
        path[:, :2] += self._group.origin
        return Solution(path, self.map(), cov, gyro_bias=self.gyro_bias)

    @property
    def range_errors(self) -> tuple[float, float] | None:
        """The scale and offset (m) of all ranges at present; None where they are not estimated."""
        return None if self._late is None else self._late.range_errors

    def calibration(self) -> Calibration:
        """The constant errors and the gyro's bias at present."""
        return Calibration(None if self._late is None else self._late.constant(self._slot), self.gyro_bias)

    @property
    def gyro_bias(self) -> Bias | None:
        """The gyro's bias at present; None without one in the state."""
        return None if self._bias is None else Bias(*self._group.one(self._bias))

    @property
    def pairs(self) -> int:
        """The state's pairs after the pose: landmarks, kept poses, constant errors."""
        return self._group.n // 2

    def _close(self, kept: KeptPoses, found: RelativePoses) -> None:
        """Corrects by the loop closures to kept poses, and keeps the pose."""
        group = self._group
        loops, pairs = kept.take(found, group.n // 2)
        failed, nis = _invariant_loops.close(
            group.arrays.address, group.n, group.kept, loops.entries, loops.delta, loops.cov
        )  # fmt: skip
        if failed >= 0:
            raise Diverged(
                f"the innovation covariance of the loop closure to step {loops.to[failed]} is not positive definite"
            )
        self._others_nis, self._others_dof = self._others_nis + nis, self._others_dof + 3 * len(loops.to)
        self._left_out = len(found.to) - len(loops.to)
        group.add(pairs - group.n // 2)
        group.beside(loops=kept.entries)
        _invariant_loops.keep(group.arrays.address, group.n, *loops.clone)

    def _take(self, seen: RangeBearing) -> None:
        """Corrects by the sightings of known landmarks and adds the others, in their order."""
        slot, group = self._slot, self._group
        count = group.n // 2
        slots = [slot.get(landmark, -1) for landmark in seen.ids.tolist()]
        if -1 in slots:
            fresh = [landmark for landmark in seen.ids.tolist() if landmark not in slot]
            slot.update(zip(fresh, range(count, count + len(fresh)), strict=True))
            group.reserve(group.n + 2 * len(fresh))
        group.n, wrong = _invariant.observe(
            group.arrays.address, group.n, group.kept,
            np.array(slots), np.array(seen.z), np.array(seen.cov, order="C"), self._nis,
        )  # fmt: skip
        if wrong:
            raise Diverged(_invariant.WRONG[wrong])

    def _adopt(self, given: Map) -> None:
        """Starts from a given map; landmarks without covariance are held fixed, outside of the state."""
        self._group.adopt(given)
        of = range(len(given.ids)) if given.cov is not None else range(-2, -2 - len(given.ids), -1)
        self._slot.update(zip(given.ids.tolist(), of, strict=True))


def _turned(group: Group, odometry: Odometry, bias: int, turn: Turn) -> Odometry:
    """The motion by wheels and gyro of one by the wheels; the belief gets what the turn tells of the bias, an entry."""
    motion = np.vstack(odometry)
    _turns.turned(group.arrays.address, group.n, group.kept, motion, bias, *turn)
    return Odometry(motion[0], motion[1:])


build = Builder(
    InvariantEkf,
    options=Options,
    loops=True,
    partial=True,
    fixes=True,
    gyro=True,
    wheel_scale=True,
    implementation=COMPILED_HERE,
)
