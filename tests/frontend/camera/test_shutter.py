"""A rolling shutter: what each row sees, by a plain loop over the camera's own poses, and back."""

import cv2
import numpy as np
import pytest

from differences import central
from slamduel.core.factors import Odometry
from slamduel.core.se2 import Array, compose
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.camera.mounting import mounting
from slamduel.frontend.camera.shutter import CameraMotion, SweptPlane, carried

LENS = (-0.21, 0.06, 0.0008, -0.0006, 0.01)
CAMERA = Camera(640, 480, (576.0, 570.0), (321.7, 238.4), LENS, mounting(0, 0, 0, 0), readout=0.03)
RATES = np.array([0.2, -1.0, 0.4, 0.3, -0.1, 0.5])
EXACT = CameraMotion(RATES, np.zeros((6, 6)))
POINTS = np.array([[-0.3, -0.2], [0.3, -0.25], [0.35, 0.2], [-0.3, 0.25], [0.0, 0.0]])


def plane(distance: float = 1.0) -> Array:
    """T_camera_plane: turned about all axes, its front towards the camera."""
    pose = np.eye(4)
    pose[:3, :3] = np.asarray(cv2.Rodrigues(np.array([2.7, 0.3, 0.5]))[0])
    pose[:3, 3] = [0.05, -0.03, distance]
    return pose


def seen_by_its_row(point: Array, rates: Array) -> Array:
    """The pixel of a point (3,), by bisection for the row that sees it: above it, the point is below its row."""
    low, high, pixel = 0.0, 479.0, np.zeros(2)
    while high - low > 1e-10:
        row = (low + high) / 2
        t = 0.03 * ((row + 0.5) / 480 - 0.5)
        turn = np.asarray(cv2.Rodrigues(t * rates[:3])[0])
        (pixel,) = CAMERA.project((turn.T @ (point - t * rates[3:]))[None])
        low, high = (row, high) if pixel[1] > row else (low, row)
    assert abs(pixel[1] - low) < 1e-8
    return pixel


def test_rows_are_exposed_evenly_around_the_middle() -> None:
    rows = np.array([0.0, 239.5, 479.0])
    np.testing.assert_allclose(CAMERA.delays(rows), [-0.015 * 479 / 480, 0.0, 0.015 * 479 / 480], atol=1e-15)
    still = Camera(640, 480, (576.0, 570.0), (321.7, 238.4), LENS, np.eye(4))
    assert not still.delays(rows).any()


def test_pixels_are_those_of_the_rows_that_see_them_and_lead_back_to_the_middle() -> None:
    pose = plane()
    points = np.column_stack((POINTS, np.zeros(len(POINTS)))) @ pose[:3, :3].T + pose[:3, 3]
    expected = np.array([seen_by_its_row(point, RATES) for point in points])
    middle = points[:, :2] / points[:, 2:]
    assert np.abs(expected - CAMERA.project(points)).max() > 3
    swept = SweptPlane(CAMERA, pose, EXACT)
    # four rounds from up to ten rows away, each to a part in twenty: 40 px at most in 480 rows, at some slant
    np.testing.assert_allclose(swept.seen(middle), expected, atol=1e-3)
    pixels = swept.seen(middle)
    found, cov = swept.corners_at_middle(CAMERA.undistort(pixels), pixels[:, 1])
    np.testing.assert_allclose(found, middle, atol=1e-9)
    assert not cov.any()


def test_a_camera_that_stands_sees_the_middle_in_every_row() -> None:
    swept = SweptPlane(CAMERA, plane(), CameraMotion(np.zeros(6), np.zeros((6, 6))))
    rays = CAMERA.rays[100:200:20, ::40]
    np.testing.assert_allclose(swept.at_middle(rays, np.arange(100.0, 200, 20)), rays, atol=1e-15)


