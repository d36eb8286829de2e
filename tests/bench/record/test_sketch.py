"""Sketches of logs: how far two logs are apart, from a few numbers of each."""

import json
from dataclasses import replace

import numpy as np
import pytest

from random_logs import random_log
from slamduel.bench.record.sketch import ROUNDING, SUMS, distance, from_words, sketch
from slamduel.core.factors import Log, Map, Prior


def log(seed: int = 1) -> Log:
    return random_log(np.random.default_rng(seed), 60, 8).log


def off_by(one: Log, size: float, rng: np.random.Generator) -> Log:
    """`one` with every sighting off by so many standard deviations."""
    sd = np.sqrt(np.diagonal(one.z_cov, axis1=1, axis2=2))
    return replace(one, z=one.z + size * sd * rng.choice([-1.0, 1.0], one.z.shape))


def test_the_same_log_is_no_distance_away() -> None:
    assert distance(sketch(log()), sketch(log())) == 0
    again = from_words(json.loads(json.dumps(sketch(log()).words())))
    assert again is not None
    assert distance(sketch(log()), again) == 0


@pytest.mark.parametrize("size", [1e-12, 1e-6, 1e-3, 1.0])
def test_a_distance_is_that_of_the_numbers_in_standard_deviations(size: float) -> None:
    """The mean square of SUMS sums is a chi-square's, over SUMS: between 0.2 and 2.5 but for one time in 1,000."""
    one, rng = log(), np.random.default_rng(5)
    right = size * np.sqrt(one.z.size)
    found = [distance(sketch(one), sketch(off_by(one, size, rng))) for _ in range(20)]
    assert np.sqrt(0.2) * right <= min(found)
    assert max(found) <= np.sqrt(2.5) * right
    assert np.sqrt(np.mean(np.square(found))) == pytest.approx(right, rel=5 * np.sqrt(2 / (20 * SUMS)) / 2)


def test_one_number_that_is_off_is_noticed_in_a_long_log() -> None:
    one = random_log(np.random.default_rng(2), 800, 20).log
    z = one.z.copy()
    z[234, 0] += np.sqrt(one.z_cov[234, 0, 0])
    assert distance(sketch(one), sketch(replace(one, z=z))) == pytest.approx(1.0, rel=1e-6)


def test_another_noise_is_noticed_by_its_share() -> None:
    one = log()
    other = replace(one, z=one.z, z_cov=one.z_cov * 1.02**2)
    assert distance(sketch(one), sketch(other)) > ROUNDING


def test_other_times_ids_or_landmarks_are_no_rounding() -> None:
    one = log()
    given = Map(np.arange(3), np.ones((3, 2)), None)
    with_map = replace(one, prior=Prior(one.prior.pose, one.prior.cov, given))
    moved = replace(one, prior=Prior(one.prior.pose, one.prior.cov, given._replace(xy=given.xy + 1e-9)))
    others = [replace(one, t=one.t + 1e-9), replace(one, ids=one.ids[::-1].copy()), one.head(59), with_map]
    assert all(np.isinf(distance(sketch(one), sketch(other))) for other in others)
    assert np.isinf(distance(sketch(with_map), sketch(moved)))


def test_a_map_with_a_covariance_counts_in_its_standard_deviations() -> None:
    one = log()
    given = [Map(np.arange(3), np.ones((3, 2)) + off, 4.0 * np.eye(6)) for off in (0.0, 2e-3)]
    first, second = (sketch(replace(one, prior=Prior(one.prior.pose, one.prior.cov, known))) for known in given)
    assert 0 < distance(first, second) <= 1e-3 * 6


def test_a_landmark_that_is_known_exactly_is_left_out() -> None:
    one = log()
    given = Map(np.arange(2), np.ones((2, 2)), np.diag([1.0, 1.0, 0.0, 0.0]))
    found = sketch(replace(one, prior=Prior(one.prior.pose, one.prior.cov, given)))
    assert np.isfinite(found.sums).all()
    assert distance(found, found) == 0


@pytest.mark.parametrize(
    "words", [None, 3, {}, {"frame": "f"}, {"frame": "f", "sums": [1.0]}, {"frame": "f", "sums": "x"}]
)
def test_what_is_no_sketch_is_none(words: object) -> None:
    assert from_words(words) is None
