"""iSAM2: incremental smoothing and mapping with the Bayes tree (Kaess et al., IJRR 31(2), 2012), by GTSAM.

Three differences from GTSAM's examples: the latest pose is taken from its marginal, which the top of the Bayes tree
gives alone, as its last factors are there; asking for the estimate would back-substitute through all changes at every
step. Variables are checked for relinearization every 50 steps, which saves most of the checks' cost (the study
`relinearisation`); a gyro's bias moves all headings since the start, so that they are checked, too, once the newest
ones were corrected by the threshold in all. And on logs of partial sightings `bayes_tree` looks at J where a landmark
starts, where they move the newest pose far at once, before a check, and at the end.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice

import gtsam
import numpy as np

from ...core.factors import Map, Odometry, Prior, RangeBearing, Step
from ...core.gyro import Bias
from ...core.se2 import Array, rotation
from .. import common_options
from ..api import GTSAM_WHEEL, Belief, Builder, Diverged, Expected, Pose, Solution
from ..incremental.biases import together
from ..incremental.smoother import JUMP, SMALL
from ..vicinity import Vicinity, first_expected
from ._gtsam import Factors, array, joint_covariance, path_and_map, pose2, to_world
from .bayes_tree import BayesTree, TreeOptions
from .gtsam_parts import FAILURES

FINE = 3e-5
"""Relinearize threshold at the end with constant errors: a scale of ranges is that of tens of metres."""

MORE_UPDATES = 5
"""Times `final_updates` with that threshold: on CMU's Plaza logs a loss needs more of them to move nothing by more."""

NOTHING = gtsam.VectorValues()  # parents of a single variable's marginal: none


@dataclass(frozen=True)
class Options(TreeOptions):
    """Settings; the defaults are the best found."""

    joint_up_to: int = common_options.joint_up_to()
    loss: str = common_options.loss("sightings and loops")
    loss_scale: float = common_options.loss_scale()
    gyro: str = common_options.gyro()


