"""EKF-SLAM with known correspondence, as in ArUco EKF SLAM, eqs (5)-(20).

The state is (x, y, heading, m1x, m1y, m2x, ...) with one joint covariance. The document's way is to take one sighting
after another, each linearised where the last one left the mean; `update=joint` stacks those of a frame into one update
linearised at the prediction. The equations themselves are in `_ekf`, a frame a call, on a `Joint` belief; a large map
is worked on through its `Active` part, which gives the same answers (see `compressed`).

Where Jacobians are taken decides what the filter believes to observe. At the mean (`standard`) the heading becomes
known though nothing measures it, and the filter is too sure of itself. `first-estimates` (Huang, Mourikis and
Roumeliotis, IJRR 29(5), 2010, the FEJ-EKF) takes every landmark at its first estimate, and the pose at its prediction
both for the sightings there and for the motions from and to it. `ideal` takes them at the truth, which only a study
has.
"""

from dataclasses import dataclass
from math import log

import numpy as np

from ...frontend.factors import Map, Prior, Step, Truth
from ...frontend.options import option
from ...frontend.se2 import Array, Ints
from .._blas import routine
from ..api import COMPILED_HERE, Belief, Builder, Diverged, Pose, TruthWanted
from ._ekf import AT_ROBOT, FIRST, IDEAL, INDEFINITE, ODOMETRY, STANDARD, frame
from .compressed import Active
from .joint import Joint

WHERE = {"standard": STANDARD, "first-estimates": FIRST, "ideal": IDEAL, "odometry": ODOMETRY}
"""The last is no choice of the EKF's: it makes it the linear filter of `kf`."""

LARGEST = 5000
"""Landmarks up to which a map comes with its joint covariance, which takes 0.8 GB there."""

SIGHTINGS = 16
"""Sightings a frame that there is space for at first."""


@dataclass(frozen=True)
class Options:
    """Where the models are linearised, which sightings are believed, and from when on the filter is compressed."""

    jacobians: str = option(
        "standard",
        "where Jacobians are taken: at the mean, at first estimates (Huang 2010), at the truth (needs --oracle)",
        choices=("standard", "first-estimates", "ideal"),
    )
    update: str = option(
        "sequential",
        "one sighting after another, each linearised anew, or those of a frame jointly at the prediction",
        choices=("sequential", "joint"),
    )
    gate: float = option(
        0.0,
        "refuse a sighting whose innovation is further off than this share of right ones is (chi-square); 0: none is",
        minimum=0,
        maximum=0.999999999,
    )
    confirm: int = option(
        3, "with a gate: sightings that must agree with a landmark before others are refused for its sake", minimum=0
    )
    compress_above: int = option(
        100, "landmarks above which only the part of the map in view is updated each step, the rest later", minimum=0
    )


