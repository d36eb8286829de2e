"""The ArUco document's robot: its constants, what its camera sees, and noise that is what it states."""

from typing import Any

import cv2
import numpy as np
import pytest
from scipy.stats import chi2, kstest

from drawn_errors import errors, known, run, seen
from slamduel.core.factors import Dataset
from slamduel.core.factors.check import problems
from slamduel.datasets.cache import generator
from slamduel.datasets.worlds.aruco_robot import CAMERA, ENCODER, NOISE, SIDE, Options, aruco_robot, in_view

SEEDS = 12


@pytest.fixture(scope="module")
def drives() -> list[Dataset]:
    return [aruco_robot(Options(seconds=30.0), generator("aruco-robot", seed)) for seed in range(SEEDS)]


def test_the_robot_has_the_document_s_noise(drives: list[Dataset]) -> None:
    made = drives[0]
    assert not list(problems(made.log))
    r, bearing = made.log.z.T
    np.testing.assert_allclose(np.sqrt(made.log.z_cov[:, 0, 0]), np.hypot(0.05 * r, 0.02))
    np.testing.assert_allclose(np.sqrt(made.log.z_cov[:, 1, 1]), np.hypot(0.05 * bearing, 0.01))
    forward = 0.01 * 0.4 * 0.05 / np.sqrt(2)  # a reading of both wheels at 0.4 m/s, 20 a second
    np.testing.assert_allclose(made.log.delta_cov[100, 0, 0], 4 * forward**2 + ENCODER.floors.position**2, rtol=0.02)


def test_every_sighting_is_a_whole_marker_in_the_image(drives: list[Dataset]) -> None:
    """Its centre is as far as the camera can read, and in the robot's plane nothing is behind it."""
    for made in drives:
        assert made.log.z[:, 0].max() < 3.18 * 1.05**5
        assert np.abs(seen(*at(made))[:, 1]).max() < np.deg2rad(45)
    assert 1.5 < np.mean([len(made.log.ids) / len(made.log) for made in drives]) < 6


def at(made: Dataset) -> tuple[np.ndarray, np.ndarray]:
    truth, landmarks = known(made)
    return truth.poses[made.log.sighting_step], landmarks.xy[made.log.ids]


@pytest.mark.parametrize(
    ("place", "normal", "found"),
    [
        ((2.0, 0.0, 0.5), (-1.0, 0.0), True),
        ((2.0, 0.0, 0.5), (1.0, 0.0), False),  # its back
        ((3.3, 0.0, 0.5), (-1.0, 0.0), False),  # 3.16 m from the camera
        ((3.1, 0.0, 0.5), (-1.0, 0.0), True),
        ((2.0, 0.0, -1.0), (-1.0, 0.0), False),  # below the image: the camera looks up
        ((2.0, 2.0, 0.5), (-1.0, 0.0), False),  # to the left of it
        ((-2.0, 0.0, 0.5), (1.0, 0.0), False),  # behind
        ((1.5, 0.0, 0.5), (0.2, 1.0), False),  # edge on
    ],
)
def test_the_camera_reads_what_is_in_front_of_it(place: Any, normal: Any, found: bool) -> None:
    turned = np.array(normal) / np.linalg.norm(normal)
    step, marker = in_view(np.zeros((1, 3)), np.array([place]), turned[None])
    assert len(step) == len(marker) == found


def test_the_view_is_what_opencv_projects() -> None:
    """The corners of a marker in the image, on its way out of it to the left."""
    left = np.linspace(0.5, 2.5, 201)
    place = np.column_stack((np.full(201, 2.0), left, np.full(201, 0.4)))
    _, inside = in_view(np.zeros((1, 3)), place, np.tile([-1.0, 0.0], (201, 1)))
    to_camera = np.linalg.inv(CAMERA.mounting)
    rotation, _ = cv2.Rodrigues(to_camera[:3, :3])
    last = []
    for k in range(201):
        h = SIDE / 2
        corners = place[k] + np.array([[0, h, h], [0, -h, h], [0, -h, -h], [0, h, -h]])
        shift = to_camera[:3, 3].copy()
        pixels, _ = cv2.projectPoints(corners, rotation, shift, CAMERA.matrix, np.array(CAMERA.distortion))
        last.append(bool(((pixels >= 0) & (pixels.reshape(-1, 1, 2) <= [959, 539])).all()))
    near = np.linalg.norm((place - CAMERA.mounting[:3, 3]), axis=1) <= 3.0
    np.testing.assert_array_equal(np.isin(np.arange(201), inside), np.array(last) & near)
    assert 0 < len(inside) < 201


def test_every_error_is_drawn_from_the_stated_covariance(drives: list[Dataset]) -> None:
    """That of sightings is stated at the reading and drawn at the true place, so theirs is compared there."""
    moved = np.concatenate([errors(made).motions_squared for made in drives])
    assert kstest(moved, chi2(3).cdf).pvalue > 1e-4
    scaled = np.concatenate([
        errors(made).sightings / np.sqrt(NOISE.cov(seen(*at(made)))[:, [0, 1], [0, 1]]) for made in drives
    ])  # fmt: skip
    assert kstest((scaled**2).sum(axis=1), chi2(2).cdf).pvalue > 1e-4


def test_an_ekf_is_as_sure_as_it_may_be_where_the_noise_is_honest_and_too_sure_where_not(drives: list[Dataset]) -> None:
    """NEES at the last step, summed over seeds: chi-square of 3 degrees of freedom a seed."""
    low, high = chi2(3 * SEEDS).ppf([1e-4, 1 - 1e-4])
    assert low < sum(run("ekf", made)[1][-1] for made in drives) < high
    spoilt = [aruco_robot(Options(seconds=30.0, sensor_scale=3.0), generator("aruco-robot", s)) for s in range(SEEDS)]
    assert sum(run("ekf", made)[1][-1] for made in spoilt) > high


def test_seeds_are_other_rooms(drives: list[Dataset]) -> None:
    again = aruco_robot(Options(seconds=30.0), generator("aruco-robot", 0))
    assert again.log.digest == drives[0].log.digest != drives[1].log.digest
    assert (known(drives[0])[1].xy != known(drives[1])[1].xy).any()
    few = aruco_robot(Options(seconds=1.0, markers=1), generator("aruco-robot", 0))
    assert not list(problems(few.log))
