"""Sightings whose errors stay: how they are drawn, and how they are stated."""

import numpy as np
import pytest

import slamduel
from slamduel.core.se2 import Array
from slamduel.core.truth.errors import sighting_errors

SHARE, TIME = 0.8, 5.0
WORLD = f"circle[steps=4000,correlated={SHARE},correlation_time={TIME}"


def scaled(name: str, seed: int = 0) -> tuple[slamduel.Log, Array]:
    """The log, and the errors (s, 2) of its sightings over their stated standard deviations."""
    log, truth = slamduel.load(name, seed)
    assert truth is not None
    found = sighting_errors(log, truth)
    assert len(found.row) == len(log.ids)
    return log, found.values / np.sqrt(log.z_cov[:, [0, 1], [0, 1]])


def test_errors_have_the_stated_variance_and_stay_for_the_time() -> None:
    """Autocorrelations of 1 s to 10 s, each by some 6,000 pairs of which every tenth is news: five sd of 600."""
    log, x = scaled(WORLD + "]")
    at = {(landmark, step): i for i, (landmark, step) in enumerate(zip(log.ids, log.sighting_step, strict=True))}
    for axis in range(2):
        assert np.mean(x[:, axis] ** 2) == pytest.approx(1.0, abs=0.2)
        for lag in (1, 3, 10):
            pairs = [(i, at[key, step + lag]) for (key, step), i in at.items() if (key, step + lag) in at]
            a, b = x[np.array(pairs)].transpose(1, 2, 0)[:, axis]
            assert np.mean(a * b) == pytest.approx(SHARE * np.exp(-lag / TIME), abs=0.2)
    assert abs(np.mean(x[:, 0] * x[:, 1])) < 0.2


def test_all_else_is_the_log_without() -> None:
    plain, slow = slamduel.load("circle[steps=300]").log, slamduel.load("circle[steps=300,correlated=0.5]").log
    assert (plain.delta[1:] == slow.delta[1:]).all()
    assert (plain.ids == slow.ids).all()
    assert (plain.z_cov == slow.z_cov).all()
    assert (plain.z != slow.z).all()


def test_the_part_that_does_not_stay_is_that_of_the_log_without() -> None:
    """A share of 0.5 of the variance: half of the difference of two logs is drawn anew, half is the old error less."""
    (_, x), (_, y) = scaled("circle[steps=4000]"), scaled("circle[steps=4000,correlated=0.5,correlation_time=0.01]")
    assert np.mean(x * y) == pytest.approx(np.sqrt(0.5), abs=0.05)


def test_thinned_sightings_have_together_the_information_of_their_covariance() -> None:
    own, _ = slamduel.load(WORLD + "]")
    thinned, _ = slamduel.load(WORLD + ",stated=thinned]")
    assert (own.z == thinned.z).all()
    for landmark in np.unique(own.ids)[:5]:
        row = np.flatnonzero(own.ids == landmark)[:60]
        t = own.t[own.sighting_step[row]]
        for axis in range(2):
            sd = np.sqrt(own.z_cov[row, axis, axis])
            lag = np.abs(t[:, None] - t)
            cov = np.outer(sd, sd) * (SHARE * np.exp(-lag / TIME) + (1 - SHARE) * np.eye(len(row)))
            whole = np.linalg.inv(cov).sum()
            assert (1 / thinned.z_cov[row, axis, axis]).sum() == pytest.approx(whole, rel=1e-2)


def test_even_sightings_have_together_as_much_and_each_the_same_share() -> None:
    own, _ = slamduel.load(WORLD + "]")
    even, _ = slamduel.load(WORLD + ",stated=even]")
    assert (own.z == even.z).all()
    whole = 0.0
    for landmark in np.unique(own.ids):
        t = own.t[own.sighting_step[own.ids == landmark]]
        lag = np.abs(t[:, None] - t)
        whole += np.linalg.inv(SHARE * np.exp(-lag / TIME) + (1 - SHARE) * np.eye(len(t))).sum()
    for axis in range(2):
        share = own.z_cov[:, axis, axis] / even.z_cov[:, axis, axis]
        assert share == pytest.approx(whole / len(own.ids), rel=1e-6)


def test_options_of_the_correlation_are_refused_without_it() -> None:
    with pytest.raises(slamduel.InputError, match="correlated"):
        slamduel.load("circle[stated=thinned]")
