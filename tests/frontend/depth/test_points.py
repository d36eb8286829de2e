"""Depths of features and the noise of points, against planes and drawn errors."""

import numpy as np

from depth_scenes import CAMERA, on_planes
from slamduel.datasets.rendering.depth import kinect
from slamduel.frontend.depth._depth_image import depths_at
from slamduel.frontend.depth.points import points_of
from slamduel.frontend.depth.settings import Settings


def test_depth_between_pixels_of_a_plane_is_that_of_the_plane() -> None:
    T = CAMERA.mounting
    plane = np.array([[0.0, 0.0, 1.0, 0.0]])
    depth = on_planes(CAMERA, T, plane).astype(np.float32)
    pixels = np.random.default_rng(0).uniform([5, 120], [310, 230], (200, 2))
    z = depths_at(depth, pixels, 0.4, 4.5, 0.05, 0.05)
    rays = np.column_stack((CAMERA.undistort(pixels), np.ones(200)))
    exact = -T[2, 3] / (rays @ T[2, :3])
    assert np.isfinite(z).all()
    np.testing.assert_allclose(z, exact, rtol=3e-6)  # single precision


def test_a_feature_at_an_edge_a_hole_or_the_border_has_no_depth() -> None:
    depth = np.full((40, 60), 2.0, np.float32)
    depth[:, 30:] = 3.0
    depth[10, 10] = 0.0
    pixels = np.array([[29.6, 20.0], [28.4, 20.0], [9.0, 9.0], [0.0, 20.0], [40.0, 39.0], [40.0, 20.0]])
    z = depths_at(depth, pixels, 0.4, 4.5, 0.02, 0.02)
    assert np.isnan(z[[0, 2, 3, 4]]).all()
    np.testing.assert_allclose(z[[1, 5]], [2.0, 3.0], rtol=1e-6)
    assert np.isnan(depths_at(depth, pixels[[1, 5]], 2.5, 2.9, 0.02, 0.02)).all()


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
    true = depths_at(exact, pixels, 0.5, 4.4, 0.02, 0.02)
    off, sd = list[np.ndarray](), list[np.ndarray]()
    for _ in range(5):
        z = depths_at(kinect(exact, rng), pixels, 0.5, 4.4, 0.02, 0.02)
        known = np.isfinite(z) & np.isfinite(true)
        off.append(z[known] - true[known])
        sd.append(points_of(CAMERA, pixels[known], true[known], np.ones(known.sum()), settings).z_sd)
    squared = (np.concatenate(off) / np.concatenate(sd)) ** 2
    assert len(squared) > 10_000
    # below 1 by what whole millimetres are stated with; neighbours are alike, so that some 3,000 draws are independent
    assert 0.7 < squared.mean() < 1.15
