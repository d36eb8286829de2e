"""The world of a robot among markers: the one room, or a building whose corridor leads round past rooms.

The building has the plan of `laser-floor`, smaller: its walls, cupboards and furniture reach up to the ceiling. People
walk along the corridor, and are in pictures and scans alike.
"""

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from ...core.elementary import hypot
from ...core.errors import InputError
from ...core.options import option
from ...core.se2 import Array
from ..on_demand.imu import Drive
from ..rendering.people import NOBODY, People, nobody, upright
from ..rendering.room import Room, furnish, furnish_along, furnish_with_boxes
from .floor_plan import CORRIDOR, floor_plan
from .laser_floor import legs, passers_by, steered, way_points
from .wheeled_robot import ClosedPath, drive

ROOM = (6.0, 5.0, 2.5)  # m
SIDE = 0.16  # m, of a marker
BERTH = 0.3  # m, least distance of the robot's middle from a box

FLOOR, DEPTH = (20.0, 18.0, 2.5), 3.5  # m, of the building, and of its outer rooms
PEOPLE = 4
LOOP = ClosedPath(
    cos=np.array([[1.4, 0.0], [0.0, 0.0], [0.25, 0.0]]),
    sin=np.array([[0.0, 0.0], [0.0, 1.0], [0.0, 0.0]]),
)
"""A figure of eight of 11.3 m: as much turning left as right, and no bend tighter than 0.54 m."""


@dataclass(frozen=True)
class WorldOptions:
    """The place that the robot drives through."""

    markers: int = option(24, "markers in the room, half of them on the floor", minimum=2, maximum=50)
    boxes: int = option(0, "boxes in the room, a third of the markers on them", minimum=0, maximum=8)
    building: bool = option(
        False, "a building in place of the one room: a corridor that leads round past rooms, with markers along it"
    )
    people: int | None = option(None, "people who walk along its corridor; none: 4", minimum=0, maximum=100)
    speed: float = option(0.4, "speed of the robot, m/s", minimum=0.05, maximum=1.0)


class World(NamedTuple):
    """A place with a robot in it."""

    room: Room
    drive: Drive
    people: People


def world(options: WorldOptions, seconds: float, rng: np.random.Generator) -> World:
    """The world of a drive of `seconds`; InputError for boxes without room, in a building, and people in one room."""
    if options.building:
        if options.boxes:
            raise InputError(
                f"dataset aruco-room: found options building=true and boxes={options.boxes}, expected one of them."
            )
        return _building(options, seconds, rng)
    if options.people is not None:
        raise InputError(
            f"dataset aruco-room: found option people={options.people}, expected it beside building=true, in whose "
            "corridor they walk."
        )
    room = furnish(*ROOM, SIDE, options.markers, rng)
    path, _ = LOOP.at(np.linspace(0, 2 * np.pi, 200))
    return World(furnish_with_boxes(room, options.boxes, path, BERTH, rng), partial(drive, LOOP, options.speed), nobody)


def _building(options: WorldOptions, seconds: float, rng: np.random.Generator) -> World:
    plan = floor_plan(*FLOOR[:2], DEPTH, rng)
    middle = np.array(FLOOR[:2]) / 2
    centred = plan._replace(
        walls=plan.walls - np.tile(middle, 2),
        ring=plan.ring - middle,
        doors=[door._replace(at=door.at - middle) for door in plan.doors],
    )
    bare = Room(*FLOOR, SIDE, (), walls=centred.walls)
    room = furnish_along(bare, centred.ring, options.markers, CORRIDOR / 2 + 0.1, rng)
    around = float(hypot(*(np.roll(centred.ring, -1, axis=0) - centred.ring).T).sum())
    laps = 0.25 + options.speed * seconds / around  # more than can be driven
    driven = steered(way_points(centred, centred.ring, laps, rng), options.speed)
    walkers = passers_by(centred, PEOPLE if options.people is None else options.people, rng)

    def people(t: float) -> Array:
        x, y, _ = driven.at(np.array([t]))[0][0].tolist()
        there = [legs(centred, walkers[k : k + 1], t, x, y) for k in range(len(walkers))]
        near = [k for k, one in enumerate(there) if len(one)]
        return upright(np.concatenate([there[k] for k in near]), np.array(near)) if near else NOBODY

    return World(room, driven.at, people)
