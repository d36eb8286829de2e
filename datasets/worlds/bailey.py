"""Bailey's consistency setting: a car that drives two loops, on which EKF-SLAM and FastSLAM were shown inconsistent.

T. Bailey, J. Nieto, J. Guivant, M. Stevens and E. Nebot, "Consistency of the EKF-SLAM algorithm", IROS 2006; T. Bailey,
J. Nieto and E. Nebot, "Consistency of the FastSLAM algorithm", ICRA 2006. A car of 4 m wheel base drives at 3 m/s from
waypoint to waypoint, its steering limited to 30 degrees and 20 degrees/s; a control every 0.025 s, with noise of 0.3
m/s and 3 degrees; sightings every 0.2 s ahead within 30 m, with noise of 0.1 m and 1 degree; a known start. The
waypoints and landmarks are not given there and are ours. Eight controls make one factor, with propagated covariance.
"""

from dataclasses import dataclass
from math import pi, radians, remainder

import numpy as np

from ...core.elementary import arctan2, hypot, sincos
from ...core.factors import Dataset, Log, Map, Truth
from ...core.options import option
from ...core.se2 import Array
from ...core.small_matrices import product
from ...frontend.wheels.encoder import compose
from ..hidden_ids import HiddenIds
from ..on_demand.fixes import WorldFixes
from ..on_demand.gyro import WorldGyro
from ..on_demand.parts import Parts
from ..on_demand.signatures import WorldSignatures
from ..on_demand.slip import WorldSlip
from ..on_map import OnMap
from ..registry import Source
from .faults import Faults, with_faults
from .measurements import FLOORS, in_reach, polar, prior

SPEED = 3.0  # m/s
WHEEL_BASE = 4.0  # m, from the front axle to the rear one
MOST_STEERING, STEERING_RATE = radians(30.0), radians(20.0)  # rad and rad/s
CONTROL = 0.025  # s between controls
CONTROLS = 8  # controls between sightings
NEAR = 1.0  # m from a waypoint at which the car turns to the next

WAYPOINTS = np.array(
    [[35, 0], [60, 10], [68, 32], [55, 52], [30, 48], [5, 58], [-18, 48], [-25, 25], [-15, 5], [0, 0]], float
)
"""m, (w, 2): a loop of some 250 m with bends to both sides. The car starts at the last of them, along x."""

ASIDE = (4.0, 14.0)
"""m, distances of the landmarks from the straight lines between waypoints, on either side."""


@dataclass(frozen=True)
class Options(HiddenIds, OnMap, Parts, WorldFixes, WorldGyro, WorldSlip, WorldSignatures, Faults):
    """The world, its noise, and faults."""

    landmarks: int = option(35, "landmarks along the loop; smaller sets are part of larger", minimum=1, maximum=10_000)
    loops: int = option(2, "laps of the loop", minimum=1, maximum=50)
    speed_noise: float = option(0.3, "noise of a control's speed, m/s", minimum=1e-4, maximum=3.0)
    steering_noise: float = option(3.0, "noise of a control's steering angle, degrees", minimum=1e-3, maximum=30.0)
    range_noise: float = option(0.1, "noise of a sighting's range, m", minimum=1e-4, maximum=10.0)
    bearing_noise: float = option(1.0, "noise of a sighting's bearing, degrees", minimum=1e-3, maximum=30.0)
    reach: float = option(30.0, "range of the sightings, m", minimum=1.0, maximum=1000.0)


