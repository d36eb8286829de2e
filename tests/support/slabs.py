"""Rays that are followed through a room with boxes by clipping them with slabs."""

import numpy as np

from slamduel.core.se2 import Array, Ints
from slamduel.datasets.rendering.boxes import Box
from slamduel.datasets.rendering.room import Room


def met(box: Box, origin: Array, rays: Array) -> tuple[Array, Ints]:
    """(n,) how far along each ray (n, 3) the box begins (inf: it is missed), and which face is met there."""
    c, s = np.cos(box.place[2]), np.sin(box.place[2])
    turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
    start, along = turn @ (origin - [*box.place[:2], box.size[2] / 2]), rays @ turn.T
    half = np.array(box.size) / 2
    with np.errstate(divide="ignore"):
        enter, leave = (-np.sign(along) * half - start) / along, (np.sign(along) * half - start) / along
    first, last = enter.max(axis=1), leave.min(axis=1)
    axis = enter.argmax(axis=1)
    towards = np.take_along_axis(along, axis[:, None], axis=1)[:, 0] < 0
    face = np.select([axis == 0, axis == 1], [np.where(towards, 0, 2), np.where(towards, 1, 3)], 4)
    return np.where((first < last) & (first > 0), first, np.inf), face


def followed(room: Room, origin: Array, rays: Array) -> Array:
    """(n,) how far along each ray (n, 3) it leaves the room or enters a box."""
    middle, half = np.array([0, 0, room.height / 2]), np.array([room.length, room.width, room.height]) / 2
    ends = ((middle + np.sign(rays) * half - origin) / rays).min(axis=1)
    return np.minimum.reduce([ends, *(met(box, origin, rays)[0] for box in room.boxes)])
