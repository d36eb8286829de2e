"""GraphSLAM as a batch: the minimum of the survey's J_GraphSLAM over the whole path and map.

J is the sum of the prior's, every odometry factor's and every sighting's squared Mahalanobis distance; GTSAM's error is
half of it. The optimum is the reference where a log's truth is not known.
"""

from dataclasses import dataclass

import gtsam
import numpy as np

from ..frontend.factors import Map, Prior, Step
from ..frontend.options import option
from ..frontend.se2 import compose
from ._gtsam import Keys, array, failure, joint_covariance, path_and_map, prior_factors, step_factors
from .api import Builder, Diverged, Solution

CHUNK = 100
"""Steps handed to iSAM2 at once while it makes the starting point: much cheaper than one by one, as good a start."""


@dataclass(frozen=True)
class Options:
    """When Levenberg-Marquardt stops; GTSAM's defaults stop far too early on large graphs."""

    relative_tolerance: float = option(1e-12, "stop where J falls by a smaller share in one iteration", minimum=0)
    iterations: int = option(200, "most iterations", minimum=1)


class Graph:
    """Batch GraphSLAM: Levenberg-Marquardt over the whole log (GTSAM), started from iSAM2's path."""

    def __init__(self, prior: Prior, options: Options, rng: np.random.Generator) -> None:
        del rng
        self._prior, self._options = prior, options
        self._steps: list[Step] = []

    def step(self, step: Step) -> None:
        """Keep the step; None: a batch has no online estimate."""
        self._steps.append(step)

    def belief(self) -> None:
        """None: nothing is believed before the log is over."""

    def map(self) -> Map:
        """The map that was given; an empty one where none was: the batch's own comes from `finish`."""
        return self._prior.map or Map(np.zeros(0, np.int64), np.zeros((0, 2)), None)

    def finish(self) -> Solution:
        """The optimum: path, map and the map's joint covariance."""
        keys = Keys()
        params = gtsam.LevenbergMarquardtParams()
        params.setRelativeErrorTol(self._options.relative_tolerance)
        params.setAbsoluteErrorTol(0.0)
        params.setMaxIterations(self._options.iterations)
        try:
            graph, values = self._start(keys)
            optimum = gtsam.LevenbergMarquardtOptimizer(graph, values, params).optimize()
            path, landmarks = path_and_map(keys, len(self._steps), optimum)
            cov = joint_covariance(keys, gtsam.Marginals(graph, optimum))
        except RuntimeError as error:
            raise Diverged(failure(error)) from None
        return Solution(path, landmarks._replace(cov=cov))

    def _start(self, keys: Keys) -> tuple[gtsam.NonlinearFactorGraph, gtsam.Values]:
        """The whole graph, and iSAM2's estimate of it, which LM needs on long logs: from dead reckoning it diverges."""
        params = gtsam.ISAM2Params()
        params.relinearizeSkip = 1
        params.setFactorization("QR")
        isam = gtsam.ISAM2(params)
        pose = self._prior.pose
        graph, values = prior_factors(keys, self._prior)
        for k, step in enumerate(self._steps):
            if step.odometry is not None:
                pose = compose(pose, step.odometry.delta)
            more, more_values = step_factors(keys, k, step, pose)
            graph.push_back(more)
            values.insert(more_values)
            if (k + 1) % CHUNK == 0 or k == len(self._steps) - 1:
                isam.update(graph, values)
                pose = array(isam.calculateEstimatePose2(keys.pose(k)))
                graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        return isam.getFactorsUnsafe(), isam.calculateBestEstimate()


build = Builder(Graph, options=Options, loops=True)
