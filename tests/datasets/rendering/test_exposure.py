"""What differs from frame to frame: streaks against edges integrated over time, brightness, shadows, covers."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from slamduel.core.se2 import Array
from slamduel.datasets.rendering.cameras import CAMERAS
from slamduel.datasets.rendering.disturbances import Disturbances, raised, rocked, take, views
from slamduel.datasets.rendering.render import Conditions, Cover, Renderer
from slamduel.datasets.rendering.room import Marker, Room
from slamduel.datasets.rendering.sensor import Sensor
from slamduel.datasets.rendering.surfaces import Surfaces
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.camera.mounting import mounting
from slamduel.frontend.markers.aruco import Image
from tiers import first_quick

LEVEL = Camera(320, 240, (500.0, 500.0), (159.5, 119.5), (), mounting(0.0, 0.0, 0.5, 0.0))
PLANE = np.array([[0, 0, -1.0, 2.0], [-1, 0, 0, 0], [0, 1, 0, 0.5], [0, 0, 0, 1]])
T = np.array([0.0, 0.5, 1.0])


def renderer(
    *markers: Marker, camera: Camera = LEVEL, grey: int = 0, grain: float = 0.0, exposure: float = 0.0
) -> Renderer:
    room = Room(60.0, 60.0, 50.0, 0.8, markers)
    plain = Surfaces(np.full((20, 20), grey, np.uint8), 10)
    return Renderer(room, camera, "4X4_50", plain, blur=0.0, sensor=Sensor(grain, exposure=exposure), vignetting=0.0)


def turning(rate: float) -> Callable[[Array], Array]:
    return lambda t: np.stack((0 * t, 0 * t, rate * t), axis=-1)


def sideways(speed: float) -> Callable[[Array], Array]:
    """To the left, as no wheeled robot goes: the picture of a plane ahead shifts evenly."""
    return lambda t: np.stack((0 * t, speed * t, 0 * t), axis=-1)


@pytest.mark.parametrize("t", [0.0, 0.013])
@pytest.mark.parametrize("shift", first_quick([8.5, 3.0, 20.0]))
def test_an_edge_is_a_ramp_about_the_middle_of_the_exposure(shift: float, t: float) -> None:
    """The left rim of a sheet that moves by `shift` px while the shutter is open."""
    exposure = 0.02
    speed = shift / exposure * 2.0 / 500
    made = renderer(Marker(0, PLANE), exposure=exposure)
    poses = views(made, sideways(speed), t, made.camera.mounting)
    assert len(poses) - 1 == pytest.approx(shift, abs=1)
    row = np.mean([made.scene(pose) for pose in poses], axis=0)[110:130].mean(axis=0) / 222
    middle = 159.5 - 0.8 * 8 / 12 / 2.0 * 500 + speed * t / 2.0 * 500
    times = (np.arange(2000) + 0.5) / 2000 - 0.5
    u = np.arange(320)[:, None]
    expected = np.clip(u + 0.5 - (middle + shift * times), 0, 1).mean(axis=1)
    part = slice(max(int(middle - shift), 0), int(middle + shift / 2 + 8))
    # Its corners are cut in parts: by an eighth of one at the most.
    np.testing.assert_allclose(row[part], expected[part], atol=1 / (8 * len(poses)) + 0.003)
    assert np.interp(0.5, row[part], u[part, 0]) == pytest.approx(middle, abs=0.05)


def test_a_frame_is_the_mean_of_its_moments() -> None:
    made = renderer(Marker(0, PLANE), exposure=0.03)
    poses = views(made, turning(0.5), 0.1, made.camera.mounting)
    assert len(poses) == pytest.approx(0.015 * 500 * 1.1 + 1, abs=1)
    expected = np.mean([made.scene(pose) for pose in poses], axis=0)
    np.testing.assert_allclose(made.frame(poses, np.random.default_rng(0)), expected, atol=0.51)
    noisy = renderer(grey=128, grain=4.0).frame(poses, np.random.default_rng(0))
    assert noisy[:20, :].astype(float).std() == pytest.approx(4, rel=0.05)  # noise is of the frame, not of each moment


def test_a_robot_at_rest_has_one_moment() -> None:
    assert len(views(renderer(exposure=0.1), turning(0.0), 0.0, LEVEL.mounting)) == 1


@pytest.mark.parametrize("name", CAMERAS)
def test_streaks_of_every_lens_are_counted_sanely(name: str) -> None:
    """Turning by 0.02 rad moves what is ahead by 0.02 f px, and nothing by ever so much."""
    camera = CAMERAS[name]
    room = Room(6.0, 5.0, 2.5, 0.16, tuple(Marker(i, PLANE) for i in range(3)))
    plain = Surfaces(np.full((20, 20), 9, np.uint8), 10)
    made = Renderer(room, camera, "4X4_50", plain, sensor=Sensor(exposure=0.02))
    moments = len(views(made, turning(1.0), 0.0, made.camera.mounting))
    assert 0.8 * 0.02 * camera.focal[0] < moments < 2.5 * 0.02 * camera.focal[0]


def pictures(made: Renderer, seed: int = 0, t: Array = T, **changes: Any) -> list[Image]:
    frames = take([made], turning(0.1), t, Disturbances(**changes), np.random.default_rng(seed))
    return [frame.image for frame in frames if frame.image is not None]


def test_a_seed_is_a_film() -> None:
    made = renderer(Marker(0, PLANE), grey=100, grain=2.0, exposure=0.02)
    changes: dict[str, Any] = {"gain_drift": 0.3, "shadow": 0.5, "occlusion": 0.5}
    one, same, other = (pictures(made, seed, **changes) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert (np.array(one) != other).mean() > 0.5
    frames = list(take([made], turning(0.1), T, Disturbances(), np.random.default_rng(0)))
    assert [frame.t for frame in frames] == T.tolist()


def test_brightness_drifts_smoothly_and_ends_at_white() -> None:
    t = np.arange(0.0, 400.0, 1.0)
    tiny = Camera(8, 8, (9.0, 9.0), (3.5, 3.5), (), mounting(0.0, 0.0, 0.5, 0.0))
    made = renderer(camera=tiny, grey=90)
    levels = np.array([image.mean() for image in pictures(made, t=t, gain_drift=0.2)])
    swing = np.log(levels / 90)
    assert swing.std() == pytest.approx(0.2, rel=0.15)
    assert abs(swing.mean()) < 0.03
    fine = np.array([image.mean() for image in pictures(made, t=np.arange(0.0, 20.0, 0.1), gain_drift=0.2)])
    assert np.abs(np.diff(np.log(fine))).max() < 0.06
    white = np.array(pictures(made, t=t, gain_drift=1.0))
    assert white.max() == 255
    assert (white == 255).mean() > 0.05


def test_light_and_cover() -> None:
    made = renderer(Marker(0, PLANE), grey=100)
    pose = raised(np.zeros((1, 3)))[0] @ LEVEL.mounting
    plain = made.frame(pose, np.random.default_rng(0)).astype(float)
    bright = made.frame(pose, np.random.default_rng(0), Conditions(light=2.0))
    np.testing.assert_allclose(bright, np.minimum(2 * plain, 255), atol=1.01)
    share = np.zeros((240, 320), np.float32)
    share[:, :50], share[:, 50:60] = 1.0, 0.5
    hidden = made.frame(pose, np.random.default_rng(0), Conditions(cover=Cover(share, 40.0)))
    assert (hidden[:, :50] == 40).all()
    np.testing.assert_allclose(hidden[:, 50:60], (plain[:, 50:60] + 40) / 2, atol=1.01)
    np.testing.assert_array_equal(hidden[:, 60:], plain[:, 60:])


def test_shadows_take_what_they_say() -> None:
    made = renderer(grey=200)
    for image in pictures(made, shadow=0.6):
        levels = image.astype(float) / 200
        assert 0.39 < levels.min() < 0.6
        assert levels.max() > 0.6
        assert np.abs(np.diff(levels, axis=1)).max() < 0.02  # its edge is soft


def test_a_share_of_the_frames_is_covered() -> None:
    made = renderer(grey=200)
    t = np.arange(120.0)
    covered = np.array([(image < 190).mean() for image in pictures(made, t=t, occlusion=0.4)])
    assert (covered > 0.005).mean() == pytest.approx(0.4, abs=4 * np.sqrt(0.24 / 120))
    assert covered.max() < 0.8
    assert all((image == 200).all() for image in pictures(made, t=t[:3]))


def test_a_body_that_leans_forward_sees_what_is_ahead_higher_up() -> None:
    """Small angles: by the pitch, things go up f * pitch px; by the roll to the right they turn to the left."""
    point = np.array([5.0, 0.0, 0.0, 1.0])  # ahead of a robot whose camera is at its origin, so that nothing moves
    ahead = mounting(0, 0, 0, 0)

    def seen(pitch: float, roll: float, at: Array) -> Array:
        x, y, z, _ = np.linalg.inv(rocked(pitch, roll) @ ahead) @ at
        return np.array([x / z, y / z])

    np.testing.assert_allclose(seen(0.01, 0.0, point), [0, -np.tan(0.01)], atol=1e-12)
    left = np.array([5.0, 1.0, 0.0, 1.0])
    np.testing.assert_allclose(seen(0.0, 0.01, left), [-0.2 * np.cos(0.01), 0.2 * np.sin(0.01)], atol=1e-12)


def test_rocking_is_as_large_as_it_is_said() -> None:
    made = renderer(Marker(0, PLANE))
    t: Array = np.arange(300) / 10.0
    leans: list[Array] = []

    def note(pose: Array, *_: object) -> Image:
        leans.append(pose)
        return np.zeros((1, 1), np.uint8)

    object.__setattr__(made, "frame", note)
    list(take([made], lambda at: np.zeros((len(at), 3)), t, Disturbances(sway=0.03), np.random.default_rng(3)))
    bodies = np.array(leans) @ np.linalg.inv(made.camera.mounting)
    pitch, roll = -bodies[:, 2, 0], bodies[:, 2, 1]
    # 300 draws know a standard deviation to 1 / sqrt(600), 4 %.
    assert pitch.std() == pytest.approx(0.03, rel=0.16)
    assert roll.std() == pytest.approx(0.03, rel=0.16)
    assert abs(np.corrcoef(pitch, roll)[0, 1]) < 4 / np.sqrt(300)


@pytest.mark.parametrize("exposure", [0.0, 0.01])
def test_a_rolling_shutter_slants_an_upright_edge(exposure: float) -> None:
    """The left rim of a sheet that moves by 24 px while the frame is read, and stays where it is in the middle row."""
    readout, speed = 0.04, 24 / 0.04 * 2.0 / 500
    made = renderer(Marker(0, PLANE))
    made = replace(made, sensor=Sensor(0.0, exposure=exposure, readout=readout))
    (frame,) = take([made], sideways(speed), np.zeros(1), Disturbances(), np.random.default_rng(0))
    middle = 159.5 - 0.8 * 8 / 12 / 2.0 * 500
    for row in range(5, 240, 10):  # the middle rows of the bands
        found = np.interp(0.5 * 222, frame.image[row, :50].astype(float), np.arange(50))
        assert found == pytest.approx(middle + 24 * ((row + 0.5) / 240 - 0.5), abs=0.15)


def test_each_band_of_a_rolling_frame_is_of_its_own_pose() -> None:
    made = replace(renderer(Marker(0, PLANE), grey=100), sensor=Sensor(0.0, readout=0.04))
    poses = views(made, turning(0.8), 0.1, made.camera.mounting)
    assert poses.shape == (24, 1, 4, 4)
    light = made.light(poses)
    for k in (0, 7, 12, 23):
        whole = made.scene(poses[k, 0])
        band = slice(10 * k, 10 * k + 10)
        np.testing.assert_allclose(light[band], whole[band], atol=6)  # of edges' samples
        assert np.abs(light[10 * k : 10 * k + 10] - whole[10 * k : 10 * k + 10]).mean() < 0.1


def test_colours_are_imaged_at_different_sizes_about_the_centre() -> None:
    """Both rims of a sheet: from the principal point red is farther than green, and blue nearer, by the share.

    The mean of the three by their shares in grey is where a camera without aberration has it.
    """
    pose = raised(np.zeros((1, 3)))[0] @ LEVEL.mounting
    made = renderer(Marker(0, PLANE))
    green = made.light(pose)
    dispersed = replace(made, sensor=Sensor(0.0, aberration=0.01)).light(pose)
    assert dispersed.shape == (3, 240, 320)
    mean = 0.299 * 1.01 + 0.587 + 0.114 * 0.99
    for light, scale in zip((*dispersed, green), (1.01 / mean, 1 / mean, 0.99 / mean, 1.0), strict=True):
        profile = light[100:140].mean(axis=0)
        left = np.interp(0.5 * 222, profile[:50], np.arange(50))
        right = 270 + np.interp(-0.5 * 222, -profile[270:], np.arange(50))
        half = 0.8 * 8 / 12 / 2.0 * 500 * scale
        assert (left, right) == (pytest.approx(159.5 - half, abs=0.1), pytest.approx(159.5 + half, abs=0.1))
