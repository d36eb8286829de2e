"""Rendered frames against rays followed one by one, against projected corners, and against the detector."""

from dataclasses import replace

import numpy as np
import pytest

from slamduel.core.se2 import Array
from slamduel.datasets.rendering import surfaces as painting
from slamduel.datasets.rendering.render import Renderer
from slamduel.datasets.rendering.room import Marker, Room, furnish, wall_point
from slamduel.datasets.rendering.sensor import Sensor
from slamduel.datasets.rendering.sheet import INK, PAPER
from slamduel.datasets.rendering.surfaces import Surfaces, paint
from slamduel.frontend.camera.camera import Camera
from slamduel.frontend.camera.mounting import mounting
from slamduel.frontend.markers.aruco import Detector, Image, square
from slamduel.frontend.markers.markers import Markers, find

LENS = (-0.208, 0.062, 0.0008, -0.0006, 0.0)
CAMERA = Camera(640, 480, (576.4, 575.8), (321.7, 238.4), LENS, mounting(0.12, 0.0, 0.75, 0.35))
SIDE = 0.16
GREY = 128


def facing(x: float, y: float, z: float, lean: float = 0.0) -> Array:
    """T_world_marker of a marker at (x, y, z) that looks towards -x, its normal `lean` rad to the side."""
    c, s = np.cos(lean), np.sin(lean)
    return np.array([[s, 0, -c, x], [-c, 0, -s, y], [0, 1, 0, z], [0, 0, 0, 1]])


def flat(x: float, y: float, heading: float) -> Array:
    """T_world_marker of a marker on the floor."""
    c, s = np.cos(heading), np.sin(heading)
    return np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, 0], [0, 0, 0, 1]])


def renderer(
    *poses: Array, camera: Camera = CAMERA, plain: bool = True, blur: float = 0.6, grain: float = 2.0
) -> Renderer:
    room = Room(6.0, 5.0, 2.5, SIDE, tuple(Marker(i, pose) for i, pose in enumerate(poses)))
    surfaces = Surfaces(np.full((1200, 3520), GREY, np.uint8), 800) if plain else paint(room, np.random.default_rng(1))
    return Renderer(room, camera, "4X4_50", surfaces, blur=blur, sensor=Sensor(grain))


def robot(x: float = 0.0, y: float = 0.0, heading: float = 0.0) -> Array:
    """T_world_camera of the camera on a robot there."""
    return flat(x, y, heading) @ CAMERA.mounting


def corners(pose: Array, marker: Array) -> Array:
    """(4, 2) px, where a marker's true corners are seen."""
    inside = np.linalg.inv(pose) @ marker
    return CAMERA.project(square(SIDE) @ inside[:3, :3].T + inside[:3, 3])


def plain_frame(made: Renderer, pose: Array) -> Image:
    return made.frame(pose, np.random.default_rng(0))


VIEWS = [facing(1.4, 0.1, 0.5), facing(2.4, -0.6, 0.4, lean=0.7), flat(1.3, 0.3, 0.4), flat(1.9, -0.5, 2.0)]
VIEWS.append(facing(1.3, -0.4, 0.65, lean=-0.5))


@pytest.mark.parametrize("marker", VIEWS)
def test_the_detector_finds_the_corners_where_they_are(marker: Array) -> None:
    made = renderer(marker, plain=False)
    found, _ = Detector(Markers("4X4_50", SIDE), CAMERA).detect(plain_frame(made, robot()))
    assert [s.id for s in found] == [0]
    expected = corners(robot(), marker)
    # Each corner comes out a little inside the square, the four together hardly moved.
    np.testing.assert_allclose(found[0].corners, expected, atol=0.9)
    np.testing.assert_allclose((found[0].corners - expected).mean(axis=0), 0, atol=0.2)


