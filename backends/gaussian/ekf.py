"""EKF-SLAM with known data association, as in ArUco EKF SLAM, eqs (5)-(20).

The state is (x, y, heading, m1x, m1y, m2x, ...) with one joint covariance. The document processes sightings one by one,
each linearised at the mean left by the last; `update=joint` stacks those of a frame into one update linearised at the
prediction. The equations themselves are in `_ekf`, one frame per call, on a `Joint` belief; large maps are processed
through their `Active` part, with the same results (see `compressed`).

The linearisation points determine which directions the filter treats as observable. At the mean (`standard`) the
heading gains information that no measurement provides, and the filter becomes overconfident. `first-estimates` (Huang,
Mourikis and Roumeliotis, IJRR 29(5), 2010, the FEJ-EKF) linearises every landmark at its first estimate, and the pose
at its prediction, for sightings and motions alike. `ideal` linearises at the ground truth, for studies only.

Positions, headings and sightings of a range or a bearing alone come after the whole sightings of their step: see
`late_starts`. Logs with some are not compressed, nor are those with a gyro, whose bias is an entry of the state: see
`core.gyro`.

On a log with loop closures the state also has the poses that these may come back to: see `kept_poses`. They are taken
after the sightings of their step, and the pose is cloned last. A clone keeps the pose's linearisation point, for first
estimates its prediction, so that all models are linearised at one path.
"""

from dataclasses import dataclass
from itertools import takewhile
from math import log
from typing import Any

import numpy as np
from scipy.special import chdtri

from ...core.factors import UNKNOWN, Map, Odometry, Prior, RangeBearing, RelativePoses, Step, Truth
from ...core.gyro import Turn
from ...core.options import option
from ...core.se2 import Array
from .. import common_options
from .._expected_arrays import ExpectedArrays
from ..api import COMPILED_HERE, Belief, Bias, Builder, Calibration, Diverged, Expected, Pose, Solution, TruthWanted
from ..expected import as_expected, room_for, roomier
from ._beliefs import Frame
from ._ekf import AT_ROBOT, FIRST, IDEAL, INDEFINITE, ODOMETRY, POSE, STANDARD, frame
from ._expected import expect
from ._loops import close, keep
from ._partial import turned
from .compressed import Active
from .joint import Joint
from .joint_parts import JointParts
from .kept_poses import SUMMARY, KeptPoses, Loops
from .late_starts import LateStarts

WHERE = {"standard": STANDARD, "first-estimates": FIRST, "ideal": IDEAL, "odometry": ODOMETRY}
"""The last is not an option of the EKF: it makes it the linear filter of `kf`."""

LARGEST = 5000  # most landmarks of a map with joint covariance, which takes 0.8 GB at that size
SIGHTINGS = 16  # sightings per frame that space is reserved for at first
NOWHERE = np.zeros(3)
"""In place of the true pose where none is linearised at."""


@dataclass(frozen=True)
class Options:
    """Linearisation points, gating, and the map size from which the filter is compressed."""

    jacobians: str = option(
        "standard",
        "linearise at the mean, at first estimates (Huang 2010), or at the ground truth (needs --oracle)",
        choices=("standard", "first-estimates", "ideal"),
    )
    update: str = option(
        "sequential",
        "process sightings one by one, each at the newest estimate, or those of a frame jointly at the prediction",
        choices=("sequential", "joint"),
    )
    frame: str = option(
        "start",
        "on logs with fixes, whose coordinates the state is in: the start's, whose place in the world is another part "
        "of it, or the world's, as with first estimates, loop closures or a given map",
        choices=("start", "world"),
    )
    gate: float = common_options.gate()
    gate_after: int = common_options.gate_after()
    compress_above: int = option(
        100, "landmarks above which only the part of the map in view is updated each step, the rest later", minimum=0
    )
    poses: int = option(0, SUMMARY, minimum=0)
    gyro: str = common_options.gyro()


