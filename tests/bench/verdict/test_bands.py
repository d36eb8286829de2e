"""NEES averaged over independent logs, beside its band: a textbook Kalman filter on a linear problem is the measure."""

import numpy as np
import pytest
from scipy import stats

from slamduel.bench.verdict.bands import averaged, band
from slamduel.core.se2 import Array

RUNS = 20
STEPS = 150
REPLICATIONS = 150

# A cart whose place is measured: place, speed and a drag on it that comes and goes.
A = np.array([[1, 0.1, 0], [0, 1, 0.1], [0, 0, 0.95]])
H = np.array([[1.0, 0, 0]])
Q = np.diag([1e-4, 1e-3, 1e-1])
R = np.array([[0.04]])
START = np.diag([0.1, 0.1, 0.1])


def simulated(rng: np.random.Generator, stated: float = 1.0, sightings: bool = True) -> Array:
    """NEES (REPLICATIONS, RUNS, STEPS) of a Kalman filter that takes all variances for `stated` times what they are."""

    def normal(cov: Array) -> Array:
        return rng.standard_normal((REPLICATIONS, RUNS, len(cov))) @ np.linalg.cholesky(cov).T

    truth, mean, cov = normal(START), np.zeros((REPLICATIONS, RUNS, 3)), stated * START
    found = np.empty((STEPS, REPLICATIONS, RUNS))
    for k in range(STEPS):
        truth, mean, cov = truth @ A.T + normal(Q), mean @ A.T, A @ cov @ A.T + stated * Q
        if sightings:
            z = truth @ H.T + normal(R)
            gain = cov @ H.T @ np.linalg.inv(H @ cov @ H.T + stated * R)
            mean, cov = mean + (z - mean @ H.T) @ gain.T, (np.eye(3) - gain @ H) @ cov
        error = truth - mean
        found[k] = np.einsum("rni,ij,rnj->rn", error, np.linalg.inv(cov), error)
    return np.moveaxis(found, 0, 2)


def studied(nees: Array) -> Array:
    """The share of times inside of every replication."""
    t = np.arange(nees.shape[2], dtype=float)
    found = [averaged([(t, run) for run in runs]) for runs in nees]
    assert all(f is not None for f in found)
    return np.array([f.inside for f in found if f])


def test_a_filter_with_true_noise_is_inside_its_band_95_percent_of_the_time() -> None:
    inside = studied(simulated(np.random.default_rng(1)))
    assert 0.94 < inside.mean() < 0.96


def test_a_filter_with_misstated_noise_is_outside_most_of_the_time() -> None:
    for stated in (1 / 4, 1 / 2, 2, 4):
        assert studied(simulated(np.random.default_rng(2), stated)).mean() < 0.25


def test_the_band_is_chi_squares() -> None:
    low, high = band(np.array([2, 10, 50]))
    for n, ends in zip((2, 10, 50), zip(low, high, strict=True), strict=True):
        assert ends == pytest.approx([stats.chi2.ppf(q, 3 * n) / (3 * n) for q in (0.025, 0.975)], rel=1e-9)


def test_averages_are_over_degrees_of_freedom_at_each_time() -> None:
    t = np.array([0.0, 1, 2])
    found = averaged([(t, np.array([3.0, 0, 9])), (t, np.array([3.0, 0, np.inf]))])
    np.testing.assert_array_equal(found.t, t)
    np.testing.assert_array_equal(found.mean, [1, 0, np.inf])
    np.testing.assert_array_equal(found.n, [2, 2, 2])
    assert found.inside == pytest.approx(1 / 3)


def test_runs_of_other_lengths_and_rates_are_read_at_the_nearest_earlier_step() -> None:
    slow = np.array([0.5, 1.5, 2.5, 9.5]), np.array([3.0, 3, 3, 3])
    fast = np.arange(0, 3.01, 0.2), np.arange(16.0)
    found = averaged([slow, fast])
    np.testing.assert_array_equal(found.t, [0.5, 1.5, 2.5])
    np.testing.assert_allclose(found.mean, [(3 + 2) / 6, (3 + 7) / 6, (3 + 12) / 6])


def test_a_missing_covariance_counts_at_its_times_only() -> None:
    t = np.arange(4.0)
    missing = np.array([np.nan, np.nan, 6, np.nan])
    found = averaged([(t, np.full(4, 3.0)), (t, missing), (t, np.array([np.nan, 3, 3, 3]))])
    np.testing.assert_array_equal(found.n, [1, 2, 3, 2])
    np.testing.assert_array_equal(found.mean, [np.nan, 1, 4 / 3, 1])
    np.testing.assert_array_equal(np.isnan(found.low), [True, False, False, False])
    assert found.low[2] > found.low[1]
    assert found.inside == 1


def test_fewer_than_two_runs_have_no_average() -> None:
    t, none = np.arange(3.0), np.full(3, np.nan)
    assert averaged([]) is None
    assert averaged([(t, t)]) is None
    assert averaged([(t, t), (t, none)]) is None
    assert averaged([(t, t), (t[:0], t[:0])]) is None
    assert averaged([(t, t), (t + 10, t)]) is None
