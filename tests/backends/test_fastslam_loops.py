"""FastSLAM with loop closures: against a plain loop over particles, their paths, and exact linear theory."""

from functools import partial
from typing import Any

import numpy as np
import pytest

import driven
from dense_delayed import DelayedEkf, relative, with_loops
from dense_invariant import turning
from random_logs import random_covariance, random_log
from slamduel.backends.api import Diverged, Odometry, Prior, Step, Unsuited
from slamduel.backends.particles import _loops, resampling
from slamduel.backends.particles._proposal import Motion
from slamduel.backends.particles.particle_paths import ParticlePaths
from slamduel.backends.programs.textbook_fastslam import Particle, TextbookFastSlam
from slamduel.backends.registry import find
from slamduel.core.factors import Log, RelativePoses
from slamduel.core.se2 import Array, Ints, between, compose, wrap
from tiers import first_quick

make = partial(driven.make, "fastslam")


class PathFastSlam(TextbookFastSlam):
    """The textbook's with loop closures: a particle is known by its pose's array, and so is its path."""

    def __init__(self, prior: Prior, particles: int, rng: np.random.Generator, *options: Any, **named: Any) -> None:
        super().__init__(prior, particles, rng, *options, **named)
        self.paths: dict[int, list[Array]] = {id(particle.pose): [] for particle in self.particles}
        self.held: dict[int, list[Array]] = {}  # the same at the end of a step, without its pose
        self.path: list[Array] = []  # of the particle at hand
        self.loops: list[tuple[int, Array, Array]] = []

    def step(self, step: Step) -> Array:
        self.loops = list(zip(step.loops.to.tolist(), step.loops.delta, step.loops.cov, strict=True))
        self.held = {}
        pose = super().step(step)
        self.paths = {id(one.pose): [*self.held[id(one.pose)], one.pose] for one in self.particles}
        return pose

    def _in_world(self, particle: Particle, motion: Odometry) -> tuple[Array, Array]:
        """The motion's mean and axes: with version 2 those of its product with the loop closures."""
        mean, turn = super()._in_world(particle, motion)
        self.path = self.paths[id(particle.pose)]
        cov = turn @ motion.cov @ turn.T
        for to, z, R in self.loops if self._version == 2 else ():
            H = np.eye(3)
            H[:2, :2] = turning(self.path[to][2]).T
            error = z - relative(mean, self.path[to])
            error[2] = wrap(error[2])
            S = H @ cov @ H.T + R
            K = cov @ H.T @ np.linalg.inv(S)
            particle.log_weight += density(error, S)
            mean, cov = mean + K @ error, (np.eye(3) - K @ H) @ cov
        if self._version == 1:
            return mean, turn
        return mean, np.linalg.cholesky((cov + cov.T) / 2) @ np.linalg.inv(np.linalg.cholesky(motion.cov))

    def _move(self, particle: Particle, motion: Odometry, normals: Array) -> None:
        super()._move(particle, motion, normals)
        self.held[id(particle.pose)] = self.path
        for to, z, R in self.loops:
            error = z - relative(particle.pose, self.path[to])
            error[2] = wrap(error[2])
            particle.log_weight += density(error, R)

    def _propose(self, particle: Particle, motion: Odometry, normals: Array, step: Step, known: list[int]) -> None:
        super()._propose(particle, motion, normals, step, known)
        self.held[id(particle.pose)] = self.path


def density(error: Array, cov: Array) -> float:
    return float(-0.5 * (error @ np.linalg.solve(cov, error) + np.log(np.linalg.det(2 * np.pi * cov))))


