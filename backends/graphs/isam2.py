"""iSAM2: incremental smoothing and mapping with the Bayes tree (Kaess et al., IJRR 31(2), 2012), by GTSAM.

Two things are done otherwise than in GTSAM's examples. The latest pose is taken from its marginal, which the top of the
Bayes tree alone gives, since its last factors have just been put there: asking for the estimate would substitute back
through all that has changed, at every step. And variables are checked for relinearization every 50 steps, which
saves most of what checking costs (the study `relinearisation`).
"""

import math
from dataclasses import dataclass

import gtsam
import numpy as np

from ...frontend.factors import Map, Prior, Step
from ...frontend.options import option
from ..api import GTSAM_WHEEL, Belief, Builder, Diverged, Pose, Solution
from ._gtsam import (
    FAILURES,
    LOSSES,
    Factors,
    array,
    failure,
    joint_covariance,
    path_and_map,
    pose2,
    to_world,
)

NOTHING = gtsam.VectorValues()
"""What a marginal of one variable still depends on."""


@dataclass(frozen=True)
class Options:
    """The settings that were found best."""

    relinearize_threshold: float = option(
        0.03, "change (m, rad) of a variable above which it is relinearized", minimum=0
    )
    relinearize_skip: int = option(50, "steps between checks for variables to relinearize", minimum=1)
    partial_check: bool = option(False, "look for variables to relinearize from the root down, no further than needed")
    factorization: str = option(
        "qr",
        "qr survives a long stretch without landmarks, on which cholesky fails",
        choices=("qr", "cholesky"),
    )
    final_updates: int = option(10, "most updates without new factors made at the end of the log", minimum=0)
    joint_up_to: int = option(
        5000, "landmarks up to which a map comes with its joint covariance, which takes long to work out", minimum=0
    )
    loss: str = option("none", "robust loss of the sightings", choices=("none", *LOSSES))
    loss_scale: float = option(0.0, "scale of the loss, standard deviations; 0: 95 % efficient", minimum=0)


class Isam2:
    """The iSAM2 factor graph (GTSAM): a causal pose each step, the smoothed path and map at the end."""

    def __init__(self, prior: Prior, options: Options, rng: np.random.Generator) -> None:
        del rng
        params = gtsam.ISAM2Params()
        params.setRelinearizeThreshold(options.relinearize_threshold)
        params.relinearizeSkip = options.relinearize_skip
        params.enablePartialRelinearizationCheck = options.partial_check
        params.setFactorization(options.factorization.upper())
        # Back-substitution in full wherever there is one: its result then depends on no earlier question.
        params.setOptimizationParams(gtsam.ISAM2GaussNewtonParams(0.0))
        self._options = options
        self._isam = gtsam.ISAM2(params)
        self._factors = Factors(prior, options.loss, options.loss_scale)
        self._steps = 0
        self._pose = pose2(prior.pose)
        self._update(*self._factors.prior())

    def step(self, step: Step) -> Pose:
        """Add the step's factors, starting from the current estimate, and ask for the latest pose alone."""
        guess = self._pose if step.odometry is None else self._pose.compose(pose2(step.odometry.delta))
        self._update(*self._factors.step(self._steps, step, guess))
        self._pose = self._latest(guess)
        self._steps += 1
        pose = array(self._pose)
        if not math.isfinite(sum(pose.tolist())):
            raise Diverged("the latest pose is not finite")
        return pose

    def belief(self) -> Belief:
        """The latest pose and its marginal covariance."""
        pose = array(self._pose)
        R, _ = self._marginal(self._factors.keys.pose(max(self._steps - 1, 0))).jacobian()
        R_inv = np.linalg.inv(R)
        return Belief(pose, to_world(pose, R_inv @ R_inv.T))

    def map(self) -> Map:
        """The landmarks at the current estimate with, up to `joint_up_to` of them, their joint covariance."""
        landmarks = path_and_map(self._factors.keys, 0, self._isam.calculateEstimate())[1]
        if len(landmarks.ids) > self._options.joint_up_to:
            return landmarks
        try:
            # From the factors anew: what the tree would do by QR is ten times slower where there are many landmarks.
            marginals = gtsam.Marginals(self._isam.getFactorsUnsafe(), self._isam.getLinearizationPoint())
            cov = joint_covariance(self._factors.keys, marginals)
        except FAILURES:  # Cholesky alone cannot do it
            cov = joint_covariance(self._factors.keys, self._isam)
        return landmarks._replace(cov=cov)

    def finish(self) -> Solution:
        """Relinearize until nothing moves by more than the threshold, then solve fully, back-substitution included."""
        for _ in range(self._options.final_updates):
            result = self._update(gtsam.NonlinearFactorGraph(), gtsam.Values(), relinearize=True)
            if result.getVariablesRelinearized() == 0:
                break
        path, landmarks = path_and_map(self._factors.keys, self._steps, self._isam.calculateBestEstimate())
        return Solution(path, self._factors.with_newcomers(path, landmarks))

    def _update(
        self, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values, *, relinearize: bool = False
    ) -> gtsam.ISAM2Result:
        """Fold factors in."""
        try:
            return self._isam.update(graph, values, force_relinearize=relinearize)
        except FAILURES as error:
            raise Diverged(failure(error)) from None

    def _latest(self, guess: gtsam.Pose2) -> gtsam.Pose2:
        """The pose of the newest step, which was put at `guess`: where its marginal is highest."""
        key = self._factors.keys.pose(self._steps)
        return guess.retract(self._marginal(key).solve(NOTHING).at(key))

    def _marginal(self, key: int) -> gtsam.GaussianConditional:
        """The marginal of a pose's offset x from where it was put, |R x - d|^2, R (3, 3) being upper triangular."""
        try:
            return self._isam.marginalFactor(key)
        except FAILURES as error:
            raise Diverged(failure(error)) from None


build = Builder(Isam2, options=Options, loops=True, implementation=GTSAM_WHEEL)
