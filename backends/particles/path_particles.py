"""Weighted particles over the path of a robot, each with a map of its own: what all of FastSLAM has in common."""

from dataclasses import dataclass
from math import atan2, cos, isfinite, pi, sin
from typing import Any, NamedTuple

import numpy as np

from ...core.factors import Map, Odometry, Prior, Step
from ...core.options import option
from ...core.se2 import Array, Ints, wrap
from .. import common_options
from ..api import Belief, Bias, Diverged, Pose, Solution
from ._particles import move
from .particle_paths import ParticlePaths
from .resampling import SCHEMES
from .turns import GyroBias

RANK = 4  # particles needed for a covariance of three coordinates
ROUNDING = 1e-9  # relative difference of weights that counts as none


@dataclass(frozen=True)
class Options:
    """Number of particles, proposal, and resampling.

    The defaults are chosen by the study `fastslam-defaults`: the smallest error at a cost of a step below iSAM2's.
    """

    particles: int = option(
        500,
        "number of particles; 500 is the most whose step costs less than isam2's on all bundled logs",
        minimum=1,
        maximum=10_000_000,
    )
    version: int = option(
        2,
        "1: FastSLAM 1.0, poses drawn from odometry; 2: from sightings too, which needs fewer particles",
        minimum=1,
        maximum=2,
    )
    resampling: str = option("systematic", "resampling scheme", choices=tuple(SCHEMES))
    resample_below: float = option(
        0.5, "resample when the effective sample size is below this share of the particles", minimum=0, maximum=1
    )
    gate: float = option(
        0.0,
        "gate: each particle refuses ranges, bearings alone and fixes beyond this chi-square probability; 0: no gate",
        minimum=0,
        maximum=0.999999999,
    )
    gyro: str = common_options.gyro()


class Cloud(NamedTuple):
    """Weighted poses of M particles, each with a covariance about it that is the same for all."""

    poses: Array  # (5, M)
    weights: Array  # (M,)
    within: Array | None = None  # (3, 3) in the world frame; None: none

    def mean(self) -> Pose:
        """The weighted mean pose; headings are averaged as directions."""
        x, y, _, c, s = (self.poses @ self.weights).tolist()
        heading = atan2(s, c)
        return np.array((x, y, pi if heading == -pi else heading))

    def scatter(self) -> tuple[Pose, Array]:
        """The weighted mean pose, and each particle's difference from it (3, M)."""
        pose = self.mean()
        error = self.poses[:3] - pose[:, None]
        error[2] = wrap(error[2])
        return pose, error

    def moments(self) -> tuple[Pose, Array]:
        """The weighted mean pose and covariance (3, 3)."""
        pose, error = self.scatter()
        cov = (error * self.weights) @ error.T
        cov = cov if self.within is None else cov + self.within
        return pose, (cov + cov.T) / 2


