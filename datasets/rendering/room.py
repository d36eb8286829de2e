"""A room with ArUco markers on its floor and walls, and on boxes in it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...core.elementary import hypot, sincos
from ...core.errors import InputError
from ...core.factors import Map
from ...core.se2 import Array
from ...core.small_matrices import product
from ._casting import cast
from .boxes import Box, place_boxes


class Marker(NamedTuple):
    """A printed marker."""

    id: int
    pose: Array  # (4, 4) T_world_marker, m; the marker's frame: x right, y up, z out of its printed face
    box: int | None = None  # index of the box it is glued to; None: on the floor or a wall


@dataclass(frozen=True)
class Room:
    """A rectangular room, its centre at the world's origin, the floor at z = 0."""

    length: float  # m, along x
    width: float  # m, along y
    height: float  # m
    side: float  # m, of the markers' black squares
    markers: tuple[Marker, ...]
    boxes: tuple[Box, ...] = ()  # the circles around their footprints are disjoint
    lamp: tuple[float, float, float] | None = None  # m, what glossy paper reflects; None: the middle of the ceiling
    walls: Array | None = None  # (w, 4) m, x and y of both ends, of all walls of a building; None: those of the room

    @property
    def lamp_at(self) -> Array:
        """(3,) m, the lamp's place."""
        return np.array((0.0, 0.0, self.height) if self.lamp is None else self.lamp)

    @property
    def landmarks(self) -> Map:
        """The markers' true centres in the plane."""
        ids = np.array([marker.id for marker in self.markers], np.int64)
        return Map(ids, np.array([marker.pose[:2, 3] for marker in self.markers]).reshape(-1, 2), None)

    @property
    def outlines(self) -> Array:
        """(w, 4) m, the walls, and the sides of boxes, as segments in the plane."""
        a, b = self.length / 2, self.width / 2
        around = [np.array([[-a, -b], [a, -b], [a, b], [-a, b]])] if self.walls is None else []
        rings = [*around, *(box.footprint for box in self.boxes)]
        sides = [np.column_stack((one, np.roll(one, -1, axis=0))) for one in rings]
        return np.concatenate([*sides, *([] if self.walls is None else [self.walls])])

    @property
    def perimeter(self) -> float:
        """The length of all walls, m."""
        return 2 * (self.length + self.width)


LOW, HIGH = 0.3, 0.75
"""m, heights of markers on the walls: visible to a camera that looks down from across a room."""

MARGIN = 0.3  # m, between a marker's centre and the next corner, or, on the floor, the next wall

TRIES = 300  # places on a wall that are tried for a marker
FLAT = 1e-6  # m, by which a wall's distance from the way varies at most
NO_DISCS = np.zeros((0, 3))  # nothing round

SHEET = 8 / 6
"""Ratio of a marker's sheet of paper to its black square, for dictionaries of 4 x 4 bits."""


def furnish(length: float, width: float, height: float, side: float, markers: int, rng: np.random.Generator) -> Room:
    """A room with `markers` markers, ids from 0: every other one on the floor, the rest around the walls.

    Along the walls they are spaced evenly and then shifted at random; on the floor each new one is put at the best of
    many random places, the one farthest from the others.
    """
    room = Room(length, width, height, side, ())
    on_floor, on_walls = markers // 2, markers - markers // 2
    places = _scatter(on_floor, length / 2 - MARGIN, width / 2 - MARGIN, rng)
    headings = rng.uniform(-np.pi, np.pi, on_floor)
    slots = (np.arange(on_walls) + rng.uniform(0.15, 0.85, on_walls)) / on_walls
    heights = rng.uniform(LOW, HIGH, on_walls)
    poses = [_on_floor(place, heading) for place, heading in zip(places, headings, strict=True)]
    poses += [_on_wall(room, along, up) for along, up in zip(_away_from_corners(room, slots), heights, strict=True)]
    return Room(length, width, height, side, tuple(Marker(i, pose) for i, pose in enumerate(poses)))


def furnish_with_boxes(bare: Room, boxes: int, path: Array, robot: float, rng: np.random.Generator) -> Room:
    """The room with `boxes` boxes in it, and a third of its markers, at most four per box, moved onto them.

    The boxes avoid the markers on the floor, and stay at least `robot` m from every point of the `path` (n, 2). Every
    third marker goes to a box: first one per box, on the side that faces the room's middle most, then the tops, then
    the other sides; at a random place on that face, upright. InputError if the boxes do not fit.
    """
    if not boxes:
        return bare
    moved = [marker.id for marker in bare.markers[2::3]][: 4 * boxes]
    left = [marker for marker in bare.markers if marker.id not in moved]
    on_floor = [[*marker.pose[:2, 3], SHEET * bare.side / np.sqrt(2)] for marker in left if marker.pose[2, 3] == 0]
    keep_clear = np.vstack((np.array(on_floor).reshape(-1, 3), np.column_stack((path, np.full(len(path), robot)))))
    placed = place_boxes(boxes, bare.length, bare.width, keep_clear, rng)
    onto = [_on_box(placed, i, bare.side, rng) for i in range(len(moved))]
    glued = [Marker(name, pose, i % boxes) for i, (name, pose) in enumerate(zip(moved, onto, strict=True))]
    markers = sorted([*left, *glued], key=lambda marker: marker.id)
    return replace(bare, markers=tuple(markers), boxes=tuple(placed))


