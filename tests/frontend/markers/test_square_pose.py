"""The pose of a square from its corners: both solutions, against SciPy's optimiser, exact corners and Monte Carlo."""

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from differences import central
from slamduel.core.se2 import Array
from slamduel.frontend.markers._square_pose import _misses  # pyright: ignore[reportPrivateUsage]
from slamduel.frontend.markers.square_pose import SquarePose, square, square_poses

SIDE = 0.16
PIXEL = 1 / 576
"""A pixel, in rays."""


def any_pose(rng: np.random.Generator, distance: float, lean: float = 0.9) -> Array:
    """T_camera_square of a square in view, turned to the camera by up to `lean` rad."""
    pose = np.eye(4)
    axis = np.append(rng.normal(size=2), 0.0)
    leaning = Rotation.from_rotvec(axis / np.linalg.norm(axis) * rng.uniform(0.2, lean))
    pose[:3, :3] = (leaning * Rotation.from_euler("xz", [np.pi, rng.uniform(-3, 3)])).as_matrix()
    pose[:3, 3] = distance * np.array([rng.uniform(-0.35, 0.35), rng.uniform(-0.25, 0.25), 1.0])
    return pose


def rays_of(pose: Array) -> Array:
    points = square(SIDE) @ pose[:3, :3].T + pose[:3, 3]
    return points[:, :2] / points[:, 2:]


def any_cov(rng: np.random.Generator, sd: float) -> Array:
    """(8, 8), with correlations."""
    root = np.eye(8) + 0.3 * rng.normal(size=(8, 8))
    return sd**2 * root @ root.T


def test_exact_corners_give_the_exact_pose() -> None:
    rng = np.random.default_rng(1)
    for _ in range(50):
        pose = any_pose(rng, rng.uniform(0.4, 2))
        best = square_poses(rays_of(pose), any_cov(rng, 0.1 * PIXEL), SIDE)[0]
        # IPPE's corners are single precision; what is left is where the optimiser stops, 1e-9 of a chi-square
        np.testing.assert_allclose(best.pose, pose, atol=1e-5)
        assert best.chi2 < 1e-6
        np.testing.assert_allclose(best.pose[:3, :3] @ best.pose[:3, :3].T, np.eye(3), atol=1e-12)


def test_both_solutions_are_least_squares() -> None:
    """From either of IPPE's poses SciPy's optimiser comes to the same pose and chi-square."""
    rng = np.random.default_rng(2)
    twice = 0
    for _ in range(40):
        rays = rays_of(any_pose(rng, rng.uniform(1, 4))) + 0.2 * PIXEL * rng.normal(size=(4, 2))
        cov = any_cov(rng, 0.2 * PIXEL)
        found = square_poses(rays, cov, SIDE)
        assert found
        assert [s.chi2 for s in found] == sorted(s.chi2 for s in found)
        twice += len(found) == 2
        for solution, start in _matched(found, _ippe(rays)):
            whiten = np.linalg.cholesky(np.linalg.inv(cov)).T
            exact: Any = dict.fromkeys(("xtol", "ftol", "gtol"), 1e-14) | {"x_scale": "jac"}
            best = least_squares(lambda p, w=whiten, r=rays: w @ (_reprojected(p) - r).ravel(), start, **exact)
            assert solution.chi2 == pytest.approx(2 * best.cost, rel=1e-6, abs=1e-6)
            np.testing.assert_allclose(solution.pose[:3, 3], best.x[3:], rtol=0, atol=2e-2 * _sd(solution))
    assert twice > 20


def _sd(solution: SquarePose) -> float:
    return float(np.sqrt(np.linalg.eigvalsh(solution.cov[:3, :3])[-1]))


def _reprojected(parameters: Array) -> Array:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = Rotation.from_rotvec(parameters[:3]).as_matrix(), parameters[3:]
    return rays_of(pose)


def _ippe(rays: Array) -> list[Array]:
    _, turns, shifts, _ = cv2.solvePnPGeneric(square(SIDE), rays, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE_SQUARE)
    return [np.concatenate((np.ravel(t), np.ravel(s))).astype(float) for t, s in zip(turns, shifts, strict=True)]


def _matched(found: Sequence[SquarePose], starts: Sequence[Array]) -> list[tuple[SquarePose, Array]]:
    """Each solution with the start whose normal is nearest."""
    normals = [Rotation.from_rotvec(start[:3]).as_matrix()[:, 2] for start in starts]
    return [(s, starts[int(np.argmax([n @ s.pose[:3, 2] for n in normals]))]) for s in found]