class PathParticles:
    """Particles over the path. A subclass has their maps: `_see`, `_copy`, `_map_of`.

    The online pose is the particles' weighted mean; the solution is the path of the heaviest particle and its
    ancestors, with that particle's map.
    """

    def __init__(self, prior: Prior, options: Any, rng: np.random.Generator) -> None:
        M = options.particles
        self._prior, self._options, self._rng = prior, options, rng
        self._poses = np.empty(
            (5, M)
        )  # x, y, heading, and the cosine and sine that rotate a motion into the world's axes
        self._poses.T[:] = (*prior.pose, 1.0, 0.0)  # turned by 0: the prior's covariance is in the world frame already
        self._started = False
        self._draws_start = True  # False: all start at the prior's pose; its covariance is added to beliefs
        self._log_weights = np.zeros(M)  # the largest is zero
        self._weights = np.full(M, 1 / M)
        self._origins = np.arange(M)  # initial particle that each descends from
        self._paths = ParticlePaths(M)
        self._bias = None if prior.gyro is None else GyroBias(prior.gyro, M)

    def step(self, step: Step) -> Pose:
        """Resamples if the weights are too uneven, samples the motion, weights and corrects by the sightings.

        Resampling at the start of a step, not at the end of the last, keeps the estimate that of the weighted
        particles, which are more informative than their resampled copies.
        """
        if self._n_eff() < self._options.resample_below * len(self._weights) * (1 - ROUNDING):
            self._resample()
        self._see(step)
        if self._bias is not None:
            self._bias.learn(self._poses)
        self._paths.add(self._poses)
        pose = self._cloud().mean()
        if not isfinite(pose.sum()):
            raise Diverged("the particles' poses are no longer finite numbers")
        return pose

    def belief(self) -> Belief:
        """Weighted mean and covariance, effective number of particles, and number of initial ancestors.

        The covariance is None where fewer than RANK particles carry weight: it would be singular.
        """
        pose, cov = self._moments()
        n_eff = self._n_eff()
        ancestors = len(np.unique(self._origins))
        return Belief(pose, cov if n_eff >= RANK else None, n_eff=n_eff, ancestors=ancestors)

    def finish(self) -> Solution:
        """The path of the heaviest particle and its ancestors, and its map, with covariance given that path."""
        best = self._heaviest()
        return Solution(self._paths.path(best), self._map_of(best), gyro_bias=self.gyro_bias)

    @property
    def gyro_bias(self) -> Bias | None:
        """The gyro's bias at present, by all particles; None without one in the state."""
        return None if self._bias is None else self._bias.marginal(self._weights)

    def _see(self, step: Step) -> None:
        """Samples the poses, weights the particles by the sightings, and corrects their maps."""
        raise NotImplementedError

    def _copy(self, ancestors: Ints) -> None:
        """Gives each particle m the map of particle ancestors[m]."""
        raise NotImplementedError

    def _map_of(self, particle: int) -> Map:
        """A particle's map, with covariance given its path."""
        raise NotImplementedError

    def _motion(self, step: Step) -> Odometry | None:
        """The distribution of the step's poses, given a gyro's turn, by which the particles are weighted."""
        motion = self._by_wheels(step)
        if motion is None or self._bias is None or step.odometry is None or step.gyro is None:
            return motion
        motion, surprise = self._bias.turned(self._poses, motion, step.gyro)
        self._weigh(surprise)
        return motion

    def _by_wheels(self, step: Step) -> Odometry | None:
        """The distribution of the step's poses: at the first, the prior's covariance about its pose, if that is drawn.

        Copies: a log's arrays are read-only, and kernels would be compiled once for each kind.
        """
        motion = None if step.odometry is None else Odometry(*(part.copy("C") for part in step.odometry))
        if self._started:
            return motion
        self._started = True
        if not self._draws_start:
            self._poses[3], self._poses[4] = cos(self._prior.pose[2]), sin(self._prior.pose[2])
            return motion
        start = Odometry(np.zeros(3), self._prior.cov.copy("C"))
        if motion is None:
            return start
        move(self._poses, *start, self._normals())
        return motion

    def _weigh(self, surprise: Array) -> None:
        """Multiplies the weights by exp(-surprise / 2), (M,), up to a common factor."""
        self._log_weights -= 0.5 * surprise
        most = self._log_weights.max()
        if not isfinite(most):
            raise Diverged("no particle has a finite likelihood left")
        self._log_weights -= most
        self._weights = np.exp(self._log_weights)
        self._weights /= self._weights.sum()

    def _resample(self) -> None:
        """Draws as many equal particles from the weighted ones."""
        ancestors = SCHEMES[self._options.resampling](self._weights, self._rng)
        self._poses = np.take(self._poses, ancestors, axis=1)  # plain indexing would leave its columns contiguous
        self._origins = self._origins[ancestors]
        self._copy(ancestors)
        if self._bias is not None:
            self._bias.resampled(ancestors)
        self._paths.resampled(ancestors)
        self._log_weights = np.zeros(len(ancestors))
        self._weights = np.full(len(ancestors), 1 / len(ancestors))

    def _normals(self) -> Array:
        """(3, M) standard normal random numbers."""
        return self._rng.standard_normal((3, len(self._weights)))

    def _cloud(self) -> Cloud:
        """The particles."""
        return Cloud(self._poses, self._weights)

    def _moments(self) -> tuple[Pose, Array]:
        """The weighted mean pose and covariance (3, 3)."""
        if self._started:
            return self._cloud().moments()
        return np.array(self._prior.pose), (self._prior.cov + self._prior.cov.T) / 2

    def _heaviest(self) -> int:
        """The heaviest particle; of those that are equal up to rounding, the first."""
        return int(np.argmax(self._log_weights > -ROUNDING))

    def _n_eff(self) -> float:
        """Effective sample size, 1 / sum of squared weights: between 1 and M."""
        return float(1 / (self._weights @ self._weights))


def with_blocks(cov: Array, blocks: Array) -> Array:
    """`cov` (2n, 2n) with `blocks` (n, 3), xx, xy, yy of each landmark, added on its diagonal."""
    i = 2 * np.arange(len(blocks))
    for (a, b), block in zip(((0, 0), (0, 1), (1, 0), (1, 1)), blocks.T[[0, 1, 1, 2]], strict=True):
        cov[i + a, i + b] += block
    return cov
