"""Boxes in the room: where they stand, what they hide, and the markers on them."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from refusals import refused
from slabs import met
from slamduel.core.se2 import Array
from slamduel.datasets.rendering.boxes import Box, place_boxes
from slamduel.datasets.rendering.cameras import CAMERAS
from slamduel.datasets.rendering.disturbances import raised
from slamduel.datasets.rendering.render import Renderer
from slamduel.datasets.rendering.room import Marker, Room, furnish, furnish_with_boxes
from slamduel.datasets.rendering.sheet import INK, PAPER
from slamduel.datasets.rendering.surfaces import Surfaces, paint
from slamduel.datasets.worlds.rendered_world import BERTH, LOOP, ROOM, SIDE

PATH, _ = LOOP.at(np.linspace(0, 2 * np.pi, 500))
CAMERA = CAMERAS["pinhole"]
BACK = 222
WALL = np.array([[0, 0, -1.0, 2.99], [-1, 0, 0, 0], [0, 1, 0, 0.5], [0, 0, 0, 1]])


def view(x: float, y: float, heading: float) -> Array:
    return raised(np.array([[x, y, heading]]))[0] @ CAMERA.mounting


def renderer(boxes: tuple[Box, ...], *markers: Marker, greys: tuple[int, ...] = (100,)) -> Renderer:
    """Boxes whose faces are even, box i, face j at greys[i] + 10 j, before an even background."""
    room = Room(6.0, 5.0, 2.5, SIDE, markers, boxes)
    faces = tuple(
        tuple(np.full((30, 30), grey + 10 * face, np.uint8) for face in range(5))
        for grey in (*greys, *[100] * len(boxes))[: len(boxes)]
    )
    return Renderer(room, CAMERA, "4X4_50", Surfaces(np.full((20, 20), BACK, np.uint8), 10, faces))


def furnished(markers: int, boxes: int, seed: int) -> tuple[Room, Room]:
    rng = np.random.default_rng(seed)
    bare = furnish(*ROOM, SIDE, markers, rng)
    return bare, furnish_with_boxes(bare, boxes, PATH, BERTH, rng)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("markers", "boxes"), [(24, 5), (50, 8), (2, 3)])
def test_boxes_are_out_of_the_way(markers: int, boxes: int, seed: int) -> None:
    bare, room = furnished(markers, boxes, seed)
    assert len(room.boxes) == boxes
    for index, box in enumerate(room.boxes):
        assert (np.abs(box.footprint) < [3.0, 2.5]).all()
        rim = np.linspace(0, 1, 30)[:, None]
        sides = zip(box.footprint, np.roll(box.footprint, -1, axis=0), strict=True)
        outline = np.vstack([a + rim * (b - a) for a, b in sides])
        assert np.linalg.norm(outline[:, None] - PATH[None], axis=2).min() > BERTH
        for marker in room.markers:
            if marker.box is None and marker.pose[2, 3] == 0:
                assert np.linalg.norm(outline - marker.pose[:2, 3], axis=1).min() > SIDE * 8 / 6 / np.sqrt(2)
        for other in room.boxes[:index]:
            assert np.linalg.norm(box.place[:2] - other.place[:2]) > box.radius + other.radius
    assert [m.id for m in room.markers] == list(range(markers))
    assert sum(m.box is not None for m in room.markers) == min(len(range(2, markers, 3)), 4 * boxes)
    for before, after in zip(bare.markers, room.markers, strict=True):
        if after.box is None:
            np.testing.assert_array_equal(before.pose, after.pose)


def test_markers_lie_on_faces() -> None:
    _, room = furnished(50, 4, 1)
    places: set[tuple[int | None, int]] = set()
    for marker in room.markers:
        if marker.box is None:
            continue
        on = []
        half = SIDE * 8 / 12
        sheet = half * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) @ marker.pose[:3, :3].T
        for number, face in enumerate(room.boxes[marker.box].faces):
            local = (sheet + marker.pose[:3, 3] - face.pose[:3, 3]) @ face.pose[:3, :3]
            if np.abs(local[:, 2]).max() < 1e-9 and (np.abs(local[:, :2]) < [face.width / 2, face.height / 2]).all():
                on.append(number)
                np.testing.assert_allclose(marker.pose[:3, 2], face.pose[:3, 2], atol=1e-12)
        assert len(on) == 1
        assert (marker.box, on[0]) not in places
        places.add((marker.box, on[0]))
        if on[0] < 4:
            np.testing.assert_allclose(marker.pose[:3, 1], [0, 0, 1], atol=1e-12)  # upright
    assert {face for _, face in places} >= {4}


def test_faces_enclose_the_box() -> None:
    box = Box(np.array([0.7, -0.4, 0.6]), (0.5, 0.3, 0.6))
    corners = {tuple(np.round(p, 9)) for p in np.vstack([[*xy, z] for xy in box.footprint for z in (0.0, 0.6)])}
    middle = np.array([0.7, -0.4, 0.3])
    assert {tuple(np.round(p, 9)) for face in box.faces for p in face.outline} == corners
    for face in box.faces:
        assert face.pose[:3, 2] @ (face.pose[:3, 3] - middle) > 0.1
        assert np.linalg.det(face.pose[:3, :3]) == pytest.approx(1)


def test_no_room_is_said() -> None:
    blocked = np.array([[0.0, 0.0, 3.0]])
    refused("boxes: found room for 0 boxes, expected 3", place_boxes, 3, 4.0, 4.0, blocked, np.random.default_rng(0))


@pytest.mark.parametrize("heading", [0.0, 0.35, -0.5])
def test_boxes_hide_what_is_behind_them(heading: float) -> None:
    """Every face of three boxes that overlap in the view, against rays and slabs."""
    boxes = (
        Box(np.array([1.5, 0.15, 0.3]), (0.5, 0.3, 0.45)),
        Box(np.array([2.2, 0.45, 1.0]), (0.3, 0.55, 0.7)),
        Box(np.array([2.3, -0.3, -0.4]), (0.4, 0.4, 0.6)),
    )
    made = renderer(boxes, greys=(20, 80, 140))
    pose = view(-0.1, -0.1, heading)
    image = made.scene(pose)
    v, u = np.mgrid[:480:3, :640:3]
    rays = CAMERA.undistort(np.stack((u.ravel(), v.ravel()), axis=-1).astype(float))
    ahead = np.column_stack((rays, np.ones(len(rays)))) @ pose[:3, :3].T
    hits = [met(box, pose[:3, 3], ahead) for box in boxes]
    nearest = np.argmin([reach for reach, _ in hits], axis=0)
    expected = np.full(len(rays), float(BACK))
    for index, (reach, face) in enumerate(hits):
        mine = (nearest == index) & np.isfinite(reach)
        expected[mine] = 20 + 60 * index + 10 * face[mine]
    found = image[::3, ::3].ravel()
    right = np.abs(found - expected) < 0.01
    assert len(np.unique(expected)) >= 5
    # All but the pixels on an edge, of which there are a few in a hundred.
    assert right.mean() > 0.98
    assert (np.isfinite([reach for reach, _ in hits]).any(axis=0)).mean() > 0.05
    level = np.unique(expected)
    assert found.min() >= level.min() - 0.01


def test_the_edge_between_two_faces_lets_nothing_through() -> None:
    box = Box(np.array([1.5, 0.1, 0.5]), (0.5, 0.4, 0.5))
    made = renderer((box,))
    dark = replace(made, surfaces=made.surfaces._replace(boxes=((np.full((9, 9), 10, np.uint8),) * 5,)))
    image = dark.scene(view(0.0, 0.0, 0.0))
    inside = image < 10.01
    assert inside.sum() > 5000
    closed = cv2.morphologyEx(inside.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8)) > 0
    within = cv2.erode(closed.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    # A ray that falls on the edge to rounding may miss both faces or hit both: one of 16 in a pixel.
    assert np.abs(image[within] - 10).max() <= 1.01 * (BACK - 10) / 16
    assert (np.abs(image[within] - 10) > 0.01).mean() < 1e-3


def test_a_marker_behind_a_box_leaves_nothing() -> None:
    box = Box(np.array([1.6, 0.0, 0.2]), (0.5, 0.5, 0.7))
    hidden, beside = Marker(0, WALL), WALL.copy()
    beside[1, 3] = 0.57
    pose = view(0.0, 0.0, 0.0)
    empty = renderer((box,)).scene(pose)
    np.testing.assert_array_equal(renderer((box,), hidden).scene(pose), empty)
    alone, partly = (renderer(boxes, Marker(0, beside)).scene(pose) for boxes in ((), (box,)))
    shown, left = (alone != BACK).sum(), (partly != empty).sum()
    assert 0.1 * shown < left < 0.9 * shown
    same = partly == alone
    assert same[partly != empty].mean() > 0.9  # what is left of it is as it was
    behind = replace(renderer((box,)), room=replace(renderer((box,)).room, markers=()))
    np.testing.assert_array_equal(behind.scene(pose), empty)


def test_a_marker_on_a_box_is_seen_on_its_side_only() -> None:
    box = Box(np.array([1.5, 0.0, np.pi]), (0.4, 0.4, 0.5))  # its first face looks at the robot
    front, back = (Marker(7, box.faces[number].pose, 0) for number in (0, 2))
    image = renderer((box,), front).scene(view(0.0, 0.0, 0.0))
    around = image[np.abs(image - 100) > 0.01]
    assert (np.abs(image - INK) < 0.01).sum() > 500
    assert (np.abs(image - PAPER) < 0.01).sum() > 500
    assert len(around)
    away = renderer((box,), back).scene(view(0.0, 0.0, 0.0))
    np.testing.assert_array_equal(away, renderer((box,)).scene(view(0.0, 0.0, 0.0)))


def test_painted_boxes() -> None:
    _, room = furnished(24, 4, 2)
    bare = paint(replace(room, boxes=()), np.random.default_rng(0))
    full = paint(room, np.random.default_rng(0))
    assert bare.boxes == ()
    assert [len(faces) for faces in full.boxes] == [5] * 4
    assert (full.image <= bare.image).all()  # boxes only take light away
    np.testing.assert_array_equal(full.image[full.wall_row :], bare.image[bare.wall_row :])
    for box, faces in zip(room.boxes, full.boxes, strict=True):
        column, row = ((box.place[:2] + np.array([3.0, 2.5])) * 160).astype(int)
        assert full.image[row, column] < 0.8 * bare.image[row, column]
        for texture in faces:
            assert texture.std() > 2
