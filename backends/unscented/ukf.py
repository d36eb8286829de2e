"""UKF-SLAM, with sigma points only over the coordinates a model depends on.

The unscented transform (Julier and Uhlmann, A New Extension of the Kalman Filter to Nonlinear Systems, 1997; scaled as
by Wan and van der Merwe, 2000) replaces the EKF's Jacobians by a regression over a few points spread as wide as the
belief. The whole state need not be sampled: a motion depends on the pose and its own noise alone, a sighting on the
pose and one landmark, so 13 or 11 points suffice for any size of the map (Andrade-Cetto, Vidal-Calleja and Sanfeliu,
Unscented Transformation of Vehicle States in SLAM, ICRA 2005; Huang, Mourikis and Roumeliotis, On the Complexity and
Consistency of UKF-based SLAM, ICRA 2009). Angles are averaged as wrapped differences from the central point's.

Over these few coordinates x the transform is the line A (x - mean) + shift and a residual covariance (Lefebvre,
Bruyninckx and De Schutter, IEEE Trans. Automatic Control 47(8), 2002). The rest of the state follows through its
covariance with x: a step is the EKF's with A as the Jacobian and the residual added to the noise, at the same cost.
Only the 3 x 3 or 5 x 5 covariance of x is factored.

The square-root form, which keeps the root of the whole covariance (van der Merwe and Wan, ICASSP 2001; Holmes, Klein
and Murray, ICRA 2008), gives the same estimates at five times the cost for 1,000 landmarks, with a larger numerical
range: here, as in the EKF, rounding can make a covariance indefinite where the prior's standard deviations are more
than 10^6 times a sighting's. The filter then ends with `Diverged`.

The models are those of ArUco EKF SLAM: eq. (2) for a motion, (12) for a sighting, (17) for a new landmark.

Positions, headings and sightings of a range or a bearing alone come after the whole sightings of their step, and
landmarks that these leave open start late: see `..gaussian.late_starts`, and `_partial` for the transform.

A gyro's bias is an entry of the state. The joint of state and motion is conditioned on the turn before it moves, which
is linear, so exact (see `core.gyro`); the motion then depends on the state, and sigma points are those of both.
"""

from dataclasses import dataclass

import numpy as np

from ...core.factors import UNKNOWN, Map, Odometry, Prior, RangeBearing, Step
from ...core.gyro import Turn
from ...core.options import option
from .. import common_options
from .._expected_arrays import ExpectedArrays
from ..api import COMPILED_HERE, Belief, Bias, Builder, Calibration, Diverged, Expected, Pose
from ..expected import as_expected, room_for, roomier
from ..gaussian._ekf import STANDARD
from ..gaussian._expected import expect
from ..gaussian._partial import turned
from ..gaussian.joint import Joint
from ..gaussian.late_starts import NO_GATES, LateStarts
from . import _ukf
from .parts import UnscentedParts


@dataclass(frozen=True)
class Options:
    """Spread and weights of the sigma points; all settings keep the covariance positive definite."""

    alpha: float = option(1.0, "spread of the sigma points; 1 is sqrt(dimensions + kappa)", minimum=1e-3, maximum=2)
    beta: float = option(2.0, "extra weight of the central point; 2 suits a Gaussian", minimum=0, maximum=10)
    kappa: float = option(0.0, "added to the number of dimensions in the spread", minimum=0, maximum=10)
    gyro: str = common_options.gyro()