@pytest.mark.parametrize("marker", VIEWS[:4])
def test_every_pixel_is_the_mean_of_its_rays(marker: Array) -> None:
    """The grey of pixels around the marker against 15 x 15 rays each, every one taken through the lens by itself."""
    made = renderer(marker, blur=1e-3, grain=0.0)
    image = plain_frame(made, robot())
    inside = np.linalg.inv(robot()) @ marker
    box = corners(robot(), marker)
    (u0, v0), (u1, v1) = box.min(axis=0).astype(int) - 12, box.max(axis=0).astype(int) + 13
    picked = np.random.default_rng(2).integers([u0, v0], [u1, v1], (400, 2))
    offsets = (np.arange(15) + 0.5) / 15 - 0.5
    du, dv = np.meshgrid(offsets, offsets)
    fine = picked[:, None] + np.stack((du.ravel(), dv.ravel()), axis=-1)
    rays = CAMERA.undistort(fine.reshape(-1, 2))
    on_plane = np.linalg.solve(inside[:3, [0, 1, 3]], np.column_stack((rays, np.ones(len(rays)))).T)
    a, b = on_plane[0] / on_plane[2] / SIDE * 6 + 3, 3 - on_plane[1] / on_plane[2] / SIDE * 6
    bits = np.asarray(find("4X4_50").generateImageMarker(0, 6))
    column, row = np.floor(a).astype(int), np.floor(b).astype(int)
    on_square = (column >= 0) & (column < 6) & (row >= 0) & (row < 6)
    on_sheet = (a >= -1) & (a < 7) & (b >= -1) & (b < 7)
    black = on_square & (bits[np.clip(row, 0, 5), np.clip(column, 0, 5)] == 0)
    grey = np.where(on_sheet, np.where(black, INK, PAPER), GREY).reshape(400, -1).mean(axis=1)
    middle = CAMERA.undistort(picked.astype(float))
    expected = grey * (1 + (middle**2).sum(axis=1)) ** -0.8
    difference = image[picked[:, 1], picked[:, 0]] - expected
    # 16 rays, each in a strip of its own, miss the share on either side of an edge by little; on the mean they do not.
    assert np.abs(difference).max() < (PAPER - INK) / 10 + 1
    assert np.abs(difference.mean()) < 0.3


def test_a_marker_turned_away_or_behind_is_not_seen() -> None:
    away = facing(1.4, 0.1, 0.5, lean=np.pi)
    empty = plain_frame(renderer(), robot())
    np.testing.assert_array_equal(plain_frame(renderer(away), robot()), empty)
    behind = facing(-1.4, 0.1, 1.25, lean=np.pi)  # facing the camera, and where its axis points backwards
    np.testing.assert_array_equal(plain_frame(renderer(behind), robot()), empty)
    assert (plain_frame(renderer(VIEWS[0]), robot()) != empty).any()


def test_a_near_marker_hides_a_far_one() -> None:
    near, far = facing(1.0, 0.05, 0.55), facing(1.8, 0.1, 0.45)
    for order in ((near, far), (far, near)):
        room = renderer(*order).room
        named = replace(room, markers=tuple(Marker(3 if pose is near else 9, pose) for pose in order))
        image = plain_frame(replace(renderer(), room=named), robot())
        found, _ = Detector(Markers("4X4_50", SIDE), CAMERA).detect(image)
        assert [s.id for s in found] == [3]


def test_a_marker_at_the_edge_of_the_view_is_cut() -> None:
    empty = plain_frame(renderer(), robot())
    shown = 0
    for y in np.linspace(0, 1.2, 9):  # out of the view, to the left
        changed = plain_frame(renderer(facing(1.5, y, 0.5)), robot()) != empty
        columns = np.flatnonzero(changed.any(axis=0))
        if len(columns):
            shown += 1
            assert np.diff(columns).max() == 1
            ends = corners(robot(), facing(1.5, y, 0.5))[:, 0]
            assert columns[0] == pytest.approx(max(ends.min() - 9, 0), abs=6)
    assert 0 < shown < 9


def test_driving_over_a_marker_never_paints_nonsense() -> None:
    """Half of the sheet is behind the lens, where a projection would turn it inside out."""
    empty = plain_frame(renderer(), robot())
    for x in np.linspace(-0.5, 0.4, 7):
        changed = plain_frame(renderer(flat(x, 0.0, 0.3)), robot()) != empty
        assert not changed[:400].any()


