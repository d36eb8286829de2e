"""Paints the floor and the walls of a room and its boxes: grey images that a renderer samples."""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from .boxes import Box, Face
from .room import Room

DENSITY = 160  # px per metre of the painted surfaces
PLANK = 0.14  # m, the width of a floorboard

WALLS = np.array([168.0, 152.0, 180.0, 160.0])
"""Grey levels of the four walls, which are lit differently."""

FADED = 28  # widths from a line at which it has vanished: exp(-28^2) is 0 in double precision

Grey = NDArray[np.floating]


class Surfaces(NamedTuple):
    """The floor and, under it, the four walls side by side, counter-clockwise from the corner (-x, -y)."""

    image: NDArray[np.uint8]
    wall_row: int  # the row of the walls' upper edge
    boxes: tuple[tuple[NDArray[np.uint8], ...], ...] = ()  # each box's faces, upright


def paint(room: Room, rng: np.random.Generator) -> Surfaces:
    """Paints a boarded floor, and plastered walls with a skirting board, sockets and two doors; darker in the corners.

    Boxes darken the floor around them.
    """
    floor, walls = _floor(room, rng), _walls(room, rng)
    image = np.full((len(floor) + len(walls), max(floor.shape[1], walls.shape[1])), 128.0)
    image[: len(floor), : floor.shape[1]] = floor
    image[len(floor) :, : walls.shape[1]] = walls
    for box in room.boxes:
        _shade(image, room, box)
    papers = rng.uniform(95, 165, len(room.boxes))
    pairs = zip(room.boxes, papers, strict=True)
    faces = tuple(tuple(_cardboard(face, paper, rng) for face in box.faces) for box, paper in pairs)
    return Surfaces(np.clip(image, 0, 255).astype(np.uint8), len(floor), faces)


def _floor(room: Room, rng: np.random.Generator) -> Grey:
    rows, columns = round(room.width * DENSITY), round(room.length * DENSITY)
    y, x = (np.arange(rows, dtype=np.float32) / DENSITY)[:, None], np.arange(columns, dtype=np.float32) / DENSITY
    board = (y / PLANK).astype(int)
    boards = int(board.max()) + 1
    shift, length = rng.uniform(0, 2, boards)[board], rng.uniform(0.9, 1.6, boards)[board]
    piece = ((x + shift) / length).astype(int)
    shade = rng.normal(0, 7, (boards, int(piece.max()) + 1))[board, piece]
    seam = np.minimum(_gap(y, PLANK), _gap(x + shift, length))
    grain = cv2.GaussianBlur(rng.standard_normal((rows, columns), np.float32), (0, 0), sigmaX=22, sigmaY=0.9)
    light = np.exp(-(((x - 0.6 * room.length) / room.length) ** 2)) * np.exp(-((y / room.width - 0.45) ** 2))
    edge = np.minimum(np.minimum(x, room.length - x), np.minimum(y, room.width - y))
    return (84 + 62 * light + shade + 30 * grain - 26 * _line(seam, 0.004)) * _shadow(edge)


def _walls(room: Room, rng: np.random.Generator) -> Grey:
    rows, columns = round(room.height * DENSITY), round(room.perimeter * DENSITY)
    z, u = (
        (np.arange(rows - 1, -1, -1, dtype=np.float32) / DENSITY)[:, None],
        np.arange(columns, dtype=np.float32) / DENSITY,
    )
    ends = np.cumsum([0.0, room.length, room.width, room.length, room.width])
    wall = np.clip(np.searchsorted(ends, u, "right") - 1, 0, 3)
    corner = np.minimum(u - ends[wall], ends[wall + 1] - u)
    plaster = cv2.GaussianBlur(rng.standard_normal((rows, columns), np.float32), (0, 0), 2.5)
    clouds = cv2.resize(rng.standard_normal((4, 24), np.float32), (columns, rows), interpolation=cv2.INTER_CUBIC)
    grey = WALLS[wall] + 10 * plaster + 2.5 * clouds + 6 * z
    grey = np.where(z < 0.1, 208, grey) - 45 * _line(z - 0.1, 0.006) - 60 * _line(z, 0.006)
    for middle in (0.3 * room.length, ends[2] + 0.35 * room.length):
        near = _around(u, z, middle - 0.45, middle + 0.45, -1.0, 2.03, 0.08 + FADED * 0.006)
        x, y, part = u[near[1]], z[near[0]], grey[near]
        door = _outside(x, y, middle - 0.45, middle + 0.45, -1.0, 2.03)
        part = np.where(door < 0.08, 204, part) - 40 * _line(door - 0.08, 0.006)
        part = np.where(door < 0, 128 + 4 * plaster[near], part) - 50 * _line(door, 0.006)
        for bottom, top in ((0.14, 0.85), (1.0, 1.9)):
            panel = _outside(x, y, middle - 0.33, middle + 0.33, bottom, top)
            part += 16 * _line(panel - 0.012, 0.008) - 22 * _line(panel, 0.008)
        grey[near] = part
    for middle in ends[:4] + 0.5 * np.diff(ends) + 0.7:
        near = _around(u, z, middle - 0.04, middle + 0.04, 0.26, 0.34, FADED * 0.004)
        socket = _outside(u[near[1]], z[near[0]], middle - 0.04, middle + 0.04, 0.26, 0.34)
        grey[near] = np.where(socket < 0, 214, grey[near]) - 40 * _line(socket, 0.004)
    return grey * _shadow(corner)


