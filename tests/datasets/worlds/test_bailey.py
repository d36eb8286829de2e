"""Bailey's car: the published figures, noise that is what it states, and a filter as sure as it should be."""

import numpy as np
import pytest
from scipy.stats import chi2, kstest

from drawn_errors import errors, known, run
from slamduel.core.factors import Dataset
from slamduel.core.factors.check import problems
from slamduel.core.se2 import between
from slamduel.datasets.cache import generator
from slamduel.datasets.worlds.bailey import WAYPOINTS, WHEEL_BASE, Options, bailey, landmarks

SEEDS = 5
MIDDLE = 200
"""A step of the first loop."""


@pytest.fixture(scope="module")
def made() -> Dataset:
    return bailey(Options(), generator("bailey", 0))


def test_the_car_drives_as_published(made: Dataset) -> None:
    assert not list(problems(made.log))
    truth, _ = known(made)
    np.testing.assert_allclose(np.diff(made.log.t), 0.2)
    delta = between(truth.poses[:-1], truth.poses[1:])
    way, turn = np.hypot(*delta[:, :2].T), delta[:, 2]
    assert (way <= 3.0 * 0.2 + 1e-9).all()
    assert way.min() > 0.99 * 3.0 * 0.2
    assert np.abs(turn).max() <= 3.0 * 0.2 * np.sin(np.deg2rad(30)) / WHEEL_BASE + 1e-9
    steering = np.arcsin(turn * WHEEL_BASE / 0.6)  # on the average of a step
    assert np.abs(np.diff(steering)).max() <= np.deg2rad(20) * 0.2 * 1.01
    assert (truth.poses[0] == 0).all()


def test_it_passes_every_waypoint_in_each_of_two_loops(made: Dataset) -> None:
    truth, _ = known(made)
    half = len(truth.poses) // 2
    for loop in (truth.poses[: half + 10], truth.poses[half - 10 :]):
        for waypoint in WAYPOINTS:
            assert np.hypot(*(loop[:, :2] - waypoint).T).min() < 1.3  # 1 m, and half of a step
    one = bailey(Options(loops=1), generator("bailey", 0)).log
    assert abs(2 * len(one) - len(made.log)) < 10


def test_what_is_sighted_is_all_that_is_ahead_and_in_reach(made: Dataset) -> None:
    truth, known_map = known(made)
    d = known_map.xy[None] - truth.poses[:, None, :2]
    ahead = np.einsum("nmi,ni->nm", d, np.stack((np.cos(truth.poses[:, 2]), np.sin(truth.poses[:, 2])), axis=-1)) > 0
    step, landmark = np.nonzero(ahead & (np.hypot(d[..., 0], d[..., 1]) <= 30))
    np.testing.assert_array_equal(made.log.sighting_step, step)
    np.testing.assert_array_equal(made.log.ids, landmark)
    assert len(np.unique(landmark)) == 35


def test_every_error_is_drawn_from_the_stated_covariance(made: Dataset) -> None:
    """The controls' errors are pushed to the first order through eight motions, which is close enough here."""
    found = errors(made)
    assert kstest(found.sightings_squared, chi2(2).cdf).pvalue > 1e-4
    assert kstest(found.motions_squared, chi2(3).cdf).pvalue > 1e-4
    np.testing.assert_allclose(made.log.z_cov, np.tile(np.diag([0.1**2, np.deg2rad(1) ** 2]), (len(made.log.z), 1, 1)))
    straight = made.log.delta_cov[10]  # eight controls: 0.3 m/s of speed, 3 degrees of steering
    np.testing.assert_allclose(np.sqrt(straight[0, 0]), 0.025 * 0.3 * np.sqrt(8), rtol=0.02)
    np.testing.assert_allclose(np.sqrt(straight[2, 2]), 0.025 * 3 * np.deg2rad(3) / 4 * np.sqrt(8), rtol=0.1)


def test_more_landmarks_contain_the_fewer_and_stand_along_the_loop() -> None:
    np.testing.assert_array_equal(landmarks(100)[:35], landmarks(35))
    ends = np.concatenate((WAYPOINTS[-1:], WAYPOINTS))
    xy = landmarks(300)
    legs, starts = np.diff(ends, axis=0), ends[:-1]
    share = np.clip(np.einsum("nli,li->nl", xy[:, None] - starts, legs) / (legs**2).sum(axis=1), 0, 1)
    off = np.linalg.norm(xy[:, None] - starts - share[..., None] * legs, axis=-1).min(axis=1)
    assert off.max() <= 14 + 1e-9
    assert np.mean(off > 3.9) > 0.9  # in a bend, the next leg may be nearer


def nees_in_the_middle(options: Options) -> float:
    """Summed over seeds."""
    total = 0.0
    for seed in range(SEEDS):
        log, _ = made = bailey(options, generator("bailey", seed))
        truth, _ = known(made)
        begun = truth._replace(t=truth.t[: MIDDLE + 1], poses=truth.poses[: MIDDLE + 1])
        total += run("ekf", Dataset(log.head(MIDDLE + 1), begun))[1][-1]
    return total


def test_an_ekf_is_about_as_sure_as_it_may_be_where_the_noise_is_honest_and_too_sure_where_not() -> None:
    """NEES after 40 s, summed over seeds: chi-square of 3 degrees of freedom a seed."""
    low, high = chi2(3 * SEEDS).ppf([1e-4, 1 - 1e-4])
    assert low < nees_in_the_middle(Options(loops=1)) < high
    assert nees_in_the_middle(Options(loops=1, sensor_scale=3.0)) > high


def test_seeds_are_other_logs_of_the_same_drive(made: Dataset) -> None:
    again, other = (bailey(Options(), generator("bailey", seed)) for seed in (0, 1))
    assert again.log.digest == made.log.digest != other.log.digest
    np.testing.assert_array_equal(known(other)[0].poses, known(made)[0].poses)
    np.testing.assert_array_equal(other.log.ids, made.log.ids)
