"""A square's corners in the image: the compiled sums against NumPy's, and slopes against the camera's own."""

import numpy as np
import pytest

from slamduel.core.se2 import Array
from slamduel.datasets.rendering.cameras import CAMERAS
from slamduel.frontend.markers._corners import judge, mixture, slopes, to_project
from slamduel.frontend.markers.square_pose import square

RAYS = np.array([[-0.21, -0.12], [0.08, -0.15], [0.11, 0.14], [-0.18, 0.17]])


def pixels(rays: Array) -> Array:
    return CAMERAS["pinhole"].project(np.column_stack((rays, np.ones(len(rays)))))


def test_slopes_are_those_of_the_camera() -> None:
    found = slopes(CAMERAS["pinhole"].project(to_project(RAYS, np.zeros((0, 3)), np.eye(4))))
    for j in range(2):
        little = 1e-4 * np.eye(2)[j]
        by_ray = (pixels(RAYS + little) - pixels(RAYS - little)) / 2e-4
        # central differences of 1e-4 and 1e-5 differ by the third derivative: some 600 px x 1e-8
        np.testing.assert_allclose(found[:, :, j], by_ray, atol=1e-3)


def test_corners_have_their_rays_covariance_and_the_outlines_distance() -> None:
    rng = np.random.default_rng(1)
    root = rng.normal(size=(8, 8)) * 1e-4
    pose = np.eye(4)
    pose[:3, 3] = 0.02, -0.01, 0.6
    seen = CAMERAS["pinhole"].project(to_project(RAYS, square(0.16), pose))
    cov, error = judge(seen, root @ root.T)
    by_ray = np.zeros((8, 8))
    for k, block in enumerate(slopes(seen)):
        by_ray[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = block
    np.testing.assert_allclose(cov, by_ray @ root @ root.T @ by_ray.T, rtol=1e-9, atol=1e-12)
    outline = square(0.16) + pose[:3, 3]
    misses = pixels(RAYS) - pixels(outline[:, :2] / outline[:, 2:])
    assert error == pytest.approx(np.sqrt((misses**2).sum(axis=1).mean()), rel=1e-9)


@pytest.mark.parametrize("count", [1, 2])
def test_a_mixture_has_the_mean_centre_of_what_is_drawn_from_it_and_its_mean_square(count: int) -> None:
    rng = np.random.default_rng(2)
    offsets, roots = rng.normal(size=(count, 6)), rng.normal(size=(count, 6, 6))
    offsets[0, 3:] = 0
    covs, squares = roots @ roots.transpose(0, 2, 1), np.array([3.0, 4.5])[:count]
    mean, cov = mixture(offsets, covs, squares)
    weights = np.exp(-squares / 2) / np.exp(-squares / 2).sum()
    second = np.einsum("k,kij->ij", weights, covs + offsets[:, :, None] * offsets[:, None, :])
    about = np.append(weights @ offsets[:, :3], np.zeros(3))
    across = np.outer(about, weights @ offsets)
    np.testing.assert_allclose(mean, about[:3], rtol=1e-12)
    np.testing.assert_allclose(cov, second - across - across.T + np.outer(about, about), rtol=1e-9, atol=1e-9)
