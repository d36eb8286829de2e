"""Huang's circle: the published figures, and noise that is what it states."""

import numpy as np
import pytest
from scipy.stats import chi2, kstest

from drawn_errors import errors
from motions import chained
from refusals import refused
from slamduel.bench.plan.spec import read_options
from slamduel.core.factors import Dataset
from slamduel.core.factors.check import check
from slamduel.core.se2 import wrap
from slamduel.datasets.cache import generator
from slamduel.datasets.worlds.circle import Options, circle


@pytest.fixture(scope="module")
def made() -> Dataset:
    return circle(Options(), generator("circle", 0))


def test_the_robot_drives_as_published(made: Dataset) -> None:
    log, truth = made
    check(log, "circle")
    assert len(log) == len(truth.t) == 2500
    assert (np.diff(log.t) == 1.0).all()
    np.testing.assert_allclose(np.hypot(truth.poses[:, 0], truth.poses[:, 1] - 10.0), 10.0, rtol=1e-12)
    np.testing.assert_allclose(wrap(np.diff(truth.poses[:, 2])), 0.025, rtol=1e-9)
    chord = 2 * 10.0 * np.sin(0.025 / 2)
    np.testing.assert_allclose(np.hypot(*np.diff(truth.poses[:, :2], axis=0).T), chord, rtol=1e-9)


def test_the_noise_is_as_published(made: Dataset) -> None:
    """Where the robot does not turn much, forward and heading noise can be read off the covariance."""
    s = 0.05 * 0.25
    cov = made.log.delta_cov[1]
    np.testing.assert_allclose(np.sqrt(cov[2, 2]), 2 * np.sqrt(2) * s, rtol=1e-4)
    np.testing.assert_allclose(np.sqrt(cov[0, 0]), s / np.sqrt(2), rtol=1e-2)
    assert (made.log.delta_cov[1:] == cov).all()
    ranges = (made.log.z - errors(made).sightings)[:, 0]
    np.testing.assert_allclose(made.log.z_cov[:, 0, 0], 0.01)
    np.testing.assert_allclose(made.log.z_cov[:, 1, 1], (0.1 / ranges) ** 2)
    assert (made.log.z_cov[:, 0, 1] == 0).all()


def test_what_is_sighted_is_all_that_is_in_reach(made: Dataset) -> None:
    d = np.linalg.norm(made.truth.map.xy[None] - made.truth.poses[:, None, :2], axis=-1)
    step, landmark = np.nonzero((d >= 2.0) & (d <= 5.0))
    np.testing.assert_array_equal(made.log.sighting_step, step)
    np.testing.assert_array_equal(made.log.ids, landmark)
    assert len(np.unique(made.log.ids)) == 20


def test_every_error_is_drawn_from_the_stated_covariance(made: Dataset) -> None:
    """Squared Mahalanobis distances are chi-square: a Kolmogorov-Smirnov test that a right log fails once in 10,000."""
    found = errors(made)
    assert kstest(found.sightings_squared, chi2(2).cdf).pvalue > 1e-4
    assert kstest(found.motions_squared, chi2(3).cdf).pvalue > 1e-4
    n = len(found.sightings)
    scaled = found.sightings / np.sqrt(made.log.z_cov[:, [0, 1], [0, 1]])
    assert abs(np.mean(scaled[:, 0] * scaled[:, 1])) < 4 / np.sqrt(n)
    assert (abs(scaled.mean(axis=0)) < 4 / np.sqrt(n)).all()


def test_the_odometry_covariance_is_that_of_an_arc(made: Dataset) -> None:
    """Against the motions that come out when the readings themselves are drawn."""
    rng, s = np.random.default_rng(1), 0.05 * 0.25
    v = 0.25 + s / np.sqrt(2) * rng.standard_normal(200_000)
    w = 0.025 + 2 * np.sqrt(2) * s * rng.standard_normal(200_000)
    drawn = np.stack((v / w * np.sin(w), v / w * (1 - np.cos(w)), w), axis=-1)
    found, stated = np.cov(drawn.T), made.log.delta_cov[1]
    scale = np.sqrt(np.outer(np.diag(stated), np.diag(stated)))
    np.testing.assert_allclose(found / scale, stated / scale, atol=0.01)  # 4 sd of an entry of the former


def test_seeds_are_other_logs_and_options_do_what_they_say(made: Dataset) -> None:
    again, other = (circle(Options(), generator("circle", seed)) for seed in (0, 1))
    assert again.log.digest == made.log.digest != other.log.digest
    quiet = circle(Options(steps=300, odometry=0.005, sighting=0.01), generator("circle", 0))
    assert len(quiet.log) == 300
    np.testing.assert_allclose(np.std(errors(quiet).motions[:, 2]), 2 * np.sqrt(2) * 0.005 * 0.25, rtol=0.2)
    assert abs(errors(quiet).sightings).max() < 0.06
    many = circle(Options(landmarks=200, steps=300, turn_rate=0.5), generator("circle", 0))
    away = abs(np.hypot(many.truth.map.xy[:, 0], many.truth.map.xy[:, 1] - 0.5) - 0.5)
    assert ((away >= 2) & (away <= 5)).all()  # a circle of half a metre has no inside for them


def test_without_noise_the_log_leads_to_the_truth() -> None:
    quiet = circle(Options(steps=500, odometry=1e-4, sighting=1e-4), generator("circle", 3))
    end = chained(quiet.log.delta[1:], quiet.log.prior.pose)[-1]
    assert np.hypot(*(end - quiet.truth.poses[-1])[:2]) < 0.1  # the prior is off by a milliradian


def test_nothing_in_reach_is_a_log_without_sightings() -> None:
    log = circle(Options(landmarks=1, nearest=2, farthest=2.001, steps=2), generator("circle", 0)).log
    check(log, "circle")
    assert len(log.ids) == 0


def test_bad_options_are_sentences() -> None:
    ring = Options(nearest=3.0, farthest=2.0)
    refused("option farthest=2: expected more than nearest=3 m", circle, ring, np.random.default_rng(0))
    refused("option steps=1 is out of range", read_options, Options, [("steps", "1")], "dataset circle")
