"""iSAM2: incremental smoothing and mapping with the Bayes tree (Kaess et al., IJRR 31(2), 2012), by GTSAM."""

from dataclasses import dataclass

import gtsam
import numpy as np

from ..frontend.factors import Map, Prior, Step
from ..frontend.options import option
from ..frontend.se2 import compose
from ._gtsam import Keys, array, failure, joint_covariance, path_and_map, prior_factors, step_factors, to_world
from .api import Belief, Builder, Diverged, Pose, Solution


@dataclass(frozen=True)
class Options:
    """GTSAM's own defaults, but for the factorization."""

    relinearize_threshold: float = option(
        0.1, "change (m, rad) of a variable above which it is relinearized", minimum=0
    )
    relinearize_skip: int = option(10, "steps between checks for variables to relinearize", minimum=1)
    factorization: str = option(
        "qr",
        "qr survives a long stretch without landmarks, on which cholesky fails",
        choices=("qr", "cholesky"),
    )
    final_updates: int = option(10, "most updates without new factors made at the end of the log", minimum=0)


class Isam2:
    """The iSAM2 factor graph (GTSAM): a causal pose each step, the smoothed path and map at the end."""

    def __init__(self, prior: Prior, options: Options, rng: np.random.Generator) -> None:
        del rng
        params = gtsam.ISAM2Params()
        params.setRelinearizeThreshold(options.relinearize_threshold)
        params.relinearizeSkip = options.relinearize_skip
        params.setFactorization(options.factorization.upper())
        self._options = options
        self._isam = gtsam.ISAM2(params)
        self._keys = Keys()
        self._steps = 0
        self._pose = prior.pose
        self._update(*prior_factors(self._keys, prior))

    def step(self, step: Step) -> Pose:
        """Add the step's factors, starting from the current estimate, and ask for the latest pose alone."""
        guess = self._pose if step.odometry is None else compose(self._pose, step.odometry.delta)
        self._update(*step_factors(self._keys, self._steps, step, guess))
        self._pose = array(self._isam.calculateEstimatePose2(self._keys.pose(self._steps)))
        self._steps += 1
        return self._pose

    def belief(self) -> Belief:
        """The latest pose and its marginal covariance."""
        cov = self._isam.marginalCovariance(self._keys.pose(max(self._steps - 1, 0)))
        return Belief(self._pose, to_world(self._pose, cov))

    def map(self) -> Map:
        """The landmarks at the current estimate with their joint covariance."""
        landmarks = path_and_map(self._keys, 0, self._isam.calculateEstimate())[1]
        return landmarks._replace(cov=joint_covariance(self._keys, self._isam))

    def finish(self) -> Solution:
        """Relinearize until nothing moves by more than the threshold, then solve fully, back-substitution included."""
        for _ in range(self._options.final_updates):
            if self._update(gtsam.NonlinearFactorGraph(), gtsam.Values()) == 0:
                break
        path, landmarks = path_and_map(self._keys, self._steps, self._isam.calculateBestEstimate())
        return Solution(path, landmarks)

    def _update(self, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> int:
        """Fold factors in; how many variables were relinearized."""
        try:
            return self._isam.update(graph, values).getVariablesRelinearized()
        except RuntimeError as error:
            raise Diverged(failure(error)) from None


build = Builder(Isam2, options=Options, loops=True)