class Ekf:
    """The extended Kalman filter of ArUco EKF SLAM: sightings one by one, markers added as they appear.

    With a gate, a sighting is tested against its innovation's covariance before it is used (chi-square, 2 degrees of
    freedom), in a joint update conditional on those before it in the frame. A first sighting cannot be tested, and may
    be the outlier itself: until `gate_after` others have agreed with it, one that fails the test replaces the landmark
    instead of being rejected. Nothing is lost by that, as a first sighting carries no information on the pose; one that
    agreed by chance with a wrong landmark has moved the pose by no more than the gate allows. Sightings that agree are
    used from the second on, and unconfirmed landmarks are part of the map. A loop closure is tested likewise, with 3
    degrees of freedom.
    """

    def __init__(self, prior: Prior, options: Options, rng: np.random.Generator) -> None:
        del rng
        self._options = options
        self._where = WHERE[options.jacobians]
        self._gate = -2 * log(1 - options.gate) if options.gate > 0 else 0.0  # the quantile, at two degrees of freedom
        self._loop_gate = float(chdtri(3, 1 - options.gate)) if options.gate > 0 else 0.0
        self._confirm = options.gate_after
        apart = prior.fixes and not prior.loops and prior.map is None and self._where == STANDARD
        apart = apart and options.frame == "start"
        start = (np.zeros(3), np.zeros((3, 3))) if apart else (prior.pose, prior.cov)
        self._whole = Joint(*start, fixed_points=self._where != STANDARD)
        self._parts = JointParts(self._whole, self._where)
        if apart:
            self._parts.start_at(prior.pose, prior.cov)
        self._part: Active | None = None
        self._slot: dict[int, int] = {}  # landmark id -> its index in the whole
        self._ids = np.zeros(0, np.int64)  # and the inverse when last asked what is expected; UNKNOWN for kept poses
        self._truth: Truth | None = None
        self._expected = room_for(SIGHTINGS)
        self._frame = Frame(motion=np.zeros((4, 3)), truth=np.zeros(3), **_sightings(SIGHTINGS))
        self._nis, self._nis_dof, self._refused, self._left_out = 0.0, 0, 0, 0
        self._kept = KeptPoses(options.poses) if prior.loops else None
        self._gates = np.array([float(chdtri(k, 1 - options.gate)) if options.gate > 0 else 0.0 for k in (1, 2, 3)])
        if prior.map is not None:
            self._whole.adopt(prior.map)
            self._whole.agreed[: len(prior.map.ids)] = self._confirm
            self._slot = {landmark: i for i, landmark in enumerate(prior.map.ids.tolist())}
        self._bias = None if prior.gyro is None else self._parts.constant(prior.gyro.sd, 0.0)
        if self._bias is not None and prior.gyro is not None:
            self._whole.mean[3 + self._bias] = prior.gyro.mean
        self._turn: Turn | None = None  # of the next step, where that has been told
        self._late: LateStarts | None = None
        if prior.partial or prior.fixes or prior.systematic.wheel_scale:
            self._late = LateStarts(self._parts, prior, self._slot, self._started)
        self._mixed = self._late is not None or self._bias is not None
        """The state has more than landmarks and poses: it is not compressed."""

    def tell(self, truth: Truth) -> bool:
        """Stores the ground truth to linearise at; False unless the Jacobians are to be ideal."""
        if self._where != IDEAL:
            return False
        self._truth = truth
        self._pose_at = {t: i for i, t in enumerate(truth.t.tolist())}
        known = truth.map
        self._xy_of = {} if known is None else dict(zip(known.ids.tolist(), known.xy, strict=True))
        for landmark, slot in self._slot.items():
            self._linearise_at_truth(landmark, slot)
        return True

    def step(self, step: Step) -> Pose:
        """Predicts with the odometry, then processes the sightings: corrects by known markers and adds new ones.

        Loop closures are next, and the pose is kept, on logs that have some.
        """
        if self._where == IDEAL:
            self._frame.truth[:] = self._truth_at(step.t)
        self._turn = None
        known, slot, part = self._whole.pairs, self._slot, self._whole
        landmarks, poses = len(slot), known - len(slot)
        if landmarks > self._options.compress_above and not self._mixed:
            self._compressed()
        ids, z, R = step.sightings
        k = len(ids)
        slots = [slot.setdefault(landmark, poses + len(slot)) for landmark in ids.tolist()]
        if len(slot) > landmarks:
            self._make_space(ids.tolist(), slots)
        loops = None if self._kept is None else self._loops_of(self._kept, step.loops)
        if self._part is not None:
            part = self._part
            part.move(step.odometry)
            pairs = [] if loops is None else loops.pairs()
            slots = part.bring([*slots, *pairs], known)
            loops = None if loops is None else loops.moved(dict(zip(pairs, slots[k:], strict=True)))
        if k > len(self._frame.slots):
            self._frame = self._frame.replaced(**_sightings(2 * k))
        seen = self._frame
        seen.slots[:k], seen.z[:k], seen.cov[:k] = slots[:k], z, R.reshape(k, 4)
        odometry = step.odometry if self._late is None else self._late.moved(step.odometry)
        if odometry is not None:
            seen.motion[0], seen.motion[1:] = odometry
            if self._bias is not None and step.gyro is not None:
                turned(part.address, 2 * known, seen.motion, seen.truth, self._bias, *step.gyro, self._where)
        failed, why, self._nis, self._nis_dof, self._refused = frame(
            part.address, seen.address, 2 * (part.pairs - self._whole.pairs + known), part.columns, k,
            step.odometry is not None, self._where, self._options.update == "joint", self._gate, self._confirm,
        )  # fmt: skip
        if why == AT_ROBOT:
            raise Diverged(
                f"the estimate of landmark {ids[failed]} lies at the robot's own position: it has no bearing"
            )
        if why == INDEFINITE:
            raise Diverged(f"the innovation covariance of landmark {ids[failed]} is not positive definite")
        if self._late is not None:
            nis, dof, refused = self._late.step(step, self._gates)
            self._nis, self._nis_dof, self._refused = self._nis + nis, self._nis_dof + dof, self._refused + refused
            if self._kept is None and self._late.compacted():
                self._ids = self._ids[:0]
        if loops is not None:
            self._close(part, loops)
            keep(part.address, 2 * part.pairs, part.columns, *loops.clone)
        return part.mean[:3].copy() if self._late is None else self._parts.pose()

    def foresee(self, turn: Turn | None) -> None:
        """Takes the next step's turn, by which sightings are expected."""
        self._turn = turn

    def expected(self, odometry: Odometry | None, seen: RangeBearing, gate: float) -> Expected:
        """Landmarks that one of the sightings may be of, by the joint belief after the motion."""
        self._expected = self.expected_into(odometry, seen, gate, self._expected)
        return as_expected(self._expected)

    def expected_into(
        self, odometry: Odometry | None, seen: RangeBearing, gate: float, into: ExpectedArrays
    ) -> ExpectedArrays:
        """The same, in compiled arrays."""
        moves, part, ids = odometry is not None, self._whole, self._ids
        known = len(ids)
        if part.pairs > known:
            self._ids = ids = np.concatenate((ids, np.full(part.pairs - known, UNKNOWN)))
            for landmark, at in takewhile(lambda one: one[1] >= known, reversed(self._slot.items())):
                ids[at] = landmark
        if odometry is not None:
            self._frame.motion[0], self._frame.motion[1:] = odometry
        where = STANDARD if self._where == IDEAL else self._where
        if len(self._slot) > self._options.compress_above and not self._mixed:
            part = self._compressed()
            part.bring_near(odometry, seen, gate)
            ids = ids[part.members()]
        if odometry is not None and self._bias is not None and self._turn is not None:
            part = part.copy()
            turned(part.address, 2 * part.pairs, self._frame.motion, NOWHERE, self._bias, *self._turn, where)
        if self._gate > 0:
            part.bound.fill(np.inf)  # a landmark may have been started again
        address = part.address
        while not expect(
            address, ids, part.pairs, moves, self._frame.motion, where, seen.z, seen.cov, gate, into.address
        ):  # fmt: skip
            into = roomier(into, 2 * len(into.ids))
        return into

    def unite(self, pairs: list[tuple[int, int]]) -> Pose:
        """Corrects by their differences, which are zero: both are at one place from then on."""
        if self._part is not None:
            self._part.settle_with(self._whole)
            self._part = None
        whole = self._whole
        slots = np.array([(self._slot[gone], self._slot[kept]) for gone, kept in pairs], np.int64)
        whole.equate(slots)
        return whole.mean[:3].copy() if self._late is None else self._parts.pose()

    def belief(self) -> Belief:
        """The pose's marginal and the NIS of the loop closures, and sightings of known landmarks, that were used."""
        part = self._whole if self._part is None else self._part
        nis = self._nis if self._nis_dof else None
        pose, cov = part.mean[:3].copy(), part.pose.copy()
        if self._late is not None:
            pose, cov = self._parts.pose(), self._parts.pose_cov()
        return Belief(pose, cov, nis, self._nis_dof, refused=self._refused, left_out=self._left_out)

    def map(self) -> Map:
        """All landmarks in order of first sighting, with their joint covariance up to `LARGEST`."""
        return self._map_of(self._settled())

    def finish(self) -> Solution | None:
        """The path given all measurements, where the poses of all steps are kept; else None."""
        if self._kept is None or not self._kept.complete or not self._kept.steps:
            return None
        whole = self._settled()
        path, cov = whole.poses(self._kept.entries)
        return Solution(path, self._map_of(whole), cov, gyro_bias=self.gyro_bias)

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
        return None if self._bias is None else Bias(*self._whole.one(self._bias))

    @property
    def pairs(self) -> int:
        """The state's pairs after the pose: landmarks, kept poses, constant errors."""
        return self._whole.pairs

    def _settled(self) -> Joint:
        """The whole belief at present: a copy where it is compressed, so that later results do not change."""
        if self._part is None:
            return self._whole
        whole = self._whole.copy()
        self._part.settle_with(whole)
        return whole

    def _map_of(self, whole: Joint) -> Map:
        ids = np.fromiter(self._slot, np.int64, len(self._slot))
        if self._kept is None and not self._mixed:
            return Map(ids, whole.xy(), whole.cov() if len(ids) <= LARGEST else None)
        pairs = np.fromiter(self._slot.values(), np.int64, len(ids))
        if self._late is not None:
            return Map(ids, self._parts.places(pairs), self._parts.places_cov(pairs) if len(ids) <= LARGEST else None)
        return Map(ids, whole.xy()[pairs], whole.cov_of(pairs) if len(ids) <= LARGEST else None)

    def _loops_of(self, kept: KeptPoses, found: RelativePoses) -> Loops:
        """Those of a step's loop closures that are to kept poses, and space for its own pose."""
        loops, pairs = kept.take(found, self._whole.pairs)
        self._left_out = len(found.to) - len(loops.to)
        if pairs > self._whole.pairs:
            self._whole.grow(pairs)
        for entry in loops.clone:
            self._whole.agreed[entry // 2] = POSE
        return loops

    def _close(self, part: Joint, loops: Loops) -> None:
        """Corrects by loop closures."""
        failed, why, nis, dof, refused = close(
            part.address, 2 * part.pairs, part.columns, loops.entries, loops.delta, loops.cov,
            self._where, self._options.update == "joint", self._loop_gate,
        )  # fmt: skip
        if why == INDEFINITE:
            raise Diverged(
                f"the innovation covariance of the loop closure to step {loops.to[failed]} is not positive definite"
            )
        self._nis, self._nis_dof, self._refused = self._nis + nis, self._nis_dof + dof, self._refused + refused

    def _compressed(self) -> Active:
        """The part in view of a map that is large."""
        if self._part is None:
            self._part = Active(self._whole, fixed_points=self._where != STANDARD)
        return self._part

    def _make_space(self, ids: list[int], slots: list[int]) -> None:
        """Reserves space for new landmarks, whose slots are the last."""
        self._whole.grow(max(slots) + 1)
        if self._where == IDEAL:
            for landmark, slot in zip(ids, slots, strict=True):
                self._linearise_at_truth(landmark, slot)

    def _started(self, landmark: int, slot: int) -> None:
        """A landmark has entered the map late."""
        if self._where == IDEAL:
            self._linearise_at_truth(landmark, slot)

    def _truth_at(self, t: float) -> Array:
        """The true pose at time t (s), to the last bit."""
        if self._truth is None:
            raise TruthWanted("ekf[jacobians=ideal] linearises at the ground truth: it needs bench run --oracle")
        i = self._pose_at.get(t)
        if i is None:
            raise TruthWanted(f"ekf[jacobians=ideal] needs the true pose of every step; none at t = {t:.6g} s")
        return self._truth.poses[i]

    def _linearise_at_truth(self, landmark: int, slot: int) -> None:
        xy = self._xy_of.get(landmark)
        if xy is None:
            raise TruthWanted(f"ekf[jacobians=ideal] needs the true position of every landmark, none of {landmark}")
        self._whole.points[3 + 2 * slot : 5 + 2 * slot] = xy


def _sightings(k: int) -> dict[str, Any]:
    """Arrays of a `Frame` for at most k sightings."""
    return {"slots": np.zeros(k, np.int64), "z": np.zeros((k, 2)), "cov": np.zeros((k, 4))}


build = Builder(
    Ekf,
    options=Options,
    loops=True,
    partial=True,
    fixes=True,
    gyro=True,
    wheel_scale=True,
    implementation=COMPILED_HERE,
)