def _shade(image: Grey, room: Room, box: Box) -> None:
    """Darkens the floor around the box, and blackens it underneath."""
    reach = box.radius + 0.8
    middle = (box.place[:2] + np.array([room.length, room.width]) / 2) * DENSITY
    (left, top), (right, bottom) = (np.floor(middle + sign * reach * DENSITY).astype(int) for sign in (-1, 1))
    rows = slice(max(top, 0), min(bottom, round(room.width * DENSITY)))
    columns = slice(max(left, 0), min(right, round(room.length * DENSITY)))
    y = np.arange(rows.start, rows.stop)[:, None] / DENSITY - room.width / 2 - box.place[1]
    x = np.arange(columns.start, columns.stop) / DENSITY - room.length / 2 - box.place[0]
    c, s = np.cos(box.place[2]), np.sin(box.place[2])
    along, across = np.abs(c * x + s * y) - box.size[0] / 2, np.abs(c * y - s * x) - box.size[1] / 2
    image[rows, columns] *= _shadow(np.hypot(np.maximum(along, 0), np.maximum(across, 0)))


def _cardboard(face: Face, paper: float, rng: np.random.Generator) -> NDArray[np.uint8]:
    """A face of a cardboard box: ribbed, scuffed, with a strip of tape across and some print in a corner."""
    rows, columns = round(face.height * DENSITY), round(face.width * DENSITY)
    y, x = np.arange(rows, dtype=np.float32)[:, None] / DENSITY, np.arange(columns, dtype=np.float32) / DENSITY
    normal = face.pose[:3, 2]
    light = 0.82 + 0.1 * normal[0] * 0.6 - 0.1 * normal[1] * 0.8 + 0.26 * normal[2]
    scuffs = cv2.GaussianBlur(rng.standard_normal((rows, columns), np.float32), (0, 0), 5)
    grey = paper * light + 2 * np.sin(2 * np.pi * x / 0.035) + 30 * scuffs
    tape = np.abs(x - face.width / 2) < 0.025
    grey = np.where(tape, grey + 16, grey)
    for line in range(int(rng.integers(2, 5))):
        top, right = face.height - 0.035 - 0.018 * line, 0.03 + rng.uniform(0.04, 0.09)
        print_ = (np.abs(y - top) < 0.005) & (x > 0.03) & (x < right) & (np.sin(2 * np.pi * x / 0.013) > -0.4)
        grey = np.where(print_, 0.45 * grey, grey)
    edge = np.minimum(np.minimum(x, face.width - x), np.minimum(y, face.height - y))
    grey *= 1 - 0.2 * np.exp(-edge / 0.008)
    if normal[2] < 0.5:
        grey *= _shadow(2 * (face.height - y))
    return np.clip(grey, 0, 255).astype(np.uint8)


def _around(
    u: Grey, z: Grey, left: float, right: float, bottom: float, top: float, reach: float
) -> tuple[slice, slice]:
    """The rows and columns of a wall within `reach` (m) of a rectangle: u rises along rows, z falls down columns."""
    rows = np.searchsorted(-z[:, 0], (-top - reach, reach - bottom)).tolist()
    columns = np.searchsorted(u, (left - reach, right + reach)).tolist()
    return slice(*rows), slice(*columns)


def _outside(u: Grey, z: Grey, left: float, right: float, bottom: float, top: float) -> Grey:
    """Distance (m) of a point outside of a rectangle; negative inside."""
    return np.maximum(np.maximum(left - u, u - right), np.maximum(bottom - z, z - top))


def _line(distance: Grey, width: float) -> Grey:
    """1 on a line, 0 a few widths (m) away."""
    return np.exp(-((distance / width) ** 2))


def _gap(x: Grey, period: Grey | float) -> Grey:
    """The distance from x to the nearest multiple of `period`."""
    rest = np.mod(x, period)
    return np.minimum(rest, period - rest)


def _shadow(distance: Grey) -> Grey:
    """The remaining light at this distance (m) from the next surface."""
    return 1 - 0.28 * np.exp(-distance / 0.22)
