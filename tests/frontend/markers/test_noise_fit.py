"""Fitting the noise model: known parameters come back within what the standard errors allow, outliers or not."""

from collections.abc import Callable

import numpy as np
import pytest

from refusals import refused
from slamduel.core.se2 import Array
from slamduel.frontend.markers.noise import rocking
from slamduel.frontend.markers.noise_fit import FEWEST, fit_propagated, fit_slope, squares

SEEDS = range(6)


def sloped(rng: np.random.Generator, n: int, k: float, floor: float) -> tuple[Array, Array]:
    z = rng.uniform(0.3, 5.0, n)
    return z, rng.normal(size=n) * np.hypot(k * z, floor)


def random_covs(rng: np.random.Generator, n: int) -> Array:
    half = rng.normal(size=(n, 2, 2)) * np.array([0.05, 0.01])[:, None]
    return half @ half.transpose(0, 2, 1) + np.diag([1e-4, 1e-6])


def drawn(rng: np.random.Generator, cov: Array) -> Array:
    return np.einsum("nij,nj->ni", np.linalg.cholesky(cov), rng.normal(size=(len(cov), 2)))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("k", "floor"), [(0.02, 0.02), (0.05, 0.005), (0.003, 0.01)])
def test_slope_and_floor_come_back(seed: int, k: float, floor: float) -> None:
    z, errors = sloped(np.random.default_rng(seed), 4000, k, floor)
    fit = fit_slope(z, errors)
    # Four and a half standard errors a number: 36 of them are beyond it once in 4,000 runs of the whole.
    assert abs(fit.k - k) < 4.5 * fit.k_error
    assert abs(fit.floor - floor) < 4.5 * fit.floor_error
    assert fit.k_error < 0.35 * k
    assert fit.used.sum() > 3990


def test_standard_errors_are_the_spread_of_the_fits() -> None:
    fits = [fit_slope(*sloped(np.random.default_rng(seed), 800, 0.03, 0.02)) for seed in range(120)]
    for name in ("k", "floor"):
        spread = np.std([getattr(fit, name) for fit in fits], ddof=1)
        stated = np.median([getattr(fit, f"{name}_error") for fit in fits])
        # From 120 draws it is known to one in sqrt(240): four of these, and a twentieth for curvature.
        assert abs(spread / stated - 1) < 4 / np.sqrt(240) + 0.05


@pytest.mark.parametrize("seed", SEEDS)
def test_it_is_the_likeliest(seed: int) -> None:
    z, errors = sloped(np.random.default_rng(seed), 300, 0.02, 0.03)
    fit = fit_slope(z, errors)

    def cost(k: float, floor: float) -> float:
        v = (k * z[fit.used]) ** 2 + floor**2
        return float((np.log(v) + errors[fit.used] ** 2 / v).sum())

    best = cost(fit.k, fit.floor)
    for turn in np.linspace(0, 2 * np.pi, 12):
        for far in (0.003, 0.1):
            assert cost(fit.k * (1 + far * np.cos(turn)), fit.floor * (1 + far * np.sin(turn))) > best - 1e-6


@pytest.mark.parametrize("seed", SEEDS)
def test_gross_outliers_are_set_aside(seed: int) -> None:
    rng = np.random.default_rng(seed)
    z, errors = sloped(rng, 2000, 0.02, 0.02)
    wrong = rng.choice(2000, 40, replace=False)
    errors[wrong] += rng.choice([-1, 1], 40) * rng.uniform(1.5, 3, 40)
    fit = fit_slope(z, errors)
    assert not fit.used[wrong].any()
    assert fit.used.sum() > 2000 - 40 - 5
    assert abs(fit.k - 0.02) < 4.5 * fit.k_error
    assert abs(fit.floor - 0.02) < 4.5 * fit.floor_error


def test_no_slope_and_no_floor_are_found_as_such() -> None:
    rng = np.random.default_rng(1)
    z = rng.uniform(0.3, 5, 3000)
    flat = fit_slope(z, rng.normal(size=3000) * 0.02)
    assert abs(flat.floor - 0.02) < 4.5 * flat.floor_error
    assert flat.k < 4.5 * flat.k_error
    steep = fit_slope(z, rng.normal(size=3000) * 0.02 * z)
    assert abs(steep.k - 0.02) < 4.5 * steep.k_error
    assert 0 < steep.floor < max(4.5 * steep.floor_error, 0.005)
    dead_ahead = fit_slope(np.zeros(100), rng.normal(size=100) * 0.01)
    assert dead_ahead.k == 0
    assert 0.007 < dead_ahead.floor < 0.013


