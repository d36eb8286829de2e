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
"""

from dataclasses import dataclass
from itertools import islice

import numpy as np

from ...core.factors import Map, Odometry, Prior, RangeBearing, RelativePoses, Step
from ...core.kernels._blas import routine
from ...core.options import option
from ...core.se2 import Array
from .._expected_arrays import ExpectedArrays
from ..api import COMPILED_HERE, Belief, Builder, Diverged, Expected, Pose, Solution
from ..expected import as_expected, room_for, roomier
from ..gaussian import _triangle
from ..gaussian.kept_poses import NOWHERE, SUMMARY, KeptPoses
from ..vicinity import Vicinity
from . import _invariant, _invariant_loops, _plain
from ._arrays import GroupArrays

SPACE = 64  # state entries reserved at first
SIGHTINGS = 16  # expected landmarks that there is room for at first


@dataclass(frozen=True)
class Options:
    """Poses kept for loop closures."""

    poses: int = option(0, SUMMARY, minimum=0)


class InvariantEkf:
    """Right-invariant EKF-SLAM: heading, position and landmarks form one group element, and so does their error."""

    def __init__(self, prior: Prior, options: Options, rng: np.random.Generator) -> None:
        del rng
        # The group's origin, here the robot's start, affects rounding only.
        self._origin = np.array(prior.pose[:2])
        self._pose = np.array([0.0, 0.0, prior.pose[2]])
        self._slot: dict[int, int] = {}  # landmark id -> its number, or -2 minus its number among those held fixed
        self._known = np.zeros((0, 2))  # landmarks held fixed, m from the origin
        self._n = 0  # entries of the landmarks' mean
        self._mean = np.zeros(0)
        self._strip = np.zeros((3, 3))  # the pose's rows of the covariance
        self._flat = np.zeros(0)  # the landmarks' covariance without deferred updates: see _triangle, _invariant
        self._owed, self._owing = np.zeros((_invariant.RANK, 0)), np.zeros(2, np.int64)
        self._blas = np.array([routine("dgemm"), routine("dsyrk")])
        self._arrays: GroupArrays | None = None
        self._reserve(SPACE)
        self._strip[:, :3] = prior.cov  # both errors agree at the origin
        self._nis = np.zeros(0)  # of each sighting of the last step, -1 for none
        self._loops_nis, self._loops_used, self._left_out = 0.0, 0, 0
        self._vicinity, self._expected = Vicinity(follows=True), room_for(SIGHTINGS)
        self._near = np.zeros(0, np.int64)  # numbers of the landmarks in the vicinity, by its rows
        self._kept = KeptPoses(options.poses) if prior.loops else None
        self._entries = NOWHERE  # (k, 2) of the kept poses
        if prior.map is not None:
            self._adopt(prior.map)

    def step(self, step: Step) -> Pose:
        """Predicts with the odometry, then corrects by sightings one by one, adding new landmarks.

        Loop closures are next, and the pose is kept, on logs that have some.
        """
        if self._vicinity.used:
            self._vicinity.move(step.odometry)
        if step.odometry is not None:
            delta, cov = np.array(step.odometry.delta), np.array(step.odometry.cov)
            _invariant.move(self._belief.address, self._n, self._entries, delta, cov)
        self._nis = np.empty(len(step.sightings.ids))
        if len(self._nis):
            self._take(step.sightings)
        if self._kept is not None:
            self._close(self._kept, step.loops)
        return self._placed()

    def expected(self, odometry: Odometry | None, seen: RangeBearing, gate: float) -> Expected:
        """Landmarks that one of the sightings may be of, by the joint belief in plain coordinates, to first order."""
        self._expected = self.expected_into(odometry, seen, gate, self._expected)
        return as_expected(self._expected)

    def expected_into(
        self, odometry: Odometry | None, seen: RangeBearing, gate: float, into: ExpectedArrays
    ) -> ExpectedArrays:
        """The same, in compiled arrays."""
        around = self._vicinity
        new = list(islice(reversed(self._slot), len(self._slot) - around.count))[::-1]
        moves = around.ready(odometry, new)
        if new:
            self._near = np.fromiter(self._slot.values(), np.int64, len(self._slot))
        while (
            missing := _plain.ask(
                self._belief.address, around.address, around.count, self._near, moves, around.motion,
                seen.z, seen.cov, gate, into.address,
            )
        ) < 0:  # fmt: skip
            into = roomier(into, -2 * missing)
        return into

    def belief(self) -> Belief:
        """The pose's marginal in plain coordinates, and the NIS of known landmarks' sightings and of loop closures."""
        plain = np.eye(3)
        plain[0, 2], plain[1, 2] = -self._pose[1], self._pose[0]
        cov = plain @ self._strip[:, :3] @ plain.T
        seen = self._nis[self._nis >= 0]
        nis, dof = float(seen.sum()) + self._loops_nis, 2 * len(seen) + 3 * self._loops_used
        return Belief(self._placed(), (cov + cov.T) / 2, nis if dof else None, dof, left_out=self._left_out)

    def map(self) -> Map:
        """All landmarks with joint covariance in plain coordinates; fixed ones first, then in order of sighting."""
        if self._kept is not None:
            return self._map_beside_poses()
        n, fixed = self._n, self._known.size
        block, around = np.empty((n, n)), _lever(self._mean[:n])
        flat = self._flat.copy()  # later results must not change
        _invariant.fold(self._belief.replaced(flat=flat, owing=self._owing.copy()), n)
        _triangle.whole(flat, n, block)
        turned = np.outer(around, self._strip[2, 3 : n + 3])
        cov = np.zeros((fixed + n, fixed + n))
        cov[fixed:, fixed:] = block + (turned + turned.T) + self._strip[2, 2] * np.outer(around, around)
        xy = np.concatenate((self._known, self._mean[:n].reshape(-1, 2))) + self._origin
        return Map(np.fromiter(self._slot, np.int64, len(self._slot)), xy, cov)

    def finish(self) -> Solution | None:
        """The path given all measurements, where the poses of all steps are kept; else None."""
        if self._kept is None or not self._kept.complete or not self._kept.steps:
            return None
        path, cov = np.empty((self._kept.steps, 3)), np.empty((self._kept.steps, 3, 3))
        _invariant_loops.marginals(self._belief.address, self._entries, path, cov)
        path[:, :2] += self._origin
        return Solution(path, self.map(), cov)

    def _map_beside_poses(self) -> Map:
        """`map` where some of the state's entries are of poses."""
        fixed, ids = len(self._known), np.fromiter(self._slot, np.int64, len(self._slot))
        _, xy, cov = self._marginals(ids[fixed:].tolist())
        whole = np.zeros((2 * len(ids), 2 * len(ids)))
        whole[2 * fixed :, 2 * fixed :] = cov[:-3, :-3]
        return Map(ids, np.concatenate((self._known + self._origin, xy)), whole)

    def _close(self, kept: KeptPoses, found: RelativePoses) -> None:
        """Corrects by the loop closures to kept poses, and keeps the pose."""
        loops, pairs = kept.take(found, self._n // 2)
        failed, self._loops_nis = _invariant_loops.close(
            self._belief.address, self._n, self._entries, loops.entries, loops.delta, loops.cov
        )  # fmt: skip
        if failed >= 0:
            raise Diverged(
                f"the innovation covariance of the loop closure to step {loops.to[failed]} is not positive definite"
            )
        self._loops_used, self._left_out = len(loops.to), len(found.to) - len(loops.to)
        self._reserve(2 * pairs)
        self._n, self._entries = 2 * pairs, kept.entries
        _invariant_loops.keep(self._belief.address, self._n, *loops.clone)

    def _marginals(self, landmarks: list[int]) -> tuple[Array, Array, Array]:
        """The pose, the landmarks' places and their joint covariance, the pose last."""
        n = len(landmarks)
        slots = np.array([self._slot[landmark] for landmark in landmarks], np.int64)
        at, cov = np.empty((n, 2)), np.empty((2 * n + 3, 2 * n + 3))
        _plain.plain_joint(self._belief.address, slots, at, cov)
        return self._placed(), at + self._origin, cov

    @property
    def _belief(self) -> GroupArrays:
        """The belief's arrays."""
        if self._arrays is None:
            self._arrays = GroupArrays(
                pose=self._pose, mean=self._mean, strip=self._strip, flat=self._flat, owed=self._owed,
                owing=self._owing, known=self._known, origin=self._origin, blas=self._blas,
            )  # fmt: skip
        return self._arrays

    def _placed(self) -> Pose:
        return np.array([self._pose[0] + self._origin[0], self._pose[1] + self._origin[1], self._pose[2]])

    def _take(self, seen: RangeBearing) -> None:
        """Corrects by the sightings of known landmarks and adds the others, in their order."""
        slot, count = self._slot, self._n // 2
        slots = [slot.get(landmark, -1) for landmark in seen.ids.tolist()]
        if -1 in slots:
            fresh = [landmark for landmark in seen.ids.tolist() if landmark not in slot]
            slot.update(zip(fresh, range(count, count + len(fresh)), strict=True))
            self._reserve(self._n + 2 * len(fresh))
        self._n, wrong = _invariant.observe(
            self._belief.address, self._n, self._entries,
            np.array(slots), np.array(seen.z), np.array(seen.cov, order="C"), self._nis,
        )  # fmt: skip
        if wrong:
            raise Diverged(_invariant.WRONG[wrong])

    def _adopt(self, given: Map) -> None:
        """Starts from a given map, whose plain errors, unlike the group's, are independent of the pose's.

        Landmarks without covariance are held fixed, outside of the state. Their zero plain error is an error of the
        group caused by the heading alone, which the exponential inverts exactly: they do not move.
        """
        n, xy = given.xy.size, given.xy - self._origin
        if given.cov is None:
            self._known = xy
            self._slot = {landmark: -2 - k for k, landmark in enumerate(given.ids.tolist())}
            return
        self._reserve(n)
        self._slot = {landmark: k for k, landmark in enumerate(given.ids.tolist())}
        self._n, self._mean[:n] = n, xy.ravel()
        around = _lever(self._mean[:n])
        self._strip[:, 3 : n + 3] = -np.outer(self._strip[:, 2], around)
        block = given.cov + self._strip[2, 2] * np.outer(around, around)
        _triangle.store(self._flat, block)

    def _reserve(self, entries: int) -> None:
        """Reserves that many entries of the landmarks' mean; half as many again in the vectors."""
        before = len(self._flat)
        self._flat = _triangle.grown(self._flat, entries)
        if self._arrays is not None and len(self._flat) > before:  # it may have moved, and be the same array
            self._arrays = self._arrays.replaced(flat=self._flat)
        if entries <= len(self._mean):
            return
        self._arrays = None
        more = max(SPACE, entries + entries // 2) - len(self._mean)
        self._mean = np.pad(self._mean, (0, more))
        self._strip = np.pad(self._strip, ((0, 0), (0, more)))
        self._owed = np.pad(self._owed, ((0, 0), (0, more)))


def _lever(mean: Array) -> Array:
    """J f of every landmark, (n,): the landmarks' (n,) derivative under a rotation about the origin."""
    return (mean.reshape(-1, 2)[:, ::-1] * [-1.0, 1.0]).ravel()


build = Builder(InvariantEkf, options=Options, loops=True, implementation=COMPILED_HERE)
