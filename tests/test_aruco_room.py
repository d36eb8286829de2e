"""The rendered drive as a dataset: what it promises of the log, the truth and the noise."""

from itertools import pairwise

import numpy as np
import pytest

from slamduel.datasets import registry
from slamduel.datasets.aruco_room import ENCODER, LOOP, TICK, Options, aruco_room, record
from slamduel.datasets.simulate import count, drive
from slamduel.frontend.check import check
from slamduel.frontend.factors import Dataset
from slamduel.frontend.motion import readings
from slamduel.frontend.noise import ProportionalNoise
from slamduel.frontend.se2 import Array, between, compose, wrap
from textbook import TextbookEkf

SHORT = Options(seconds=4.0)


@pytest.fixture(scope="module")
def short() -> Dataset:
    return aruco_room(SHORT, np.random.default_rng(1))


@pytest.fixture(scope="module")
def lap() -> Dataset:
    """More than a lap, at a low frame rate."""
    return aruco_room(Options(seconds=45.0, frame_rate=2.0), np.random.default_rng(2))


def true_measurements(made: Dataset) -> Array:
    """(s, 2) range and bearing of every sighting, had it been perfect."""
    assert made.truth is not None
    assert made.truth.map is not None
    poses = made.truth.poses[made.log.sighting_step]
    rows = np.searchsorted(made.truth.map.ids, made.log.ids)
    d = made.truth.map.xy[rows] - poses[:, :2]
    return np.stack((np.hypot(*d.T), wrap(np.arctan2(d[:, 1], d[:, 0]) - poses[:, 2])), axis=-1)


def dead_reckoning(made: Dataset) -> Array:
    poses = [made.log.prior.pose]
    for delta in made.log.delta[1:]:
        poses.append(compose(poses[-1], delta))
    return np.array(poses)


def test_it_is_registered() -> None:
    source = registry.find("aruco-room")
    assert source.make is aruco_room
    assert source.options is Options
    assert source.seeded
    assert source.costly
    assert source.summary


def test_a_step_is_a_frame(short: Dataset) -> None:
    log, truth = short
    assert truth is not None
    assert log.name == "aruco-room"
    check(log, "aruco-room")
    np.testing.assert_allclose(log.t, np.arange(21) / 5, atol=1e-12)
    np.testing.assert_array_equal(truth.t, log.t)
    np.testing.assert_array_equal(truth.poses[0], log.prior.pose)
    np.linalg.cholesky(log.prior.cov)
    assert truth.kind == "truth"
    assert truth.map is not None
    assert truth.map.ids.tolist() == list(range(24))
    assert log[0].odometry is None
    assert log.sighting_first[1] > 0  # the robot sees markers before it moves
    assert len(log.ids) > 21
    assert log.notes["counts"]["frames"] == 21
    assert log.notes["counts"]["sightings"] == len(log.ids)
    assert log.notes["source"]


def test_measurements_are_what_they_claim(lap: Dataset) -> None:
    truth = true_measurements(lap)
    error = lap.log.z - truth
    error[:, 1] = wrap(error[:, 1])
    sd = np.sqrt(np.diagonal(lap.log.z_cov, axis1=1, axis2=2))
    assert (lap.log.z[:, 0] <= 3.0).all()
    assert np.abs(error[:, 1] / sd[:, 1]).max() < 1  # bearings are far better than eq. (10) has them
    assert 0.3 < np.sqrt(np.mean((error[:, 0] / sd[:, 0]) ** 2)) < 1.2
    near = truth[:, 0] < 2
    assert np.abs(error[near, 0]).max() < 0.1


def test_dead_reckoning_drifts_and_a_filter_does_not(lap: Dataset) -> None:
    assert lap.truth is not None
    ekf = TextbookEkf(lap.log.prior)
    poses, nees = [], []
    for step, true in zip(lap.log, lap.truth.poses, strict=True):
        pose = ekf.step(step)
        error = pose - true
        error[2] = wrap(error[2])
        poses.append(pose)
        nees.append(error @ np.linalg.solve(ekf.cov[:3, :3], error) / 3)
    adrift = np.linalg.norm((dead_reckoning(lap) - lap.truth.poses)[:, :2], axis=1)
    kept = np.linalg.norm((np.array(poses) - lap.truth.poses)[:, :2], axis=1)
    assert adrift.max() > 0.1
    assert np.sqrt((kept**2).mean()) < np.sqrt((adrift**2).mean()) / 2
    assert 0.05 < np.mean(nees) < 3
    _, seen = np.unique(lap.log.ids, return_counts=True)
    assert (seen > 1).sum() > 12