def test_the_jacobian() -> None:
    rng = np.random.default_rng(3)
    outline = square(SIDE)
    for _ in range(20):
        pose = any_pose(rng, rng.uniform(0.4, 3))
        rays = rays_of(pose) + 0.01 * rng.normal(size=(4, 2))
        misses, jacobian = np.zeros(8), np.zeros((8, 6))
        assert _misses(outline, rays, pose[:3, :3].copy(), pose[:3, 3].copy(), misses, jacobian)
        np.testing.assert_allclose(misses, (rays - rays_of(pose)).ravel(), atol=1e-14)

        def at(step: Array, pose: Array = pose, rays: Array = rays) -> Array:
            turned, end = Rotation.from_rotvec(step[:3]).as_matrix() @ pose[:3, :3], np.zeros(8)
            _misses(outline, rays, turned, pose[:3, 3] + step[3:], end, np.zeros((8, 6)))
            return end

        np.testing.assert_allclose(jacobian, -central(at, np.zeros(6)), atol=1e-8)  # misses are seen less expected


def test_a_point_behind_the_camera_has_no_misses() -> None:
    pose = any_pose(np.random.default_rng(5), 1.0)
    behind = np.array([0.0, 0.0, -1.0])
    assert not _misses(square(SIDE), rays_of(pose), pose[:3, :3].copy(), behind, np.zeros(8), np.zeros((8, 6)))


def test_the_covariance_is_that_of_many_draws() -> None:
    """A large square, whose two poses are far apart: n draws have a covariance right to sqrt(2 / n) along any axis."""
    rng = np.random.default_rng(6)
    pose, cov, count = any_pose(rng, 0.8), any_cov(rng, 0.1 * PIXEL), 2000
    (exact, *_) = square_poses(rays_of(pose), cov, SIDE)
    root = np.linalg.cholesky(cov)
    noise = (rng.normal(size=(count, 8)) @ root.T).reshape(-1, 4, 2)
    found = [square_poses(rays_of(pose) + drawn, cov, SIDE)[0] for drawn in noise]
    whiten = np.linalg.inv(np.linalg.cholesky(exact.cov[:3, :3]))
    seen = whiten @ (np.array([s.pose[:3, 3] for s in found]) - pose[:3, 3]).T
    np.testing.assert_allclose(seen @ seen.T / count, np.eye(3), atol=5 * np.sqrt(2 / count))
    # four corners are eight numbers, and a pose six: chi-square with two degrees of freedom, variance 4
    assert np.mean([s.chi2 for s in found]) == pytest.approx(2, abs=5 * np.sqrt(4 / count))


def test_the_covariance_of_the_pose_is_that_of_the_corners_through_its_numerical_jacobian() -> None:
    """Where exact corners are moved along each of their eight directions, place and turn move so."""
    rng = np.random.default_rng(9)
    for _ in range(5):
        pose, cov, h = any_pose(rng, rng.uniform(0.6, 1.0)), any_cov(rng, 0.1 * PIXEL), 1e-5
        ends = [
            [_nearest(rays_of(pose) + way * step.reshape(4, 2), cov, pose) for way in (-h, h)] for step in np.eye(8)
        ]
        slope = np.array([(_step(pose, more) - _step(pose, less)) / (2 * h) for less, more in ends]).T
        stated, numeric = _nearest(rays_of(pose), cov, pose).cov, slope @ cov @ slope.T
        sd = np.sqrt(np.diag(numeric))
        np.testing.assert_allclose(stated / np.outer(sd, sd), numeric / np.outer(sd, sd), atol=5e-3)


def _nearest(rays: Array, cov: Array, pose: Array) -> SquarePose:
    return min(square_poses(rays, cov, SIDE), key=lambda one: float(np.abs(one.pose - pose).max()))


def _step(pose: Array, found: SquarePose) -> Array:
    """(6,) from the pose to the one found: of the place, and the turn about the camera's axes."""
    turn = Rotation.from_matrix(found.pose[:3, :3] @ pose[:3, :3].T).as_rotvec()
    return np.concatenate((found.pose[:3, 3] - pose[:3, 3], turn))


def test_corners_in_the_wrong_order_have_no_pose() -> None:
    pose = any_pose(np.random.default_rng(7), 1.0)
    assert square_poses(rays_of(pose)[::-1].copy(), PIXEL**2 * np.eye(8), SIDE) == []  # the square's back


@pytest.mark.parametrize("rays", [np.zeros((4, 2)), np.full((4, 2), np.nan)], ids=["a point", "not numbers"])
def test_corners_of_no_square_have_no_pose(rays: Array) -> None:
    assert square_poses(rays, PIXEL**2 * np.eye(8), SIDE) == []


def test_a_covariance_without_an_inverse_has_no_pose() -> None:
    assert square_poses(rays_of(any_pose(np.random.default_rng(8), 1.0)), np.zeros((8, 8)), SIDE) == []
