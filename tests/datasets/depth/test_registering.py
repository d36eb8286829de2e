"""Depth of one camera as the depth of another's pixels, against depths rendered from there."""

from pathlib import Path

import numpy as np
import pytest

from depth_views import CAMERA, ROOM, SIZE, png, robot_toml
from slamduel.core.se2 import Array
from slamduel.datasets.depth.open import open_depth
from slamduel.datasets.depth.registering import Registration
from slamduel.datasets.rendering.cameras import CAMERAS, MOUNTING
from slamduel.datasets.rendering.depth import true_depth
from slamduel.datasets.rendering.disturbances import raised
from slamduel.datasets.rendering.lens import through
from slamduel.frontend.camera.calibration import write_opencv
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.camera.mounting import from_rpy, mounting

BODY = mounting(0, 0, 0, 0)

BESIDE = BODY.T @ from_rpy((-0.002, 0.025, 0.001), (0.004, -0.003, 0.008))
"""T_camera_depth of a Kinect's kind."""

SOURCES = {
    "alike": Camera(*SIZE, (146.0, 145.0), (80.5, 58.0), (), np.eye(4)),
    "half as fine": Camera(80, 60, (73.0, 73.0), (39.5, 29.5), (), np.eye(4)),
    "finer, distorted": Camera(320, 240, (290.0, 289.0), (160.0, 121.0), (-0.2, 0.05, 0.001, 0.0, 0.0), np.eye(4)),
}

WORLD = raised(np.array([[0.2, -0.1, 0.2]]))[0] @ MOUNTING


def edges(depth: Array, apart: int) -> np.ndarray:
    """(h, w) which pixels have a jump in depth within some pixels."""
    found = np.zeros(depth.shape, bool)
    for du in range(-apart, apart + 1):
        for dv in range(-apart, apart + 1):
            found |= np.abs(np.roll(depth, (dv, du), (0, 1)) - depth) > 0.04 * depth
    found[:apart], found[-apart:], found[:, :apart], found[:, -apart:] = True, True, True, True
    return found


@pytest.mark.parametrize("name", SOURCES)
def test_registered_depth_is_that_of_the_other_cameras_pixels(name: str) -> None:
    source = SOURCES[name]
    measured = true_depth(ROOM, through(source), WORLD @ BESIDE)
    found = Registration(source, CAMERA, BESIDE).registered(measured)
    exact = true_depth(ROOM, through(CAMERA), WORLD)
    inside = ~edges(exact.astype(float), 4)
    both = inside & (found > 0)
    # A depth is of a place up to half a pixel of either camera away, where the floor is deeper or nearer.
    slope = np.maximum(*(np.abs(np.gradient(exact.astype(float), axis=axis)) for axis in (0, 1)))
    pixels = 0.55 * (1 + CAMERA.focal[0] / source.focal[0])
    assert (np.abs(found - exact)[both] <= 2 * pixels * slope[both] + 1e-4).all()
    left = np.abs(np.arange(SIZE[0]) - 79.5) < 70  # what the other camera sees, too
    assert (found[inside & left & (np.arange(SIZE[1]) < 110)[:, None]] > 0).mean() > 0.995
    unmoved = CAMERA if name != "alike" else source
    if name == "alike":
        same = Registration(unmoved, unmoved, np.eye(4)).registered(measured)
        assert (same[measured > 0] <= measured[measured > 0] + 1e-6).all()
        assert (same == measured).mean() > 0.5


def test_the_nearest_of_two_surfaces_wins() -> None:
    """A near square hides the wall behind it, from a camera to the side as well."""
    wall = np.full(SIZE[::-1], 3.0, np.float32)
    wall[40:80, 60:100] = 1.0
    found = Registration(CAMERA, CAMERA, BODY.T @ from_rpy((0, 0.1, 0), (0, 0, 0))).registered(wall)
    # Moved by 0.1 m, the square is seen 14.4 px to the left of where it was, and the wall 4.8 px.
    assert np.abs(found[60, 48:83] - 1.0).max() < 1e-6
    assert found[60, 60 - 18] == pytest.approx(3.0)
    shadow = found[60, 86:95]  # seen by one camera only
    assert (shadow == 0).all()
    assert not found[:, -4:].any()


