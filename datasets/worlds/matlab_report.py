"""The Matlab report's setting: a small robot on a fixed path that sees 6 or 12 tags, with a stretch without any.

The report (Fan Zhenhui, 2018, chapter 4) drives a differential-drive robot along one path and fuses its wheel encoders
with a camera's sightings of tags. It finds that dead reckoning drifts, that 12 tags give a better path than 6, and that
the estimate jumps near (-0.7, 2.6), where tags come into view again after a stretch with encoders only. It gives
neither the path nor the tags nor any noise: those are ours, laid out so that the 6 tags are left behind in the first
quarter of the way and are in sight again just there; the other 6 are along the rest and shorten that stretch. The
wheels roll on exact arcs, eq. (3-1) with the sign of its x corrected.
"""

from dataclasses import dataclass

import numpy as np

from ...core.elementary import cos, hypot, sin, sincos
from ...core.factors import Dataset, Log, Map, Truth
from ...core.options import option
from ...core.se2 import Array, Ints
from ...frontend.wheels.encoder import Encoder
from ..hidden_ids import HiddenIds
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

TICK = 0.02  # s between readings of the encoders

TAGS = np.array([
    [-1.9, 0.9], [-1.2, -0.2], [-0.4, 0.4], [-0.2, -0.9], [0.6, 0.2], [1.4, -0.9],
    [3.0, -0.3], [2.7, 1.1], [3.9, 2.0], [2.2, 2.4], [1.9, 3.7], [0.5, 2.7],
])  # fmt: skip
"""m, (12, 2); the report's six come first."""

NEAREST, FARTHEST, HALF_VIEW = 0.3, 2.2, np.deg2rad(42.0)
"""m and rad: where the camera reads a tag, ahead."""


@dataclass(frozen=True)
class Options(HiddenIds, OnMap, Faults):
    """The tags, the noise, and faults."""

    tags: int = option(6, "number of tags; the first of 12, and the report has 6 or 12", minimum=1, maximum=12)
    wheels: float = option(0.015, "noise of a wheel's distance, m per root metre", minimum=1e-4, maximum=1.0)
    range_noise: float = option(0.03, "noise of a sighting's range, m", minimum=1e-4, maximum=1.0)
    bearing_noise: float = option(0.02, "noise of a sighting's bearing, rad", minimum=1e-4, maximum=1.0)


def matlab_report(options: Options, rng: np.random.Generator) -> Dataset:
    """The Matlab report's robot: one fixed path, 6 or 12 tags, and a stretch without tags before they return."""
    start, wheels, floors, seeing = rng.spawn(4)
    encoder = Encoder(1e-4, 1e-4, 0.3, options.wheels, noise="distance", curve="arc", floors=FLOORS)
    t = PERIOD * np.arange(STEPS, dtype=np.float64)
    ticks = TICK * np.arange(round(PERIOD / TICK) * (STEPS - 1) + 1, dtype=np.float64)
    poses = _path(t)
    readings = count(*drive(LOOP, SPEED, ticks), ticks, encoder, wheels)
    delta, delta_cov = counted(readings, encoder, t, floors)
    # All twelve are sighted and some are then removed, so that 6 and 12 tags share their errors.
    step, tag = _seen(poses)
    sd = np.array([options.range_noise, options.bearing_noise])
    z, z_cov = polar(poses[step], TAGS[tag], sd, seeing)
    there, ids, beginning = tag < options.tags, np.arange(options.tags), prior(poses[0], start)
    sighted = step[there], tag[there], z[there], z_cov[there]
    notes = {"source": "simulated after the Matlab report, chapter 4; path, tags and noise are ours"}
    log = Log.from_arrays("matlab-report", beginning, t, delta, delta_cov, *sighted, notes=notes)
    return with_faults(Dataset(log, Truth(t, poses, Map(ids, TAGS[ids], None), None, "truth")), options, rng)


def _path(t: Array) -> Array:
    """The true poses (n, 3) at the times `t` (n,), s."""
    poses, _ = drive(LOOP, SPEED, t)
    return poses + np.array([*CENTRE, 0.0])


def _seen(poses: Array) -> tuple[Ints, Ints]:
    """Tags in the camera's view from each pose: the steps and the tags."""
    step, tag = in_reach(poses, TAGS, NEAREST, FARTHEST)
    x, y = (TAGS[tag] - poses[step, :2]).T
    s, c = sincos(poses[step, 2])
    within = x * c + y * s > hypot(x, y) * cos(HALF_VIEW)
    return step[within], tag[within]


source = Source(matlab_report, options=Options, seeded=True)
