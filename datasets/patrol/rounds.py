"""The round of a patrol: along the corridor, into some of the rooms and back, at a steady pace, and then again."""

from typing import NamedTuple

import numpy as np

from ...core.elementary import arctan2, hypot, sincos
from ...core.se2 import Array, Ints, wrap
from ..worlds.floor_plan import CORRIDOR, Plan

VISITED = 0.5  # share of the rooms that the robot looks into, the same ones each round
INSIDE = 0.5  # m behind a door, from where it looks into the room
TURNING = 0.8  # rad/s, on the spot
WANDERING = 0.2  # m in x and in y, at most, beside the round


class Rounds(NamedTuple):
    """A closed path of legs, driven at constant speed, with a turn on the spot at the end of each."""

    begins: Array  # (p + 1,) s, of p pieces, legs and turns by turns; the last one is the time of a round
    xy: Array  # (p, 2) m, where a piece begins
    heading: Array  # (p,) rad, there, not wrapped
    way: Array  # (p,) m of a round, there
    speed: Array  # (p,) m/s
    rate: Array  # (p,) rad/s
    length: float  # m of a round
    turned: float  # rad, all turns of a round together

    @property
    def period(self) -> float:
        """Time of a round, s."""
        return float(self.begins[-1])


class Drive(NamedTuple):
    """A robot on its rounds."""

    poses: Array  # (n, 3)
    rolled: Array  # (n - 1, 2) m and rad that the wheels roll and turn to the next pose
    round: Ints  # (n,)
    phase: Array  # (n,) s since the round began


def rounds(plan: Plan, speed: float, rng: np.random.Generator) -> Rounds:
    """A round of the plan's corridor at `speed` m/s, with looks into rooms on either side that `rng` chooses."""
    points = _points(plan, rng)
    legs = np.diff(points, axis=0)
    lengths, heading = hypot(*legs.T), arctan2(legs[:, 1], legs[:, 0])
    turns = wrap(np.roll(heading, -1) - heading)
    count = len(legs)
    seconds, pace, rate = np.empty(2 * count), np.zeros(2 * count), np.zeros(2 * count)
    seconds[0::2], seconds[1::2] = lengths / speed, np.abs(turns) / TURNING
    pace[0::2], rate[1::2] = speed, np.sign(turns) * TURNING
    turned = np.concatenate(([0.0], np.cumsum(turns)))
    ways = np.concatenate(([0.0], np.cumsum(lengths)))
    return Rounds(
        begins=np.concatenate(([0.0], np.cumsum(seconds))),
        xy=np.stack((points[:-1], points[1:]), axis=1).reshape(-1, 2),
        heading=heading[0] + np.repeat(turned[:-1], 2),
        way=np.stack((ways[:-1], ways[1:]), axis=1).ravel(),
        speed=pace,
        rate=rate,
        length=float(ways[-1]),
        turned=float(turned[-1]),
    )


def driven(path: Rounds, t: Array, rng: np.random.Generator) -> Drive:
    """The robot at the times `t` (n,) s. Beside the round it is by an offset that changes slowly, and differs each."""
    number = np.floor(t / path.period).astype(np.int64)
    phase = np.clip(t - number * path.period, 0.0, np.nextafter(path.period, 0.0))
    xy, heading, way = _at(path, phase)
    beside = rng.uniform(-WANDERING, WANDERING, (int(number[-1]) + 2, 2))
    share = (phase / path.period)[:, None]
    xy += (1 - share) * beside[number] + share * beside[number + 1]
    rolled = np.stack((way + number * path.length, heading + number * path.turned), axis=-1)
    return Drive(np.column_stack((xy, wrap(heading))), np.diff(rolled, axis=0), number, phase)


def places(path: Rounds, phase: Array) -> Array:
    """(n, 2) m: the places on the round at the times `phase` (n,) s since it began."""
    return _at(path, phase)[0]


def _at(path: Rounds, phase: Array) -> tuple[Array, Array, Array]:
    """Places (n, 2), headings (n,), not wrapped, and ways (n,) from the begin of a round."""
    piece = np.searchsorted(path.begins, phase, "right") - 1
    into = phase - path.begins[piece]
    ahead = path.speed[piece] * into
    s, c = sincos(path.heading[piece])
    xy = path.xy[piece] + ahead[:, None] * np.stack((c, s), axis=-1)
    return xy, path.heading[piece] + path.rate[piece] * into, path.way[piece] + ahead


def _points(plan: Plan, rng: np.random.Generator) -> Array:
    """The way points (w, 2) of a round, which ends where it begins."""
    points = list[Array]()
    for start, end in zip(plan.ring, np.roll(plan.ring, -1, axis=0), strict=True):
        length = float(np.abs(end - start).sum())
        along = (end - start) / length
        points.append(start)
        beside = list[tuple[float, Array]]()
        for door in plan.doors:
            off = door.at - start
            way = float(off[0] * along[0] + off[1] * along[1])
            if hypot(*(off - along * way)) < 0.75 * CORRIDOR and 1 < way < length - 1:
                beside.append((way, door.at + INSIDE * door.inward))
        for way, inside in sorted(beside, key=lambda one: one[0]):
            if rng.random() < VISITED:
                points += [start + along * way, inside, start + along * way]
    return np.array([*points, plan.ring[0]])
