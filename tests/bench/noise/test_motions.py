"""Factors on the odometry's stated noise against closed forms."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from noisy_logs import noisy
from slamduel.bench.noise.motions import fitted_motions
from slamduel.core.factors import Dataset, Log, Prior, Truth
from slamduel.core.se2 import Array, wrap
from slamduel.datasets.noise.stated import scaled
from slamduel.datasets.recordings.robot import USUAL
from slamduel.datasets.worlds.wheeled_robot import count
from slamduel.frontend.wheels.encoder import Encoder, Floors
from slamduel.frontend.wheels.ticks import Wheels


def straight(errors: Array, stated: Array) -> Dataset:
    """A robot that stands still and whose odometry is `errors` (n, 3), a step per second."""
    n = len(errors) + 1
    delta, cov = np.zeros((n, 3)), np.tile(np.diag(stated**2), (n, 1, 1))
    delta[1:] = errors
    none = np.zeros(0, np.int64)
    t = np.arange(n, dtype=float)
    log = Log.from_arrays(
        "still", Prior(np.zeros(3), np.eye(3)), t, delta, cov, none, none, np.zeros((0, 2)), np.zeros((0, 2, 2))
    )
    return Dataset(log, Truth(t, np.zeros((n, 3))))


def test_single_steps_with_a_diagonal_covariance_have_the_root_mean_square() -> None:
    stated = np.array([0.01, 0.02, 0.005])
    errors = np.random.default_rng(0).standard_normal((500, 3)) * stated * [1.5, 0.5, 2.0]
    found = fitted_motions([straight(errors, stated)], 1.0)
    right = np.sqrt(np.mean((errors / stated) ** 2, axis=0))
    assert [one.value for one in found.scales] == pytest.approx(right, rel=1e-4)
    half = 1.96 / np.sqrt(2 * 500)
    for one in found.scales:
        assert np.log(one.high / one.value) == pytest.approx(half, rel=0.01)


def test_an_encoders_default_noise_is_measured() -> None:
    """Wheels that roll with half of it, stated with the default: half is asked for."""
    t = np.arange(4001) / 20
    poses = np.column_stack((np.sin(0.1 * t) * 5, 5 - np.cos(0.1 * t) * 5, wrap(0.1 * t)))
    true = Encoder(1e-6, 1e-6, 0.3, USUAL / 2, "distance", curve="arc", floors=Floors(1e-6, 1e-6))
    wheels = Wheels(count(poses, 0.5 * t, t, true, np.random.default_rng(5)), replace(true, k=USUAL))
    steps = [wheels.odometry(start, end) for start, end in pairwise(t[::10].tolist())]
    delta = np.vstack((np.zeros(3), [one.delta for one in steps]))
    cov = np.concatenate((np.zeros((1, 3, 3)), [one.cov for one in steps]))
    none = np.zeros(0, np.int64)
    log = Log.from_arrays(
        "wheels", Prior(poses[0], np.eye(3)), t[::10], delta, cov, none, none, np.zeros((0, 2)), np.zeros((0, 2, 2))
    )
    found = fitted_motions([Dataset(log, Truth(t[::10], poses[::10]))], 1.0)
    assert found is not None
    forward, _, turn = found.scales
    assert (forward.value, turn.value) == pytest.approx((0.5, 0.5), abs=0.05)


def test_independent_errors_ask_for_the_same_at_every_horizon() -> None:
    found = fitted_motions([noisy("circle[steps=1500]", 3, odometry=(1.4, 0.7, 1.2))], 1.0)
    for horizon in found.horizons:
        for one, true in zip(horizon.scales, (1.4, 0.7, 1.2), strict=True):
            wide = np.log(one.high / one.low) / 2  # two standard errors
            assert wide > 1 or abs(np.log(one.value / true)) < 2 * wide


def test_a_slow_error_asks_for_more_over_longer_times_and_the_horizon_that_matters_is_stated() -> None:
    stated = np.full(3, 0.01)
    rng = np.random.default_rng(1)
    slow = np.repeat(rng.standard_normal((60, 3)), 20, axis=0) * 0.01  # the same for 20 s: sqrt(10) times over 10 s
    dataset = straight(slow, stated)
    found = fitted_motions([dataset], 10.0)
    turn = [one.scales[2].value for one in found.horizons]
    assert turn == sorted(turn)
    assert turn[-1] > 2 * turn[0]
    assert found.scales[2] == found.horizons[[h.seconds for h in found.horizons].index(10.0)].scales[2]
    at_once = fitted_motions([dataset], 1.0)
    assert at_once.scales[2] == found.horizons[0].scales[2]


def test_too_few_motions_have_no_noise() -> None:
    assert fitted_motions([straight(np.ones((10, 3)), np.ones(3))], 1.0) is None


def test_scaled_covariances_keep_their_correlations() -> None:
    cov = np.array([[[4.0, 1.0, 0.5], [1.0, 9.0, 0.2], [0.5, 0.2, 1.0]]])
    size = np.diag([2.0, 0.5, 3.0])
    assert scaled(cov, np.diag(size)) == pytest.approx(size @ cov @ size)
