"""Registration against an independent solution, and its covariance against drawn errors."""

import numpy as np
from scipy.linalg import expm
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from depth_scenes import Seen, measured, seen_twice
from differences import central
from slamduel.core.se2 import Array
from slamduel.frontend.depth._registration import normal_equations, turn_by
from slamduel.frontend.depth.planar import skew
from slamduel.frontend.depth.points import Points
from slamduel.frontend.depth.registration import Registration, registered
from slamduel.frontend.depth.settings import Settings

SETTINGS = Settings()


def columns(points: Points) -> tuple[Array, Array]:
    return points.xyz, np.column_stack((points.z_sd, points.ray_sd))


def error(found: Registration, seen: Seen) -> Array:
    """(6,) the shift and turn on the left of the true motion that make it the one found."""
    turn = Rotation.from_matrix(found.R @ seen.R.T)
    return np.concatenate((found.t - turn.apply(seen.t), turn.as_rotvec()))


def by_scipy(seen: Seen, start: Registration) -> tuple[Array, Array]:
    """The motion with the least squared distances, each residual whitened by its own covariance at the optimum."""
    whitening = np.linalg.cholesky(np.linalg.inv(seen.first.cov + start.R @ seen.second.cov @ start.R.T))

    def residuals(x: Array) -> Array:
        R = Rotation.from_rotvec(x[3:]).as_matrix()
        r = seen.first.xyz - seen.second.xyz @ R.T - x[:3]
        return np.einsum("nji,nj->ni", whitening, r).ravel()

    found = least_squares(residuals, np.zeros(6), xtol=1e-15, ftol=1e-15, gtol=1e-15)
    return Rotation.from_rotvec(found.x[3:]).as_matrix(), found.x[:3]


def test_motion_is_the_optimum_that_scipy_finds() -> None:
    seen = seen_twice(np.random.default_rng(1), 150, SETTINGS, noise=0.5)  # so small that all are inliers
    found = registered(seen.first, seen.second, SETTINGS, np.random.default_rng(0))
    assert found is not None
    assert len(found.inliers) == 150
    R, t = by_scipy(seen, found)
    np.testing.assert_allclose(found.t, t, atol=1e-7)
    np.testing.assert_allclose(found.R, R, atol=1e-7)


def test_information_and_gradient_are_those_of_numerical_derivatives() -> None:
    seen = seen_twice(np.random.default_rng(2), 30, SETTINGS)
    (p, p_sd), (q, q_sd) = columns(seen.first), columns(seen.second)
    A, g, inside = np.empty((6, 6)), np.empty(6), np.zeros(30, bool)
    normal_equations(p, p_sd, q, q_sd, seen.R, seen.t, 1e9, inside, A, g)
    W = np.linalg.inv(seen.first.cov + seen.R @ seen.second.cov @ seen.R.T)

    def residuals(x: Array) -> Array:
        turn = Rotation.from_rotvec(x[3:])
        return p - turn.apply(q @ seen.R.T + seen.t) - x[:3]

    J = central(residuals, np.zeros(6))
    expected = np.einsum("nki,nkl,nlj->ij", J, W, J)
    np.testing.assert_allclose(A, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())
    downhill = -np.einsum("nki,nkl,nl->i", J, W, residuals(np.zeros(6)))
    np.testing.assert_allclose(g, downhill, rtol=1e-6, atol=1e-6 * np.abs(g).max())


def test_an_error_moves_a_motion_by_the_exponential_of_its_twist() -> None:
    rng = np.random.default_rng(5)
    for size in (1e-9, 1e-5, 4e-3, 0.1, 2.0):
        x = rng.normal(0, size, 6)
        R, t = Rotation.from_rotvec(rng.normal(0, 1, 3)).as_matrix(), rng.normal(0, 1, 3)
        hat = np.zeros((4, 4))
        hat[:3, :3], hat[:3, 3] = skew(x[3:]), x[:3]
        moved = expm(hat)
        expected = moved[:3, :3] @ R, moved[:3, :3] @ t + moved[:3, 3]
        turn_by(x, R, t)
        np.testing.assert_allclose(R, expected[0], atol=1e-14)
        np.testing.assert_allclose(t, expected[1], atol=1e-14)


def test_covariance_is_that_of_drawn_errors() -> None:
    rng, trials = np.random.default_rng(7), 400
    squared = np.empty(trials)
    for k in range(trials):
        seen = seen_twice(rng, 80, SETTINGS)
        found = registered(seen.first, seen.second, SETTINGS, np.random.default_rng(k))
        assert found is not None
        e = error(found, seen)
        squared[k] = e @ np.linalg.solve(found.cov, e) / 6
    # The mean of 400 chi2 (6) / 6 errs by sqrt(2 / 6 / 400) = 0.029. Weights at the measured depths, a gate at 99 % and
    # a covariance that is never made smaller move it by some hundredths.
    assert 0.85 < squared.mean() < 1.15


def test_a_motion_is_found_among_two_in_three_false_matches() -> None:
    rng = np.random.default_rng(11)
    seen = seen_twice(rng, 150, SETTINGS)
    wrong = np.sort(rng.permutation(150)[:100])
    shuffled = np.arange(150)
    shuffled[wrong] = np.roll(wrong, 1)
    found = registered(seen.first, seen.second.taken(shuffled), SETTINGS, np.random.default_rng(0))
    assert found is not None
    e = error(found, seen)
    assert e @ np.linalg.solve(found.cov, e) < 30  # chi2 of 6 degrees of freedom: 1 in 25,000
    right = np.setdiff1d(np.arange(150), wrong)
    assert len(np.intersect1d(found.inliers, right)) >= 45
    assert len(np.intersect1d(found.inliers, wrong)) <= 5  # that happen to fit


def test_points_on_a_line_or_too_few_are_no_motion() -> None:
    rng = np.random.default_rng(13)
    seen = seen_twice(rng, 40, SETTINGS)
    assert registered(seen.first.taken(range(11)), seen.second.taken(range(11)), SETTINGS, rng) is None
    line = np.linspace(-0.5, 0.5, 60)[:, None] * [1.0, 0.2, 0.3] + [0.0, 0.0, 2.0]
    one, two = (measured(line, rng, SETTINGS, 0.0) for _ in range(2))
    assert registered(one, two, SETTINGS, np.random.default_rng(0)) is None  # a turn about the line is unknown


def test_residuals_beyond_the_stated_noise_widen_the_covariance() -> None:
    seen = seen_twice(np.random.default_rng(17), 200, SETTINGS, noise=1.4)
    found = registered(seen.first, seen.second, SETTINGS, np.random.default_rng(0))
    assert found.chi > 1.2
    (p, p_sd), (q, q_sd) = columns(seen.first.taken(found.inliers)), columns(seen.second.taken(found.inliers))
    A, inside = np.empty((6, 6)), np.zeros(len(found.inliers), bool)
    squared = normal_equations(p, p_sd, q, q_sd, found.R, found.t, 1e9, inside, A, np.empty(6))
    chi = squared / (3 * len(found.inliers) - 6)
    np.testing.assert_allclose(found.cov, np.linalg.inv(A) * chi, rtol=1e-3, atol=1e-3 * np.abs(found.cov).max())