def test_pixels_without_depth_or_outside_stay_empty() -> None:
    holes = np.zeros(SIZE[::-1], np.float32)
    registration = Registration(CAMERA, CAMERA, np.eye(4))
    assert not registration.registered(holes).any()
    holes[10, 20] = 2.0
    found = registration.registered(holes)
    assert found[10, 20] == 2.0
    assert (found > 0).sum() <= 4
    behind = np.eye(4)
    behind[2, 3] = -5.0
    assert not Registration(CAMERA, CAMERA, behind).registered(holes + 1).any()


def test_beyond_a_lens_nothing_is_drawn() -> None:
    """Points outside of the field of view of a lens that turns back there would fall into its image."""
    target = CAMERAS["fisheye"]
    source = Camera(*SIZE, (30.0, 30.0), (79.5, 59.5), (), np.eye(4))
    turned = BODY.T @ from_rpy((0, 0, 0), (0, 0, np.pi / 2))
    found = Registration(source, target, turned).registered(np.full(SIZE[::-1], 2.0, np.float32))
    rays = target.rays
    drawn = found > 0
    assert drawn.any()
    # Seen from the target everything is to its left, and covers a few of its pixels.
    assert (rays[drawn][:, 0] < -0.25).all()


def test_a_folder_of_unregistered_depth_is_registered_on_reading(tmp_path: Path) -> None:
    source = SOURCES["half as fine"]
    measured = true_depth(ROOM, through(source), WORLD @ BESIDE)
    pose = "pose = { xyz = [-0.002, 0.025, 0.001], rpy = [0.004, -0.003, 0.008] }"
    robot_toml(tmp_path, f'calibration = "ir.yaml"\n{pose}')
    write_opencv(tmp_path / "ir.yaml", source)
    (tmp_path / "a.png").write_bytes(png(np.full(SIZE[::-1], 90, np.uint8)))
    (tmp_path / "b.png").write_bytes(png(np.rint(1000 * measured).astype(np.uint16)))
    (tmp_path / "frames.csv").write_text("image,depth,t\na.png,b.png,0.5\n")
    found = open_depth(tmp_path)
    (frame,) = found.recording.frames
    expected = Registration(source, CAMERA, BESIDE).registered((np.rint(1000 * measured) / 1000).astype(np.float32))
    assert frame.depth.shape == SIZE[::-1]
    np.testing.assert_allclose(frame.depth, expected, atol=2e-3)
    assert (frame.depth == expected).mean() > 0.98
    assert found.recording.depth_camera is not None
    assert found.recording.notes["depth_registered"] == "on reading"


@pytest.mark.parametrize("coefficients", [0, 4, 5, 8])
def test_the_compiled_projection_is_opencvs(coefficients: int) -> None:
    """One depth at a time, at random places: it covers the pixel that OpenCV projects it to."""
    rng = np.random.default_rng(coefficients)
    lens = (-0.21, 0.06, 0.002, -0.003, 0.01, 0.02, -0.01, 0.005)[:coefficients]
    target = Camera(*SIZE, (140.0, 150.0), (81.0, 57.0), lens, MOUNTING)
    registration = Registration(CAMERA, target, BESIDE)
    checked = 0
    for u, v in rng.integers([10, 10], [SIZE[0] - 10, SIZE[1] - 10], (40, 2)):
        z = rng.uniform(0.6, 4.0)
        depth = np.zeros(SIZE[::-1], np.float32)
        depth[v, u] = z
        point = BESIDE[:3, :3] @ ([*(CAMERA.rays[v, u] * z), z]) + BESIDE[:3, 3]
        ((column, row),) = target.project(point[None])
        found = registration.registered(depth)
        at = np.argwhere(found > 0)
        if not (3 < column < SIZE[0] - 4 and 3 < row < SIZE[1] - 4):
            continue
        assert (np.abs(at - [row, column]) <= 0.5 * 1.1 * 150 / 144 * 1.1).all()
        assert 1 <= len(at) <= 4
        np.testing.assert_allclose(found[found > 0], point[2], rtol=1e-6)
        general = np.zeros_like(found)
        registration.draw_by_opencv(depth, general)
        np.testing.assert_array_equal(general, found)
        checked += 1
    assert checked > 25