def closed(seed: int, steps: int, landmarks: int, share: float = 0.3) -> Log:
    rng = np.random.default_rng(seed)
    return with_loops(rng, random_log(rng, steps, landmarks, radius=4.0), share)


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("landmarks", [0, 8])
@pytest.mark.parametrize("resampled", first_quick(resampling.SCHEMES))
def test_it_is_the_textbook_filter_with_paths(version: int, landmarks: int, resampled: str) -> None:
    log = closed(1, 60, landmarks)
    assert len(log.loop_to) > 20
    options: dict[str, Any] = {"version": version, "resampling": resampled}
    mine = make(log.prior, 0, particles=20, **options)
    textbook = PathFastSlam(log.prior, 20, np.random.default_rng(0), **options)
    for step in log:
        assert mine.step(step) == pytest.approx(textbook.step(step), abs=1e-8)
        assert mine._weights == pytest.approx(textbook.weights(), abs=1e-7)
    for m, particle in enumerate(textbook.particles):
        assert mine._paths.path(m) == pytest.approx(np.array(textbook.paths[id(particle.pose)]), abs=1e-8)


def test_a_weight_of_version_two_is_the_integral_over_the_motion() -> None:
    """By Gauss-Hermite quadrature of 41 nodes in each direction, of two loop closures at once."""
    rng = np.random.default_rng(2)
    M = 5
    poses, earlier = np.zeros((5, M)), rng.uniform(-2, 2, (2, 3, M))
    poses[:3] = earlier[0] + 0.01 * rng.standard_normal((3, M))
    poses[3], poses[4] = np.cos(poses[2]), np.sin(poses[2])
    delta, motion = np.array([0.5, 0.1, 0.2]), random_covariance(rng, [0.02, 0.02, 0.02])
    R = np.array([random_covariance(rng, [0.03, 0.03, 0.03]) for _ in range(2)])
    at = compose(poses[:3, 0], delta)
    z = np.array([between(earlier[k, :, 0], at) + 0.01 for k in range(2)])
    earlier[1] = np.array([compose(poses[:3, m], between(at, earlier[1, :, 0])) for m in range(M)]).T  # nearly agrees
    nodes, shares = np.polynomial.hermite_e.hermegauss(41)
    grid = np.stack(np.meshgrid(*[nodes] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    share = np.prod(np.stack(np.meshgrid(*[shares] * 3, indexing="ij"), axis=-1).reshape(-1, 3), axis=1)
    logs: list[float] = []
    for m in range(M):
        there = compose(poses[:3, m], delta + grid @ np.linalg.cholesky(motion).T)
        likelihood = np.ones(len(grid))
        for k in range(2):
            error = z[k] - between(earlier[k, :, m], there)
            error[:, 2] = wrap(error[:, 2])
            likelihood *= np.exp(-0.5 * np.sum(error @ np.linalg.inv(R[k]) * error, axis=1))
        logs.append(float(np.log(share @ likelihood)))
    distance, none = np.zeros(M), np.zeros(0, np.int64)
    noise = rng.standard_normal((3, M))
    _loops.propose(
        poses, Motion(delta, motion, noise), _loops.Loops(earlier, z, R),
        np.zeros((1, 5, M)), none, np.zeros((0, 2)), np.zeros((0, 2, 2)), distance, np.ones((0, M)),
    )  # fmt: skip
    weights = -0.5 * distance
    assert np.ptp(logs) > 0.3  # they do differ
    assert weights - weights[0] == pytest.approx(np.array(logs) - logs[0], abs=1e-6)


@pytest.mark.parametrize("version", [1, 2])
def test_many_particles_are_the_exact_posterior_where_models_are_linear(version: int) -> None:
    """Headings are known, so the EKF with all poses kept is exact; without resampling errors are of weighted means."""
    rng = np.random.default_rng(3)
    sure, steps, pose, poses = 1e-6, list[Step](), np.array([0.0, 0.0, 0.4]), []
    prior = Prior(pose, np.diag([0.1, 0.1, sure]) ** 2)
    for k in range(10):
        motion, cov = np.array([0.5, 0.1, 0.3]), np.diag([0.1, 0.07, sure]) ** 2
        pose = pose if k == 0 else compose(pose, motion)
        poses.append(pose)
        loops = driven.NO_LOOPS
        if k in (5, 8):
            to = np.array([k - 4, k - 2])
            R = np.diag([0.15, 0.1, 10 * sure]) ** 2
            z = between(np.array(poses)[to], pose) + rng.multivariate_normal(np.zeros(3), R, 2)
            loops = RelativePoses(to, z, np.array([R, R]))
        moved = None if k == 0 else Odometry(motion + rng.multivariate_normal(np.zeros(3), cov), cov)
        steps.append(Step(float(k), moved, driven.NO_SIGHTINGS, loops))
    log = Log.from_steps("linear", prior, steps)
    backend = make(log.prior, 0, particles=50_000, version=version, resample_below=0.0)
    exact = DelayedEkf(log.prior)
    for step in log:
        found, expected = backend.step(step), exact.step(step)
        cov, n = exact.cov[:2, :2], backend.belief().n_eff
        assert n > 500
        assert (np.abs(found - expected)[:2] < 6 * np.sqrt(np.diag(cov) / n) + 1e-4).all()
        apart = backend.belief().cov[:2, :2] - cov
        # a sample variance of n normal numbers has a standard deviation of sqrt(2 / n) of it
        assert np.abs(apart).max() < 6 * np.sqrt(2 / n) * np.abs(cov).max()
    path, n = backend._paths.at(np.arange(10)), backend.belief().n_eff
    for k in range(10):  # all earlier poses, too, given all loop closures
        own, cov = exact.pose(k)
        mean = path[k] @ backend._weights
        assert (np.abs(mean - own)[:2] < 6 * np.sqrt(np.diag(cov)[:2] / n) + 1e-4).all()


@pytest.mark.parametrize("sort", [True, False])
def test_the_poses_of_a_step_are_those_of_the_paths(sort: bool) -> None:
    rng = np.random.default_rng(4)
    M = 12
    paths: Any = ParticlePaths(M)
    for k in range(40):
        if k % 3 == 2:
            ancestors: Ints = rng.integers(0, M, M)
            paths.resampled(np.sort(ancestors) if sort else ancestors)
        if k > 5:
            steps = rng.integers(0, k, 4)
            found = paths.at(steps)
            for m in range(M):
                assert np.array_equal(found[:, :, m], paths.path(m)[steps])
        paths.add(rng.standard_normal((5, M)))
    assert paths.at(np.zeros(0, np.int64)).shape == (0, 3, M)


def test_a_loop_closure_takes_out_drift() -> None:
    """With errors as stated, the pose after a loop is that of the EKF with all poses kept, to its uncertainty."""
    log = closed(5, 150, 0)
    path, kept = (driven.run(name, log)[1] for name in ("fastslam", "ekf"))
    reckoned = driven.run("dead-reckoning", log.without_loops())[1]
    closing = np.unique(log.loop_step)[-10:]
    apart = np.hypot(*(path - kept)[closing, :2].T).mean()
    assert apart < np.hypot(*(reckoned - kept)[closing, :2].T).mean() / 3


def test_what_is_impossible_ends_it_and_decisions_of_particles_have_no_loops() -> None:
    log = closed(6, 12, 0, share=0.0)
    steps = list(log)
    far = RelativePoses(np.array([3]), np.full((1, 3), 1e200), 1e-4 * np.eye(3)[None])
    bad = Log.from_steps("bad", log.prior, [*steps[:-1], steps[-1]._replace(loops=far)])
    backend = make(bad.prior, particles=20, version=1)
    for step in steps[:-1]:
        backend.step(step)
    with pytest.raises(Diverged, match="finite likelihood"):
        backend.step(bad[-1])
    builder = find("fastslam")
    with pytest.raises(Unsuited, match="takes no loop closures"):
        builder.make(bad.prior, builder.options(association="particle"), np.random.default_rng(0))
