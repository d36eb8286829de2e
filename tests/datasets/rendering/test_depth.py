"""Depth images against rays followed one by one through solids, and their noise against what it is said to be."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from slabs import followed
from slamduel.core.se2 import Array
from slamduel.datasets.rendering.boxes import Box
from slamduel.datasets.rendering.cameras import CAMERAS
from slamduel.datasets.rendering.depth import FARTHEST, FOCAL_BASE, NEAR, NOISE_SD, STEPS, kinect, true_depth
from slamduel.datasets.rendering.disturbances import raised, rocked
from slamduel.datasets.rendering.lens import through
from slamduel.datasets.rendering.room import Room
from tiers import first_quick

BOXES = (
    Box(np.array([1.4, 0.3, 0.4]), (0.5, 0.4, 0.6)),
    Box(np.array([2.0, -0.8, -1.0]), (0.3, 0.5, 0.3)),
    Box(np.array([-1.2, 1.0, 2.0]), (0.4, 0.4, 0.7)),
)
ROOM = Room(6.0, 5.0, 2.5, 0.16, (), BOXES)
POSES = [(0.0, 0.0, 0.0), (0.4, -0.3, 0.6), (-0.3, 0.2, 2.4), (1.0, 1.2, -2.0)]


def views() -> list[Array]:
    rocking = rocked(0.03, -0.02)
    return [pose @ rocking @ CAMERAS["pinhole"].mounting for pose in raised(np.array(POSES))]


@pytest.mark.parametrize("lens", first_quick(["fisheye", "pinhole", "wide"]))
def test_each_pixel_is_as_deep_as_its_ray_goes(lens: str) -> None:
    camera = CAMERAS[lens]
    picked = np.random.default_rng(3).integers(0, [camera.width, camera.height], (300, 2))
    rays = camera.undistort(picked.astype(float))
    seen, on_boxes = np.isfinite(rays).all(axis=1), 0
    shifts = 1e-6 * np.array([[0, 0], [1, 1], [1, -1], [-1, 1], [-1, -1]])
    for pose in views():
        depth = true_depth(ROOM, through(camera), pose)
        on_boxes += int((depth < true_depth(replace(ROOM, boxes=()), through(camera), pose)).sum())
        found = depth[picked[:, 1], picked[:, 0]]
        assert (found[~seen] == 0).all()
        ahead = [np.column_stack((rays + shift, np.ones(300)))[seen] @ pose[:3, :3].T for shift in shifts]
        around = np.array([followed(ROOM, pose[:3, 3], one) for one in ahead])
        clear = np.ptp(around, axis=0) < 0.05  # else the edge of a box is within rounding of the ray
        assert clear.mean() > 0.98
        np.testing.assert_allclose(found[seen][clear], around[0][clear], rtol=3e-6)
    assert on_boxes > 10_000


def flat(z: float) -> NDArray[np.float32]:
    return np.full((240, 320), z, np.float32)


@pytest.mark.parametrize("z", [0.7, 1.3, 2.6, 4.2])
def test_noise_grows_with_the_square_of_the_depth(z: float) -> None:
    """The mean and spread of errors on a slightly slanted wall: neighbours err alike, some 76800 / 12.6 do not."""
    exact = flat(z) * np.linspace(0.97, 1.03, 320, dtype=np.float32)
    found = kinect(exact, np.random.default_rng(7)).astype(float)
    assert (found > 0).all()
    error = FOCAL_BASE / found - FOCAL_BASE / exact
    whole_mm = 1e-3 * FOCAL_BASE / z**2  # px of a millimetre
    expected = np.sqrt(NOISE_SD**2 + (1 / STEPS) ** 2 / 12 + whole_mm**2 / 12)
    independent = 76800 / 12.6
    assert error.std() == pytest.approx(expected, rel=4 / np.sqrt(2 * independent))
    assert abs(error.mean()) < 4 * expected / np.sqrt(independent)
    assert (found - exact).std() == pytest.approx(0.003 * z**2, rel=0.1)


def test_noise_is_alike_within_three_pixels_only() -> None:
    errors = kinect(flat(1.0), np.random.default_rng(8)).astype(float) - 1.0
    for apart in (1, 2, 3, 6, 12):
        alike = (errors[:, apart:] * errors[:, :-apart]).mean() / errors.var()
        # Two windows of standard deviation 1 px overlap as exp(-apart^2 / 4); steps take a tenth of it.
        assert alike == pytest.approx(np.exp(-(apart**2) / 4), abs=0.1)


def test_depths_are_whole_millimetres_of_whole_steps() -> None:
    found = kinect(flat(3.0), np.random.default_rng(9)).astype(float)
    mm = 1000 * found
    assert np.abs(mm - np.rint(mm)).max() < 1e-3
    steps = FOCAL_BASE / found * STEPS
    assert np.abs(steps - np.rint(steps)).max() < 0.5e-3 * FOCAL_BASE / 2.7**2 * STEPS + 1e-6
    assert 4 <= len(np.unique(found)) <= 12


def test_edges_and_what_is_too_near_or_too_far_have_no_depth() -> None:
    camera = CAMERAS["pinhole"]
    for pose in views():
        exact = true_depth(ROOM, through(camera), pose)
        found = kinect(exact, np.random.default_rng(1))
        outside = (exact < NEAR) | (exact > FARTHEST)
        assert (found[outside] == 0).all()
        left, right = exact[:, :-1], exact[:, 1:]
        v, u = np.nonzero(np.abs(left - right) > 0.1 * np.minimum(left, right))
        assert len(v) > 50
        for shift in (-1, 0, 1, 2):
            assert (found[v, np.clip(u + shift, 0, 639)] == 0).all()
        assert (found > 0).mean() > 0.5
        kept = found > 0
        assert (np.abs(found - exact)[kept] < 6 * 0.003 * exact[kept] ** 2 + 0.0005).all()


def test_without_noise_only_steps_are_left() -> None:
    found = kinect(flat(2.0), np.random.default_rng(1), noise=0.0)
    step = np.rint(FOCAL_BASE / 2.0 * STEPS) / STEPS
    assert found.min() == found.max() == pytest.approx(FOCAL_BASE / step, abs=6e-4)


def test_the_same_generator_measures_the_same() -> None:
    one, same, other = (kinect(flat(2.0), np.random.default_rng(seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert (one != other).mean() > 0.5