class Isam2:
    """The iSAM2 factor graph (GTSAM): a causal pose each step, the smoothed path and map at the end."""

    def __init__(self, prior: Prior, options: Options, rng: np.random.Generator) -> None:
        del rng
        self._options, self._prior = options, prior
        self._tree = BayesTree(options)
        self._factors = Factors(prior, options.loss, options.loss_scale)
        self._vicinity = Vicinity(follows=True)
        self._pose = pose2(prior.pose)
        self._corrected = 0.0  # rad, by which newest headings were corrected since the last check for a gyro's bias
        self._tree.update(*self._factors.prior())

    def step(self, step: Step) -> Pose:
        """Adds the step's factors at the current estimate and returns the latest pose alone."""
        if self._vicinity.used:
            self._vicinity.move(step.odometry)
        tree, k = self._tree, self._tree.steps
        tree.partly = tree.partly or len(step.partial.ids) > 0
        if tree.partly and (tree.done + 1) % self._options.relinearize_skip == 0:
            tree.look()
        bias = None if step.gyro is None else self.gyro_bias
        guess = ahead(self._pose, step, bias)
        graph, values = self._factors.step(k, step, guess, estimated=self._estimated, bias=bias)
        if self._factors.late:
            tree.start(graph, values)
            moved = True
        else:
            due = self._corrected > self._options.relinearize_threshold and not tree.stays
            moved = tree.update(graph, values, relinearize=due) > 0
            self._corrected = 0.0 if due else self._corrected
        if self._vicinity.used:
            tree.around.fold(graph, values, self._factors.keys.pose(k), moved=moved)
        self._pose = self._latest(guess)
        if step.gyro is not None:
            self._corrected += abs(math.remainder(self._pose.theta() - guess.theta(), math.tau))
        if len(step.partial.ids) and (tree.stays or self._jumped(guess)):
            tree.look()
            self._pose = self._latest(guess)
        tree.steps += 1
        x, y, heading = self._pose.x(), self._pose.y(), self._pose.theta()
        if not math.isfinite(x + y + heading):
            raise Diverged("the latest pose is not finite")
        return np.array((x, y, heading if heading > -math.pi else math.pi))

    def expected(self, odometry: Odometry | None, seen: RangeBearing, gate: float) -> Expected:
        """Landmarks that one of the sightings may be of, by joint marginals; one that is held back is offered, too."""
        if self._tree.steps == 0:
            return first_expected(self._prior, seen, gate)
        known = self._factors.keys.landmarks
        new = list(islice(reversed(known), len(known) - len(self._vicinity)))
        found = self._vicinity.expected(
            array(self._pose), None, odometry, seen, gate, new[::-1], self._joint_marginals
        )  # fmt: skip
        return self._factors.with_held(found, odometry, self._tree.steps - 1)

    def belief(self) -> Belief:
        """The latest pose and its marginal covariance."""
        pose = array(self._pose)
        R, _ = self._tree.marginal(self._factors.keys.pose(max(self._tree.steps - 1, 0))).jacobian()
        R_inv = np.linalg.inv(R)
        return Belief(pose, to_world(pose, R_inv @ R_inv.T))

    @property
    def gyro_bias(self) -> Bias | None:
        """The gyro's bias at the last step; None without a gyro."""
        key = self._factors.biases.last
        if key is None:
            return self._prior.gyro
        marginal = self._tree.marginal(key)
        at = float(self._tree.isam.getLinearizationPoint().atPoint2(key)[0])
        (a, b), (_, c) = marginal.R().tolist()
        return Bias(at + float(marginal.solve(NOTHING).at(key)[0]), math.hypot(1 / a, b / (a * c)))

    def map(self) -> Map:
        """Landmarks at the current estimate with, up to `joint_up_to` of them, their joint covariance."""
        landmarks = path_and_map(self._factors.keys, 0, self._tree.isam.calculateEstimate())[1]
        if len(landmarks.ids) > self._options.joint_up_to:
            return landmarks
        try:
            # From the factors: the tree's QR is ten times slower for many landmarks.
            marginals = gtsam.Marginals(self._tree.isam.getFactorsUnsafe(), self._tree.isam.getLinearizationPoint())
            cov = joint_covariance(self._factors.keys, marginals)
        except FAILURES:  # where Cholesky fails
            cov = joint_covariance(self._factors.keys, self._tree.isam)
        return landmarks._replace(cov=cov)

    def finish(self) -> Solution:
        """Relinearizes until nothing moves by more than the threshold, then solves with full back-substitution.

        Landmarks that partial sightings have not started are before, with all of their sightings.

        Landmarks that are near lower the threshold, and constant errors do: a tree with the new one is made of all
        factors, and kept if its J is lower.
        """
        tree = self._tree
        if tree.partly:
            more = self._factors.ended(path_and_map(self._factors.keys, tree.steps, tree.estimate())[0])
            if more[0].size():
                tree.start(*more)
        converged, values = tree.settled()
        fine = self._factors.constant.used
        threshold = min(self._factors.closest / SMALL, FINE if fine else math.inf)
        if threshold < self._options.relinearize_threshold:
            converged, values = tree.refined(values, threshold, MORE_UPDATES if fine else 1)
        path, landmarks = path_and_map(self._factors.keys, tree.steps, values)
        landmarks = self._factors.with_newcomers(path, landmarks)
        constant = self._factors.constant.read(landmarks.ids, values, tree.isam.marginalCovariance)
        return Solution(path, landmarks, None, converged, tree.gave_way, constant, self.gyro_bias)

    def _estimated(self, steps: Sequence[int]) -> Array:
        """The estimates (k, 3) of the poses of k steps."""
        keys = [self._factors.keys.pose(k) for k in steps]
        isam = self._tree.isam
        at = isam.getLinearizationPoint().atPose2 if self._tree.stays else isam.calculateEstimatePose2
        return np.array([array(at(key)) for key in keys]).reshape(-1, 3)

    def _jumped(self, guess: gtsam.Pose2) -> bool:
        """Tells if a step has moved the pose far from where its motion led."""
        return bool(np.abs(guess.localCoordinates(self._pose)).max() > JUMP)

    def _joint_marginals(self, landmarks: list[int]) -> tuple[Array, Array, Array]:
        """The last pose, the landmarks' places and their joint covariance, the pose last."""
        keys = [self._factors.keys.landmarks[landmark] for landmark in landmarks]
        pose = array(self._pose)
        last = self._factors.keys.pose(self._tree.steps - 1)
        offsets, cov = self._tree.joint(keys, last)
        points = self._tree.isam.getLinearizationPoint()
        at = np.array([points.atPoint2(key) for key in keys]) + offsets[:-3].reshape(-1, 2)
        R = rotation(pose[2])
        cov[-3:] = R @ cov[-3:]
        cov[:, -3:] = cov[:, -3:] @ R.T
        return pose, at, cov

    def _latest(self, guess: gtsam.Pose2) -> gtsam.Pose2:
        """The newest step's pose, initialised at `guess`: the maximum of its marginal."""
        key = self._factors.keys.pose(self._tree.steps)
        if self._tree.stays:
            return self._tree.isam.getLinearizationPoint().atPose2(key)
        return guess.retract(self._tree.marginal(key).solve(NOTHING).at(key))


def ahead(pose: gtsam.Pose2, step: Step, bias: Bias | None) -> gtsam.Pose2:
    """The pose after a step's motion, by wheels and, with a gyro's turn, by that with the bias that is known."""
    if step.odometry is None:
        return pose
    delta, cov = step.odometry
    if step.gyro is not None and bias is not None:
        delta = together(np.vstack((delta, cov)), step.gyro, bias.mean)
    return pose.compose(pose2(delta))


build = Builder(
    Isam2,
    options=Options,
    loops=True,
    partial=True,
    fixes=True,
    gyro=True,
    minimises=common_options.without_loss,
    implementation=GTSAM_WHEEL,
)
