"""Levelling against planes whose tilt is known."""

import numpy as np
import pytest
from numpy.typing import NDArray

from depth_scenes import CAMERA, on_planes
from slamduel.datasets.rendering.disturbances import rocked
from slamduel.frontend.depth.level import Level, Leveller, levelling, tilt_of
from slamduel.frontend.depth.settings import Settings
from slamduel.frontend.se2 import Array

FLOOR = [0.0, 0.0, 1.0, 0.0]
WALL = [-1.0, 0.1, 0.0, -2.6]  # across the way, 2.6 m ahead


def depth_at(body: Array, planes: list[list[float]]) -> NDArray[np.float32]:
    """The depth image of a robot whose body is at `body` (4, 4)."""
    return on_planes(CAMERA, body @ CAMERA.mounting, np.array(planes)).astype(np.float32)


def off(level: Level, body: Array) -> Array:
    """(3,) the turns about x and y (rad) and the height (m) by which a level is wrong."""
    D = level.T @ np.linalg.inv(body @ CAMERA.mounting)
    return np.array([D[2, 1], D[0, 2], D[2, 3]])


@pytest.mark.parametrize(("pitch", "roll"), [(0.0, 0.0), (0.04, 0.0), (-0.04, 0.03), (0.02, -0.05)])
def test_a_floor_in_front_of_a_wall_levels_a_body_that_rocks(pitch: float, roll: float) -> None:
    body = rocked(pitch, roll)
    level = Leveller(CAMERA, Settings()).level(depth_at(body, [FLOOR, WALL]))
    assert level.found
    # the body's turn about the vertical by its rocking, pitch times roll, is no part of a level
    np.testing.assert_allclose(off(level, body)[:2], 0, atol=np.radians(0.02))
    assert abs(off(level, body)[2]) < 5e-4


def test_covariance_is_that_of_drawn_errors() -> None:
    rng, settings, trials = np.random.default_rng(1), Settings(), 60
    leveller, errors = Leveller(CAMERA, settings), np.empty((trials, 3))
    level = None
    for k in range(trials):
        body = rocked(*rng.normal(0, 0.02, 2))
        depth = depth_at(body, [FLOOR, WALL])
        depth += rng.normal(0, 1, depth.shape) * (settings.constant_sd + settings.depth_sd * depth**2)
        level = leveller.level(depth.astype(np.float32))
        assert level.found
        errors[k] = off(level, body)
    assert level is not None
    squared = np.einsum("ni,ij,nj->n", errors, np.linalg.inv(level.cov), errors) / 3
    # smaller than 1 by what is added for errors that pixels share; the mean of 60 errs by sqrt(2 / 3 / 60) = 0.1
    assert 0.1 < squared.mean() < 1.3


def test_without_a_floor_the_mounting_is_taken_with_the_sway_as_its_error() -> None:
    settings = Settings(sway=0.03)
    for depth in (np.zeros((240, 320), np.float32), depth_at(np.eye(4), [[-1.0, 0.0, 0.0, -1.2]])[:100]):
        image = np.zeros((240, 320), np.float32)
        image[: len(depth)] = depth
        level = Leveller(CAMERA, settings).level(image)
        assert not level.found
        np.testing.assert_array_equal(level.T, CAMERA.mounting)
        np.testing.assert_allclose(np.sqrt(np.diag(level.cov))[:2], 0.03)


def test_with_level_false_no_floor_is_looked_for() -> None:
    level = Leveller(CAMERA, Settings(level=False)).level(depth_at(np.eye(4), [FLOOR]))
    assert not level.found


def test_levelling_takes_a_plane_to_the_floor_by_the_shortest_turn() -> None:
    plane = np.array([0.05, -0.03, 0.02])
    T = levelling(plane)
    xy = np.random.default_rng(2).uniform(-2, 2, (20, 2))
    on_plane = np.column_stack((xy, xy @ plane[:2] + plane[2], np.ones(20)))
    np.testing.assert_allclose((on_plane @ T.T)[:, 2], 0, atol=1e-15)
    np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-15)
    assert abs(T[1, 0] - T[0, 1]) < 1e-15  # no turn about the vertical


@pytest.mark.parametrize(
    ("pitch", "roll", "up"), [(0.0, 0.0, 0.0), (0.04, 0.0, 0.01), (-0.04, 0.03, -0.02), (0.02, -0.05, 0.0)]
)
def test_a_tilt_is_that_of_the_body(pitch: float, roll: float, up: float) -> None:
    body = rocked(pitch, roll)
    body[2, 3] = up
    exact = tilt_of(Level(body @ CAMERA.mounting, np.eye(3), True), CAMERA)
    np.testing.assert_allclose(exact, (pitch, roll, up), atol=1e-14)
    found = tilt_of(Leveller(CAMERA, Settings()).level(depth_at(body, [FLOOR, WALL])), CAMERA)
    np.testing.assert_allclose(found[:2], (pitch, roll), atol=np.radians(0.02))
    assert abs(found.up - up) < 1e-3
    stated = tilt_of(Leveller(CAMERA, Settings(level=False)).level(depth_at(body, [FLOOR])), CAMERA)
    np.testing.assert_allclose(stated, 0, atol=1e-14)
