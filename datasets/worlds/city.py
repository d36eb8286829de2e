"""A simulated city: a robot drives the streets of a block grid and sees landmarks along them.

The map can be arbitrarily large at a constant number of landmarks in view: the log for measuring a step's cost over the
size of the map. At the default spacing and reach that is about six landmarks per step.
"""

from dataclasses import dataclass

import numpy as np

from ...core.arrays import read_only, slices
from ...core.elementary import arctan2, sin, sinc, sincos
from ...core.factors import Dataset, Log, Map, Truth
from ...core.options import option
from ...core.se2 import Array, Ints, wrap
from ..hidden_ids import HiddenIds
from ..on_demand.fixes import WorldFixes
from ..on_demand.gyro import WorldGyro
from ..on_demand.parts import Parts
from ..on_demand.signatures import WorldSignatures
from ..on_demand.slip import WorldSlip
from ..on_map import OnMap
from ..registry import Source
from .faults import Faults, with_faults
from .measurements import in_reach, odometry, prior, sightings

BLOCK = 20.0  # m between the middles of two streets
KERB = 2.0  # m from the middle of a street to its landmarks
BEND = 2.0  # m, turning radius of the robot at a crossing
SPACING = 2.8  # m along a side of a street per landmark, on average
LEAST_RANGE = 0.5  # m; nearer landmarks are not sighted
HEADINGS = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])  # east, north, west and south, in blocks


@dataclass(frozen=True)
class Options(HiddenIds, OnMap, Parts, WorldFixes, WorldGyro, WorldSlip, WorldSignatures, Faults):
    """The city, the drive, its noise, and faults."""

    landmarks: int = option(
        1000, "landmarks along the streets; with more of them the city grows", minimum=40, maximum=1_000_000
    )
    steps: int = option(2000, "steps of the drive", minimum=2, maximum=1_000_000)
    passes: float = option(
        0.0, "length of the drive over that of all streets, instead of steps; 0: use steps", minimum=0.0, maximum=100.0
    )
    stride: float = option(1.0, "distance from step to step, m", minimum=0.05, maximum=10.0)
    speed: float = option(2.0, "speed of the robot, m/s", minimum=0.05, maximum=50.0)
    reach: float = option(4.0, "range of the sightings, m", minimum=2.5, maximum=100.0)
    forward: float = option(0.02, "noise of the distance of a step, m", minimum=1e-4, maximum=1.0)
    turning: float = option(0.001, "noise of the turn of a step, rad", minimum=1e-5, maximum=1.0)
    sighting: float = option(0.05, "noise of a sighting along and across its line, m", minimum=1e-4, maximum=10)


def city(options: Options, rng: np.random.Generator) -> Dataset:
    """A robot in the streets of a simulated city, 1,000 landmarks by default; one city per seed."""
    world, driving, moving, seeing = rng.spawn(4)
    blocks = side(options.landmarks)
    xy = _landmarks(options.landmarks, blocks, world)
    steps = options.steps
    if options.passes:
        steps = 2 + int(options.passes * 2 * blocks * (blocks + 1) * BLOCK / options.stride)
    way = options.stride * np.arange(steps, dtype=np.float64)
    poses, turns = _drive(_route(blocks, way[-1], driving), way)
    rolling = np.stack((np.diff(way), turns), axis=-1)
    delta, delta_cov = odometry(poses, rolling, np.array([options.forward, options.turning]), moving)
    step, row = in_reach(poses, xy, LEAST_RANGE, options.reach)
    z, z_cov = np.empty((len(row), 2)), np.empty((len(row), 2, 2))
    for some in slices(len(row)):
        z[some], z_cov[some] = sightings(poses[step[some]], xy[row[some]], options.sighting, seeing)
    t = way / options.speed
    ids = np.arange(len(xy))
    sighted = len(np.unique(row))
    notes = {"source": "slamduel's own city", "blocks along a side": blocks, "landmarks sighted": sighted}
    start = prior(poses[0], world)
    seen = read_only(ids[row]), read_only(z), read_only(z_cov)
    log = Log.from_arrays("city", start, t, delta, delta_cov, step, *seen, notes=notes)
    return with_faults(Dataset(log, Truth(t, poses, Map(ids, xy, None), None, "truth")), options, rng)


