"""The cameras of the rendered drive: what each pixel shows, against rays and outlines taken one by one."""

import cv2
import numpy as np
import pytest

from slamduel.core.se2 import Array
from slamduel.datasets.rendering.cameras import CAMERAS, MOUNTING
from slamduel.datasets.rendering.lattice import jitter, lattice
from slamduel.datasets.rendering.render import Renderer
from slamduel.datasets.rendering.room import Marker, Room
from slamduel.datasets.rendering.sensor import Sensor
from slamduel.datasets.rendering.surfaces import Surfaces
from slamduel.frontend.camera.camera import Camera
from tiers import first_quick

FLOOR = np.array([[0.8, -0.6, 0, 0], [0.6, 0.8, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
WALL = np.array([[0, 0, -1.0, 0], [-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])


def at(turned: Array, *place: float) -> Array:
    """T_world_marker: the orientation, moved there."""
    pose = turned.copy()
    pose[:3, 3] = place
    return pose


def even(grey: int) -> Surfaces:
    return Surfaces(np.full((20, 20), grey, np.uint8), 10)


def covered(camera: Camera, marker: Array, side: float) -> Array:
    """(height, width) the share of each pixel that the marker's sheet takes, seen by a robot at the origin."""
    room = Room(60.0, 60.0, 50.0, side, (Marker(0, marker),))
    shown = [Renderer(room, camera, "4X4_50", even(grey)).scene(MOUNTING) for grey in (0, 100)]
    return np.asarray(1 - (shown[1] - shown[0]) / 100, np.float64)


PLACES = [
    (at(WALL, 1.6, 0.25, 0.45), 0.16),
    (at(FLOOR, 1.5, -0.3, 0.0), 0.16),
    (at(WALL, 2.4, 0.9, 0.5), 0.3),  # at or over the left edge of most views
]


@pytest.mark.parametrize("name", first_quick(CAMERAS, 2))
@pytest.mark.parametrize(("marker", "side"), PLACES)
def test_a_sheet_covers_its_projected_outline(name: str, marker: Array, side: float) -> None:
    """Against the outline projected by `Camera.project`, point by point, and filled."""
    camera = CAMERAS[name]
    half, fine = side * 8 / 12, np.linspace(0, 1, 60, endpoint=False)[:, None]
    corners = half * np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0.0]])
    rim = np.vstack([a + fine * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)])
    inside = np.linalg.inv(MOUNTING) @ marker
    pixels = camera.project(rim @ inside[:3, :3].T + inside[:3, 3])
    zoom, shift = 16, 8
    canvas = np.zeros((camera.height * zoom, camera.width * zoom), np.uint8)
    points = np.round(((pixels + 0.5) * zoom - 0.5) * 2**shift).astype(np.int32)
    cv2.fillPoly(canvas, [points], 1, shift=shift)
    expected = canvas.reshape(camera.height, zoom, camera.width, zoom).mean(axis=(1, 3))
    found = covered(camera, marker, side)
    # cv2 fills the pixels of the outline too: half a fine pixel all around is too much.
    length = np.linalg.norm(np.diff(pixels, axis=0, append=pixels[:1]), axis=1).sum()
    assert expected.sum() > 50 or name == "pinhole"
    assert abs(found.sum() - expected.sum()) <= length / zoom + 0.1
    assert np.abs(found - expected).max() < 0.25
    v, u = np.mgrid[: camera.height, : camera.width]
    if found.sum() > 50:
        middles = [[(axis * share).sum() / share.sum() for axis in (u, v)] for share in (found, expected)]
        np.testing.assert_allclose(*middles, rtol=0, atol=0.05)


@pytest.mark.parametrize("name", first_quick(CAMERAS, 2))
@pytest.mark.parametrize(
    "marker", first_quick([at(WALL, 0.5, 0.3, 0.7), at(FLOOR, 0.3, 0.0, 0.0), at(FLOOR, 0.1, 0.1, 0.7)])
)
def test_a_sheet_that_reaches_behind_the_camera_is_cut(name: str, marker: Array) -> None:
    """A sheet of 4 m around and before the robot, against one ray a pixel."""
    camera = CAMERAS[name]
    found = covered(camera, marker, 3.0)
    v, u = np.mgrid[: camera.height, : camera.width]
    rays = camera.undistort(np.stack((u.ravel(), v.ravel()), axis=-1).astype(float))
    inside = np.linalg.inv(MOUNTING) @ marker
    x, y, w = np.linalg.solve(inside[:3, [0, 1, 3]], np.column_stack((rays, np.ones(len(rays)))).T)
    with np.errstate(invalid="ignore"):
        expected = ((w > 0) & (np.abs(x / w) < 2) & (np.abs(y / w) < 2)).reshape(u.shape)
    edge = cv2.morphologyEx(expected.astype(np.uint8), cv2.MORPH_GRADIENT, np.ones((5, 5), np.uint8)) > 0
    open_ = np.isfinite(rays).all(axis=1).reshape(u.shape)
    settled = ~edge & open_
    assert expected[settled].any()
    np.testing.assert_allclose(found[settled], expected[settled], atol=1e-5)


def test_pixels_without_a_ray_are_black() -> None:
    camera = CAMERAS["fisheye"]
    room = Room(6.0, 5.0, 2.5, 0.16, ())
    made = Renderer(room, camera, "4X4_50", even(200), blur=0.0, sensor=Sensor(0.0))
    image = made.frame(MOUNTING, np.random.default_rng(0))
    v, u = np.mgrid[:480, :640]
    rays = camera.undistort(np.stack((u.ravel(), v.ravel()), axis=-1).astype(float))
    blind = ~np.isfinite(rays).all(axis=1).reshape(480, 640)
    assert 0.005 < blind.mean() < 0.05
    assert blind[0, 0]
    assert not blind[240].any()
    assert (image[blind] == 0).all()
    assert (image[~blind] > 30).all()