def test_the_walls_are_where_the_world_says() -> None:
    """A grey ramp along the walls and up them is seen where `wall_point` puts it."""
    room = Room(6.0, 5.0, 2.5, SIDE, ())
    density, perimeter = 160, 22.0
    along = np.arange(3520) / density
    up = np.arange(399, -1, -1)[:, None] / density
    walls = 40 + 120 * np.abs(along / perimeter - 0.5) + 30 * up
    ramp = Surfaces(np.vstack((np.full((800, 3520), 250.0), walls)).astype(np.uint8), 800)
    made = Renderer(room, CAMERA, "4X4_50", ramp, sensor=Sensor(0.0))
    checked = 0
    for heading in np.arange(-3, 3, 0.5):
        pose = robot(0.4, -0.3, heading)
        image = plain_frame(made, pose)
        for u in np.linspace(0.4, 21.6, 54):
            for z in (0.2, 0.5):
                (x, y), _ = wall_point(room, np.asarray(u))
                seen = np.linalg.inv(pose) @ [x, y, z, 1.0]
                if seen[2] < 0.5 or np.abs(seen[:2] / seen[2]).max() > 0.6:
                    continue
                ((column, row),) = np.round(CAMERA.project(seen[None, :3])).astype(int)
                if 3 < column < 636 and 3 < row < 476 and min(abs(u - np.array([6.0, 11.0, 17.0]))) > 0.3:
                    vignette = (1 + (seen[:2] ** 2).sum() / seen[2] ** 2) ** -0.8
                    expected = (40 + 120 * abs(u / perimeter - 0.5) + 30 * z) * vignette
                    assert image[row, column] == pytest.approx(expected, abs=2)
                    checked += 1
    assert checked > 100


def test_the_same_generator_takes_the_same_picture() -> None:
    made = renderer(*VIEWS, plain=False)
    one, same, other = (made.frame(robot(), np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert one.dtype == np.uint8
    assert one.shape == (480, 640)
    np.testing.assert_array_equal(one, same)
    difference = one.astype(float) - other
    assert difference.std() == pytest.approx(2 * np.sqrt(2), rel=0.03)  # two grey levels of noise in each


@pytest.mark.parametrize("size", [(6.0, 5.0, 2.5), (1.3, 0.9, 0.2)])
def test_doors_and_sockets_are_painted_as_far_as_they_show(
    size: tuple[float, float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """To the last grey level as if each were painted all over the walls; on small ones some are not there at all."""
    room = Room(*size, SIDE, ())
    painted = paint(room, np.random.default_rng(1)).image
    monkeypatch.setattr(painting, "FADED", 10_000)
    np.testing.assert_array_equal(painted, paint(room, np.random.default_rng(1)).image)


@pytest.mark.parametrize("markers", [2, 3, 24, 50])
def test_a_furnished_room(markers: int) -> None:
    room = furnish(6.0, 5.0, 2.5, SIDE, markers, np.random.default_rng(markers))
    assert [marker.id for marker in room.markers] == list(range(markers))
    xy = room.landmarks.xy
    assert (np.abs(xy) <= [3.0, 2.5]).all()
    gaps = np.linalg.norm(xy[:, None] - xy[None], axis=2) + 10 * np.eye(markers)
    assert gaps.min() > SIDE * 8 / 6  # a sheet with its white rim
    for marker in room.markers:
        turn, place = marker.pose[:3, :3], marker.pose[:3, 3]
        np.testing.assert_allclose(turn.T @ turn, np.eye(3), atol=1e-12)
        assert np.linalg.det(turn) == pytest.approx(1)
        if marker.id < markers // 2:
            assert place[2] == 0
            np.testing.assert_allclose(turn[:, 2], [0, 0, 1])
        else:
            assert np.max(np.abs(place[:2]) / [3.0, 2.5]) == pytest.approx(1)
            np.testing.assert_allclose(turn[:, 1], [0, 0, 1])
            assert (np.abs(place[:2] + 0.1 * turn[:2, 2]) < [3.0, 2.5]).all()  # it looks into the room
