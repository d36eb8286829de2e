"""Levelling against planes whose tilt is known."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from depth_scenes import CAMERA, on_planes
from slamduel.core.se2 import Array
from slamduel.datasets.rendering.disturbances import rocked
from slamduel.frontend.depth.level import Level, Leveller, levelling, tilt_of
from slamduel.frontend.depth.settings import Settings

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
    # exact depths: what remains is of points of the wall that pass for the floor, a fifth of a millimetre without them
    np.testing.assert_allclose(off(level, body)[:2], 0, atol=3e-5)
    assert abs(off(level, body)[2]) < 5e-5


@pytest.mark.parametrize(("pitch", "roll"), [(0.0, 0.0), (-0.067, -0.051), (-0.06, 0.05), (0.05, -0.02)])
@pytest.mark.parametrize("columns", [slice(80, None), slice(160, None), slice(-80), slice(-120)])
@pytest.mark.parametrize("away", [0.95, 1.2, 1.5])
def test_a_box_that_hides_the_floor_is_not_levelled_by(pitch: float, roll: float, columns: slice, away: float) -> None:
    """Body and box make a plane that is steeper than the floor, with nearly as many points near it."""
    body = rocked(pitch, roll)
    depth, box = depth_at(body, [FLOOR, [-1.0, 0.1, 0.0, -2.3]]), depth_at(body, [FLOOR, [-1.0, 0.0, 0.0, -away]])
    depth[:, columns] = box[:, columns]
    level = Leveller(CAMERA, Settings()).level(depth)
    assert level.found
    # the lowest centimetre of a face is within the floor's noise, and turns the plane by so much
    np.testing.assert_allclose(off(level, body)[:2], 0, atol=np.radians(0.6))


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
    squared = np.einsum("ni,ij,nj->n", errors, np.linalg.inv(level.cov), errors) / 3
    assert 0.6 < squared.mean() < 1.4  # the mean of 60 errs by sqrt(2 / 3 / 60) = 0.1


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


@pytest.mark.parametrize(("pitch", "roll"), [(0.04, -0.03), (-0.07, -0.05), (0.0, 0.06)])
def test_a_tilted_body_s_heading_is_where_its_x_axis_points_to(pitch: float, roll: float) -> None:
    """By Euler angles: a body turned by heading, then pitch, then roll has that heading, which levelling keeps."""
    body = Rotation.from_euler("ZYX", [0.7, pitch, roll]).as_matrix()
    normal = body.T[:, 2]  # the vertical, as the body sees it
    T = levelling(np.array([-normal[0] / normal[2], -normal[1] / normal[2], 0.0]))
    upright = body @ T[:3, :3].T
    np.testing.assert_allclose(upright, Rotation.from_euler("Z", 0.7).as_matrix(), atol=1e-12)


def test_levelling_takes_a_plane_to_the_floor() -> None:
    plane = np.array([0.05, -0.03, 0.02])
    T = levelling(plane)
    xy = np.random.default_rng(2).uniform(-2, 2, (20, 2))
    on_plane = np.column_stack((xy, xy @ plane[:2] + plane[2], np.ones(20)))
    np.testing.assert_allclose((on_plane @ T.T)[:, 2], 0, atol=1e-15)
    np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-15)
    assert np.linalg.det(T) == pytest.approx(1.0)


@pytest.mark.parametrize(("pitch", "roll", "up"), [(0, 0, 0), (0.04, 0, 0.01), (-0.04, 0.03, -0.02), (0.02, -0.05, 0)])
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
