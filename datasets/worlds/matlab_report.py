"""The Matlab report's setting: a small robot on a fixed path that sees 6 or 12 tags, with a stretch without any.

The report (Fan Zhenhui, 2018, chapter 4) drives a differential-drive robot along one path and fuses its wheel encoders
with a camera's sightings of tags. It finds that dead reckoning drifts, that 12 tags give a better path than 6, and that
the estimate jumps near (-0.7, 2.6), where tags come into view again after a stretch with encoders only. It gives
neither the path nor the tags nor any noise: those are ours, laid out so that the 6 tags are left behind in the first
quarter of the way and are in sight again just there; the other 6 are along the rest and shorten that stretch. The
wheels roll on exact arcs, eq. (3-1) with the sign of its x corrected. `simulated` takes any drive among any tags.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...core.elementary import cos, hypot, sin, sincos
from ...core.factors import Dataset, Log, Map, Prior, Truth
from ...core.options import option
from ...core.se2 import Array, Ints
from ...frontend.wheels.encoder import Encoder
from ..hidden_ids import HiddenIds
from ..on_demand.fixes import WorldFixes
from ..on_demand.gyro import WorldGyro
from ..on_demand.parts import Parts
from ..on_demand.signatures import WorldSignatures
from ..on_demand.slip import WorldSlip
from ..on_map import OnMap
from ..registry import Source
from .faults import Faults, with_faults
from .measurements import FLOORS, counted, in_reach, polar, prior
from .wheeled_robot import ClosedPath, count, drive

CENTRE, HALF, START = np.array([1.0, 1.4]), np.array([2.3, 1.75]), np.deg2rad(160.0)
"""The path's ellipse: its centre and half axes, m, and the robot's starting angle on it, counter-clockwise."""

LOOP = ClosedPath(cos=HALF * np.array([[cos(START), sin(START)]]), sin=HALF * np.array([[-sin(START), cos(START)]]))
"""The path around its centre."""

SPEED, PERIOD, STEPS = 0.3, 0.2, 280
"""m/s, s between keyframes, and number of keyframes: a lap and three tenths."""

READINGS = 10  # of the encoders per keyframe: every 0.02 s

TAGS = np.array([
    [-1.9, 0.9], [-1.2, -0.2], [-0.4, 0.4], [-0.2, -0.9], [0.6, 0.2], [1.4, -0.9],
    [3.0, -0.3], [2.7, 1.1], [3.9, 2.0], [2.2, 2.4], [1.9, 3.7], [0.5, 2.7],
])  # fmt: skip
"""m, (12, 2); the report's six come first."""

NEAREST, FARTHEST, HALF_VIEW = 0.3, 2.2, np.deg2rad(42.0)
"""m and rad: where the camera reads a tag, ahead."""

BASE, COUNT = 0.3, 1e-4  # m between the wheels, and m per count of an encoder
WHEELS, RANGE_NOISE, BEARING_NOISE = 0.015, 0.03, 0.02  # m per root metre, m, and rad


@dataclass(frozen=True)
class Robot:
    """The robot: by default the report's, with our noise."""

    base: float = BASE  # m
    count: float = COUNT  # m
    wheels: float = WHEELS
    nearest: float = NEAREST  # m
    farthest: float = FARTHEST  # m
    half_view: float = HALF_VIEW  # rad; pi: all around
    range_noise: float = RANGE_NOISE
    bearing_noise: float = BEARING_NOISE


class Drive(NamedTuple):
    """The robot's true motion."""

    t: Array  # (n,) s, keyframes
    poses: Array  # (n, 3) there
    ticks: Array  # (m,) s, readings of the encoders
    tick_poses: Array  # (m, 3) there; of their positions none is used
    way: Array  # (m,) m driven


class Measured(NamedTuple):
    """The report's robot's measurements on a drive."""

    prior: Prior
    delta: Array  # (n, 3)
    delta_cov: Array  # (n, 3, 3)
    step: Ints  # (s,) of the sightings
    tag: Ints  # (s,)
    z: Array  # (s, 2)
    z_cov: Array  # (s, 2, 2)


