"""Boxes on a floor: their faces, and their placement."""

from typing import NamedTuple

import numpy as np

from ...core.elementary import hypot, sincos
from ...core.errors import InputError
from ...core.se2 import Array, act

GAP = 0.05
"""m, between the circles around the boxes' footprints, and between such a circle and anything else."""

LENGTHS, HEIGHTS = (0.28, 0.55), (0.28, 0.7)
"""m, range of the boxes' sides and heights: every face has room for a marker's sheet."""

TRIES = 2000


class Face(NamedTuple):
    """One side of a box, or its top."""

    pose: Array  # (4, 4) T_world_face, m: origin in its middle, x right, y up, z out of it
    width: float  # m
    height: float  # m

    @property
    def outline(self) -> Array:
        """(4, 3) m, its corners in the world."""
        w, h = self.width / 2, self.height / 2
        corners = np.array([[-w, h, 0], [w, h, 0], [w, -h, 0], [-w, -h, 0]])
        return corners @ self.pose[:3, :3].T + self.pose[:3, 3]


class Box(NamedTuple):
    """A box on the floor."""

    place: Array  # (3,) x, y of its middle, m, and heading, rad
    size: tuple[float, float, float]  # m, along its own x and y, and its height

    @property
    def radius(self) -> float:
        """m, of the circle around its footprint."""
        return float(hypot(*self.size[:2]) / 2)

    @property
    def footprint(self) -> Array:
        """(4, 2) m, the corners on the floor, counter-clockwise."""
        a, b = self.size[0] / 2, self.size[1] / 2
        return act(self.place, np.array([[-a, -b], [a, -b], [a, b], [-a, b]]))

    @property
    def faces(self) -> tuple[Face, ...]:
        """Its four sides, the one towards its own x first and counter-clockwise from there, and its top."""
        a, b, height = self.size
        middle = np.array([*self.place[:2], height / 2])
        sides: list[Face] = []
        for turn, (out, width) in enumerate(((a / 2, b), (b / 2, a), (a / 2, b), (b / 2, a))):
            s, c = sincos(self.place[2] + turn * np.pi / 2)
            normal, across = np.array([c, s, 0]), np.array([-s, c, 0])
            sides.append(Face(_pose(across, np.array([0.0, 0, 1]), middle + out * normal), width, height))
        s, c = sincos(self.place[2])
        top = _pose(np.array([c, s, 0]), np.array([-s, c, 0]), np.array([*self.place[:2], height]))
        return (*sides, Face(top, a, b))


def place_boxes(count: int, length: float, width: float, keep_clear: Array, rng: np.random.Generator) -> list[Box]:
    """Places `count` boxes of various sizes in a room of `length` by `width` m, its middle at the origin.

    They avoid each other and `keep_clear` (n, 3), circles of x, y and radius in m. They shrink as room runs out.
    InputError if not even a small one fits any more.
    """
    boxes: list[Box] = []
    taken = keep_clear
    for _ in range(count):
        box = _fitting(length, width, taken, rng)
        if box is None:
            raise InputError(f"boxes: found room for {len(boxes)} boxes, expected {count}; try fewer, or markers")
        boxes.append(box)
        taken = np.vstack((taken, [*box.place[:2], box.radius]))
    return boxes


def _fitting(length: float, width: float, taken: Array, rng: np.random.Generator) -> Box | None:
    """A box at a random free place; its sizes are redrawn each time, from a shrinking range."""
    for attempt in range(TRIES):
        size = rng.uniform([LENGTHS[0], LENGTHS[0], HEIGHTS[0]], [LENGTHS[1], LENGTHS[1], HEIGHTS[1]])
        size[:2] -= (size[:2] - LENGTHS[0]) * attempt / TRIES
        place = rng.uniform([-length / 2, -width / 2, -np.pi], [length / 2, width / 2, np.pi])
        box = Box(place, (float(size[0]), float(size[1]), float(size[2])))
        inside = (np.abs(place[:2]) + box.radius + GAP <= [length / 2, width / 2]).all()
        if inside and (np.linalg.norm(taken[:, :2] - place[:2], axis=1) > taken[:, 2] + box.radius + GAP).all():
            return box
    return None


def _pose(x: Array, y: Array, origin: Array) -> Array:
    pose = np.eye(4)
    pose[:3] = np.column_stack((x, y, np.cross(x, y), origin))
    return pose
