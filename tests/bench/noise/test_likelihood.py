"""Maxima and intervals with known answers."""

import numpy as np
import pytest

from slamduel.bench.noise.likelihood import DROP, TWO_SIDED, maximum
from slamduel.core.se2 import Array


def test_the_interval_of_a_standard_deviation_is_that_of_theory() -> None:
    x = np.random.default_rng(0).standard_normal(400)

    def log_likelihood(p: Array) -> float:
        return float(-0.5 * np.sum(x * x) * np.exp(-2 * p[0]) - len(x) * p[0])

    best = maximum(log_likelihood, np.array([1.0]), np.array([-5.0]), np.array([5.0]))
    one = best.estimate(0, lambda p: float(np.exp(p)))
    right = float(np.sqrt(np.mean(x * x)))
    half = TWO_SIDED / np.sqrt(2 * len(x))  # Fisher information of a logarithm: 2 per number
    assert one.value == pytest.approx(right, rel=1e-4)
    assert one.low == pytest.approx(right * np.exp(-half), rel=1e-3)
    assert one.high == pytest.approx(right * np.exp(half), rel=1e-3)


def test_correlated_parameters_have_marginal_intervals() -> None:
    information = np.array([[4.0, 1.9], [1.9, 1.0]])
    best = maximum(lambda p: -0.5 * float(p @ information @ p), np.ones(2), np.full(2, -50.0), np.full(2, 50.0))
    sd = np.sqrt(np.diag(np.linalg.inv(information)))
    assert best.high - best.at == pytest.approx(TWO_SIDED * sd, rel=1e-4)


def test_a_parameter_at_its_bound_has_the_profiles_interval() -> None:
    def log_likelihood(p: Array) -> float:  # the maximum is at (3, 1.5), beyond the bound of 2
        return -0.5 * float((p[0] - 3) ** 2 + 4 * (p[1] - p[0] / 2) ** 2)

    best = maximum(log_likelihood, np.zeros(2), np.full(2, -9.0), np.array([2.0, 9.0]))
    assert best.at == pytest.approx([2.0, 1.0], abs=1e-4)
    assert best.high[0] == pytest.approx(2.0)
    assert best.low[0] == pytest.approx(3 - np.sqrt(1 + 2 * DROP), abs=1e-3)  # (3 - p)^2 / 2 = 1 / 2 + DROP


def test_a_parameter_that_plays_no_part_has_the_widest_interval() -> None:
    best = maximum(lambda p: -float(p[0] ** 2), np.ones(2), np.full(2, -3.0), np.full(2, 3.0))
    assert best.low[1] == -3.0
    assert best.high[1] == 3.0
