"""A made-up floor of an office building: a corridor that goes round, with rooms on both sides of it."""

import itertools
from typing import NamedTuple

import numpy as np

from ...core.se2 import Array

CORRIDOR = 2.2  # m, its width
DOOR = 0.95  # m
CLEAR = 1.2  # m around a door in which no cupboard stands
LONGEST = 9.0  # m of corridor that one room may take
ROOM = (3.2, 6.0)  # m, width of the others


class Door(NamedTuple):
    """A way into a room."""

    at: Array  # (2,) its middle, m
    inward: Array  # (2,) unit vector into the room


class Plan(NamedTuple):
    """A floor."""

    walls: Array  # (w, 4) segments, m
    ring: Array  # (4, 2) corners of the corridor's middle line, counter-clockwise
    doors: list[Door]


def floor_plan(width: float, height: float, depth: float, rng: np.random.Generator) -> Plan:
    """A floor of `width` by `height` (m) with rooms `depth` (m) deep outside of the corridor."""
    walls = _box(0.0, 0.0, width, height)
    doors: list[Door] = []
    low, right, top = depth, width - depth, height - depth
    inner = depth + CORRIDOR
    inner_right, inner_top = width - inner, height - inner
    half = (inner_top - inner) / 2
    sides = (
        ((low, low), (right, low), (0, -1), depth),
        ((low, top), (right, top), (0, 1), depth),
        ((low, low), (low, top), (-1, 0), depth),
        ((right, low), (right, top), (1, 0), depth),
        ((inner, inner), (inner_right, inner), (0, 1), half),
        ((inner, inner_top), (inner_right, inner_top), (0, -1), half),
    )
    for start, end, inward, deep in sides:
        walls += _rooms(np.array(start), np.array(end), np.array(inward, float), deep, doors, rng)
    walls += [(inner, inner, inner, inner_top), (inner_right, inner, inner_right, inner_top)]
    walls += [(inner, inner + half, inner_right, inner + half)]
    for _ in range(14):  # cupboards in the corridor, none before a door
        side, share = rng.integers(4), rng.uniform(0.1, 0.9)
        long, deep = rng.uniform(0.15, 0.4), rng.uniform(0.1, 0.3)
        x, y = low + share * (right - low), low + share * (top - low)
        box = ((x, low, x + long, low + deep), (x, top - deep, x + long, top),
               (low, y, low + deep, y + long), (right - deep, y, right, y + long))[side]  # fmt: skip
        if all(np.abs(door.at - (box[0], box[1])).max() > CLEAR for door in doors):
            walls += _box(*box)
    middle = depth + CORRIDOR / 2
    ring = np.array(
        ((middle, middle), (width - middle, middle), (width - middle, height - middle), (middle, height - middle))
    )
    return Plan(np.array(walls), ring, doors)


Segment = tuple[float, float, float, float]


def _box(x0: float, y0: float, x1: float, y1: float) -> list[Segment]:
    return [(x0, y0, x1, y0), (x1, y0, x1, y1), (x1, y1, x0, y1), (x0, y1, x0, y0)]


def _rooms(
    start: Array, end: Array, inward: Array, depth: float, doors: list[Door], rng: np.random.Generator
) -> list[Segment]:
    """Rooms along the wall from `start` to `end`, with furniture; their doors are added to `doors`."""
    length = float(np.abs(end - start).sum())
    along = (end - start) / length
    cuts = [0.0]
    while length - cuts[-1] > LONGEST:
        cuts.append(cuts[-1] + rng.uniform(*ROOM))
    cuts.append(length)
    walls, open_from = list[Segment](), 0.0
    for first, last in itertools.pairwise(cuts):
        door = rng.uniform(first + 0.4, last - 1.4)
        doors.append(Door(start + along * (door + DOOR / 2), inward))
        walls.append((*(start + along * open_from).tolist(), *(start + along * door).tolist()))
        open_from = door + DOOR
        for _ in range(rng.integers(1, 4)):
            at = start + along * rng.uniform(first + 0.6, last - 0.6) + inward * rng.uniform(1.6, depth - 0.5)
            half = rng.uniform(0.2, 0.6, 2)
            walls += _box(*(at - half).tolist(), *(at + half).tolist())
        if last < length:
            corner = start + along * last
            walls.append((*corner.tolist(), *(corner + inward * depth).tolist()))
    walls.append((*(start + along * open_from).tolist(), *end.tolist()))
    return walls