def test_a_ray_that_leaves_the_plane_has_no_place_at_the_middle() -> None:
    """The plane is nearly along the line of sight: the camera moves past it between a row and the middle."""
    pose = plane()
    pose[:3, :3] = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    pose[:3, 3] = [0.001, 0.0, 1.0]
    swept = SweptPlane(CAMERA, pose, CameraMotion(np.array([0, 0, 0, 1.0, 0, 0]), np.zeros((6, 6))))
    assert np.isnan(swept.at_middle(np.array([[[0.1, 0.1]]]), np.array([479.0]))).all()


@pytest.mark.parametrize("turning", [0.0, 1.0])
def test_the_slope_by_the_rates_is_the_numerical_one(turning: float) -> None:
    rates = RATES * np.array([turning] * 3 + [1] * 3)
    pose = plane()
    rays, rows = CAMERA.undistort(np.array([[120.0, 20.0], [500.0, 60.0], [450.0, 460.0]])), np.array([20.0, 60, 460])
    found = SweptPlane(CAMERA, pose, CameraMotion(rates, np.eye(6))).by_rates(rays, rows)

    def at(rates: Array) -> Array:
        return SweptPlane(CAMERA, pose, CameraMotion(rates, np.eye(6))).corners_at_middle(rays, rows)[0]

    expected = central(at, rates, 1e-4)
    # To first order in a turn of 1.1 rad/s over 15 ms.
    np.testing.assert_allclose(found, expected, atol=1e-7 + 0.02 * turning * np.abs(expected).max())
    _, cov = SweptPlane(CAMERA, pose, CameraMotion(rates, np.diag(np.arange(1.0, 7)))).corners_at_middle(rays, rows)
    by_rates = found.reshape(6, 6)
    np.testing.assert_allclose(cov, by_rates @ np.diag(np.arange(1.0, 7)) @ by_rates.T, atol=1e-15)


PLACED = mounting(0.2, -0.1, 0.6, 0.3)


def rates_of(delta: Array, seconds: float) -> Array:
    """The camera's rates in the middle of an arc that ends at `delta`, by the difference of two poses."""
    little = 1e-3

    def pose(share: float) -> Array:
        """T_world_camera after a `share` of the arc."""
        turn = delta[2]
        half = np.array([[np.cos(turn / 2), np.sin(turn / 2)], [-np.sin(turn / 2), np.cos(turn / 2)]])
        ahead, left = half @ delta[:2] * (turn / 2 / np.sin(turn / 2))
        x, y, heading = compose(np.zeros(3), _arc(ahead, left, turn, share))
        robot = np.eye(4)
        robot[:2, :2] = [[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]]
        robot[:2, 3] = x, y
        return robot @ PLACED

    moved = np.linalg.inv(pose(0.5 - little / 2)) @ pose(0.5 + little / 2)
    x, y, z = (moved[:3, :3] - moved[:3, :3].T)[[2, 0, 1], [1, 2, 0]] / 2
    return np.array([x, y, z, *moved[:3, 3]]) / (little * seconds)


def _arc(ahead: float, left: float, turn: float, share: float) -> Array:
    """The motion by a share of an even one: velocities `ahead` and `left` in the robot's frame, summed."""
    parts = 4000
    headings = turn * share * (np.arange(parts) + 0.5) / parts
    c, s = np.cos(headings), np.sin(headings)
    return np.array([
        (c * ahead - s * left).sum() * share / parts, (s * ahead + c * left).sum() * share / parts, turn * share
    ])  # fmt: skip


def test_a_camera_moves_as_its_robot_does() -> None:
    delta, seconds = np.array([0.08, 0.006, 0.2]), 0.2
    cov = np.array([[4.0, 0.3, 0.1], [0.3, 1.0, 0.5], [0.1, 0.5, 2.0]]) * 1e-6
    motion = carried(Odometry(delta, cov), seconds, PLACED)
    # A chord is shorter than its arc by a part of turn^2 / 24.
    np.testing.assert_allclose(motion.rates, rates_of(delta, seconds), rtol=2e-3, atol=2e-3)
    slope = central(lambda delta: carried(Odometry(delta, cov), seconds, PLACED).rates, delta)
    np.testing.assert_allclose(motion.cov, slope @ cov @ slope.T, rtol=1e-4, atol=1e-10)