@pytest.mark.parametrize("name", CAMERAS)
def test_every_camera_is_a_lens(name: str) -> None:
    """Pixels and rays are each other's over the whole frame, and to the right is to the right."""
    camera = CAMERAS[name]
    v, u = np.mgrid[0:480:7, 0:640:7].astype(float)
    rays = camera.undistort(np.stack((u.ravel(), v.ravel()), axis=-1))
    seen = np.isfinite(rays).all(axis=1)
    assert seen.all() or name == "fisheye"
    back = camera.project(np.column_stack((rays[seen], np.ones(seen.sum()))))
    np.testing.assert_allclose(back, np.stack((u.ravel(), v.ravel()), axis=-1)[seen], atol=1e-3)
    x, y = np.moveaxis(rays.reshape(*u.shape, 2), -1, 0)
    assert (np.diff(x, axis=1)[np.isfinite(np.diff(x, axis=1))] > 0).all()
    assert (np.diff(y, axis=0)[np.isfinite(np.diff(y, axis=0))] > 0).all()
    across = np.rad2deg(np.arctan(x[34, -1]) - np.arctan(x[34, 0]))
    assert across == pytest.approx({"pinhole": 58, "wide": 97, "tilted": 84, "fisheye": 150}[name], abs=4)


def test_vignetting() -> None:
    room = Room(6.0, 5.0, 2.5, 0.16, ())

    def ratio(name: str, vignetting: float) -> float:
        made = Renderer(room, CAMERAS[name], "4X4_50", even(200), blur=0.0, sensor=Sensor(0.0), vignetting=vignetting)
        image = made.frame(MOUNTING, np.random.default_rng(0))
        return image[470, 320] / image[240, 320]

    for name in ("pinhole", "wide"):
        camera = CAMERAS[name]
        (ray,) = camera.undistort(np.array([[320.0, 470.0]]))
        assert ratio(name, 0.0) == 1
        assert ratio(name, 1.0) == pytest.approx((1 + ray @ ray) ** -2, abs=0.01)
        assert ratio(name, 0.5) == pytest.approx(1 / (1 + ray @ ray), abs=0.01)
    assert ratio("fisheye", 1.0) > ratio("wide", 1.0) - 0.2


@pytest.mark.parametrize("count", [1, 4, 16, 25, 36])
def test_a_lattice_is_even_along_both_axes(count: int) -> None:
    points = lattice(count).astype(float)
    middles = (np.arange(count) + 0.5) / count - 0.5
    for axis in (0, 1):
        np.testing.assert_allclose(np.sort(points[:, axis]), middles, atol=1e-6)
    if count == 16:  # no two nearer than a square grid of ten in sixteen would have it
        apart = np.linalg.norm(points[:, None] - points[None], axis=2) + np.eye(count)
        assert apart.min() == pytest.approx(np.sqrt(10) / 16, abs=1e-6)


def test_jitter_is_even_along_rows_and_columns() -> None:
    shifts = jitter(40, 60).astype(float)
    assert np.abs(shifts).max() <= 0.5
    for axis in (1, 2):
        assert np.abs(shifts.mean(axis=axis)).max() < 0.06  # that of 40 random ones would reach 0.15
    assert np.abs(np.corrcoef(shifts.reshape(2, -1))[0, 1]) < 0.1


@pytest.mark.parametrize(("distance", "mean", "largest"), [(1.0, 1e-3, 5e-3), (2.0, 1e-3, 0.01), (4.0, 3e-3, 0.015)])
def test_edges_of_upright_squares_are_where_they_belong(distance: float, mean: float, largest: float) -> None:
    """The worst case for rays on a grid: edges along rows and columns, at places between the pixels; each by area."""
    focal, side = 576.0, 0.16
    camera = Camera(200, 150, (focal, focal), (99.5, 74.5), (), MOUNTING)
    pose = np.array([[0, 0, 1.0, 0], [-1, 0, 0, 0], [0, -1, 0, 1.25], [0, 0, 0, 1]])
    rng = np.random.default_rng(7)
    misses: list[float] = []
    for _ in range(40):
        du, dv = rng.uniform(-6, 6, 2)
        marker = at(WALL, distance, -du * distance / focal, 1.25 - dv * distance / focal)
        half = side / 2 / distance * focal
        shown = covered_from(camera, marker, side, pose)
        # The black border is a module wide: from half a module before an edge to half a module after it.
        for image, middle, other in ((shown, 99.5 + du, 74.5 + dv), (shown.T, 74.5 + dv, 99.5 + du)):
            strip = slice(int(other - 0.7 * half) + 1, int(other + 0.7 * half))
            for sign in (-1, 1):
                edge = middle + sign * half
                first, last = round(edge - half / 6), round(edge + half / 6)
                black = ((222 - image[strip, first : last + 1]) / (222 - 34)).sum(axis=1).mean()
                misses.append((last + 0.5 - black if sign < 0 else first - 0.5 + black) - edge)
    assert abs(np.mean(misses)) < mean
    assert np.abs(misses).max() < largest


def covered_from(camera: Camera, marker: Array, side: float, pose: Array) -> Array:
    """(height, width) the marker's grey levels, unblurred."""
    room = Room(60.0, 60.0, 50.0, side, (Marker(0, marker),))
    return Renderer(room, camera, "4X4_50", even(222)).scene(pose).astype(float)
