"""Dead reckoning: odometry alone, the line that every other backend has to beat."""

import numpy as np

from ..frontend.factors import Map, Prior, Step
from .api import Belief, Builder, NoOptions, Pose, Solution
from .models import predict


class DeadReckoning:
    """Odometry alone: the prior, carried along by every motion; sightings are not looked at."""

    def __init__(self, prior: Prior, options: NoOptions, rng: np.random.Generator) -> None:
        del options, rng
        self._pose, self._cov, self._known = prior.pose, prior.cov, prior.map

    def step(self, step: Step) -> Pose:
        """Compose the motion: ArUco EKF SLAM, eqs (1) and (2)."""
        if step.odometry is not None:
            self._pose, G, N = predict(self._pose, step.odometry)
            self._cov = G @ self._cov @ G.T + N
        return self._pose

    def belief(self) -> Belief:
        """The pose and its covariance."""
        return Belief(self._pose, self._cov)

    def map(self) -> Map:
        """The map that was given; an empty one where none was."""
        return self._known or Map(np.zeros(0, np.int64), np.zeros((0, 2)), None)

    def finish(self) -> Solution | None:
        """None: nothing is smoothed."""
        return None


build = Builder(DeadReckoning)
