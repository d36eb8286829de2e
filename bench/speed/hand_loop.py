"""A loop over GTSAM's iSAM2 as its users write it by hand, to compare the backend `isam2` with.

Covariances are in GTSAM's frames before the loop begins. A step makes its factors, calls `update`, and takes the
estimate of the last pose.
"""

from collections.abc import Sequence
from typing import Any

import gtsam
import numpy as np

from ...backends.graphs._gtsam import FIRST_LANDMARK, FIRST_POSE, turned
from ...backends.graphs.bayes_tree import parameters
from ...backends.graphs.gtsam_parts import FAILURES
from ...backends.graphs.isam2 import Options
from ...core.factors import Prior, Step
from ...core.se2 import rotation
from .isam2_parts import BY_HAND, WHOLE
from .timing import TimingRow, in_turns, timing
from .world import World


class HandLoop:
    """iSAM2 by hand, on steps that are known beforehand and close no loops."""

    def __init__(self, prior: Prior, steps: Sequence[Step], options: Options) -> None:
        self._isam = gtsam.ISAM2(parameters(options, options.relinearize_threshold, "cholesky"))
        self._k, self._seen = 0, set[int]()
        self._pose = gtsam.Pose2(*prior.pose.tolist())
        R = rotation(prior.pose[2])
        self._prior = gtsam.noiseModel.Gaussian.Covariance(R.T @ prior.cov @ R)
        self._motions = [
            None if step.odometry is None else turned(step.odometry.delta[None], step.odometry.cov[None])[0]
            for step in steps
        ]
        self._sightings = [np.ascontiguousarray(step.sightings.cov[:, ::-1, ::-1]) for step in steps]

    def step(self, step: Step) -> None:
        """Adds the next step, and takes the last pose."""
        graph, values, key = gtsam.NonlinearFactorGraph(), gtsam.Values(), FIRST_POSE + self._k
        motion = self._motions[self._k]
        if step.odometry is None or motion is None:
            graph.add(gtsam.PriorFactorPose2(key, self._pose, self._prior))
        else:
            delta = gtsam.Pose2(*step.odometry.delta.tolist())
            self._pose = self._pose.compose(delta)
            graph.add(gtsam.BetweenFactorPose2(key - 1, key, delta, gtsam.noiseModel.Gaussian.Covariance(motion)))
        values.insert(key, self._pose)
        covs = self._sightings[self._k]
        for landmark, (r, bearing), cov in zip(
            step.sightings.ids.tolist(), step.sightings.z.tolist(), covs, strict=True
        ):
            to = FIRST_LANDMARK + landmark
            if landmark not in self._seen:
                self._seen.add(landmark)
                values.insert(to, self._pose.transformFrom(np.array((r * np.cos(bearing), r * np.sin(bearing)))))
            model = gtsam.noiseModel.Gaussian.Covariance(cov)
            graph.add(gtsam.BearingRangeFactor2D(key, to, gtsam.Rot2(bearing), r, model))
        self._isam.update(graph, values)
        self._pose = self._isam.calculateEstimatePose2(key)
        self._k += 1


def beside_hand_loop(backend: Any, options: Options, here: World, seconds: float, beside: str) -> list[TimingRow]:
    """Times steps of an `isam2` after its survey and of a loop by hand, in turns; none where the latter fails."""
    hand = HandLoop(here.prior, [*here.survey, *here.drive], options)
    try:
        for step in here.survey:
            hand.step(step)
        spent = in_turns((backend, hand), (here.drive, here.drive), seconds)
    except FAILURES:  # GTSAM's Cholesky, which the backend replaces where it fails
        return []
    rows = zip((WHOLE, BY_HAND), spent, strict=True)
    return [TimingRow("part", name, len(here.map.ids), timing=timing(ns), beside=beside) for name, ns in rows]
