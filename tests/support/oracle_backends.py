"""Backends that use ground truth, by name: `oracle_backends:true_poses` and so on."""

from dataclasses import dataclass

import numpy as np

from slamduel.backends.api import (
    Belief,
    Builder,
    Map,
    Pose,
    Prior,
    Step,
    Truth,
    TruthWanted,
    WantsTruth,
    compose,
    option,
)


@dataclass(frozen=True)
class Options:
    """Need of ground truth."""

    needs: bool = option(True, "return the true poses, which have to be given")


class TruePoses(WantsTruth):
    """Returns the true poses; with needs=false dead reckoning."""

    def __init__(self, prior: Prior, options: Options, rng: np.random.Generator) -> None:
        self.pose, self.options, self.k = prior.pose, options, 0
        self.truth: Truth | None = None

    def tell(self, truth: Truth) -> bool:
        assert self.k == 0, "given in the middle of the log"
        assert not truth.poses.flags.writeable
        self.truth = truth
        return self.options.needs

    def step(self, step: Step) -> Pose:
        if step.odometry is not None:
            self.pose = compose(self.pose, step.odometry.delta)
        if self.options.needs:
            if self.truth is None:
                raise TruthWanted("needs=true linearises at the truth, expected --oracle")
            assert self.truth.t[self.k] == step.t
            self.pose = self.truth.poses[self.k]
        self.k += 1
        return self.pose.copy()

    def belief(self) -> Belief:
        return Belief(self.pose.copy())

    def map(self) -> Map:
        return Map(np.zeros(0, np.int64), np.zeros((0, 2)), None)

    def finish(self) -> None:
        """None."""


true_poses = Builder(TruePoses, options=Options)
