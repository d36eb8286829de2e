"""A world in which SLAM is linear, to any degree: a robot that slides in any direction at constant heading.

Its sightings have equal noise along and across the line of sight, so that they are offsets in metres with isotropic
noise, and its odometry equal noise in x and y. As long as the heading is known, motions and sightings are then linear
in the positions of robot and landmarks: the Kalman filter's assumptions. The heading's uncertainty is an option.
"""

from dataclasses import dataclass

import numpy as np

from ...core.elementary import sincos
from ...core.factors import Dataset, Log, Map, Prior, Truth
from ...core.options import option
from ...core.se2 import Array, between, wrap
from ..hidden_ids import HiddenIds
from ..on_demand.fixes import WorldFixes
from ..on_demand.gyro import WorldGyro
from ..on_demand.parts import Parts
from ..on_demand.signatures import WorldSignatures
from ..on_demand.slip import WorldSlip
from ..on_map import OnMap
from ..registry import Source
from .faults import Faults, with_faults
from .measurements import START_SD, in_reach, sightings

RADIUS = 10.0  # m, radius of the robot's circle
STRIDE = 0.5  # m from step to step
AROUND = 6.0  # m; largest distance of landmarks from the circle

NEAREST, FARTHEST = 2.0, 8.0
"""m, least range of a sighting: its noise is small against it, as a bearing is linear in small errors only."""

PERIOD = 1.0  # s between steps


@dataclass(frozen=True)
class Options(HiddenIds, OnMap, Parts, WorldFixes, WorldGyro, WorldSlip, WorldSignatures, Faults):
    """The drive, its noise, and faults."""

    steps: int = option(400, "steps, of half a metre", minimum=2, maximum=100_000)
    landmarks: int = option(30, "landmarks around the circle", minimum=1, maximum=1000)
    sliding: float = option(0.05, "noise of a step's motion in x and in y, m", minimum=1e-4, maximum=1.0)
    turning: float = option(1e-6, "noise of a step's turn, rad", minimum=1e-6, maximum=0.3)
    sighting: float = option(0.05, "noise of a sighting along and across its line, m", minimum=1e-4, maximum=1.0)


def linear(options: Options, rng: np.random.Generator) -> Dataset:
    """A robot that slides around a circle at constant heading: SLAM for a Kalman filter; one log per seed."""
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
    delta_cov: Array = np.tile(np.diag(sd**2), (n, 1, 1))
    notes = {"source": "slamduel's own linear world"}
    log = Log.from_arrays("linear", start, t, delta, delta_cov, step, ids[row], z, z_cov, notes=notes)
    return with_faults(Dataset(log, Truth(t, poses, Map(ids, xy, None), None, "truth")), options, rng)


def _landmarks(count: int, rng: np.random.Generator) -> Array:
    """(count, 2) m: random within AROUND of the circle."""
    angle = rng.uniform(0, 2 * np.pi, count)
    away = RADIUS + rng.uniform(-AROUND, AROUND, count)
    s, c = sincos(angle)
    return np.stack((away * c, away * s), axis=-1)


source = Source(linear, options=Options, seeded=True)