@dataclass(frozen=True)
class Options(HiddenIds, OnMap, Parts, WorldFixes, WorldGyro, WorldSlip, WorldSignatures, Faults):
    """The tags, the noise, and faults."""

    tags: int = option(6, "number of tags; the first of 12, and the report has 6 or 12", minimum=1, maximum=12)
    wheels: float = option(WHEELS, "noise of a wheel's distance, m per root metre", minimum=1e-4, maximum=1.0)
    range_noise: float = option(RANGE_NOISE, "noise of a sighting's range, m", minimum=1e-4, maximum=1.0)
    bearing_noise: float = option(BEARING_NOISE, "noise of a sighting's bearing, rad", minimum=1e-4, maximum=1.0)


def matlab_report(options: Options, rng: np.random.Generator) -> Dataset:
    """The Matlab report's robot: one fixed path, 6 or 12 tags, and a stretch without tags before they return."""
    t, ticks = times(STEPS, PERIOD)
    poses = _path(t)
    robot = Robot(wheels=options.wheels, range_noise=options.range_noise, bearing_noise=options.bearing_noise)
    # All twelve are sighted and some are then removed, so that 6 and 12 tags share their errors.
    seen = simulated(robot, Drive(t, poses, ticks, *drive(LOOP, SPEED, ticks)), TAGS, rng)
    there, ids = seen.tag < options.tags, np.arange(options.tags)
    sighted = seen.step[there], seen.tag[there], seen.z[there], seen.z_cov[there]
    notes = {"source": "simulated after the Matlab report, chapter 4; path, tags and noise are ours"}
    log = Log.from_arrays("matlab-report", seen.prior, t, seen.delta, seen.delta_cov, *sighted, notes=notes)
    return with_faults(Dataset(log, Truth(t, poses, Map(ids, TAGS[ids], None), None, "truth")), options, rng)


def times(steps: int, period: float) -> tuple[Array, Array]:
    """The times of `steps` keyframes, `period` s apart, and those of the encoders' readings, s."""
    return (
        period * np.arange(steps, dtype=np.float64),
        period / READINGS * np.arange(READINGS * (steps - 1) + 1, dtype=np.float64),
    )


def simulated(robot: Robot, driven: Drive, tags: Array, rng: np.random.Generator) -> Measured:
    """Draws the measurements of `robot` on a drive among `tags` (k, 2), m."""
    start, wheels, floors, seeing = rng.spawn(4)
    encoder = Encoder(robot.count, robot.count, robot.base, robot.wheels, noise="distance", curve="arc", floors=FLOORS)
    readings = count(driven.tick_poses, driven.way, driven.ticks, encoder, wheels)
    delta, delta_cov = counted(readings, encoder, driven.t, floors)
    step, tag = _seen(robot, driven.poses, tags)
    sd = np.array([robot.range_noise, robot.bearing_noise])
    z, z_cov = polar(driven.poses[step], tags[tag], sd, seeing)
    return Measured(prior(driven.poses[0], start), delta, delta_cov, step, tag, z, z_cov)


def _path(t: Array) -> Array:
    """The true poses (n, 3) at the times `t` (n,), s."""
    poses, _ = drive(LOOP, SPEED, t)
    return poses + np.array([*CENTRE, 0.0])


def _seen(robot: Robot, poses: Array, tags: Array) -> tuple[Ints, Ints]:
    """Tags in the camera's view from each pose: the steps and the tags."""
    step, tag = in_reach(poses, tags, robot.nearest, robot.farthest)
    if robot.half_view >= np.pi:
        return step, tag
    x, y = (tags[tag] - poses[step, :2]).T
    s, c = sincos(poses[step, 2])
    within = x * c + y * s > hypot(x, y) * cos(robot.half_view)
    return step[within], tag[within]


source = Source(matlab_report, options=Options, seeded=True)
