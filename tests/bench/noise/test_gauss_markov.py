"""The compiled filters against dense covariances, and fits of drawn errors."""

import numpy as np
import pytest

from slamduel.bench.noise._gauss_markov import innovations, sum_variance
from slamduel.bench.noise.gauss_markov import IN_A_ROW, Chains, closed, fitted
from slamduel.core.se2 import Array, Ints
from slamduel.datasets._information import FIRST, information, kept

SHARE, TIME, BIAS = 0.7, 3.0, 0.4


def times(rng: np.random.Generator) -> tuple[Array, Array, Ints]:
    """Gaps, times and chain numbers of three chains of uneven spacing."""
    sizes = [7, 1, 12]
    gap = np.concatenate([np.concatenate(([np.inf], rng.exponential(2.0, n - 1))) for n in sizes])
    chain = np.repeat(np.arange(3), sizes)
    t = np.concatenate([np.cumsum(np.concatenate(([0.0], gap[chain == k][1:]))) for k in range(3)])
    return gap, t, chain


def dense(scale: Array, t: Array, chain: Ints, share: float, time: float, bias: float) -> Array:
    """The covariance of all errors."""
    same = chain[:, None] == chain
    slow = share * np.exp(-np.abs(t[:, None] - t) / time)
    return same * (np.outer(scale, scale) * (slow + (1 - share) * np.eye(len(t))) + bias**2)


@pytest.mark.parametrize(("share", "bias"), [(0.0, 0.0), (SHARE, 0.0), (0.0, BIAS), (SHARE, BIAS), (1.0, BIAS)])
def test_innovations_have_the_likelihood_of_the_dense_covariance(share: float, bias: float) -> None:
    rng = np.random.default_rng(0)
    gap, t, chain = times(rng)
    scale = rng.uniform(0.5, 2.0, len(t))
    cov = dense(scale, t, chain, share, TIME, bias)
    error = rng.standard_normal(len(t))
    e, v = innovations(error, scale, gap, share, TIME, bias)
    assert np.sum(e * e / v) == pytest.approx(error @ np.linalg.solve(cov, error), rel=1e-9)
    assert np.sum(np.log(v)) == pytest.approx(np.linalg.slogdet(cov)[1], rel=1e-9, abs=1e-9)
    assert sum_variance(scale, gap, share, TIME, bias) == pytest.approx(cov.sum(), rel=1e-12)


@pytest.mark.parametrize("share", [0.0, SHARE])
def test_information_is_that_of_the_dense_covariance_after_every_error(share: float) -> None:
    rng = np.random.default_rng(1)
    gap, t, chain = times(rng)
    scale = rng.uniform(0.5, 2.0, len(t))
    cov = dense(scale, t, chain, share, TIME, 0.0)
    keep = np.where(np.isinf(gap), FIRST, np.exp(-gap / TIME))
    added = information(scale, keep, share)
    for k in range(3):
        rows = np.flatnonzero(chain == k)
        for n in range(1, len(rows) + 1):
            some = rows[:n]
            whole = np.linalg.inv(cov[np.ix_(some, some)]).sum()
            assert added[some].sum() == pytest.approx(whole, rel=1e-9)
    assert (added > 0).all()
    assert kept(keep, share) == pytest.approx(information(np.ones(len(t)), keep, share).mean(), rel=1e-12)


def test_an_error_that_stays_the_same_adds_nothing() -> None:
    assert information(np.ones(4), np.array([FIRST, 1.0, 1.0, FIRST]), 1.0).tolist() == [1.0, 0.0, 0.0, 1.0]


def drawn(
    rng: np.random.Generator, chains: int, each: int, share: float, time: float, bias: float, power: float
) -> Chains:
    """Errors of standard deviation 1 at 1 m, stated as 0.5, a sighting per second."""
    gap = np.tile(np.concatenate(([np.inf], np.ones(each - 1))), chains)
    slow = rng.standard_normal((chains, each))
    r = np.exp(-1 / time)
    for k in range(1, each):
        slow[:, k] = r * slow[:, k - 1] + np.sqrt(1 - r * r) * slow[:, k]
    mixed = np.sqrt(share) * slow + np.sqrt(1 - share) * rng.standard_normal((chains, each))
    reach = rng.uniform(1.0, 4.0, chains * each)
    error = reach**power * mixed.ravel() + np.repeat(bias * rng.standard_normal(chains), each)
    return Chains(error, np.full(chains * each, 0.5), reach, gap)


def test_white_errors_have_no_further_parts() -> None:
    found = fitted(drawn(np.random.default_rng(2), 20, 60, 0.0, 1.0, 0.0, 0.0))
    assert found.correlation is None
    assert found.bias is None
    assert found.tails is None
    assert found.used.all()
    assert found.scale.value == pytest.approx(2.0, rel=6 / np.sqrt(2 * 1200))
    assert found.in_a_row == pytest.approx(IN_A_ROW)


def test_correlation_growth_and_bias_are_found() -> None:
    found = fitted(drawn(np.random.default_rng(3), 40, 100, 0.8, 6.0, 1.0, 0.5))
    for one, true in (
        (found.correlation.time, 6.0),
        (found.correlation.share, 0.8),
        (found.bias, 1.0),
        (found.power, 0.5),
        (found.sd, found.reach**0.5),
    ):
        wide = (one.high - one.low) / 2  # two standard errors
        assert abs(one.value - true) < 2 * wide, (one, true)
    assert found.in_a_row < IN_A_ROW / 3


def test_the_information_of_sightings_in_a_row_is_that_of_their_covariance() -> None:
    found = fitted(drawn(np.random.default_rng(4), 40, 100, 1.0, 5.0, 0.0, 0.0))
    share, time = found.correlation.share.value, found.correlation.time.value
    lag = np.abs(np.subtract.outer(np.arange(IN_A_ROW), np.arange(IN_A_ROW)))
    cov = share * np.exp(-lag / time) + (1 - share) * np.eye(IN_A_ROW)
    assert found.in_a_row == pytest.approx(np.linalg.inv(cov).sum(), rel=1e-9)


def test_outliers_are_left_out_and_heavy_tails_are_named() -> None:
    rng = np.random.default_rng(5)
    chains = drawn(rng, 20, 60, 0.0, 1.0, 0.0, 0.0)
    error = chains.error.copy()
    error[::100] += 50.0
    found = fitted(chains._replace(error=error))
    assert found.outliers.value == pytest.approx(0.01)
    assert found.outliers.low < 0.01 < found.outliers.high
    assert found.scale.value == pytest.approx(2.0, rel=6 / np.sqrt(2 * 1200))
    heavy = fitted(chains._replace(error=rng.standard_t(4, len(error))))
    assert heavy.tails.value == pytest.approx(4.0, abs=2.0)


def test_too_few_errors_and_errors_of_zero_have_no_noise() -> None:
    chains = drawn(np.random.default_rng(6), 1, 29, 0.0, 1.0, 0.0, 0.0)
    assert fitted(chains) is None
    chains = drawn(np.random.default_rng(6), 2, 29, 0.0, 1.0, 0.0, 0.0)
    assert fitted(chains._replace(error=np.zeros(58))) is None


def test_gaps_over_errors_left_out_add_up() -> None:
    gap = np.array([np.inf, 1.0, 2.0, 3.0, np.inf, 5.0])
    used = np.array([True, False, False, True, False, True])
    assert closed(gap, used).tolist() == [np.inf, 6.0, np.inf]
