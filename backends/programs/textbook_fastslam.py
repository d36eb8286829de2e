"""FastSLAM 1.0 and 2.0 as published: a Python loop over particles, each with a map of its own.

The package's particle filter is timed against it, and compared with it in the tests: Probabilistic Robotics, tables
13.1 and 13.3 and, for several sightings per step, section 4.3 of Montemerlo's thesis (2003). It is slow and shares
nothing with the package's own estimator but the order in which random numbers are drawn.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ...core.factors import Map, Odometry, Prior, Step
from ...core.options import option
from ...core.se2 import Array, wrap
from ..api import Belief, Builder, Pose


@dataclass(frozen=True)
class Options:
    """Settings."""

    particles: int = option(100, "particles, each with a map of its own", minimum=1)
    version: int = option(1, "FastSLAM 1.0 or 2.0", minimum=1, maximum=2)
    resampling: str = option(
        "systematic", "way of drawing survivors", choices=("systematic", "stratified", "residual", "multinomial")
    )
    resample_below: float = option(0.5, "resample below this effective share of particles", minimum=0, maximum=1)


class Landmark(NamedTuple):
    """A landmark's EKF; a correction makes a new one, so particles may share one."""

    mean: Array  # (2,) m
    cov: Array  # (2, 2)


@dataclass
class Particle:
    """A hypothesis of the robot's pose, with its map."""

    pose: Array  # (3,)
    map: dict[int, Landmark] = field(default_factory=dict[int, Landmark])
    log_weight: float = 0.0