class Ekf:
    """The extended Kalman filter of ArUco EKF SLAM: one sighting after another, the map grown as markers appear.

    With a gate, a sighting is tested against its innovation's covariance before it is used (chi-square, 2 degrees of
    freedom), in a joint update given those before it in the frame. A first sighting cannot be tested, and it may itself
    be the wrong one: until `confirm` others have agreed with it, one that fails the test replaces the landmark instead
    of being refused. Nothing is lost by that, as a first sighting says nothing of the pose; one that agreed by chance
    with a wrong landmark has moved the pose by no more than the gate lets through. Sightings that agree are used from
    the second on, and landmarks that nothing has confirmed are on the map all the same.
    """

    def __init__(self, prior: Prior, options: Options, rng: np.random.Generator) -> None:
        del rng
        self._options = options
        self._where = WHERE[options.jacobians]
        self._gate = -2 * log(1 - options.gate) if options.gate > 0 else 0.0  # the quantile, at two degrees of freedom
        self._confirm = options.confirm
        self._dgemm, self._dsyrk = routine("dgemm"), routine("dsyrk")
        self._whole = Joint(prior.pose, prior.cov, fixed_points=self._where != STANDARD)
        self._part: Active | None = None
        self._slot: dict[int, int] = {}  # landmark id -> its place in the whole
        self._truth: Truth | None = None
        self._true_pose = np.zeros(3)
        self._motion = np.zeros((4, 3))  # dx, dy, dtheta and their covariance
        self._slots, self._z, self._z_cov = _frame_of(SIGHTINGS)
        self._nis, self._nis_dof, self._refused = 0.0, 0, 0
        if prior.map is not None:
            self._whole.adopt(prior.map)
            self._whole.agreed[: len(prior.map.ids)] = self._confirm
            self._slot = {landmark: i for i, landmark in enumerate(prior.map.ids.tolist())}

    def tell(self, truth: Truth) -> bool:
        """Take the truth to linearise at; False unless the Jacobians are to be ideal."""
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
        """Predict with the odometry and fold the sightings in: correct, or add a marker not yet known."""
        if self._where == IDEAL:
            self._true_pose[:] = self._truth_at(step.t)
        known, slot = len(self._slot), self._slot
        if self._part is None and known > self._options.compress_above:
            self._part = Active(self._whole, self._dgemm, fixed_points=self._where != STANDARD)
        ids, z, R = step.sightings
        k = len(ids)
        slots = [slot.setdefault(landmark, len(slot)) for landmark in ids.tolist()]
        if len(slot) > known:
            self._make_space(ids.tolist(), slots)
        part = self._whole
        if self._part is not None:
            part, slots = self._part, self._part.bring(slots, known)
        if k > len(self._slots):
            self._slots, self._z, self._z_cov = _frame_of(2 * k)
        self._slots[:k], self._z[:k], self._z_cov[:k] = slots, z, R
        if step.odometry is not None:
            self._motion[0], self._motion[1:] = step.odometry
        failed, why, self._nis, self._nis_dof, self._refused = frame(
            part.mean, part.points, part.predicted, part.agreed, part.pose, part.cross, part.flat,
            part.transition, part.information, part.pull,
            2 * (part.landmarks - len(slot) + known), part.columns,
            step.odometry is not None, self._motion, self._true_pose, k, self._slots, self._z, self._z_cov,
            self._where, self._options.update == "joint", self._gate, self._options.confirm,
            part.owed_pose, part.owed_map, part.owed_transition, self._dgemm, self._dsyrk,
        )  # fmt: skip
        if why == AT_ROBOT:
            raise Diverged(
                f"the estimate of landmark {ids[failed]} lies at the robot's own position: it has no bearing"
            )
        if why == INDEFINITE:
            raise Diverged(f"the innovation covariance of landmark {ids[failed]} is not positive definite")
        return part.mean[:3].copy()

    def belief(self) -> Belief:
        """The pose's marginal and the NIS of those sightings of landmarks already known that were used."""
        part = self._whole if self._part is None else self._part
        nis = self._nis if self._nis_dof else None
        return Belief(part.mean[:3].copy(), part.pose.copy(), nis, self._nis_dof, refused=self._refused)

    def map(self) -> Map:
        """All landmarks in the order in which they were first seen, with their joint covariance up to `LARGEST`."""
        whole = self._whole
        if self._part is not None:  # settled on a copy: asking must not change what comes after
            whole = whole.copy()
            self._part.settle_with(whole)
        ids = np.fromiter(self._slot, np.int64, len(self._slot))
        return Map(ids, whole.xy(), whole.cov() if len(ids) <= LARGEST else None)

    def finish(self) -> None:
        """None: a filter does not look back."""

    def _make_space(self, ids: list[int], slots: list[int]) -> None:
        """For landmarks that are new."""
        self._whole.grow(len(self._slot))
        if self._where == IDEAL:
            for landmark, slot in zip(ids, slots, strict=True):
                self._linearise_at_truth(landmark, slot)

    def _truth_at(self, t: float) -> Array:
        """The true pose at time t (s), to the last bit."""
        if self._truth is None:
            raise TruthWanted("ekf[jacobians=ideal] linearises at the truth: it needs bench run --oracle")
        i = self._pose_at.get(t)
        if i is None:
            raise TruthWanted(f"ekf[jacobians=ideal] needs the true pose of every step; there is none at t = {t:.6g} s")
        return self._truth.poses[i]

    def _linearise_at_truth(self, landmark: int, slot: int) -> None:
        xy = self._xy_of.get(landmark)
        if xy is None:
            raise TruthWanted(
                f"ekf[jacobians=ideal] needs the true place of every landmark; that of {landmark} is lacking"
            )
        self._whole.points[3 + 2 * slot : 5 + 2 * slot] = xy


def _frame_of(k: int) -> tuple[Ints, Array, Array]:
    """Space for the sightings of a frame, k at most."""
    return np.zeros(k, np.int64), np.zeros((k, 2)), np.zeros((k, 2, 2))


build = Builder(Ekf, options=Options, implementation=COMPILED_HERE)
