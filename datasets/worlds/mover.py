"""A box with pictures on its sides that crosses a robot's view again and again."""

import numpy as np

from ...core.elementary import hypot
from ...core.se2 import Array, compose
from ..rendering.boxes import GAP, Box
from ..rendering.depth_shots import Visitor
from ..rendering.posters import poster
from ..rendering.room import Room
from ..rendering.surfaces import DENSITY

EVERY, LASTING = 6.0, 4.5  # s from one crossing to the next, and of a crossing

AHEAD, ASIDE = 1.15, 1.5
"""m, of the box's middle from the robot's: how far ahead, and how far to either side when it comes and goes."""

DEEP, HIGH = 0.4, 0.85  # m, the box along the robot's heading, and its height


def crossings(
    room: Room, poses: Array, t: Array, width: float, view: float, rng: np.random.Generator
) -> list[Visitor | None]:
    """For each of the robot's `poses` (n, 3) at `t` (n,), s, the box that is there; it is `width` m wide.

    It crosses in turns from the left and from the right, as seen by the robot. `view` is the tangent of half the angle
    of view. A crossing is left out if the box would, in view, meet a wall or another box.
    """
    size = (DEEP, width, HIGH)
    sample = Box(np.zeros(3), size)
    textures = tuple(
        np.rint(poster(round(face.height * DENSITY), round(face.width * DENSITY), rng)).astype(np.uint8)
        for face in sample.faces
    )
    crossing = np.floor(t / EVERY)
    share = (t - EVERY * crossing) / LASTING
    aside = ASIDE * (1 - 2 * share) * np.where(crossing % 2, -1.0, 1.0)
    places = compose(poses, np.stack((np.full(len(t), AHEAD), aside, np.zeros(len(t))), axis=-1))
    boxes = [Box(place, size) for place in places]
    there = share <= 1
    shown = np.abs(aside) < view * (AHEAD + DEEP / 2) + width / 2
    fits = np.array([_fits(room, box) for box in boxes])
    for number in np.unique(crossing):
        of = there & (crossing == number)
        if (of & shown & ~fits).any():
            there &= ~of
    return [Visitor(box, textures) if at else None for box, at in zip(boxes, there & fits, strict=True)]


def _fits(room: Room, box: Box) -> bool:
    """Tells if the box is inside the room and apart from its boxes."""
    free = np.array([room.length, room.width]) / 2 - np.abs(box.place[:2])
    apart = (hypot(*(box.place[:2] - other.place[:2])) - other.radius for other in room.boxes)
    return bool((free >= box.radius + GAP).all() and all(gap >= box.radius + GAP for gap in apart))
