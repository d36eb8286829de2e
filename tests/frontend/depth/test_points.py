"""Depths of features and the noise of points, against planes and drawn errors."""

import numpy as np

from depth_scenes import CAMERA, on_planes
from slamduel.core.se2 import Array
from slamduel.datasets.rendering.depth import kinect
from slamduel.frontend.depth._depth_image import depths_at
from slamduel.frontend.depth.points import SHARED, points_of, sharing
from slamduel.frontend.depth.settings import Settings
from slamduel.frontend.maps._clouds import DepthLimits


def test_depth_between_pixels_of_a_plane_is_that_of_the_plane() -> None:
    T = CAMERA.mounting
    plane = np.array([[0.0, 0.0, 1.0, 0.0]])
    depth = on_planes(CAMERA, T, plane).astype(np.float32)
    pixels = np.random.default_rng(0).uniform([5, 120], [310, 230], (200, 2))
    z = depths_at(depth, pixels, DepthLimits(0.4, 4.5, 0.05, 0.05))
    rays = np.column_stack((CAMERA.undistort(pixels), np.ones(200)))
    exact = -T[2, 3] / (rays @ T[2, :3])
    assert np.isfinite(z).all()
    np.testing.assert_allclose(z, exact, rtol=3e-6)  # single precision


def test_a_feature_at_an_edge_a_hole_or_the_border_has_no_depth() -> None:
    depth = np.full((40, 60), 2.0, np.float32)
    depth[:, 30:] = 3.0
    depth[10, 10] = 0.0
    pixels = np.array([[29.6, 20.0], [28.4, 20.0], [9.0, 9.0], [0.0, 20.0], [40.0, 39.0], [40.0, 20.0]])
    z = depths_at(depth, pixels, DepthLimits(0.4, 4.5, 0.02, 0.02))
    assert np.isnan(z[[0, 2, 3, 4]]).all()
    np.testing.assert_allclose(z[[1, 5]], [2.0, 3.0], rtol=1e-6)
    assert np.isnan(depths_at(depth, pixels[[1, 5]], DepthLimits(2.5, 2.9, 0.02, 0.02))).all()


def test_covariance_of_points_is_that_of_drawn_errors() -> None:
    settings, rng, n = Settings(), np.random.default_rng(3), 100_000
    one = points_of(CAMERA, np.array([[250.0, 40.0]]), np.array([2.5]), np.array([1.0]), settings)
    assert one.z_sd[0] == 0.7 * (0.001 + 0.003 * 2.5**2)
    rays = one.rays + rng.normal(0, one.ray_sd[0], (n, 2))
    z = 2.5 + rng.normal(0, one.z_sd[0], n)
    drawn = np.cov(np.column_stack((rays * z[:, None], z)), rowvar=False)
    sd = np.sqrt(np.diag(one.cov[0]))
    # a sample covariance errs by sqrt(2 / n) of the product of the deviations at most; the term of both errors, by less
    assert (np.abs(drawn - one.cov[0]) < 6 * np.sqrt(2 / n) * np.outer(sd, sd)).all()


def test_the_depth_of_a_feature_errs_as_stated_on_a_kinect_s_image() -> None:
    """Floor and wall at 1 to 4 m. Where the plane through nine pixels is told, its error is less than that of one."""
    rng, settings, T = np.random.default_rng(5), Settings(), CAMERA.mounting
    exact = on_planes(CAMERA, T, np.array([[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, -4.0]])).astype(np.float32)
    pixels = rng.uniform([5, 5], [314, 234], (4000, 2))
    true = depths_at(exact, pixels, DepthLimits(0.5, 4.4, 0.02, 0.02))
    off, sd = list[np.ndarray](), list[np.ndarray]()
    for _ in range(5):
        z = depths_at(kinect(exact, rng), pixels, DepthLimits(0.5, 4.4, 0.02, 0.02))
        known = np.isfinite(z) & np.isfinite(true)
        off.append(z[known] - true[known])
        sd.append(points_of(CAMERA, pixels[known], true[known], np.ones(known.sum()), settings).z_sd)
    squared = (np.concatenate(off) / np.concatenate(sd)) ** 2
    assert len(squared) > 10_000
    # below 1 by what whole millimetres are stated with; neighbours are alike, so that some 3,000 draws are independent
    assert 0.7 < squared.mean() < 1.15


def test_features_within_three_pixels_count_as_one_depth() -> None:
    settings, rng = Settings(), np.random.default_rng(7)
    pixels = np.concatenate((rng.uniform([20, 20], [300, 220], (60, 2)), [[50.0, 60.0], [52.0, 61.0], [51.0, 58.5]]))
    points = points_of(CAMERA, pixels, np.full(63, 2.0), np.full(63, 0.4), settings)
    near = (np.abs(pixels[:, None] - pixels) < SHARED).all(axis=2).sum(axis=1)
    assert (near[-3:] >= 3).all()
    np.testing.assert_allclose(sharing(points, pixels).z_sd, points.z_sd * np.sqrt(near), rtol=1e-12)
    alone = sharing(points.taken([-1] * 5), np.tile(pixels[-1], (5, 1)))  # five of one place
    np.testing.assert_allclose((1 / alone.z_sd**2).sum(), 1 / points.z_sd[-1] ** 2, rtol=1e-12)
    np.testing.assert_array_equal(alone.ray_sd, points.ray_sd[[-1] * 5])


def test_depths_of_neighbours_err_alike_as_far_as_is_stated() -> None:
    """By the rendered camera's noise: depths by nine pixels each, two and six pixels beside each other."""
    z = 2.0
    exact = np.full((240, 320), z, np.float32)
    middle = np.stack(np.meshgrid(np.arange(12.0, 300, 24), np.arange(12.0, 228, 24)), axis=-1).reshape(-1, 2)
    images = [kinect(exact, np.random.default_rng(k)) for k in range(12)]

    def errors(shift: float) -> Array:
        pixels, limits = middle + np.array([shift, 0.0]), DepthLimits(0.5, 4.0, 0.1, 0.1)
        return np.concatenate([depths_at(one, pixels, limits) for one in images]) - z

    def alike(away: float) -> float:
        e = np.vstack((errors(0.0), errors(away)))
        return float((e[0] @ e[1]) / np.sqrt((e[0] @ e[0]) * (e[1] @ e[1])))

    assert alike(2.0) > 0.5
    assert abs(alike(6.0)) < 0.12  # 4 / sqrt(1296)