def side(landmarks: int) -> int:
    """Blocks along a side of a square city for that many landmarks, SPACING apart on both kerbs.

    n x n blocks have 2 n (n + 1) streets of a block's length.
    """
    streets = landmarks * SPACING / (2 * BLOCK)
    return max(1, round((np.sqrt(1 + 2 * streets) - 1) / 2))


def _landmarks(count: int, blocks: int, rng: np.random.Generator) -> Array:
    """(count, 2) m: random along either kerb of any street, except at crossings."""
    along = rng.uniform(KERB, BLOCK - KERB, count) + BLOCK * rng.integers(blocks, size=count)
    across = BLOCK * rng.integers(blocks + 1, size=count) + KERB * rng.choice([-1.0, 1.0], count)
    east = rng.uniform(size=count) < 0.5
    return np.where(east[:, None], np.stack((along, across), -1), np.stack((across, along), -1))


def _route(blocks: int, length: float, rng: np.random.Generator) -> Ints:
    """The crossings (c, 2), in blocks, of a drive of at least `length` m from a corner of the city.

    At every crossing the robot takes the street driven least often, randomly among several, and never turns back.
    """
    driven: dict[tuple[int, int, int], int] = {}
    here, heading = (0, 0), 0
    crossings = [here]
    for _ in range(int(np.ceil(length / (BLOCK - 2 * BEND + np.pi / 2 * BEND))) + 2):
        ways = list[tuple[int, float, int, tuple[int, int], tuple[int, int, int]]]()
        for turn in (heading - 1, heading, heading + 1):
            x, y = (here[0] + int(HEADINGS[turn % 4, 0]), here[1] + int(HEADINGS[turn % 4, 1]))
            if 0 <= x <= blocks and 0 <= y <= blocks:
                street = (min(here[0], x), min(here[1], y), turn % 2)
                ways.append((driven.get(street, 0), rng.uniform(), turn % 4, (x, y), street))
        times, _, heading, here, street = min(ways)
        driven[street] = times + 1
        crossings.append(here)
    return np.array(crossings)


def _drive(crossings: Ints, way: Array) -> tuple[Array, Array]:
    """The true poses (n, 3) after `way` (n,) m along the middles of the streets, and the turn of each, (n - 1,).

    Streets alternate with the quarter circles at their ends; where the robot drives straight on, that quarter is a
    straight piece of its own.
    """
    heading = arctan2(*np.diff(crossings, axis=0).T[::-1])
    turn = np.round(wrap(np.diff(heading)) / (np.pi / 2)) * np.pi / 2
    bends = len(turn)
    lengths, turns = np.empty(2 * bends), np.zeros(2 * bends)
    lengths[0::2], lengths[1::2] = BLOCK - 2 * BEND, np.where(turn == 0, 2 * BEND, np.pi / 2 * BEND)
    turns[1::2] = turn
    starts = np.concatenate(([0.0], np.cumsum(lengths)))
    piece = np.searchsorted(starts, way, "right") - 1
    into = way - starts[piece]
    # A street's piece begins one bend after the last crossing, and the quarter after it one bend before the next.
    direction = np.repeat(heading[:-1], 2)
    s, c = sincos(direction)
    ahead = np.stack((c, s), -1)
    begin = BLOCK * np.repeat(crossings[:-2], 2, axis=0) + ahead * np.tile([BEND, BLOCK - BEND], bends)[:, None]
    angle = turns[piece] * into / lengths[piece]
    arc = np.stack((into * sinc(angle), into * sinc(angle / 2) * sin(angle / 2)), -1)
    facing = ahead[piece]
    xy = begin[piece] + facing * arc[:, :1] + np.stack((-facing[:, 1], facing[:, 0]), -1) * arc[:, 1:]
    total = direction[0] + np.concatenate(([0.0], np.cumsum(turns)))[piece] + angle
    return np.column_stack((xy, wrap(total))), np.diff(total)


source = Source(city, options=Options, seeded=True)
