"""FastSLAM 1.0 and 2.0 (Montemerlo, Thrun, Koller, Wegbreit, AAAI 2002 and IJCAI 2003): Rao-Blackwellized particles.

Each particle is a sample of the path with a small EKF for every landmark: given the path the landmarks are independent,
so M particles and N landmarks are M N filters of size two. Version 1.0 draws a particle's next pose from its odometry
alone and weights it by the sightings; version 2.0 draws it from odometry and sightings together, so that fewer
particles are wasted where sightings are sharper than odometry.
"""

from dataclasses import dataclass
from itertools import islice
from math import atan2, isfinite, pi

import numpy as np

from ...frontend.factors import Map, Odometry, Prior, RangeBearing, Step
from ...frontend.options import option
from ...frontend.se2 import Array, Ints, wrap
from ..api import COMPILED_HERE, Belief, Builder, Diverged, Expected, Pose, Solution
from ..vicinity import Vicinity
from ._particles import LOGGED, correct, move, place
from ._proposal import propose
from .particle_maps import ParticleMaps
from .particle_paths import ParticlePaths
from .resampling import SCHEMES

RANK = 4
"""Particles needed for a covariance of three coordinates."""
EVEN = 1 - 1e-9
"""Weights that are equal up to rounding are not resampled."""


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


