"""A world in which SLAM is linear, as far as one likes: a robot that slides in any direction and keeps facing one way.

Its sightings are off by as much along the line of sight as across it, so that they are offsets in metres with round
noise, and its odometry by as much in x as in y. While the heading is known, motions and sightings are then linear in
the places of robot and landmarks: the Kalman filter's own world. How well the heading is known is an option.
"""

from dataclasses import dataclass

import numpy as np

from ...frontend.elementary import sincos
from ...frontend.factors import Dataset, Log, Map, Prior, Truth
from ...frontend.options import option
from ...frontend.se2 import Array, between, wrap
from ..registry import Source
from .measurements import START_SD, in_reach, sightings
from .mishaps import Mishaps, befallen

RADIUS = 10.0
"""m, of the circle on which the robot goes round."""

STRIDE = 0.5
"""m from step to step."""

AROUND = 6.0
"""m; landmarks stand within this of the circle."""

NEAREST, FARTHEST = 2.0, 8.0
"""m, of a sighting: far enough for its noise to be small against it, as a bearing is linear in small errors alone."""

PERIOD = 1.0
"""s between steps."""


@dataclass(frozen=True)
class Options(Mishaps):
    """The drive, how well it is measured, and what goes wrong."""

    steps: int = option(400, "steps, of half a metre", minimum=2, maximum=100_000)
    landmarks: int = option(30, "landmarks around the circle", minimum=1, maximum=1000)
    sliding: float = option(0.05, "noise of a step's motion in x and in y, m", minimum=1e-4, maximum=1.0)
    turning: float = option(1e-6, "noise of a step's turn, rad", minimum=1e-6, maximum=0.3)
    sighting: float = option(0.05, "noise of a sighting, along and across its line, m", minimum=1e-4, maximum=1.0)


def linear(options: Options, rng: np.random.Generator) -> Dataset:
    """A robot that slides round and keeps its heading: SLAM that a Kalman filter can do; another log a seed."""
    world, moving, seeing = rng.spawn(3)
    n = options.steps
    angle = STRIDE / RADIUS * np.arange(n, dtype=np.float64)
    s, c = sincos(angle)
    poses = np.column_stack((RADIUS * c, RADIUS * s, np.zeros(n)))
    xy = _landmarks(options.landmarks, world)
    sd = np.array([options.sliding, options.sliding, options.turning])
    delta = np.zeros((n, 3))
    delta[1:] = between(poses[:-1], poses[1:]) + sd * moving.standard_normal((n - 1, 3))
    delta[:, 2] = wrap(delta[:, 2])
    step, row = in_reach(poses, xy, NEAREST, FARTHEST)
    z, z_cov = sightings(poses[step], xy[row], options.sighting, seeing)
    start_sd = np.array([START_SD, START_SD, min(START_SD, options.turning)])
    start = Prior(poses[0] + start_sd * world.standard_normal(3), np.diag(start_sd**2))
    t, ids = PERIOD * np.arange(n, dtype=np.float64), np.arange(options.landmarks)
    log = Log.from_arrays(
        "linear",
        start,
        t,
        delta,
        np.tile(np.diag(sd**2), (n, 1, 1)),
        step,
        ids[row],
        z,
        z_cov,
        notes={"source": "slamduel's own linear world"},
    )
    return befallen(Dataset(log, Truth(t, poses, Map(ids, xy, None), None, "truth")), options, rng)


def _landmarks(count: int, rng: np.random.Generator) -> Array:
    """(count, 2) m: anywhere within AROUND of the circle."""
    angle = rng.uniform(0, 2 * np.pi, count)
    away = RADIUS + rng.uniform(-AROUND, AROUND, count)
    s, c = sincos(angle)
    return np.stack((away * c, away * s), axis=-1)


source = Source(linear, options=Options, seeded=True)