class Ukf:
    """Unscented Kalman filter: sigma points replace Jacobians, over the pose and one landmark."""

    def __init__(self, prior: Prior, options: Options, rng: np.random.Generator) -> None:
        del rng
        self._scaling = np.array([options.alpha**2, options.kappa, options.beta - options.alpha**2])
        self._slot: dict[int, int] = {}  # landmark id -> its number, or -1 minus its number among those held fixed
        self._ids = np.zeros(0, np.int64)  # and the inverse when last asked what is expected; UNKNOWN for other pairs
        self._known = np.zeros((0, 2))  # landmarks held fixed, m
        self._joint = Joint(prior.pose, prior.cov, fixed_points=False)
        self._expected = room_for(16)
        self._motion = np.zeros((4, 3))  # dx, dy, dtheta and their covariance
        self._nis, self._nis_dof = 0.0, 0
        if prior.map is not None:
            self._adopt(prior.map)
        parts = UnscentedParts(self._joint, self._known, self._scaling)
        self._bias = None if prior.gyro is None else parts.constant(prior.gyro.sd, 0.0)
        if self._bias is not None and prior.gyro is not None:
            self._joint.mean[3 + self._bias] = prior.gyro.mean
        self._turn: Turn | None = None  # of the next step, where that has been told
        self._late: LateStarts | None = None
        if prior.partial or prior.fixes or prior.systematic.wheel_scale:
            self._late = LateStarts(parts, prior, self._slot)

    def step(self, step: Step) -> Pose:
        """Predicts with the odometry, then corrects by sightings one by one, adding new landmarks."""
        joint, slot = self._joint, self._slot
        count = joint.pairs
        others = count - len(slot)  # pairs of no landmark, less landmarks held fixed
        ids, z, R = step.sightings
        slots = [slot.setdefault(landmark, others + len(slot)) for landmark in ids.tolist()]
        if others + len(slot) > count:
            joint.grow(others + len(slot))
        odometry = step.odometry if self._late is None else self._late.moved(step.odometry)
        self._turn, moves = None, odometry is not None
        if odometry is not None:
            self._motion[0], self._motion[1:] = odometry
            if self._bias is not None and step.gyro is not None:
                moves = False
                if not _ukf.move_by_gyro(joint.address, 2 * count, self._motion, self._bias, *step.gyro, self._scaling):
                    raise Diverged("the covariance of the predicted pose is not positive definite")
        wrong, self._nis, self._nis_dof = _ukf.frame(
            joint.address, 2 * count, self._known, moves, self._motion,
            np.array(slots, np.int64), np.array(z), np.array(R, order="C"), self._scaling,
        )  # fmt: skip
        if wrong:
            raise Diverged(f"the covariance of {_ukf.WRONG[wrong]} is not positive definite")
        if self._late is not None:
            nis, dof, _ = self._late.step(step, NO_GATES)
            self._nis, self._nis_dof = self._nis + nis, self._nis_dof + dof
            if self._late.compacted():
                self._ids = self._ids[:0]
        return joint.mean[:3].copy()

    def foresee(self, turn: Turn | None) -> None:
        """Takes the next step's turn, by which sightings are expected."""
        self._turn = turn

    def expected(self, odometry: Odometry | None, seen: RangeBearing, gate: float) -> Expected:
        """Landmarks that one of the sightings may be of, by the joint belief, to first order."""
        self._expected = self.expected_into(odometry, seen, gate, self._expected)
        return as_expected(self._expected)

    def expected_into(
        self, odometry: Odometry | None, seen: RangeBearing, gate: float, into: ExpectedArrays
    ) -> ExpectedArrays:
        """The same, in compiled arrays."""
        joint = self._joint
        if odometry is not None:
            self._motion[0], self._motion[1:] = odometry
        if len(self._ids) < joint.pairs:
            self._ids = np.full(joint.pairs, UNKNOWN)
            pairs = np.fromiter(self._slot.values(), np.int64, len(self._slot))
            self._ids[pairs[pairs >= 0]] = np.fromiter(self._slot, np.int64, len(self._slot))[pairs >= 0]
        if odometry is not None and self._bias is not None and self._turn is not None:
            joint = joint.copy()
            turned(
                joint.address, 2 * joint.pairs, self._motion, np.zeros(3), self._bias, *self._turn, STANDARD
            )  # fmt: skip
        while not expect(
            joint.address, self._ids, joint.pairs, odometry is not None, self._motion, STANDARD, seen.z, seen.cov, gate,
            into.address,
        ):  # fmt: skip
            into = roomier(into, 2 * len(into.ids))
        return into

    def belief(self) -> Belief:
        """The pose's marginal and the NIS of the step's sightings of known landmarks."""
        nis = self._nis if self._nis_dof else None
        return Belief(self._joint.mean[:3].copy(), self._joint.pose.copy(), nis, self._nis_dof)

    def map(self) -> Map:
        """All landmarks with their joint covariance, fixed ones first, then in order of first sighting."""
        joint, fixed = self._joint, self._known.size
        pairs = np.fromiter(self._slot.values(), np.int64, len(self._slot))[len(self._known) :]
        n = 2 * len(pairs)
        cov = np.zeros((fixed + n, fixed + n))
        plain = self._late is None and self._bias is None
        cov[fixed:, fixed:] = joint.cov() if plain else joint.cov_of(pairs)
        xy = np.concatenate((self._known, joint.xy()[pairs]))
        return Map(np.fromiter(self._slot, np.int64, len(self._slot)), xy, cov)

    def finish(self) -> None:
        """None: a filter does not smooth."""

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
        return None if self._bias is None else Bias(*self._joint.one(self._bias))

    @property
    def pairs(self) -> int:
        """The state's pairs after the pose: landmarks, kept poses, constant errors."""
        return self._joint.pairs

    def _adopt(self, given: Map) -> None:
        """Starts from a given map; landmarks without covariance are held fixed, outside of the state."""
        ids = given.ids.tolist()
        if given.cov is None:
            self._known = np.array(given.xy)
            self._slot = {landmark: -1 - k for k, landmark in enumerate(ids)}
            return
        try:
            np.linalg.cholesky(given.cov)
        except np.linalg.LinAlgError:
            raise Diverged("the covariance of the given map is not positive definite") from None
        self._slot = {landmark: k for k, landmark in enumerate(ids)}
        self._joint.adopt(given)


build = Builder(
    Ukf, options=Options, partial=True, fixes=True, gyro=True, wheel_scale=True, implementation=COMPILED_HERE
)