class FastSlam:
    """FastSLAM 2.0, or 1.0 with version=1: particles over the path, a 2x2 EKF for every landmark in each.

    The online pose is the particles' weighted mean; the solution is the path of the heaviest particle and its
    ancestors, with that particle's map. On a given map a particle cannot represent correlated landmark errors: only the
    2x2 blocks on the diagonal of the map's covariance are used, and a map without one is held fixed.

    Random numbers, in this order: at every step, the resampling's own, if any; then, where the pose is sampled,
    `standard_normal((3, M))`, rows that multiply the columns of a Cholesky factor: at the first step that of the
    prior's covariance, later, in version 1.0, of the odometry's covariance in the body frame, in 2.0 of the proposal's
    in the world frame.
    """

    def __init__(self, prior: Prior, options: Options, rng: np.random.Generator) -> None:
        M = options.particles
        self._prior, self._options, self._rng = prior, options, rng
        self._poses = np.empty(
            (5, M)
        )  # x, y, heading, and the cosine and sine that rotate a motion into the world's axes
        self._poses.T[:] = (*prior.pose, 1.0, 0.0)  # turned by 0: the prior's covariance is in the world frame already
        self._started = False
        self._log_weights = np.zeros(M)  # the largest is zero
        self._weights = np.full(M, 1 / M)
        self._origins = np.arange(M)  # initial particle that each descends from
        self._maps, self._vicinity = ParticleMaps(M), Vicinity()
        self._paths = ParticlePaths(M)
        if prior.map is not None:
            self._adopt(prior.map)

    def step(self, step: Step) -> Pose:
        """Resamples if the weights are too uneven, samples the motion, weights and corrects by the sightings.

        Resampling at the start of a step, not at the end of the last, keeps the estimate that of the weighted
        particles, which are more informative than their resampled copies.
        """
        if self._n_eff() < self._options.resample_below * len(self._weights) * EVEN:
            self._resample()
        ids, z, cov = step.sightings
        rows = np.array([self._maps.row.get(landmark, -1) for landmark in ids.tolist()], np.int64)
        old, new = np.flatnonzero(rows >= 0), np.flatnonzero(rows < 0)
        slots = self._maps.slots(rows[old])
        self._fold(self._motion(step), slots, np.take(z, old, axis=0), np.take(cov, old, axis=0))
        for landmark, at, spread in zip(
            ids[new].tolist(), np.take(z, new, axis=0), np.take(cov, new, axis=0), strict=True
        ):
            slot = self._maps.add(landmark)
            place(self._poses, self._maps.filters, slot, at, spread)
        self._paths.add(self._poses)
        pose = self._mean_pose()
        if not isfinite(pose.sum()):
            raise Diverged("the particles' poses are no longer finite numbers")
        return pose

    def expected(self, odometry: Odometry | None, seen: RangeBearing, gate: float) -> Expected:
        """Landmarks that one of the sightings may be of, by mean and covariance of the weighted particles."""
        pose, cov = self._moments()
        new = list(islice(reversed(self._maps.row), len(self._maps) - len(self._vicinity)))
        return self._vicinity.expected(pose, cov, odometry, seen, gate, new[::-1], self._marginals)

    def belief(self) -> Belief:
        """Weighted mean and covariance, effective number of particles, and number of initial ancestors.

        The covariance is None where fewer than RANK particles carry weight: it would be singular.
        """
        pose, cov = self._moments()
        n_eff = self._n_eff()
        ancestors = len(np.unique(self._origins))
        return Belief(pose, cov if n_eff >= RANK else None, n_eff=n_eff, ancestors=ancestors)

    def map(self) -> Map:
        """Weighted mean of the particles' maps; the covariance is the mixture's, within and between particles."""
        filters = self._maps.all()
        n, w = len(filters), self._weights
        xy = filters[:, :2] @ w
        apart = (filters[:, :2] - xy[..., None]).reshape(2 * n, len(w))
        cov = (apart * w) @ apart.T
        return Map(self._ids(), xy, _with_blocks((cov + cov.T) / 2, filters[:, 2:] @ w))

    def finish(self) -> Solution:
        """The path of the heaviest particle and its ancestors, and its map, with covariance given that path."""
        best = int(np.argmax(self._weights))
        filters = self._maps.all()[..., best]
        within = _with_blocks(np.zeros((2 * len(filters), 2 * len(filters))), filters[:, 2:])
        return Solution(self._paths.path(best), Map(self._ids(), filters[:, :2].copy(), within))

    def _motion(self, step: Step) -> Odometry | None:
        """The distribution of the step's poses: at the first, the prior's covariance about its pose.

        Copies: a log's arrays are read-only, and kernels would be compiled once for each kind.
        """
        motion = None if step.odometry is None else Odometry(*(part.copy("C") for part in step.odometry))
        if self._started:
            return motion
        self._started = True
        start = Odometry(np.zeros(3), self._prior.cov.copy("C"))
        if motion is None:
            return start
        move(self._poses, *start, self._normals())
        return motion

    def _fold(self, motion: Odometry | None, slots: Ints, z: Array, cov: Array) -> None:
        """Samples the poses, weights them by the sightings (k,) of known landmarks, and corrects these."""
        M, k = len(self._weights), len(slots)
        distance, volume = np.zeros(M), np.ones((-(-k // LOGGED), M))
        seen = (self._maps.filters, slots, z, cov)
        if motion is not None and self._options.version == 2:
            propose(self._poses, *motion, self._normals(), *seen, distance, volume)
            correct(self._poses, *seen, np.empty(M), np.empty_like(volume))  # already weighted by the marginals
        else:
            if motion is not None:
                move(self._poses, *motion, self._normals())
            correct(self._poses, *seen, distance, volume)
        if k > 0:
            self._weigh(distance + (np.log(volume).sum(axis=0) if k > LOGGED else np.log(volume[0])))

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
        """Draws as many equal particles from the weighted ones; maps and paths are updated on demand."""
        ancestors = SCHEMES[self._options.resampling](self._weights, self._rng)
        self._poses = np.take(self._poses, ancestors, axis=1)  # plain indexing would leave its columns contiguous
        self._origins = self._origins[ancestors]
        self._maps.resampled(ancestors)
        self._paths.resampled(ancestors)
        self._log_weights = np.zeros(len(ancestors))
        self._weights = np.full(len(ancestors), 1 / len(ancestors))

    def _adopt(self, known: Map) -> None:
        """Gives every particle the same map: its covariance's diagonal blocks; held fixed without one."""
        for k, (landmark, xy) in enumerate(zip(known.ids.tolist(), known.xy, strict=True)):
            slot = self._maps.add(landmark)
            filters = self._maps.filters[slot]
            filters[:2] = xy[:, None]
            if known.cov is not None:
                i, j = 2 * k, 2 * k + 1
                filters[2:] = np.array((known.cov[i, i], known.cov[i, j], known.cov[j, j]))[:, None]

    def _normals(self) -> Array:
        """(3, M) standard normal random numbers."""
        return self._rng.standard_normal((3, len(self._weights)))

    def _mean_pose(self) -> Pose:
        """The weighted mean pose; headings are averaged as directions."""
        x, y, _, c, s = (self._poses @ self._weights).tolist()
        heading = atan2(s, c)
        return np.array((x, y, pi if heading == -pi else heading))

    def _moments(self) -> tuple[Pose, Array]:
        """The weighted mean pose and covariance (3, 3)."""
        pose, error = self._scatter()
        cov = (error * self._weights) @ error.T if self._started else np.array(self._prior.cov)
        return pose, (cov + cov.T) / 2

    def _scatter(self) -> tuple[Pose, Array]:
        """The weighted mean pose, and each particle's difference from it (3, M)."""
        pose = self._mean_pose() if self._started else np.array(self._prior.pose)
        error = self._poses[:3] - pose[:, None]
        error[2] = wrap(error[2])
        return pose, error

    def _marginals(self, landmarks: list[int]) -> tuple[Array, Array, Array]:
        """The mean pose, the landmarks' mean places and the mixture's joint covariance, the pose last."""
        n, w = 2 * len(landmarks), self._weights
        slots = self._maps.slots(np.array([self._maps.row[landmark] for landmark in landmarks], np.int64))
        filters = self._maps.filters[slots]
        xy = filters[:, :2] @ w
        pose, error = self._scatter()
        apart = np.concatenate(((filters[:, :2] - xy[..., None]).reshape(n, len(w)), error))
        cov = (apart * w) @ apart.T
        if not self._started:  # nothing is drawn yet
            cov[-3:, -3:] = self._prior.cov
        cov[:n, :n] = _with_blocks(cov[:n, :n].copy(), filters[:, 2:] @ w)
        return pose, xy, (cov + cov.T) / 2

    def _n_eff(self) -> float:
        """Effective sample size, 1 / sum of squared weights: between 1 and M."""
        return float(1 / (self._weights @ self._weights))

    def _ids(self) -> Ints:
        return np.fromiter(self._maps.row, np.int64, len(self._maps))


def _with_blocks(cov: Array, blocks: Array) -> Array:
    """`cov` (2n, 2n) with `blocks` (n, 3), xx, xy, yy of each landmark, added on its diagonal."""
    i = 2 * np.arange(len(blocks))
    for (a, b), block in zip(((0, 0), (0, 1), (1, 0), (1, 1)), blocks.T[[0, 1, 1, 2]], strict=True):
        cov[i + a, i + b] += block
    return cov


build = Builder(FastSlam, options=Options, random=True, implementation=COMPILED_HERE)