def furnish_along(bare: Room, way: Array, markers: int, reach: float, rng: np.random.Generator) -> Room:
    """The building `bare` with `markers` markers along a closed way (n, 2), ids from 0: every other one on the floor.

    They are spaced evenly and then shifted at random, on the floor up to `reach` / 2 m beside the way. The others are
    on the left or the right wall, where that is flat, free of doors and at most `reach` m away.
    """
    sides = np.roll(way, -1, axis=0) - way
    lengths = hypot(*sides.T)
    ends = np.concatenate(([0.0], np.cumsum(lengths)))
    walls = bare.outlines

    def beside(place: float, left: bool) -> tuple[Array, Array]:
        """The point of the way `place` m along it, and the unit vector to its left or right."""
        side = int(np.searchsorted(ends, place % ends[-1], "right")) - 1
        along = sides[side] / lengths[side]
        across = np.array([-along[1], along[0]]) * (1.0 if left else -1.0)
        return way[side] + along * (place % ends[-1] - ends[side]), across

    def on_wall(slot: int, count: int) -> Array:
        for attempt in range(TRIES):
            place = (slot + rng.uniform(0.15, 0.85) + 0.01 * attempt) / count * ends[-1]
            left = rng.random() < 0.5
            half = SHEET * side / 2
            near = [beside(place + shift, left) for shift in (-half, 0.0, half)]
            away = [
                float(cast(walls, NO_DISCS, float(at[0]), float(at[1]), out[None], 2 * reach)[0]) for at, out in near
            ]
            if max(away) < reach and max(away) - min(away) < FLAT and near[0][1] @ near[2][1] > 0:
                at, out = near[1]
                (x, y), (nx, ny) = at + away[1] * out, -out
                return _upright(x, y, nx, ny, rng.uniform(LOW, HIGH))
        raise InputError(f"markers: found walls for {slot} of {count} markers, expected as many; try fewer.")

    side = bare.side
    on_floor, on_walls = markers // 2, markers - markers // 2
    poses = list[Array]()
    for slot in range(on_floor):
        at, out = beside((slot + rng.uniform(0.15, 0.85)) / on_floor * ends[-1], True)
        poses.append(_on_floor(at + rng.uniform(-reach / 2, reach / 2) * out, rng.uniform(-np.pi, np.pi)))
    poses += [on_wall(slot, on_walls) for slot in range(on_walls)]
    return replace(bare, markers=tuple(Marker(i, pose) for i, pose in enumerate(poses)))


def wall_point(room: Room, along: Array) -> tuple[Array, Array]:
    """Points (..., 2) `along` m counter-clockwise from the corner (-x, -y), and the normals there into the room."""
    a, b = room.length, room.width
    ends = np.array([0.0, a, a + b, 2 * a + b, 2 * (a + b)])
    corners = np.array([[-a, -b], [a, -b], [a, b], [-a, b], [-a, -b]]) / 2
    x, y = np.interp(along, ends, corners[:, 0]), np.interp(along, ends, corners[:, 1])
    wall = np.clip(np.searchsorted(ends, along, "right") - 1, 0, 3)
    normals = np.array([[0.0, 1.0], [-1.0, 0.0], [0.0, -1.0], [1.0, 0.0]])
    return np.stack((x, y), axis=-1), normals[wall]


def _scatter(count: int, half_length: float, half_width: float, rng: np.random.Generator) -> Array:
    """(count, 2) points of the rectangle: Mitchell's best candidates."""
    half = np.array([half_length, half_width])
    points = np.zeros((0, 2))
    for _ in range(count):
        candidates = rng.uniform(-half, half, (60, 2))
        gaps = np.linalg.norm(candidates[:, None] - points[None], axis=2)
        best = np.argmax(gaps.min(axis=1, initial=np.inf))
        points = np.vstack((points, candidates[best]))
    return points


def _on_floor(place: Array, heading: float) -> Array:
    s, c = sincos(heading)
    return np.array([[c, -s, 0, place[0]], [s, c, 0, place[1]], [0, 0, 1, 0], [0, 0, 0, 1]], float)


def _away_from_corners(room: Room, slots: Array) -> Array:
    """(n,) m along the walls, for `slots` (n,) in [0, 1) of their length without MARGIN at either end."""
    walls = np.array([room.length, room.width, room.length, room.width])
    ends = np.concatenate(([0.0], np.cumsum(walls - 2 * MARGIN)))
    place = slots * ends[-1]
    wall = np.searchsorted(ends, place, "right") - 1
    return place + MARGIN * (2 * wall + 1)


def _on_wall(room: Room, along: float, up: float) -> Array:
    """T_world_marker of a marker upright on the wall."""
    (x, y), (nx, ny) = wall_point(room, np.asarray(along))
    return _upright(x, y, nx, ny, up)


def _upright(x: float, y: float, nx: float, ny: float, up: float) -> Array:
    """T_world_marker of an upright marker whose normal is (nx, ny)."""
    return np.array([[-ny, 0, nx, x], [nx, 0, ny, y], [0, 1, 0, up], [0, 0, 0, 1]], float)


def _on_box(boxes: Sequence[Box], turn: int, side: float, rng: np.random.Generator) -> Array:
    """T_world_marker of the marker that is the `turn`-th to be glued to a box."""
    box = boxes[turn % len(boxes)]
    *sides, top = box.faces
    sides.sort(key=lambda face: float(face.pose[:2, 2] @ box.place[:2]))
    face = (sides[0], top, *sides[1:])[turn // len(boxes)]
    free = (np.array([face.width, face.height]) - SHEET * side) / 2
    shift = np.eye(4)
    shift[:2, 3] = 0.8 * free * rng.uniform(-1, 1, 2)
    return product(face.pose, shift)
