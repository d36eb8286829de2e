"""iSAM2: incremental smoothing and mapping with the Bayes tree (Kaess et al., IJRR 31(2), 2012), by GTSAM.

Three differences from GTSAM's examples: the latest pose is taken from its marginal, which the top of the Bayes tree
gives alone, as its last factors are there; asking for the estimate would back-substitute through all changes at every
step. Variables are checked for relinearization every 50 steps, which saves most of the checks' cost (the study
`relinearisation`). And on logs of partial sightings J is looked at where a landmark starts, where they move the newest
pose far at once, before a check, and at the end: damped steps replace an update that raises it, which is not iSAM2, and
happens nowhere else. Where the undamped step that follows raises J again, the estimate stays where the tree is linear.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice

import gtsam
import numpy as np

from ...core.factors import Map, Odometry, Prior, RangeBearing, Step
from ...core.gyro import Bias
from ...core.options import option
from ...core.se2 import Array, rotation
from .. import common_options
from ..api import GTSAM_WHEEL, Belief, Builder, Diverged, Expected, Pose, Solution
from ..incremental.biases import together
from ..incremental.smoother import JUMP, SMALL
from ..vicinity import Vicinity, first_expected
from ._gtsam import Factors, array, failure, joint_covariance, path_and_map, pose2, to_world
from .gtsam_parts import FAILURES
from .neighbourhood import Neighbourhood

FINE = 3e-5
"""Relinearize threshold at the end with constant errors: a scale of ranges is that of tens of metres."""

MORE_UPDATES = 5
"""Times `final_updates` with that threshold: on CMU's Plaza logs a loss needs more of them to move nothing by more."""

SETTLING = 10
"""Most updates where a landmark of partial sightings starts."""

DAMPED, FLAT = 100, 1e-7
"""Most damped steps there, and the share of J by which the last one lowers it."""

NO_FACTORS, NO_VALUES = gtsam.NonlinearFactorGraph(), gtsam.Values()

NOTHING = gtsam.VectorValues()  # parents of a single variable's marginal: none


@dataclass(frozen=True)
class Options:
    """Settings; the defaults are the best found."""

    relinearize_threshold: float = common_options.relinearize_threshold()
    relinearize_skip: int = option(
        50, "steps between checks for variables to relinearize; each step with a gyro's bias in the state", minimum=1
    )
    partial_check: bool = option(False, "look for variables to relinearize from the root down, no further than needed")
    factorization: str = option(
        "auto",
        "cholesky is GTSAM's own default and costs less, but fails where little is known; qr does not; auto: cholesky "
        "until it fails, and then all steps so far once more by qr, which serves from there",
        choices=("auto", "cholesky", "qr"),
    )
    final_updates: int = option(10, "most updates without new factors made at the end of the log", minimum=0)
    joint_up_to: int = common_options.joint_up_to()
    loss: str = common_options.loss("sightings and loops")
    loss_scale: float = common_options.loss_scale()
    gyro: str = common_options.gyro()


