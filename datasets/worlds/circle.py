"""Huang's circle: the standard simulation of EKF-SLAM's inconsistency.

A robot drives in circles and sees a few landmarks at a time, with no absolute measurement. Any information that a
filter gains about its absolute heading is therefore an artefact of linearisation.

G. P. Huang, A. I. Mourikis and S. I. Roumeliotis, "Observability-based rules for designing consistent EKF SLAM
estimators", International Journal of Robotics Research 29(5), 2010: speed 0.25 m/s, turn rate 0.025 rad/s, wheels 0.5 m
apart that each measure their speed to s = 5 % of the robot's, hence sigma_v = s / sqrt 2 and sigma_omega = 2 sqrt 2 s;
sightings in all directions, with noise of 0.1 m along and across the line of sight. The landmarks' positions are not
given there and are ours.
"""

from dataclasses import dataclass

import numpy as np

from ...core.elementary import sincos
from ...core.errors import InputError
from ...core.factors import Dataset, Log, Map, Truth
from ...core.options import option
from ...core.se2 import Array, wrap
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

BASE = 0.5  # m between the wheels
PERIOD = 1.0  # s between steps


@dataclass(frozen=True)
class Options(HiddenIds, OnMap, Parts, WorldFixes, WorldGyro, WorldSlip, WorldSignatures, Faults):
    """The drive, its noise, and faults."""

    steps: int = option(2500, "steps, of 1 s", minimum=2, maximum=100_000)
    landmarks: int = option(20, "landmarks near the circle", minimum=1, maximum=1000)
    speed: float = option(0.25, "speed of the robot, m/s", minimum=0.01, maximum=10.0)
    turn_rate: float = option(0.025, "turn rate of the robot, rad/s", minimum=1e-3, maximum=1.0)
    odometry: float = option(0.05, "noise of a wheel's speed, as a share of the robot's", minimum=1e-4, maximum=1.0)
    sighting: float = option(0.1, "noise of a sighting along and across the line of sight, m", minimum=1e-4, maximum=10)
    nearest: float = option(2.0, "least range of a sighting, m", minimum=0.0, maximum=1000.0)
    farthest: float = option(5.0, "greatest range of a sighting, m", minimum=0.01, maximum=1000.0)


def circle(options: Options, rng: np.random.Generator) -> Dataset:
    """Huang's circle: ten laps among 20 landmarks, the classic test of a filter's consistency; one log per seed."""
    if options.farthest <= options.nearest:
        raise InputError(
            f"dataset circle: option farthest={options.farthest:g}: expected more than nearest={options.nearest:g} m."
        )
    world, moving, seeing = rng.spawn(3)
    rolling = PERIOD * np.array([options.speed, options.turn_rate])
    poses = _round(options)
    xy = _landmarks(options, world)
    wheel = options.odometry * options.speed * PERIOD
    sd = wheel * np.array([1 / np.sqrt(2), np.sqrt(2) / BASE])
    delta, delta_cov = odometry(poses, np.tile(rolling, (options.steps - 1, 1)), sd, moving)
    step, row = in_reach(poses, xy, options.nearest, options.farthest)
    z, z_cov = sightings(poses[step], xy[row], options.sighting, seeing)
    t = PERIOD * np.arange(options.steps, dtype=np.float64)
    ids = np.arange(options.landmarks)
    notes = {"source": "simulated after Huang, Mourikis and Roumeliotis, IJRR 29(5), 2010"}
    start = prior(poses[0], world)
    log = Log.from_arrays("circle", start, t, delta, delta_cov, step, ids[row], z, z_cov, notes=notes)
    return with_faults(Dataset(log, Truth(t, poses, Map(ids, xy, None), None, "truth")), options, rng)


def _round(options: Options) -> Array:
    """The true poses (steps, 3): counter-clockwise from the origin, initially along x."""
    heading = PERIOD * options.turn_rate * np.arange(options.steps, dtype=np.float64)
    s, c = sincos(heading)
    xy = options.speed / options.turn_rate * np.stack((s, 1 - c), axis=-1)
    return np.column_stack((xy, wrap(heading)))


def _landmarks(options: Options, rng: np.random.Generator) -> Array:
    """(landmarks, 2) m: random along the circle, inside or outside, from `nearest` to `farthest` off it.

    They may be close to each other, so there are clusters, and stretches without any in view.
    """
    radius, n = options.speed / options.turn_rate, options.landmarks
    angle = rng.uniform(0, 2 * np.pi, n)
    off = rng.uniform(options.nearest, options.farthest, n)
    inside = (rng.uniform(size=n) < 0.5) & (off < radius)
    away = np.where(inside, radius - off, radius + off)
    s, c = sincos(angle)
    return np.stack((away * s, radius - away * c), axis=-1)


source = Source(circle, options=Options, seeded=True)
