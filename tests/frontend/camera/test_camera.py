"""Cameras and their lenses."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from refusals import refused
from slamduel.core.se2 import Array
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.camera.mounting import mounting

LENSES: dict[str, tuple[float, ...]] = {
    "none": (),
    "four": (-0.21, 0.06, 0.0008, -0.0006),
    "five": (-0.21, 0.06, 0.0008, -0.0006, 0.01),
    "barrel": (-0.3, 0.12, 0.0, 0.0, -0.02),
    "rational": (0.2, 0.05, 0.0005, -0.0004, 0.01, 0.35, 0.06, 0.002),
    "prism": (0.2, 0.05, 0.0005, -0.0004, 0.01, 0.35, 0.06, 0.002, 1e-3, -5e-4, 4e-4, 2e-4),
    "tilted": (0.2, 0.05, 0.0005, -0.0004, 0.01, 0.35, 0.06, 0.002, 1e-3, -5e-4, 4e-4, 2e-4, 0.01, -0.02),
}


def camera(distortion: tuple[float, ...]) -> Camera:
    return Camera(640, 480, (576.0, 570.0), (321.7, 238.4), distortion, mounting(0, 0, 0, 0))


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES.keys())
def test_undistort_undoes_project(lens: tuple[float, ...]) -> None:
    u, v = np.meshgrid(np.linspace(0, 639, 9), np.linspace(0, 479, 9))
    pixels = np.stack((u.ravel(), v.ravel()), axis=-1)
    rays = camera(lens).undistort(pixels)
    depth = np.linspace(0.3, 5, len(rays))[:, None]
    back = camera(lens).project(np.hstack((rays, np.ones((len(rays), 1)))) * depth)
    np.testing.assert_allclose(back, pixels, atol=1e-6)


def test_project_is_the_lens_model_written_out() -> None:
    k1, k2, p1, p2, k3 = lens = (-0.21, 0.06, 0.0008, -0.0006, 0.01)
    points = np.random.default_rng(0).uniform([-0.5, -0.4, 1], [0.5, 0.4, 1.2], (20, 3)) * [2, 2, 2]
    x, y = points[:, 0] / points[:, 2], points[:, 1] / points[:, 2]
    r2 = x**2 + y**2
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    u = 576.0 * (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)) + 321.7
    v = 570.0 * (y * radial + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y) + 238.4
    np.testing.assert_allclose(camera(lens).project(points), np.stack((u, v), axis=-1), atol=1e-9)


def test_without_a_lens_it_is_the_reports_equation_3_5() -> None:
    (pixel,) = camera(()).project(np.array([[0.2, -0.1, 2.0]]))
    assert pixel == pytest.approx([576.0 * 0.1 + 321.7, 570.0 * -0.05 + 238.4])
    assert camera(()).undistort(np.zeros((0, 2))).shape == (0, 2)
    assert camera(()).project(np.zeros((0, 3))).shape == (0, 2)


@pytest.mark.parametrize("length", [1, 3, 6, 13, 15])
def test_a_lens_of_unknown_length_is_refused(length: int) -> None:
    refused(f"distortion: found {length} coefficients, expected one", camera((0.0,) * length).project, np.ones((1, 3)))


STRONG = (-0.35, 0.12, 0.001, -0.0005, -0.015)
FOLDING = (-0.4, 0.05, 0.001, 0.001)
FISHEYES: dict[str, tuple[tuple[float, ...], float]] = {
    "150 degrees": ((-0.0121, 0.0043, -0.0021, 0.0003), 245.0),
    "wider than the image": ((0.02, -0.01, 0.003, -0.001), 150.0),
    "folding": ((-0.2, -0.01, 0.003, -0.001), 200.0),
}


def fisheye(distortion: tuple[float, ...], focal: float) -> Camera:
    return Camera(640, 480, (focal, focal * 0.99), (321.7, 238.4), distortion, mounting(0, 0, 0, 0), "fisheye")


def everywhere(step: float = 16) -> Array:
    u, v = np.meshgrid(np.arange(0.0, 640, step), np.arange(0.0, 480, step))
    return np.stack((u.ravel(), v.ravel()), axis=-1)


def there_and_back(lens: Camera, pixels: Array) -> tuple[Array, Array]:
    """How far off pixels come back, for those that have a ray, and the rays."""
    rays = lens.undistort(pixels)
    known = np.isfinite(rays).all(axis=1)
    back = lens.project(np.column_stack((rays[known], np.ones(known.sum()))))
    return np.abs(back - pixels[known]), rays


def test_undistort_is_exact_where_opencvs_iteration_is_not() -> None:
    lens = Camera(640, 480, (300.0, 300.0), (320.0, 240.0), STRONG, mounting(0, 0, 0, 0))
    pixels = everywhere()
    plain = np.asarray(cv2.undistortPoints(pixels.reshape(-1, 1, 2), lens.matrix, lens.coefficients), float)
    plain = plain.reshape(-1, 2)
    assert np.abs(lens.project(np.column_stack((plain, np.ones(len(plain))))) - pixels).max() > 1e-3
    off, _ = there_and_back(lens, pixels)
    assert off.max() < 1e-6


def test_past_its_reach_a_lens_has_no_rays() -> None:
    lens = Camera(640, 480, (400.0, 400.0), (320.0, 240.0), FOLDING, mounting(0, 0, 0, 0))
    off, rays = there_and_back(lens, everywhere())
    assert off.max() < 1e-6
    length = np.hypot(*rays.T)
    assert np.nanmax(length) < lens.reach
    # The radial part's own largest value, looked for on a fine grid: pixels well inside have rays, those outside none.
    r = np.linspace(0, 2, 20001)
    curve = r * (1 - 0.4 * r**2 + 0.05 * r**4)
    top = np.argmax(curve[r < 1.5])
    assert lens.reach == pytest.approx(r[top], abs=1e-3)
    from_axis = np.hypot(*(everywhere() - [320, 240]).T) / 400
    assert np.isfinite(length[from_axis < 0.97 * curve[top]]).all()
    assert np.isnan(length[from_axis > 1.03 * curve[top]]).all()


def test_undistort_does_not_take_the_other_ray_of_a_pixel() -> None:
    lens = Camera(640, 480, (400.0, 400.0), (320.0, 240.0), FOLDING, mounting(0, 0, 0, 0))
    inner = np.array([[0.5, 0.2], [-0.7, 0.6], [0.0, 0.95]])
    pixels = lens.project(np.column_stack((inner, np.ones(3))))
    np.testing.assert_allclose(lens.undistort(pixels), inner, atol=1e-9)


@pytest.mark.parametrize(("distortion", "focal"), FISHEYES.values(), ids=FISHEYES.keys())
def test_undistort_undoes_a_fisheye(distortion: tuple[float, ...], focal: float) -> None:
    lens = fisheye(distortion, focal)
    pixels = everywhere()
    off, rays = there_and_back(lens, pixels)
    assert off.max() < 1e-6
    # The model written out: which distorted angles are reached before it turns back or has come to 90 degrees.
    k = np.array(distortion)
    angle = np.linspace(0, np.pi / 2, 100001)
    curve = angle * (1 + k[0] * angle**2 + k[1] * angle**4 + k[2] * angle**6 + k[3] * angle**8)
    falling = np.flatnonzero(np.diff(curve) < 0)
    most = curve[falling[0]] if len(falling) else curve[-1]
    distorted = np.hypot(*((pixels - [321.7, 238.4]) / lens.focal).T)
    np.testing.assert_array_equal(np.isfinite(rays).all(axis=1), distorted < most)


def test_a_fisheyes_angles_are_the_model_written_out_and_its_axis_is_straight_ahead() -> None:
    k1, k2, k3, k4 = lens = (-0.0121, 0.0043, -0.0021, 0.0003)
    x, y, z = 0.4, -0.9, 0.5
    a = np.arctan2(np.hypot(x, y), z)
    d = a * (1 + k1 * a**2 + k2 * a**4 + k3 * a**6 + k4 * a**8) / np.hypot(x, y)
    (pixel,) = fisheye(lens, 245.0).project(np.array([[x, y, z]]))
    assert pixel == pytest.approx([245 * d * x + 321.7, 245 * 0.99 * d * y + 238.4])
    np.testing.assert_allclose(fisheye((0.1, 0.0, 0.0, 0.0), 200.0).undistort(np.array([[321.7, 238.4]])), [[0, 0]])


def test_a_fisheye_of_five_coefficients_and_an_unknown_model_are_refused() -> None:
    refused("camera distortion: found 5 coefficients, expected 4", fisheye((0.0,) * 5, 200.0).project, np.ones((1, 3)))
    lens = Camera(640, 480, (1.0, 1.0), (0.0, 0.0), (), np.eye(4), "mirror")  # pyright: ignore[reportArgumentType]
    refused("camera model: found 'mirror', expected pinhole or fisheye", lens.project, np.ones((1, 3)))


@pytest.mark.parametrize(("corner", "size", "binning"), [((0, 0), (640, 480), (2, 2)), ((40, 30), (320, 240), (1, 2))])
def test_a_part_of_rectified_images_is_the_rectified_part(
    corner: tuple[int, int], size: tuple[int, int], binning: tuple[int, int]
) -> None:
    raw = Camera(640, 480, (576.0, 570.0), (321.7, 238.4), (-0.2, 0.05, 0.0, 0.0, 0.0), mounting(0, 0, 0, 0))
    raw = replace(raw, projection=(560.0, 562.0, 318.0, 241.0))
    assert raw.rectified is not None
    one, other = raw.rectified.window(corner, size, binning), raw.window(corner, size, binning).rectified
    assert other is not None
    assert (one.width, one.height, one.focal, one.centre) == (other.width, other.height, other.focal, other.centre)
    assert one.focal == (560.0 / binning[0], 562.0 / binning[1])