class Isam2:
    """The iSAM2 factor graph (GTSAM): a causal pose each step, the smoothed path and map at the end."""

    def __init__(self, prior: Prior, options: Options, rng: np.random.Generator) -> None:
        del rng
        self._options, self._factorization = options, "qr" if options.factorization == "qr" else "cholesky"
        self._gave_way = ""  # where Cholesky failed
        self._updates = list[tuple[gtsam.NonlinearFactorGraph, gtsam.Values, bool]]()  # of the tree, until it fails
        self._threshold, self._prior = options.relinearize_threshold, prior
        self._done = 0  # updates of the tree
        self._isam = self._tree()
        self._partly = False  # partial sightings so far
        self._stays = False  # the estimate is where the tree is linear: the undamped step raises J
        self._factors = Factors(prior, options.loss, options.loss_scale)
        self._vicinity, self._around = Vicinity(follows=True), Neighbourhood(self._isam)
        self._steps = 0
        self._pose = pose2(prior.pose)
        self._update(*self._factors.prior())

    def step(self, step: Step) -> Pose:
        """Adds the step's factors at the current estimate and returns the latest pose alone."""
        if self._vicinity.used:
            self._vicinity.move(step.odometry)
        self._partly = self._partly or len(step.partial.ids) > 0
        if self._partly and (self._done + 1) % self._options.relinearize_skip == 0:
            self._look()
        bias = None if step.gyro is None else self.gyro_bias
        guess = ahead(self._pose, step, bias)
        graph, values = self._factors.step(self._steps, step, guess, estimated=self._estimated, bias=bias)
        moved = self._started(graph, values) if self._factors.late else self._update(graph, values) > 0
        if self._vicinity.used:
            self._around.fold(graph, values, self._factors.keys.pose(self._steps), moved=moved)
        self._pose = self._latest(guess)
        if len(step.partial.ids) and (self._stays or self._jumped(guess)):
            self._look()
            self._pose = self._latest(guess)
        self._steps += 1
        x, y, heading = self._pose.x(), self._pose.y(), self._pose.theta()
        if not math.isfinite(x + y + heading):
            raise Diverged("the latest pose is not finite")
        return np.array((x, y, heading if heading > -math.pi else math.pi))

    def expected(self, odometry: Odometry | None, seen: RangeBearing, gate: float) -> Expected:
        """Landmarks that one of the sightings may be of, by joint marginals; one that is held back is offered, too."""
        if self._steps == 0:
            return first_expected(self._prior, seen, gate)
        known = self._factors.keys.landmarks
        new = list(islice(reversed(known), len(known) - len(self._vicinity)))
        found = self._vicinity.expected(
            array(self._pose), None, odometry, seen, gate, new[::-1], self._joint_marginals
        )  # fmt: skip
        return self._factors.with_held(found, odometry, self._steps - 1)

    def belief(self) -> Belief:
        """The latest pose and its marginal covariance."""
        pose = array(self._pose)
        R, _ = self._marginal(self._factors.keys.pose(max(self._steps - 1, 0))).jacobian()
        R_inv = np.linalg.inv(R)
        return Belief(pose, to_world(pose, R_inv @ R_inv.T))

    @property
    def gyro_bias(self) -> Bias | None:
        """The gyro's bias at the last step; None without a gyro."""
        key = self._factors.biases.last
        if key is None:
            return self._prior.gyro
        marginal = self._marginal(key)
        at = float(self._isam.getLinearizationPoint().atPoint2(key)[0])
        R = marginal.R()
        return Bias(at + float(marginal.solve(NOTHING).at(key)[0]), float(np.linalg.norm(np.linalg.inv(R)[0])))

    def map(self) -> Map:
        """Landmarks at the current estimate with, up to `joint_up_to` of them, their joint covariance."""
        landmarks = path_and_map(self._factors.keys, 0, self._isam.calculateEstimate())[1]
        if len(landmarks.ids) > self._options.joint_up_to:
            return landmarks
        try:
            # From the factors: the tree's QR is ten times slower for many landmarks.
            marginals = gtsam.Marginals(self._isam.getFactorsUnsafe(), self._isam.getLinearizationPoint())
            cov = joint_covariance(self._factors.keys, marginals)
        except FAILURES:  # where Cholesky fails
            cov = joint_covariance(self._factors.keys, self._isam)
        return landmarks._replace(cov=cov)

    def finish(self) -> Solution:
        """Relinearizes until nothing moves by more than the threshold, then solves with full back-substitution.

        Landmarks that partial sightings have not started are before, with all of their sightings.

        Landmarks that are near lower the threshold, and constant errors do: a tree with the new one is made of all
        factors, and kept if its J is lower.
        """
        if self._partly:
            more = self._factors.ended(path_and_map(self._factors.keys, self._steps, self._estimate())[0])
            if more[0].size():
                self._started(*more)
        converged, values = self._settled()
        fine = self._factors.constant.used
        threshold = min(self._factors.closest / SMALL, FINE if fine else math.inf)
        if threshold < self._options.relinearize_threshold:
            graph, before = self._isam.getFactorsUnsafe(), self._isam
            self._threshold = threshold
            self._isam = self._tree()
            self._updates.clear()
            try:
                self._update(graph, values)
                finer, found = self._settled(MORE_UPDATES if fine else 1)
            except Diverged:
                finer, found = None, values
            if graph.error(found) < graph.error(values):
                converged, values = finer, found
            else:
                self._isam, converged = before, False
        path, landmarks = path_and_map(self._factors.keys, self._steps, values)
        landmarks = self._factors.with_newcomers(path, landmarks)
        constant = self._factors.constant.read(landmarks.ids, values, self._isam.marginalCovariance)
        return Solution(path, landmarks, None, converged, self._gave_way, constant, self.gyro_bias)

    def _estimated(self, steps: Sequence[int]) -> Array:
        """The estimates (k, 3) of the poses of k steps."""
        keys = [self._factors.keys.pose(k) for k in steps]
        tree = self._isam
        at = tree.getLinearizationPoint().atPose2 if self._stays else tree.calculateEstimatePose2
        return np.array([array(at(key)) for key in keys]).reshape(-1, 3)

    def _settled(self, times: int = 1) -> tuple[bool | None, gtsam.Values]:
        """True if relinearization has ended, None without any, and the best estimate then.

        With partial sightings it may lead to a higher J: damped steps go from the lower one.
        """
        converged, before = None, self._estimate() if self._partly else NO_VALUES
        for _ in range(times * self._options.final_updates):
            converged = self._update(NO_FACTORS, NO_VALUES, relinearize=True) == 0
            if converged:
                break
        if self._partly:
            graph = self._graph()
            if not graph.error(self._estimate()) <= graph.error(before):
                self._renew(graph, before)
                converged = not self._stays and self._update(NO_FACTORS, NO_VALUES, relinearize=True) == 0
        return converged, self._estimate()

    def _started(self, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> bool:
        """Adds a step that starts a landmark, and relinearizes until nothing moves; True, as variables have.

        The sightings that were held back are from poses that may be far off by them: where J is no lower after an
        update, or the factorization fails, all is optimized from before it by damped steps, and is a new tree.
        """
        everything, before = self._graph(), self._estimate()
        everything.push_back(graph)
        before.insert(values)
        if not self._settles(graph, values, everything.error(before)):
            self._renew(everything, before)
        return True

    def _jumped(self, guess: gtsam.Pose2) -> bool:
        """Tells if a step has moved the pose far from where its motion led."""
        return bool(np.abs(guess.localCoordinates(self._pose)).max() > JUMP)

    def _look(self) -> None:
        """Makes damped steps where J is higher at the tree's estimate than where the tree is linear."""
        self._stays = False
        if not self._lower():
            self._renew(self._graph(), gtsam.Values(self._isam.getLinearizationPoint()))

    def _lower(self) -> bool:
        """Tells if J is no higher at the tree's estimate than where the tree is linear."""
        graph = self._isam.getFactorsUnsafe()
        return graph.error(self._estimate()) <= graph.error(self._isam.getLinearizationPoint())

    def _settles(self, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values, cost: float) -> bool:
        """Updates until nothing moves; False where J, which was `cost`, rises, or the factorization fails."""
        self._note(graph, values, relinearize=False)
        self._stays = False
        try:
            self._isam.update(graph, values)
            for _ in range(SETTLING):
                last, cost = cost, self._isam.getFactorsUnsafe().error(self._isam.calculateBestEstimate())
                if not cost <= last:
                    return False
                self._note(NO_FACTORS, NO_VALUES, relinearize=True)
                if not self._isam.update(NO_FACTORS, NO_VALUES, force_relinearize=True).getVariablesRelinearized():
                    break
        except FAILURES:
            return False
        return True

    def _renew(self, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> None:
        """Makes a new tree of these factors, where damped steps from `values` lead."""
        found = damped(graph, values)
        self._isam, self._stays = self._tree(), False
        self._updates.clear()
        self._update(graph, found)
        self._stays = not self._lower()
        self._around = Neighbourhood(self._isam)

    def _graph(self) -> gtsam.NonlinearFactorGraph:
        """All factors so far."""
        graph = gtsam.NonlinearFactorGraph()
        graph.push_back(self._isam.getFactorsUnsafe())
        return graph

    def _estimate(self) -> gtsam.Values:
        """All variables, by full back-substitution, or where the tree is linear if the estimate stays there."""
        if self._stays:
            return gtsam.Values(self._isam.getLinearizationPoint())
        try:
            return self._isam.calculateBestEstimate()
        except FAILURES as error:
            raise Diverged(failure(error)) from None

    def _tree(self) -> gtsam.ISAM2:
        """An empty Bayes tree."""
        self._done = 0
        return gtsam.ISAM2(
            parameters(self._options, self._threshold, self._factorization, turns=self._prior.gyro is not None)
        )

    def _update(self, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values, *, relinearize: bool = False) -> int:
        """Adds factors, and returns the number of variables that were relinearized."""
        self._note(graph, values, relinearize=relinearize)
        kept = None
        if self._stays and not relinearize:  # no check may move what stays
            kept = gtsam.KeyList()
            for key in self._isam.getLinearizationPoint().keys():  # noqa: SIM118 - it is no dict
                kept.push_back(key)
        try:
            return self._isam.update(
                graph, values, force_relinearize=relinearize, noRelinKeys=kept
            ).getVariablesRelinearized()
        except FAILURES as error:
            return self._give_way(error)

    def _note(self, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values, *, relinearize: bool) -> None:
        """Counts an update, and keeps it for when Cholesky fails."""
        self._done += 1
        if self._options.factorization == "auto" and not self._gave_way:
            self._updates.append((graph, values, relinearize))

    def _give_way(self, error: Exception) -> int:
        """Does, after Cholesky has failed, all updates so far once more by QR, the failed one the last.

        A tree of the factors at the points of the failing one would be cheaper, but these may be far off: on one log
        in ten it ended at another minimum. Returns the number of variables, which are all linearized anew.
        """
        if self._gave_way or self._options.factorization != "auto":
            raise Diverged(failure(error)) from None
        self._gave_way = f"GTSAM's Cholesky factorization failed at step {self._steps}: QR from there"
        self._factorization = "qr"
        self._isam = self._tree()
        for graph, values, relinearize in self._updates:
            self._update(graph, values, relinearize=relinearize)
        self._updates.clear()
        self._around = Neighbourhood(self._isam)
        return self._isam.getLinearizationPoint().size()

    def _joint_marginals(self, landmarks: list[int]) -> tuple[Array, Array, Array]:
        """The last pose, the landmarks' places and their joint covariance, the pose last."""
        keys = [self._factors.keys.landmarks[landmark] for landmark in landmarks]
        pose = array(self._pose)
        last = self._factors.keys.pose(self._steps - 1)
        try:
            offsets, cov = self._around.joint(keys, last)
        except FAILURES as error:
            self._give_way(error)
            offsets, cov = self._around.joint(keys, last)
        points = self._isam.getLinearizationPoint()
        at = np.array([points.atPoint2(key) for key in keys]) + offsets[:-3].reshape(-1, 2)
        R = rotation(pose[2])
        cov[-3:] = R @ cov[-3:]
        cov[:, -3:] = cov[:, -3:] @ R.T
        return pose, at, cov

    def _latest(self, guess: gtsam.Pose2) -> gtsam.Pose2:
        """The newest step's pose, initialised at `guess`: the maximum of its marginal."""
        key = self._factors.keys.pose(self._steps)
        if self._stays:
            return self._isam.getLinearizationPoint().atPose2(key)
        return guess.retract(self._marginal(key).solve(NOTHING).at(key))

    def _marginal(self, key: int) -> gtsam.GaussianConditional:
        """Marginal of a pose's offset x from its linearisation point, |R x - d|^2, R (3, 3) upper triangular."""
        try:
            return self._isam.marginalFactor(key)
        except FAILURES as error:
            if self._factorization == "cholesky":
                self._give_way(error)
        try:
            return self._isam.marginalFactor(key)
        except FAILURES:  # GTSAM takes Cholesky for a marginal, whatever the tree is made by
            return self._by_qr(key)

    def _by_qr(self, key: int) -> gtsam.GaussianConditional:
        """The marginal of a variable by QR throughout."""
        try:
            return self._isam.marginalFactor(key, gtsam.EliminateQR)
        except FAILURES as error:
            raise Diverged(failure(error)) from None


def ahead(pose: gtsam.Pose2, step: Step, bias: Bias | None) -> gtsam.Pose2:
    """The pose after a step's motion, by wheels and, with a gyro's turn, by that with the bias that is known."""
    if step.odometry is None:
        return pose
    delta, cov = step.odometry
    if step.gyro is not None and bias is not None:
        delta = together(np.vstack((delta, cov)), step.gyro, bias.mean)
    return pose.compose(pose2(delta))


def damped(graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> gtsam.Values:
    """A lower J, by Levenberg and Marquardt's method."""
    params = gtsam.LevenbergMarquardtParams()
    params.setMaxIterations(DAMPED)
    params.setRelativeErrorTol(FLAT)
    try:
        return gtsam.LevenbergMarquardtOptimizer(graph, values, params).optimize()
    except FAILURES as error:
        raise Diverged(failure(error)) from None


def parameters(options: Options, threshold: float, factorization: str, *, turns: bool = False) -> gtsam.ISAM2Params:
    """GTSAM's parameters, with that relinearize threshold and factorization.

    With a gyro's `turns` each step is a check: the bias moves all headings since the start. With one in 50 steps, one
    drive in ten was lost on `circle` with a bias of a degree a second.
    """
    params = gtsam.ISAM2Params()
    params.setRelinearizeThreshold(threshold)
    params.relinearizeSkip = 1 if turns else options.relinearize_skip
    params.enablePartialRelinearizationCheck = options.partial_check
    params.setFactorization(factorization.upper())
    # Always back-substitute in full: results then do not depend on earlier queries.
    params.setOptimizationParams(gtsam.ISAM2GaussNewtonParams(0.0))
    return params


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
