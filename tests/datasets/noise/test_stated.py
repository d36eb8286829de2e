"""A log that is stated with its noise: information that holds, and a filter that is as sure as it may be."""

from dataclasses import replace

import numpy as np
import pytest

from noisy_logs import Slow, noisy
from slamduel.bench.measure.nees import nees
from slamduel.bench.noise.measured import measured
from slamduel.bench.noise.recommended import backends
from slamduel.bench.plan.spec import backend_variants
from slamduel.core.factors import UNKNOWN, Dataset
from slamduel.datasets.noise.model import Model, SightingModel
from slamduel.datasets.noise.stated import factors, stated

PLAIN = SightingModel(1.0, 0.0, 3.0, 0.0, 0.0, 1.0, 0.0)
SLOW = Slow(scale=1.5, share=0.95, time=20.0)


def test_a_noise_that_is_as_stated_changes_nothing() -> None:
    log, _ = noisy("circle[steps=100]", 0)
    same = stated(log, Model(["x"], (1.0, 1.0, 1.0), PLAIN, PLAIN))
    assert same.z_cov == pytest.approx(log.z_cov, rel=1e-12)
    assert same.delta_cov[1:] == pytest.approx(log.delta_cov[1:], rel=1e-12)
    assert same.notes["noise"]["fitted_on"] == ["x"]
    left = stated(log, Model([], None, None, None))
    assert (left.z_cov == log.z_cov).all()
    assert (left.delta_cov[1:] == log.delta_cov[1:]).all()


def test_sightings_have_together_the_information_of_their_covariance() -> None:
    """Summed over all landmarks, of a noise that does not depend on the distance; each has the same."""
    log, _ = noisy("circle[steps=200]", 1)
    model = PLAIN._replace(scale=1.3, share=0.8, time=7.0)
    sd = np.sqrt(log.z_cov[:, 0, 0]).mean()
    even = replace(log, z_cov=np.full_like(log.z_cov, sd**2 * np.eye(2)))
    new = stated(even, Model([], None, model, None))
    t, whole = log.t[log.sighting_step], 0.0
    for landmark in np.unique(log.ids):
        rows = np.flatnonzero(log.ids == landmark)
        lag = np.abs(t[rows][:, None] - t[rows])
        whole += np.linalg.inv(1.3**2 * sd**2 * (0.8 * np.exp(-lag / 7.0) + 0.2 * np.eye(len(rows)))).sum()
    assert (1 / new.z_cov[:, 0, 0]).sum() == pytest.approx(whole, rel=1e-9)
    assert np.ptp(new.z_cov[:, 0, 0]) < 1e-12
    assert (new.z_cov[:, 1, 1] == even.z_cov[:, 1, 1]).all()


def test_a_bias_of_a_landmark_makes_single_sightings_less_sure_and_takes_no_more() -> None:
    log, _ = noisy("circle[steps=200]", 1)
    model = PLAIN._replace(share=0.8, time=7.0)
    plain, biased = (factors(log, one, 0) for one in (model, model._replace(bias=0.02)))
    own = factors(log, model._replace(bias=0.02), 0, own=True)
    assert biased / plain == pytest.approx(own)


def test_landmarks_sighted_at_one_step_share_what_they_tell() -> None:
    log, _ = noisy("circle[steps=100]", 2)
    beside = np.bincount(log.sighting_step)[log.sighting_step]
    assert factors(log, PLAIN._replace(together=0.5), 0) == pytest.approx(1 + (beside - 1) * 0.5)


def test_bearings_keep_what_they_tell_of_the_angles_between_landmarks() -> None:
    log, _ = noisy("circle[steps=100]", 2)
    assert factors(log, PLAIN._replace(together=0.5), 1) == pytest.approx(1.0)


def test_own_covariances_are_those_of_single_errors_and_the_backend_knows_the_rest() -> None:
    log, _ = noisy("circle[steps=200]", 1)
    slow = PLAIN._replace(scale=1.3, power=0.5, share=0.8, time=7.0, bias=0.02, together=0.4)
    model = Model([], None, slow, PLAIN)
    new = stated(log, model, own=True)
    sd = 1.3 * np.sqrt(log.z_cov[:, 0, 0]) * (log.z[:, 0] / 3.0) ** 0.5
    assert new.z_cov[:, 0, 0] == pytest.approx(sd**2 + 0.02**2)
    assert (stated(log, model).z_cov[:, 0, 0] > new.z_cov[:, 0, 0] * (1 - 1e-12)).all()
    assert backends(model, own=True) == ("bias-ekf[range_share=0.8,range_time=7,gate=0.999]",)
    (named,) = backends(Model([], None, slow._replace(share=0.9991), None), own=True)
    assert "range_share=0.9," in named


def test_sightings_without_data_association_are_stated_as_the_others() -> None:
    log, _ = noisy("circle[steps=100]", 3)
    model = PLAIN._replace(share=0.9, time=5.0)
    ids = log.ids.copy()
    ids[::7] = UNKNOWN
    found = factors(replace(log, ids=ids), model, 0)
    assert np.ptp(found) < 1e-9
    assert 1 < found[0] < factors(log, model, 0)[0]
    assert factors(replace(log, ids=np.full_like(ids, UNKNOWN)), model, 0) == pytest.approx(1.0)


def consistency(dataset: Dataset, text: str = "ekf") -> float:
    """A filter's median NEES over that of chi-square with three degrees of freedom."""
    log, truth = dataset
    (variant,) = backend_variants(text)
    ekf = variant.builder.make(log.prior, variant.options, np.random.default_rng(0))
    path, cov = np.zeros((len(log), 3)), np.zeros((len(log), 3, 3))
    for k, step in enumerate(log):
        ekf.step(step)
        belief = ekf.belief()
        path[k], cov[k] = belief.pose, belief.cov
    return float(np.median(nees(path, cov, truth.poses))) / 2.366


def test_a_filter_that_was_too_sure_is_consistent_with_the_noise_of_other_logs() -> None:
    """Correlated errors, as on real logs: sightings of 12 steps in a row tell little more than one."""
    world = "circle[steps=400]"
    noise = measured([noisy(world, seed, SLOW, Slow(share=0.9, time=20.0)) for seed in range(3)], ["a", "b", "c"])
    logs = [noisy(world, seed, SLOW, Slow(share=0.9, time=20.0)) for seed in range(10, 15)]
    before = np.median([consistency(one) for one in logs])
    after = np.median([consistency(one._replace(log=stated(one.log, noise.model))) for one in logs])
    assert before > 3
    assert 0.3 < after < 2
    (carrying,) = backends(noise.model, own=True)
    carried = [consistency(one._replace(log=stated(one.log, noise.model, own=True)), carrying) for one in logs]
    assert 0.3 < np.median(carried) < 2
