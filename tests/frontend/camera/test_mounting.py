"""Where a camera sits on its robot."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from refusals import refused
from slamduel.frontend.camera.mounting import from_matrix, from_rpy, mounting

PUBLISHED = [[0, 0.258819, 0.965926, 0.18], [-1, 0, 0, -0.1], [0, -0.965926, 0.258819, 0], [0, 0, 0, 1]]
"""The original ArUco EKF system's."""


def test_mounting_looks_ahead_and_down() -> None:
    pose = mounting(forward=0.1, left=0.2, up=0.7, tilt=0.3)
    np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-15)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1)
    np.testing.assert_allclose(pose @ [0, 0, 1, 0], [np.cos(0.3), 0, -np.sin(0.3), 0])  # where it looks
    np.testing.assert_allclose(pose @ [1, 0, 0, 0], [0, -1, 0, 0], atol=1e-15)  # right in the image, right on the robot
    np.testing.assert_allclose(pose @ [0, 0, 0, 1], [0.1, 0.2, 0.7, 1])


def test_mounting_of_the_documents_robot() -> None:
    np.testing.assert_allclose(mounting(0.18, -0.1, 0, np.deg2rad(-15)), PUBLISHED, atol=1e-6)


def test_no_turn_is_straight_ahead() -> None:
    ahead = [[0, 0, 1, 1], [-1, 0, 0, 2], [0, -1, 0, 3], [0, 0, 0, 1]]
    np.testing.assert_array_equal(from_rpy((1, 2, 3), (0, 0, 0)), ahead)


def test_rpy_turns_about_fixed_axes_roll_first() -> None:
    rng = np.random.default_rng(0)
    for rpy in rng.uniform(-3, 3, (20, 3)):
        turn = Rotation.from_euler("xyz", rpy).as_matrix()  # small letters: about axes that stay
        ahead = from_rpy((0, 0, 0), (0, 0, 0))[:3, :3]
        np.testing.assert_allclose(from_rpy((0, 0, 0), rpy)[:3, :3], turn @ ahead, atol=1e-14)


@pytest.mark.parametrize(
    ("rpy", "camera", "robot"),
    [
        ((0, 0.2, 0), [0, 0, 1], [np.cos(0.2), 0, -np.sin(0.2)]),  # pitched, it looks down
        ((0, 0, 0.2), [0, 0, 1], [np.cos(0.2), np.sin(0.2), 0]),  # yawed, to the left
        ((0.2, 0, 0), [0, -1, 0], [0, -np.sin(0.2), np.cos(0.2)]),  # rolled, its top leans to the right
    ],
)
def test_signs_of_the_angles(rpy: tuple[float, ...], camera: list[float], robot: list[float]) -> None:
    np.testing.assert_allclose(from_rpy((0, 0, 0), rpy)[:3, :3] @ camera, robot, atol=1e-15)


def test_a_published_matrix_is_taken_and_its_rotation_made_exact() -> None:
    pose = from_matrix(PUBLISHED, "robot.toml: [camera] mounting")
    np.testing.assert_allclose(pose, PUBLISHED, atol=1e-6)
    np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-15)


def changed(row: int, column: int, value: Any) -> Any:
    rows = [list(line) for line in PUBLISHED]
    rows[row][column] = value
    return rows


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("ahead", "found 'ahead', expected four rows of four numbers"),
        (None, "found one number, expected four rows"),
        ([[1, 2], [3]], "expected four rows of four numbers"),
        (np.eye(3).tolist(), "found 3 x 3 numbers, expected four rows"),
        (changed(0, 3, "x"), "expected four rows of four numbers"),
        (changed(0, 3, float("nan")), "found a number that is not finite"),
        (changed(3, 0, 0.5), "found the last row .*0.5.*, expected .0, 0, 0, 1."),
        (changed(0, 2, 0.9), "found rows that are 0.12 from being a rotation"),
        (np.diag([1, 1, -1, 1]).tolist(), "found a mirrored rotation"),
    ],
)
def test_what_is_no_rigid_motion_is_refused(rows: Any, message: str) -> None:
    refused(f"^here: .*{message}", from_matrix, rows, "here")