@pytest.mark.parametrize("seed", SEEDS)
def test_a_scale_comes_back(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cov = random_covs(rng, 1500)
    errors = 1.7 * drawn(rng, cov)
    fit = fit_propagated(errors, cov)
    # With nothing in the floors, the scale has a closed form; a little of it may have gone into them.
    assert fit.scale == pytest.approx(np.sqrt(squares(errors, cov)[fit.used].mean() / 2), rel=0.02)
    assert abs(fit.scale - 1.7) < 4.5 * fit.scale_error
    errors[:30] *= 200
    outlying = fit_propagated(errors, cov)
    assert abs(outlying.scale - 1.7) < 4.5 * outlying.scale_error
    assert not outlying.used[:30].any()


@pytest.mark.parametrize("seed", SEEDS)
def test_a_scale_and_floors_come_back(seed: int) -> None:
    rng = np.random.default_rng(seed)
    floors = np.array([0.03, 0.004])
    cov = random_covs(rng, 3000)
    fit = fit_propagated(drawn(rng, 0.6**2 * cov + np.diag(floors**2)), cov)
    assert abs(fit.scale - 0.6) < 4.5 * fit.scale_error
    assert (np.abs(fit.floors - floors) < 4.5 * fit.floor_errors).all()
    assert fit.scale_error < 0.1
    assert (fit.floor_errors < 0.3 * floors).all()


@pytest.mark.parametrize("seed", SEEDS)
def test_scale_floors_and_sway_come_back(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cov, floors = random_covs(rng, 3000), np.array([0.02, 0.004])
    places = rng.uniform((0.5, -0.5), (4.0, 1.2), (3000, 2))
    errors = drawn(rng, 0.6**2 * cov + np.diag(floors**2) + rocking(0.05, *places.T))
    fit = fit_propagated(errors, cov, places)
    assert abs(fit.scale - 0.6) < 4.5 * fit.scale_error
    assert (np.abs(fit.floors - floors) < 4.5 * fit.floor_errors).all()
    assert abs(fit.sway - 0.05) < 4.5 * fit.sway_error
    assert fit.sway_error < 0.005
    assert fit_propagated(errors, cov).sway == 0


def test_without_rocking_there_is_no_sway() -> None:
    rng = np.random.default_rng(2)
    cov, places = random_covs(rng, 2000), rng.uniform((0.5, 0.0), (4.0, 1.0), (2000, 2))
    fit = fit_propagated(drawn(rng, cov), cov, places)
    assert fit.sway < 4.5 * fit.sway_error
    assert abs(fit.scale - 1) < 4.5 * fit.scale_error


def test_at_one_height_and_range_the_sum_of_sway_and_floors_comes_back() -> None:
    rng = np.random.default_rng(3)
    cov, places = random_covs(rng, 1000), np.full((1000, 2), (2.0, 0.5))
    errors = drawn(rng, cov + rocking(0.1, *places.T))
    fit = fit_propagated(errors, cov, places)
    stated = fit.scale**2 * cov + np.diag(fit.floors**2) + rocking(fit.sway, *places.T)
    assert abs(squares(errors, stated).mean() / 2 - 1) < 0.1


def test_errors_that_do_not_come_from_the_corners_are_all_floor() -> None:
    rng = np.random.default_rng(7)
    floors = np.array([0.006, 0.002])
    cov = 1e-4 * random_covs(rng, 800) * floors.min() ** 2
    fit = fit_propagated(floors * rng.normal(size=(800, 2)), cov)
    np.testing.assert_allclose(fit.floors, floors, rtol=4.5 / np.sqrt(1600))


def test_squares_average_to_two() -> None:
    rng = np.random.default_rng(3)
    cov = random_covs(rng, 4000)
    assert abs(squares(drawn(rng, cov), cov).mean() - 2) < 4.5 * 2 / np.sqrt(4000)
    np.testing.assert_allclose(squares(np.array([[2.0, 0.3]]), np.diag([4.0, 0.01])[None]), [1 + 9])


@pytest.mark.parametrize(
    "fit",
    [lambda e: fit_slope(e[:, 0], e[:, 1]), lambda e: fit_propagated(e, np.broadcast_to(np.eye(2), (len(e), 2, 2)))],
)
def test_what_says_nothing_is_refused(fit: Callable[[Array], object]) -> None:
    refused(f"found {FEWEST - 1} sightings with a known error, expected at least", fit, np.ones((FEWEST - 1, 2)))
    refused("found only sightings without error", fit, np.zeros((50, 2)))
