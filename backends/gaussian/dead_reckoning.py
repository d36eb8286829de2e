"""Dead reckoning: odometry alone, the baseline for every other backend."""

import numpy as np

from ...core.factors import Map, Prior, Step
from .._expected import carried
from ..api import COMPILED_HERE, Belief, Builder, NoOptions, Pose, Solution


class DeadReckoning:
    """Odometry alone: the prior, propagated by every motion; sightings are ignored."""

    def __init__(self, prior: Prior, options: NoOptions, rng: np.random.Generator) -> None:
        del options, rng
        self._pose, self._cov, self._known = prior.pose, prior.cov, prior.map

    def step(self, step: Step) -> Pose:
        """Composes the motion: ArUco EKF SLAM, eqs (1) to (6)."""
        if step.odometry is not None:
            motion = np.empty((4, 3))
            motion[0], motion[1:] = step.odometry
            pose, cov = np.array(self._pose), np.array(self._cov)  # earlier results are the caller's
            carried(pose, cov, motion)
            self._pose, self._cov = pose, cov
        return self._pose

    def belief(self) -> Belief:
        """The pose and its covariance."""
        return Belief(self._pose, self._cov)

    def map(self) -> Map:
        """The given map, or an empty one."""
        return self._known or Map(np.zeros(0, np.int64), np.zeros((0, 2)), None)

    def finish(self) -> Solution | None:
        """None: a filter does not smooth."""
        return None


build = Builder(DeadReckoning, sightings=False, implementation=COMPILED_HERE)
