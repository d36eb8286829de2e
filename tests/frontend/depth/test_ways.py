"""Motions one after another, back, and the ways between steps."""

import itertools

import numpy as np

from differences import central
from slamduel.core.se2 import Array, between, compose, compose_jacobians, inverse, wrap
from slamduel.frontend.depth.planar import Planar, back, chained, distance
from slamduel.frontend.depth.ways import Ways


def motions(n: int, seed: int = 0) -> list[Planar]:
    rng = np.random.default_rng(seed)
    found = list[Planar]()
    for _ in range(n):
        A = rng.normal(0, 0.02, (3, 5))
        found.append(Planar(rng.normal([0.2, 0, 0], [0.05, 0.05, 0.5]), A @ A.T))
    return found


def one_by_one(parts: list[Planar]) -> Planar:
    """Composes as Smith, Self and Cheeseman do, one motion at a time."""
    delta, cov = np.zeros(3), np.zeros((3, 3))
    for part in parts:
        by_first, by_second = compose_jacobians(delta, part.delta)
        delta, cov = compose(delta, part.delta), by_first @ cov @ by_first.T + by_second @ part.cov @ by_second.T
    return Planar(delta, cov)


def wrapped(delta: Array) -> Array:
    return np.array([*delta[:2], wrap(delta[2])])


def columns(parts: list[Planar]) -> tuple[Array, Array]:
    return np.array([part.delta for part in parts]), np.array([part.cov for part in parts])


def test_a_chain_is_that_of_one_motion_after_another() -> None:
    for n in (1, 2, 9):
        parts = motions(n, n)
        expected, found = one_by_one(parts), chained(*columns(parts))
        np.testing.assert_allclose(found.delta, expected.delta, atol=1e-14)
        np.testing.assert_allclose(found.cov, expected.cov, rtol=1e-10, atol=1e-16)
    nothing = chained(np.zeros((0, 3)), np.zeros((0, 3, 3)))
    assert not nothing.delta.any()
    assert not nothing.cov.any()


def test_the_motion_back_has_the_covariance_of_a_numerical_jacobian() -> None:
    for motion in motions(5):
        returned = back(motion)
        np.testing.assert_allclose(returned.delta, between(motion.delta, np.zeros(3)), atol=1e-15)
        J = central(inverse, motion.delta)
        np.testing.assert_allclose(returned.cov, J @ motion.cov @ J.T, rtol=1e-7, atol=1e-12)


def test_distance_counts_both_covariances_and_wraps() -> None:
    one = Planar(np.array([1.0, 2.0, np.pi - 0.01]), np.diag([0.01, 0.04, 0.001]))
    other = Planar(np.array([1.3, 2.0, -np.pi + 0.03]), np.diag([0.02, 0.01, 0.003]))
    np.testing.assert_allclose(distance(one, other), 0.3**2 / 0.03 + 0.04**2 / 0.004)
    assert one.delta[0] == 1.0


def test_the_way_between_steps_is_the_one_of_least_variance() -> None:
    ways, steps = Ways(), motions(5, 3)
    for motion in steps:
        ways.step(motion)
    sharp = Planar(np.array([0.5, 0.1, 0.2]), 1e-8 * np.eye(3))
    ways.join(1, 4, sharp)
    edges = {(k, k + 1): motion for k, motion in enumerate(steps)} | {(1, 4): sharp}
    edges |= {(b, a): back(motion) for (a, b), motion in edges.items()}
    for first, second in itertools.permutations(range(6), 2):
        paths = [
            list(itertools.pairwise((first, *middle, second)))
            for n in range(5)
            for middle in itertools.permutations(set(range(6)) - {first, second}, n)
        ]
        possible = [[edges[edge] for edge in path] for path in paths if all(edge in edges for edge in path)]
        best = one_by_one(min(possible, key=lambda parts: sum(np.trace(part.cov) for part in parts)))
        found = ways.motion(first, second)
        np.testing.assert_allclose(found.delta, best.delta, atol=1e-12)
        np.testing.assert_allclose(found.cov, best.cov, rtol=1e-9, atol=1e-15)
    assert not ways.motion(3, 3).cov.any()
    path = ways.path()
    assert path.shape == (6, 3)
    assert not path[0].any()
    for step in range(1, 6):
        np.testing.assert_allclose(wrapped(path[step] - ways.motion(0, step).delta), 0, atol=1e-12)


def test_ways_over_many_steps_and_loops_have_the_least_variance_that_a_matrix_tells() -> None:
    rng, n = np.random.default_rng(21), 700
    ways, all_ = Ways(), np.full((n, n), np.inf)
    for k, motion in enumerate(motions(n - 1, 2)):
        ways.step(motion)
        all_[k, k + 1], all_[k + 1, k] = np.trace(motion.cov), np.trace(back(motion).cov)
    for motion in motions(200, 3):
        first, second = (int(k) for k in rng.choice(n, 2, replace=False))
        ways.join(first, second, motion)
        variances = np.trace(motion.cov), np.trace(back(motion).cov)
        all_[first, second] = min(all_[first, second], variances[0])
        all_[second, first] = min(all_[second, first], variances[1])
    end = 350
    least = np.full(n, np.inf)
    least[end] = 0
    for _ in range(n):  # Bellman and Ford
        least = np.minimum(least, (all_ + least).min(axis=1))
    for k in range(0, n, 7):
        np.testing.assert_allclose(ways.variance(k, end), least[k], rtol=1e-12, atol=1e-15)
