"""Monte Carlo localisation on a given map (Thrun, Burgard, Fox: Probabilistic Robotics, 2005, tables 8.2 and 8.3).

Particles are poses. Each is moved by the odometry with noise drawn from its covariance, and weighted by how near its
sightings fall to landmarks: to their own where they have ids, else to the nearest (the likelihood field of table 6.3).
Particles drawn from a sighting, anywhere around a landmark (table 6.5), are put in when the sightings have become less
likely than they were in the long run (augmented MCL), so that a robot carried elsewhere can be found again.
"""

from dataclasses import dataclass
from math import exp, log

import numpy as np

from ...core.factors import UNKNOWN, Map, Prior, Step
from ...core.options import option
from ...core.se2 import Array, Ints, wrap
from ..api import COMPILED_HERE, Belief, Builder, Diverged, Pose, Unsuited
from ..locating.map_index import indexed
from ._field import weigh
from ._particles import move
from .resampling import systematic

SLOW, FAST = 0.001, 0.1  # rates of the averages of the likelihood (alpha of table 8.3)
FALLEN = 2.0
"""Particles are drawn anew where the fast average is below the slow one over this: a share 1 - FALLEN fast / slow
(Gutmann and Fox, 2002). With 1, as in the table, a cloud that is wider than at a known start is drawn anew forever."""
TOGETHER = 0.9  # the robot is located where this share of the weight is near the heaviest particle
RANK = 4  # particles needed for a covariance of three coordinates


@dataclass(frozen=True)
class Options:
    """Number of particles and width of the likelihood."""

    particles: int = option(10_000, "number of particles", minimum=1, maximum=10_000_000)
    widen: float = option(
        3.0,
        "standard deviations of sightings are multiplied by this: few particles are as near as a sharp sensor tells",
        minimum=1,
        maximum=1000,
    )