def test_wheel_noise_is_what_the_factors_state() -> None:
    """Heading and way of 2,000 keyframes, without a picture, against the stated covariance."""
    n = 2000
    frames = 0.2 * np.arange(n + 1.0)
    t = TICK * np.arange(10 * n + 1.0)
    ticks = count(*drive(LOOP, 0.4, t), t, ENCODER, np.random.default_rng(3))
    factors = [ENCODER.odometry(*readings(ticks, a, b)) for a, b in pairwise(frames)]
    poses, _ = drive(LOOP, 0.4, frames)
    error = np.array([f.delta for f in factors]) - between(poses[:-1], poses[1:])
    error[:, 2] = wrap(error[:, 2])
    for axis in (0, 2):
        squared = error[:, axis] ** 2 / np.array([f.cov[axis, axis] for f in factors])
        bias = error[:, axis] / np.sqrt([f.cov[axis, axis] for f in factors])
        # chi2 with n degrees of freedom, within 6 sigma; the floors take up to an eighth of the stated variance.
        assert 7 / 8 - 6 * np.sqrt(2 / n) < squared.mean() < 1 + 6 * np.sqrt(2 / n)
        assert abs(bias.mean()) < 6 / np.sqrt(n)


def test_the_true_drive_is_smooth_and_closed() -> None:
    t = np.linspace(0, 80, 8001)
    poses, way = drive(LOOP, 0.4, t)
    steps = np.diff(poses[:, :2], axis=0)
    length = np.linalg.norm(steps, axis=1)
    np.testing.assert_allclose(length, np.diff(way), atol=1e-6)
    assert (np.diff(way) > 0).all()
    assert way[1] < 1e-4  # it starts at rest
    np.testing.assert_allclose(np.diff(way)[1000:] / 0.01, 0.4, atol=1e-4)
    course = np.arctan2(steps[1:, 1], steps[1:, 0])
    assert np.abs(wrap(course - poses[1:-1, 2])).max() < 0.01  # it heads where it goes
    assert np.abs(np.diff(np.unwrap(poses[:, 2]))).max() < 0.4 * 0.01 / 0.5
    lap = np.interp(2 * np.interp(11.28, way, way), way, t)
    assert np.linalg.norm(poses[np.searchsorted(t, lap)][:2] - poses[0, :2]) < 0.1
    assert way[np.searchsorted(t, 60.0)] > 2 * 11.29


def test_a_seed_is_a_log(short: Dataset) -> None:
    again = aruco_room(SHORT, np.random.default_rng(1))
    assert again.log.digest == short.log.digest
    assert again.truth is not None
    assert short.truth is not None
    np.testing.assert_array_equal(again.truth.poses, short.truth.poses)
    assert aruco_room(Options(seconds=1.0), np.random.default_rng(2)).log.digest != short.log.head(6).digest


def test_options_are_taken() -> None:
    options = Options(markers=2, seconds=1.0, frame_rate=2.0, speed=0.2, k_range=0.1, floor_bearing=0.5)
    recording, truth = record(options, np.random.default_rng(0))
    assert truth.map is not None
    assert len(truth.map.ids) == 2
    assert truth.t.tolist() == [0.0, 0.5, 1.0]
    assert recording.noise == ProportionalNoise(0.1, 0.02, 0.02, 0.5)
    assert np.linalg.norm(truth.poses[-1, :2] - truth.poses[0, :2]) < 0.2


def test_frames_are_rendered_as_they_are_asked_for() -> None:
    recording, truth = record(Options(seconds=600.0), np.random.default_rng(0))
    frames = iter(recording.frames)
    assert next(frames).t == 0.0
    image = next(frames).image
    assert image is not None
    assert image.shape == (480, 640)
    assert len(truth.t) == 3001
