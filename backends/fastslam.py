"""FastSLAM 1.0 (Montemerlo, Thrun, Koller, Wegbreit, AAAI 2002): a Rao-Blackwellized particle filter.

Each particle is one guess of the path, sampled from the motion model, and keeps a small EKF for every landmark; given
the path the landmarks are independent, so M particles and N landmarks are M N filters of size two. All M filters of one
landmark are corrected at once.
"""

from dataclasses import dataclass

import numpy as np

from ..frontend.factors import Map, Prior, RangeBearing, Step
from ..frontend.options import option
from ..frontend.se2 import Array, compose, wrap
from .api import Belief, Builder, Diverged, Pose
from .models import innovation, place, sight

RANK = 4
"""Particles that a covariance of three coordinates takes."""


@dataclass(frozen=True)
class Options:
    """How many particles, and when they are resampled."""

    particles: int = option(100, "number of particles", minimum=1, maximum=10_000_000)
    resample_below: float = option(
        0.5, "resample when the effective sample size is below this share of the particles", minimum=0, maximum=1
    )


class FastSlam:
    """FastSLAM 1.0: particles over the path, a 2x2 EKF a landmark in each, low-variance resampling."""

    def __init__(self, prior: Prior, options: Options, rng: np.random.Generator) -> None:
        M = options.particles
        self._options, self._rng = options, rng
        self._poses = prior.pose + rng.standard_normal((M, 3)) @ np.linalg.cholesky(prior.cov).T  # (M, 3)
        self._poses[:, 2] = wrap(self._poses[:, 2])
        self._weights = np.full(M, 1 / M)
        self._slot: dict[int, int] = {}  # landmark id -> its row in the two arrays below
        self._xy = np.zeros((0, M, 2))  # means, a row a landmark, rows reserved by doubling
        self._cov = np.zeros((0, M, 2, 2))
        if prior.map is not None:
            self._adopt(prior.map)

    def step(self, step: Step) -> Pose:
        """Resample if the weights have become too uneven, sample the motion, then weight and correct by each sighting.

        Resampling at the start of a step, not at the end of the last, leaves the estimate to the weighted particles,
        which say more than their resampled copies.
        """
        if self._n_eff() < self._options.resample_below * len(self._poses):
            self._resample()
        if step.odometry is not None:
            noise = self._rng.standard_normal(self._poses.shape) @ np.linalg.cholesky(step.odometry.cov).T
            self._poses = compose(self._poses, step.odometry.delta + noise)
        log_weights = np.log(self._weights, where=self._weights > 0, out=np.full_like(self._weights, -np.inf))
        for k, landmark in enumerate(step.sightings.ids.tolist()):
            if landmark in self._slot:
                log_weights += self._correct(step.sightings, k)
            else:
                self._add(step.sightings, k)
        self._weights = np.exp(log_weights - log_weights.max())
        self._weights /= self._weights.sum()
        if not np.isfinite(self._weights).all():
            raise Diverged("no particle has a finite likelihood left")
        return self._mean_pose()

    def belief(self) -> Belief:
        """The particles' weighted mean and covariance, and how many of them still count.

        The covariance is None where fewer than RANK particles carry weight: there are none of full rank then.
        """
        pose = self._mean_pose()
        error = self._poses - pose
        error[:, 2] = wrap(error[:, 2])
        cov = (error * self._weights[:, None]).T @ error
        n_eff = self._n_eff()
        return Belief(pose, (cov + cov.T) / 2 if n_eff >= RANK else None, n_eff=n_eff)

    def map(self) -> Map:
        """The weighted mean of the particles' maps; the covariance is the mixture's, within and between particles."""
        n = len(self._slot)
        w = self._weights
        xy = np.einsum("m,nmi->ni", w, self._xy[:n])
        apart = (self._xy[:n] - xy[:, None]).transpose(1, 0, 2).reshape(len(w), 2 * n)
        cov = (apart * w[:, None]).T @ apart
        within = np.einsum("m,nmij->nij", w, self._cov[:n])
        for k in range(n):
            cov[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] += within[k]
        return Map(np.fromiter(self._slot, np.int64, n), xy, (cov + cov.T) / 2)

    def finish(self) -> None:
        """None: a filter does not look back."""

    def _correct(self, seen: RangeBearing, k: int) -> Array:
        """Correct one landmark in every particle; the log-likelihood (M,) of the sighting, less a shared constant."""
        row = self._slot[int(seen.ids[k])]
        xy, P = self._xy[row], self._cov[row]
        expected, _, H = sight(self._poses, xy)
        PHt = P @ H.swapaxes(-1, -2)
        S = H @ PHt + seen.cov[k]
        S_inv, det = _inverse_2x2(S)
        nu = innovation(np.broadcast_to(seen.z[k], xy.shape).copy(), expected)
        weighted = np.einsum("mij,mj->mi", S_inv, nu)
        self._xy[row] += np.einsum("mij,mj->mi", PHt, weighted)
        corrected = P - PHt @ S_inv @ PHt.swapaxes(-1, -2)
        self._cov[row] = (corrected + corrected.swapaxes(-1, -2)) / 2
        return -0.5 * (np.einsum("mi,mi->m", nu, weighted) + np.log(det))

    def _add(self, seen: RangeBearing, k: int) -> None:
        """Put a new landmark where each particle sees it; given the path, only the sighting is uncertain."""
        row = self._grown(1)
        xy, _, by_z = place(self._poses, np.broadcast_to(seen.z[k], (len(self._poses), 2)))
        self._xy[row] = xy
        self._cov[row] = by_z @ seen.cov[k] @ by_z.swapaxes(-1, -2)
        self._slot[int(seen.ids[k])] = row

    def _adopt(self, known: Map) -> None:
        """Give every particle the same map: of its covariance the diagonal blocks; held fixed where it has none."""
        row = self._grown(len(known.ids))
        self._xy[row : row + len(known.ids)] = known.xy[:, None]
        for k, landmark in enumerate(known.ids.tolist()):
            if known.cov is not None:
                self._cov[row + k] = known.cov[2 * k : 2 * k + 2, 2 * k : 2 * k + 2]
            self._slot[landmark] = row + k

    def _grown(self, more: int) -> int:
        """Make sure of `more` free rows; the first of them."""
        used, reserved = len(self._slot), len(self._xy)
        if used + more > reserved:
            extra = max(reserved, more, 8)
            self._xy = np.concatenate((self._xy, np.zeros((extra, *self._xy.shape[1:]))))
            self._cov = np.concatenate((self._cov, np.zeros((extra, *self._cov.shape[1:]))))
        return used

    def _resample(self) -> None:
        """Low-variance resampling (Probabilistic Robotics, table 4.4): copies, so that no two particles share a map."""
        M, n = len(self._poses), len(self._slot)
        upto = np.cumsum(self._weights)
        ancestors = np.searchsorted(upto / upto[-1], (self._rng.random() + np.arange(M)) / M)
        self._poses = self._poses[ancestors]
        self._xy[:n] = self._xy[:n, ancestors]
        self._cov[:n] = self._cov[:n, ancestors]
        self._weights = np.full(M, 1 / M)

    def _mean_pose(self) -> Pose:
        """The weighted mean pose; headings are averaged as directions."""
        x, y = self._weights @ self._poses[:, :2]
        heading = self._poses[:, 2]
        return np.array((x, y, np.arctan2(self._weights @ np.sin(heading), self._weights @ np.cos(heading))))

    def _n_eff(self) -> float:
        """Effective sample size, 1 / sum of squared weights: between 1 and M."""
        return float(1 / (self._weights @ self._weights))


def _inverse_2x2(S: Array) -> tuple[Array, Array]:
    """Inverses (M, 2, 2) and determinants (M,) of symmetric 2x2 matrices."""
    det = S[:, 0, 0] * S[:, 1, 1] - S[:, 0, 1] * S[:, 1, 0]
    inverse = np.empty_like(S)
    inverse[:, 0, 0], inverse[:, 1, 1] = S[:, 1, 1], S[:, 0, 0]
    inverse[:, 0, 1], inverse[:, 1, 0] = -S[:, 0, 1], -S[:, 1, 0]
    inverse /= det[:, None, None]
    return inverse, det


build = Builder(FastSlam, options=Options, random=True)