class Mcl:
    """Monte Carlo localisation: particles over the pose on a given map; an unknown start is anywhere on it.

    The pose is the weighted mean of the particles near the heaviest. The map is kept as given: of its covariance the
    variance of each landmark alone makes the likelihood wider.

    Random numbers, in this order: at a known start's first step `standard_normal((3, M))`, that multiply the columns of
    the prior covariance's Cholesky factor; at an unknown one's first sightings `random((3, M))`: which sighting, which
    landmark, and the direction of sight; where particles are resampled `random()`, `random(M)` to choose m that are
    drawn anew, and `random((3, m))`; at every step with odometry `standard_normal((3, M))`, as at the first.
    """

    def __init__(self, prior: Prior, options: Options, rng: np.random.Generator) -> None:
        if prior.map is None or not len(prior.map.ids):
            raise Unsuited(
                "mcl localises on a given map: it needs bench run --map, or a log on one, such as circle[map=surveyed]"
            )
        self._prior, self._map, self._options, self._rng = prior, prior.map, options, rng
        self._on = indexed(prior.map)
        self._row = {landmark: row for row, landmark in enumerate(prior.map.ids.tolist())}
        M = options.particles
        self._poses = np.empty((5, M))  # x, y, heading, cosine and sine
        self._poses.T[:] = (*prior.pose, 1.0, 0.0)  # turned by 0: the prior's covariance is in the world frame already
        self._started = False
        self._spread = prior.start == "known"  # over the map, or at the known start
        self._log_weights, self._weights = np.zeros(M), np.full(M, 1 / M)
        self._seen = np.zeros(0, np.int64), np.zeros((0, 2))  # landmarks and sightings of the last step that had any
        self._slow = self._fast = 0.0  # averages of the likelihood of a sighting

    def step(self, step: Step) -> Pose:
        """Resamples where the weights are too uneven, moves the particles and weighs them by the sightings."""
        unlikely = self._slow > FALLEN * self._fast
        if unlikely or 1 / (self._weights @ self._weights) < len(self._weights) / 2:
            self._resample()
        self._move(step)
        ids, z, cov = step.sightings
        if len(ids):
            who = np.array([-1 if one == UNKNOWN else self._row.get(one, -2) for one in ids.tolist()], np.int64)
            known = who != -2
            if known.any():
                self._seen = who[known], np.array(z[known])
                self._weigh(*self._seen, np.array(cov[known]))
        pose = self._near()[0]
        if not np.isfinite(pose).all():
            raise Diverged("the particles' poses are no longer finite numbers")
        return pose

    def belief(self) -> Belief:
        """Weighted mean and covariance of the particles near the heaviest; located where most of the weight is there.

        The covariance is None where fewer than RANK particles carry weight: it would be singular.
        """
        pose, near, share = self._near()
        error = self._poses[:3, near] - pose[:, None]
        error[2] = wrap(error[2])
        weights = self._weights[near] / self._weights[near].sum()
        cov = (error * weights) @ error.T
        enough = 1 / (weights @ weights) >= RANK
        n_eff = float(1 / (self._weights @ self._weights))
        located = self._spread and share >= TOGETHER
        return Belief(pose, (cov + cov.T) / 2 if enough else None, n_eff=n_eff, located=located)

    def map(self) -> Map:
        """The given map."""
        return self._map

    def finish(self) -> None:
        """None: a filter does not smooth."""

    def _move(self, step: Step) -> None:
        """Draws the prior's pose at the first step, and every motion.

        Copies: a log's arrays are read-only, and kernels would be compiled once for each kind.
        """
        if not self._started:
            self._started = True
            move(self._poses, np.zeros(3), self._prior.cov.copy("C"), self._normals())
        if step.odometry is not None:
            move(self._poses, step.odometry.delta.copy("C"), step.odometry.cov.copy("C"), self._normals())

    def _scatter(self, which: Ints) -> None:
        """Draws these particles anew: each as far from a landmark as one of the last sightings, on any side of it."""
        u = self._rng.random((3, len(which)))
        who, z = self._seen
        i = (u[0] * len(who)).astype(np.int64)
        row = np.where(who[i] < 0, (u[1] * len(self._on.ids)).astype(np.int64), who[i])
        sight = np.pi * (1 - 2 * u[2])
        self._poses[:2, which] = self._on.xy[row].T - z[i, 0] * np.array((np.cos(sight), np.sin(sight)))
        self._poses[2, which] = heading = wrap(sight - z[i, 1])
        self._poses[3, which], self._poses[4, which] = np.cos(heading), np.sin(heading)

    def _weigh(self, who: Ints, z: Array, cov: Array) -> None:
        """Multiplies the weights by the likelihood of the sightings, and averages that of a single one."""
        if not self._spread:
            self._scatter(np.arange(len(self._weights)))
            self._spread = True
        count = len(who)
        before = self._log_weights.copy()
        weigh(self._on, self._poses, who, z, cov, self._options.widen, self._log_weights)
        gained = self._log_weights - before
        top = float(gained.max())
        mean = exp((top + log(float(self._weights @ np.exp(gained - top)))) / count)
        self._slow += (SLOW if self._slow else 1.0) * (mean - self._slow)
        self._fast += (FAST if self._fast else 1.0) * (mean - self._fast)
        self._log_weights -= self._log_weights.max()
        self._weights = np.exp(self._log_weights)
        self._weights /= self._weights.sum()

    def _resample(self) -> None:
        """Draws as many equal particles from the weighted ones, and some from the map."""
        M = len(self._weights)
        self._poses = np.take(self._poses, systematic(self._weights, self._rng), axis=1)
        self._log_weights, self._weights = np.zeros(M), np.full(M, 1 / M)
        anew = np.flatnonzero(self._rng.random(M) * self._slow < self._slow - FALLEN * self._fast)
        if len(anew):
            self._scatter(anew)

    def _near(self) -> tuple[Pose, Ints, float]:
        """Returns the mean pose of the particles near the heaviest, their numbers, and their share of the weight."""
        best = int(self._weights.argmax())
        off = self._poses[:3] - self._poses[:3, best : best + 1]
        near = np.flatnonzero((off[0] ** 2 + off[1] ** 2 < self._on.cell**2) & (np.abs(wrap(off[2])) < 0.5))
        weights = self._weights[near]
        share = float(weights.sum())
        turn = float(wrap(off[2, near]) @ weights) / share
        x, y = (self._poses[:2, near] @ weights / share).tolist()
        return np.array((x, y, float(wrap(self._poses[2, best] + turn)))), near, share

    def _normals(self) -> Array:
        """(3, M) standard normal random numbers."""
        return self._rng.standard_normal((3, len(self._weights)))


build = Builder(Mcl, options=Options, random=True, associates=True, locates=True, implementation=COMPILED_HERE)