def bailey(options: Options, rng: np.random.Generator) -> Dataset:
    """Bailey's car: two loops of 250 m among 35 landmarks, on which EKF-SLAM and FastSLAM were shown inconsistent."""
    start, steering, seeing = rng.spawn(3)
    path, controls = _drive(options.loops)
    poses = path[::CONTROLS]
    sd = np.array([options.speed_noise, np.deg2rad(options.steering_noise)])
    measured = controls + sd * steering.standard_normal(controls.shape)
    moves, by_control = _moves(measured)
    by_noise = by_control * sd
    cov = product(by_noise, by_noise.swapaxes(1, 2))
    delta, delta_cov = np.zeros((len(poses), 3)), np.zeros((len(poses), 3, 3))
    for k in range(1, len(poses)):
        between_sightings = slice(CONTROLS * (k - 1), CONTROLS * k)
        delta[k], delta_cov[k] = compose(moves[between_sightings], cov[between_sightings], FLOORS)
    xy = landmarks(options.landmarks)
    step, row = in_reach(poses, xy, 0.0, options.reach)
    s, c = sincos(poses[step, 2])
    x, y = (xy[row] - poses[step, :2]).T
    ahead = x * c + y * s > 0
    step, row = step[ahead], row[ahead]
    sighting_sd = np.array([options.range_noise, np.deg2rad(options.bearing_noise)])
    z, z_cov = polar(poses[step], xy[row], sighting_sd, seeing)
    t = CONTROL * CONTROLS * np.arange(len(poses), dtype=np.float64)
    ids = np.arange(options.landmarks)
    after = "simulated after Bailey and others, IROS 2006 and ICRA 2006; waypoints and landmarks are ours"
    beginning, notes = prior(poses[0], start), {"source": after}
    log = Log.from_arrays("bailey", beginning, t, delta, delta_cov, step, ids[row], z, z_cov, notes=notes)
    return with_faults(Dataset(log, Truth(t, poses, Map(ids, xy, None), None, "truth")), options, rng)


def landmarks(count: int) -> Array:
    """(count, 2) m, the same for all seeds: spread along the loop, on both sides of it and close.

    Positions along and aside are the fractional parts of multiples of two irrational numbers, which are evenly spread
    for any number of landmarks.
    """
    corners = np.concatenate((WAYPOINTS[-1:], WAYPOINTS))
    lengths = hypot(*np.diff(corners, axis=0).T)
    n = np.arange(1, count + 1, dtype=np.float64)
    along, aside = np.mod(n / np.array([[1.324717957244746], [1.754877666246693]]), 1.0)  # powers of the plastic ratio
    ends = np.concatenate(([0.0], np.cumsum(lengths)))
    place = along * ends[-1]
    leg = np.searchsorted(ends, place, "right") - 1
    direction = np.diff(corners, axis=0)[leg] / lengths[leg, None]
    off = np.where(aside < 0.5, -1.0, 1.0) * (ASIDE[0] + (ASIDE[1] - ASIDE[0]) * np.mod(2 * aside, 1.0))
    across = np.stack((-direction[:, 1], direction[:, 0]), axis=-1)
    return corners[leg] + (place - ends[leg])[:, None] * direction + off[:, None] * across


def _drive(loops: int) -> tuple[Array, Array]:
    """The car's true poses (CONTROLS * n + 1, 3) after every control, and the controls: speed and steering angle."""
    x = y = heading = steering = 0.0
    poses, controls = [(x, y, heading)], list[tuple[float, float]]()
    waypoints = WAYPOINTS.tolist() * loops
    goal, way, rate = 0, SPEED * CONTROL, STEERING_RATE * CONTROL
    while goal < len(waypoints) or len(controls) % CONTROLS:
        east, north = waypoints[min(goal, len(waypoints) - 1)]
        goal += bool(hypot(east - x, north - y) < NEAR)
        wanted = remainder(float(arctan2(north - y, east - x)) - heading - steering, 2 * pi)
        steering = min(max(steering + min(max(wanted, -rate), rate), -MOST_STEERING), MOST_STEERING)
        s, c = map(float, sincos(heading + steering))
        x, y = x + way * c, y + way * s
        heading = remainder(heading + way * float(sincos(steering).sin) / WHEEL_BASE, 2 * pi)
        poses.append((x, y, heading))
        controls.append((SPEED, steering))
    return np.array(poses), np.array(controls)


def _moves(controls: Array) -> tuple[Array, Array]:
    """The motions (n, 3) of `controls` (n, 2), speed and steering angle, and d motion / d control, (n, 3, 2).

    The car's pose is that of its front axle, which moves in the direction of the front wheels.
    """
    way, (s, c) = CONTROL * controls[:, 0], sincos(controls[:, 1])
    delta = np.stack((way * c, way * s, way * s / WHEEL_BASE), axis=-1)
    by_speed = CONTROL * np.stack((c, s, s / WHEEL_BASE), axis=-1)
    by_steering = np.stack((-way * s, way * c, way * c / WHEEL_BASE), axis=-1)
    return delta, np.stack((by_speed, by_steering), axis=-1)


source = Source(bailey, options=Options, seeded=True)
