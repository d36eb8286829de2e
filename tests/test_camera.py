"""The pinhole camera, its lens and its mounting."""

import numpy as np
import pytest

from slamduel.frontend.camera import Camera, mounting
from slamduel.frontend.errors import InputError

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


def test_nothing_gives_nothing() -> None:
    assert camera(()).undistort(np.zeros((0, 2))).shape == (0, 2)
    assert camera(()).project(np.zeros((0, 3))).shape == (0, 2)


@pytest.mark.parametrize("length", [1, 3, 6, 13, 15])
def test_a_lens_of_unknown_length_is_refused(length: int) -> None:
    with pytest.raises(InputError, match=f"camera distortion: found {length} coefficients, expected one of 0, 4, 5"):
        camera((0.0,) * length).project(np.ones((1, 3)))


def test_mounting_looks_ahead_and_down() -> None:
    pose = mounting(forward=0.1, left=0.2, up=0.7, tilt=0.3)
    np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-15)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1)
    np.testing.assert_allclose(pose @ [0, 0, 1, 0], [np.cos(0.3), 0, -np.sin(0.3), 0])  # where it looks
    np.testing.assert_allclose(
        pose @ [1, 0, 0, 0], [0, -1, 0, 0], atol=1e-15
    )  # right in the image is the robot's right
    np.testing.assert_allclose(pose @ [0, 0, 0, 1], [0.1, 0.2, 0.7, 1])


def test_mounting_of_the_documents_robot() -> None:
    published = [[0, 0.258819, 0.965926, 0.18], [-1, 0, 0, -0.1], [0, -0.965926, 0.258819, 0], [0, 0, 0, 1]]
    np.testing.assert_allclose(mounting(0.18, -0.1, 0, np.deg2rad(-15)), published, atol=1e-6)
