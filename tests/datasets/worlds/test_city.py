"""The simulated city: streets, what stands along them, and a drive that sees most of it."""

import numpy as np
import pytest
from scipy.stats import chi2, kstest

from drawn_errors import errors, known
from slamduel.core.factors import Dataset
from slamduel.core.factors.check import check
from slamduel.core.se2 import between
from slamduel.datasets.cache import generator
from slamduel.datasets.worlds.city import BEND, BLOCK, KERB, LEAST_RANGE, Options, city, side


@pytest.fixture(scope="module")
def made() -> Dataset:
    return city(Options(), generator("city", 0))


def test_the_robot_keeps_to_the_streets(made: Dataset) -> None:
    check(made.log, "city")
    poses = known(made)[0].poses
    off = abs(poses[:, :2] - BLOCK * np.round(poses[:, :2] / BLOCK))
    on_street = off.min(axis=1) < 1e-9
    at_crossing = (off <= BEND + 1e-9).all(axis=1)
    assert (on_street | at_crossing).all()
    assert on_street.mean() > 0.8
    assert (poses[:, :2] > -1e-9).all()
    assert (poses[:, :2] < BLOCK * side(1000) + 1e-9).all()


def test_the_path_is_smooth_and_its_stride_even(made: Dataset) -> None:
    """On a street a step is 1 m; on a bend its chord is shorter. The heading is that of the path."""
    poses = known(made)[0].poses
    delta = between(poses[:-1], poses[1:])
    stride = np.hypot(*delta[:, :2].T)
    assert stride.max() < 1 + 1e-9
    assert stride.min() >= 2 * BEND * np.sin(1 / (2 * BEND)) - 1e-9
    assert (abs(delta[:, 2]) <= 1 / BEND + 1e-9).all()
    straight = delta[:, 2] == 0
    assert straight.any()
    np.testing.assert_allclose(delta[straight, 1], 0, atol=1e-9)
    arcs = np.isclose(abs(delta[:, 2]), 1 / BEND)  # a whole step on a bend: its chord is half the turn off the heading
    assert arcs.any()
    np.testing.assert_allclose(np.arctan2(delta[arcs, 1], delta[arcs, 0]), delta[arcs, 2] / 2, atol=1e-9)


def test_landmarks_stand_along_the_kerbs(made: Dataset) -> None:
    xy = known(made)[1].xy
    assert len(xy) == 1000
    off = abs(xy - BLOCK * np.round(xy / BLOCK))
    np.testing.assert_allclose(off.min(axis=1), KERB, atol=1e-9)
    assert (off.max(axis=1) >= KERB).all()


def test_what_is_sighted_is_all_that_is_in_reach(made: Dataset) -> None:
    truth, landmarks = known(made)
    d = np.linalg.norm(landmarks.xy[None] - truth.poses[:, None, :2], axis=-1)
    step, landmark = np.nonzero((d >= LEAST_RANGE) & (d <= Options().reach))
    np.testing.assert_array_equal(made.log.sighting_step, step)
    np.testing.assert_array_equal(made.log.ids, landmark)


def test_every_error_is_drawn_from_the_stated_covariance(made: Dataset) -> None:
    found = errors(made)
    assert kstest(found.sightings_squared, chi2(2).cdf).pvalue > 1e-4
    assert kstest(found.motions_squared, chi2(3).cdf).pvalue > 1e-4


@pytest.mark.parametrize(("landmarks", "steps", "share"), [(300, 1000, 0.98), (1000, 2000, 0.9), (10_000, 20_000, 0.9)])
def test_two_steps_a_landmark_see_most_of_a_city_of_any_size(landmarks: int, steps: int, share: float) -> None:
    """And the sightings a step do not depend on its size."""
    log = city(Options(landmarks=landmarks, steps=steps), generator("city", 1)).log
    assert len(np.unique(log.ids)) == log.notes["landmarks sighted"] > share * landmarks
    assert 4.5 < len(log.ids) / len(log) < 7.5
    assert np.diff(log.sighting_first).max() < 25


def test_a_place_is_met_again_after_a_long_way(made: Dataset) -> None:
    """Loops to close: half of the landmarks have a gap of 100 steps and more in their sightings."""
    step = made.log.sighting_step
    gaps = [np.diff(step[made.log.ids == i]).max(initial=0) for i in np.unique(made.log.ids)]
    assert np.mean(np.array(gaps) > 100) > 0.5


def test_seeds_are_other_cities(made: Dataset) -> None:
    again, other = (city(Options(), generator("city", seed)) for seed in (0, 1))
    assert again.log.digest == made.log.digest != other.log.digest


def test_the_smallest_city_is_one_block() -> None:
    made = city(Options(landmarks=40, steps=2), generator("city", 0))
    check(made.log, "city")
    assert made.log.notes["blocks along a side"] == 1
    check(city(Options(landmarks=40, steps=500), generator("city", 0)).log, "city")


def test_faults_apply_to_a_city(made: Dataset) -> None:
    """They alone: the city, the drive and what is left of the sightings stay."""
    poor = city(Options(missing=0.5, clutter=0.5), generator("city", 0))
    check(poor.log, "city")
    np.testing.assert_array_equal(known(poor)[0].poses, known(made)[0].poses)
    kept = poor.log.z[poor.log.ids >= 0]
    assert np.isin(kept[:, 0], made.log.z[:, 0]).all()
    assert len(kept) / len(made.log.z) == pytest.approx(0.5, abs=6 * 0.5 / np.sqrt(len(made.log.z)))
    assert np.sum(poor.log.ids < 0) == poor.log.notes["faults"]["false sightings"] > 0


def test_a_drive_may_be_as_long_as_the_streets() -> None:
    one, two = (city(Options(landmarks=170, passes=passes), np.random.default_rng(0)).log for passes in (1.0, 2.0))
    streets = 2 * side(170) * (side(170) + 1) * BLOCK
    assert len(one) - 2 == streets
    assert len(two) - 2 == 2 * streets