class TextbookFastSlam:
    """FastSLAM of a `version`, 1 or 2; `resampling` is one of systematic, stratified, residual, multinomial.

    Random numbers are drawn as in the package's own: first those of resampling, then three rows of standard normal
    numbers, one column per particle, wherever poses are sampled.
    """

    def __init__(
        self,
        prior: Prior,
        particles: int,
        rng: np.random.Generator,
        version: int = 1,
        resampling: str = "systematic",
        resample_below: float = 0.5,
    ) -> None:
        self.particles = [Particle(np.array(prior.pose)) for _ in range(particles)]
        self._prior, self._rng, self._version = prior, rng, version
        self._resampling, self._resample_below = resampling, resample_below
        self._first = True
        if prior.map is not None:
            for particle in self.particles:
                for k, landmark in enumerate(prior.map.ids.tolist()):
                    block = slice(2 * k, 2 * k + 2)
                    cov = np.zeros((2, 2)) if prior.map.cov is None else prior.map.cov[block, block]
                    particle.map[landmark] = Landmark(prior.map.xy[k], cov)

    def step(self, step: Step) -> Pose:
        """Makes a step; returns the weighted mean of the poses."""
        weights = self.weights()
        if 1 / np.sum(weights**2) < self._resample_below * len(weights) * (1 - 1e-9):
            self._resample(weights)
        motion, self._first = self._motion_of(step), False
        normals = None if motion is None else self._rng.standard_normal((3, len(self.particles)))
        for m, particle in enumerate(self.particles):
            known = [k for k, landmark in enumerate(step.sightings.ids.tolist()) if landmark in particle.map]
            if motion is not None and normals is not None:
                if self._version == 1:
                    self._move(particle, motion, normals[:, m])
                else:
                    self._propose(particle, motion, normals[:, m], step, known)
            for k, landmark in enumerate(step.sightings.ids.tolist()):
                z, R = step.sightings.z[k], step.sightings.cov[k]
                if k not in known:
                    particle.map[landmark] = _seen_first(particle.pose, z, R)
                    continue
                particle.map[landmark], likelihood = _correct(particle.map[landmark], particle.pose, z, R)
                if self._version == 1 or motion is None:
                    particle.log_weight += likelihood
        return self.mean_pose()

    def belief(self) -> Belief:
        """The weighted mean pose, the particles' covariance about it, and their effective number."""
        weights, mean = self.weights(), self.mean_pose()
        off = np.array([particle.pose for particle in self.particles]) - mean
        off[:, 2] = wrap(off[:, 2])
        return Belief(mean, off.T @ (weights[:, None] * off), n_eff=float(1 / np.sum(weights**2)))

    def map(self) -> Map:
        """The map of the likeliest particle, its landmarks independent of one another."""
        best = self.particles[int(np.argmax(self.weights()))].map
        cov = np.zeros((2 * len(best), 2 * len(best)))
        for k, landmark in enumerate(best.values()):
            cov[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = landmark.cov
        xy = np.array([landmark.mean for landmark in best.values()]).reshape(-1, 2)
        return Map(np.array(list(best), np.int64), xy, cov if cov.any() else None)

    def finish(self) -> None:
        """None: the particles keep no path."""

    def weights(self) -> Array:
        """The particles' normalised weights (M,)."""
        logs = np.array([particle.log_weight for particle in self.particles])
        weights = np.exp(logs - logs.max())
        return weights / weights.sum()

    def mean_pose(self) -> Pose:
        """The weighted mean (3,); headings are averaged as directions."""
        poses = np.array([particle.pose for particle in self.particles])
        x, y, c, s = self.weights() @ np.column_stack((poses[:, :2], np.cos(poses[:, 2]), np.sin(poses[:, 2])))
        return np.array([x, y, np.arctan2(s, c)])

    def _motion_of(self, step: Step) -> Odometry | None:
        """The motion; at the first step the prior's covariance, about a pose at rest."""
        return Odometry(np.zeros(3), self._prior.cov) if self._first else step.odometry

    def _in_world(self, particle: Particle, motion: Odometry) -> tuple[Array, Array]:
        """The pose after the motion, and the matrix that turns the motion's errors to the world's axes."""
        c, s = np.cos(particle.pose[2]), np.sin(particle.pose[2])
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        mean = particle.pose + turn @ motion.delta
        is_prior = motion.cov is self._prior.cov
        return mean, np.eye(3) if is_prior else turn

    def _move(self, particle: Particle, motion: Odometry, normals: Array) -> None:
        """Samples from the motion model: Probabilistic Robotics, table 13.1."""
        mean, turn = self._in_world(particle, motion)
        particle.pose = mean + turn @ np.linalg.cholesky(motion.cov) @ normals
        particle.pose[2] = _wrapped(particle.pose[2])

    def _propose(self, particle: Particle, motion: Odometry, normals: Array, step: Step, known: list[int]) -> None:
        """Samples from motion and sightings, one after another: Probabilistic Robotics, table 13.3."""
        mean, turn = self._in_world(particle, motion)
        cov = turn @ motion.cov @ turn.T
        for k in known:
            landmark = particle.map[int(step.sightings.ids[k])]
            z, R = step.sightings.z[k], step.sightings.cov[k]
            expected, by_pose, by_landmark = _sight(mean, landmark.mean)
            innovation = z - expected
            innovation[1] = _wrapped(innovation[1])
            Z = R + by_landmark @ landmark.cov @ by_landmark.T  # the sighting's covariance, given the pose
            L = by_pose @ cov @ by_pose.T + Z  # and given the motion alone
            K = cov @ by_pose.T @ np.linalg.inv(L)
            particle.log_weight += -0.5 * (
                innovation @ np.linalg.solve(L, innovation) + np.log(np.linalg.det(2 * np.pi * L))
            )
            mean = mean + K @ innovation
            cov = (np.eye(3) - K @ by_pose) @ cov
        particle.pose = mean + np.linalg.cholesky((cov + cov.T) / 2) @ normals
        particle.pose[2] = _wrapped(particle.pose[2])

    def _resample(self, weights: Array) -> None:
        M = len(weights)
        if self._resampling == "residual":
            ancestors = [m for m in range(M) for _ in range(int(M * weights[m]))]
            rest = M * weights - np.floor(M * weights)
            points = np.sort(self._rng.random(M - len(ancestors)))
            ancestors = sorted(ancestors + _found(rest, points))
        elif self._resampling == "systematic":
            ancestors = _found(weights, (self._rng.random() + np.arange(M)) / M)
        elif self._resampling == "stratified":
            ancestors = _found(weights, (self._rng.random(M) + np.arange(M)) / M)
        else:
            ancestors = _found(weights, np.sort(self._rng.random(M)))
        self.particles = [Particle(self.particles[m].pose, dict(self.particles[m].map)) for m in ancestors]


def _found(weights: Array, points: Array) -> list[int]:
    """The particle in whose share of the cumulative weight each point falls."""
    upto = np.cumsum(weights) / np.sum(weights)
    return [int(np.searchsorted(upto, point, side="right")) for point in points]


def _wrapped(angle: float) -> float:
    return float(np.pi - (np.pi - angle) % (2 * np.pi))


def _sight(pose: Array, at: Array) -> tuple[Array, Array, Array]:
    """Predicts (range, bearing), Jacobians by pose (2, 3) and landmark (2, 2): ArUco EKF SLAM, eqs (12)-(16)."""
    dx, dy = at - pose[:2]
    r = np.hypot(dx, dy)
    by_landmark = np.array([[dx / r, dy / r], [-dy / r**2, dx / r**2]])
    by_pose = np.column_stack((-by_landmark, [0.0, -1.0]))
    return np.array([r, _wrapped(np.arctan2(dy, dx) - pose[2])]), by_pose, by_landmark


def _seen_first(pose: Array, z: Array, R: Array) -> Landmark:
    c, s = np.cos(pose[2] + z[1]), np.sin(pose[2] + z[1])
    by_z = np.array([[c, -z[0] * s], [s, z[0] * c]])
    return Landmark(pose[:2] + z[0] * np.array([c, s]), by_z @ R @ by_z.T)


def _correct(landmark: Landmark, pose: Array, z: Array, R: Array) -> tuple[Landmark, float]:
    """Updates the landmark's EKF; returns it and the log-likelihood of the sighting."""
    expected, _, H = _sight(pose, landmark.mean)
    innovation = z - expected
    innovation[1] = _wrapped(innovation[1])
    S = H @ landmark.cov @ H.T + R
    K = landmark.cov @ H.T @ np.linalg.inv(S)
    likelihood = -0.5 * (innovation @ np.linalg.solve(S, innovation) + np.log(np.linalg.det(2 * np.pi * S)))
    return Landmark(landmark.mean + K @ innovation, (np.eye(2) - K @ H) @ landmark.cov), float(likelihood)


def textbook_fastslam(prior: Prior, options: Options, rng: np.random.Generator) -> TextbookFastSlam:
    """FastSLAM 1.0 and 2.0 as published, a loop in Python over particles: slow, to be read beside the tables."""
    version, resampling, below = options.version, options.resampling, options.resample_below
    return TextbookFastSlam(prior, options.particles, rng, version, resampling, below)


build = Builder(textbook_fastslam, options=Options, random=True, implementation="NumPy, as printed")
