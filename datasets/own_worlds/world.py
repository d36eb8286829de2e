"""A world of your own: the Matlab report's robot among landmarks of a file, along way points of another.

As the report's `ekfslam(lm, wp)` (Fan Zhenhui, 2018, appendix A). The robot, its wheels and its camera are those of the
dataset matlab-report, made as much larger as the landmarks here are farther apart: every length and the speed by that
factor, the wheels' noise, which grows with the root of the distance, by its root. Then the same drive is as hard in
a world of any size. The appendix' own robot sees all around, `view=360`, and starts at the origin along x, here at the
first way point towards the second.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...core.elementary import hypot
from ...core.errors import InputError
from ...core.factors import REMARKS, Dataset, Log, Map, Truth
from ...core.options import option
from ...core.se2 import Array, Ints
from ..hidden_ids import HiddenIds
from ..on_demand.fixes import WorldFixes
from ..on_demand.gyro import WorldGyro
from ..on_demand.parts import Parts
from ..on_demand.signatures import WorldSignatures
from ..on_demand.slip import WorldSlip
from ..on_map import OnMap
from ..registry import Named, Source
from ..worlds import matlab_report as report
from ..worlds.faults import Faults, with_faults
from ..worlds.matlab_report import Drive, Robot, simulated, times
from .points import Points, read_landmarks, read_way_points
from .route import Route, route

SPACING = 1.5  # m between the 12 tags of matlab-report, as `spacing` measures it
NEAR = 0.3  # m, there, at which the robot heads for the next way point
MOST_STEPS = 100_000
"""More indicate an error: millimetres, or coordinates of a country."""


@dataclass(frozen=True)
class Options(HiddenIds, OnMap, Parts, WorldFixes, WorldGyro, WorldSlip, WorldSignatures, Faults, Named):
    """The files, the robot, its noise, and faults."""

    landmarks: str | None = option(None, "file of the landmarks: x,y or id,x,y, or the variable lm of a .mat file")
    path: str | None = option(None, "file of the way points: x,y, or the variable wp of a .mat file")
    loops: int = option(1, "laps from the first way point to the last", minimum=1, maximum=1000)
    scale: float | None = option(
        None,
        "size of the robot, 1 being matlab-report's; not given: as much larger as the landmarks are farther apart",
        minimum=1e-3,
        maximum=1e6,
    )
    speed: float | None = option(
        None, "speed, m/s; not given, here and below: that of matlab-report, times scale", minimum=1e-4, maximum=1e5
    )
    turn_rate: float = option(1.0, "turn rate in a turn, rad/s", minimum=1e-3, maximum=100.0)
    near: float | None = option(
        None, "distance from a way point at which the robot heads for the next, m", minimum=1e-6, maximum=1e6
    )
    period: float = option(report.PERIOD, "time from step to step, s", minimum=1e-3, maximum=1e4)
    nearest: float | None = option(None, "least range of a sighting, m", minimum=0.0, maximum=1e6)
    reach: float | None = option(None, "greatest range of a sighting, m", minimum=1e-3, maximum=1e7)
    view: float = option(84.0, "field of view ahead, degrees; 360: all around", minimum=1.0, maximum=360.0)
    wheels: float | None = option(
        None, "noise of a wheel's distance, m per root metre; not given: times the root of scale",
        minimum=1e-6, maximum=1e3,
    )  # fmt: skip
    range_noise: float | None = option(None, "noise of a sighting's range, m", minimum=1e-6, maximum=1e5)
    bearing_noise: float = option(report.BEARING_NOISE, "noise of a sighting's bearing, rad", minimum=1e-5, maximum=1.0)


class _Sizes(NamedTuple):
    """The sizes that grow with the world."""

    robot: Robot
    speed: float  # m/s
    near: float  # m


def world(options: Options, rng: np.random.Generator) -> Dataset:
    """The Matlab report's robot on way points and among landmarks of your own: world[landmarks=FILE,path=FILE]."""
    if options.landmarks is None or options.path is None:
        missing = "landmarks" if options.landmarks is None else "path"
        raise InputError(f"option {missing} of dataset world is not given, expected world[landmarks=FILE,path=FILE].")
    landmarks, way_points = read_landmarks(Path(options.landmarks)), read_way_points(Path(options.path))
    sizes = _sizes(options, spacing(landmarks.xy, way_points.xy) / SPACING)
    way = route(np.tile(way_points.xy, (options.loops, 1)), sizes.speed / options.turn_rate, sizes.near)
    driven = _drive(way, way_points, options, sizes)
    seen = simulated(sizes.robot, driven, landmarks.xy, rng)
    if not len(seen.step):
        raise _out_of_reach(landmarks, driven.poses, sizes.robot)
    remarks = [*_landmark_remarks(landmarks, seen.tag), *_way_remarks(way_points, way, sizes.near)]
    notes: dict[str, Any] = {
        "source": "simulated: the Matlab report's robot among landmarks and way points from files",
        "files": {"landmarks": landmarks.path.name, "path": way_points.path.name},
        "robot": {"speed": sizes.speed, "near": sizes.near, **vars(sizes.robot)},
    }
    log = Log.from_arrays(
        way_points.path.stem,
        seen.prior,
        driven.t,
        seen.delta,
        seen.delta_cov,
        seen.step,
        landmarks.ids[seen.tag],
        seen.z,
        seen.z_cov,
        notes=notes | ({REMARKS: remarks} if remarks else {}),
    )
    known = Map(landmarks.ids, landmarks.xy, None)
    return with_faults(Dataset(log, Truth(driven.t, driven.poses, known, None, "truth")), options, rng)


def spacing(landmarks: Array, way_points: Array) -> float:
    """The distance between `landmarks` (k, 2) that fill the rectangle around them and `way_points` (w, 2) evenly, m."""
    wide, high = np.ptp(np.concatenate((landmarks, way_points)), axis=0)
    return float(np.sqrt(max(wide * high, max(wide, high) ** 2 / len(landmarks)) / len(landmarks)))


def _sizes(options: Options, scale: float) -> _Sizes:
    """The robot, its speed and its steering; `scale` where the options give none."""
    scale = scale if options.scale is None else options.scale

    def sized(given: float | None, usual: float, factor: float = scale) -> float:
        return usual * factor if given is None else given

    robot = Robot(
        base=report.BASE * scale,
        count=report.COUNT * scale,
        wheels=sized(options.wheels, report.WHEELS, float(np.sqrt(scale))),
        nearest=sized(options.nearest, report.NEAREST),
        farthest=sized(options.reach, report.FARTHEST),
        half_view=np.pi * options.view / 360,
        range_noise=sized(options.range_noise, report.RANGE_NOISE),
        bearing_noise=options.bearing_noise,
    )
    if robot.farthest <= robot.nearest:
        raise InputError(
            f"dataset world: sightings reach to {robot.farthest:g} m (option reach), expected more than "
            f"{robot.nearest:g} m, the least range of a sighting (option nearest)."
        )
    return _Sizes(robot, sized(options.speed, report.SPEED), sized(options.near, NEAR))


def _drive(way: Route, way_points: Points, options: Options, sizes: _Sizes) -> Drive:
    """The robot's motion, at one speed to the last whole step; InputError for no step, or too many."""
    stride = sizes.speed * options.period
    steps = 1 + int(way.length / stride)
    if not way.length:
        raise InputError(
            f"{way_points.path}: all way points are within near={sizes.near:g} m of the first, expected one farther "
            "away, or another scale or near."
        )
    if steps < 2:
        raise InputError(
            f"{way_points.path}: the way is {way.length:.4g} m long, expected at least a step, {stride:.4g} m at "
            f"{sizes.speed:.4g} m/s and {options.period:g} s; options speed, period and scale make steps shorter."
        )
    if steps > MOST_STEPS:
        legs = hypot(*np.diff(way_points.xy, axis=0).T)
        longest = int(np.argmax(legs))
        raise InputError(
            f"{way_points.path}: the way is {way.length:.4g} m long, {steps:,} steps at {sizes.speed:.4g} m/s and "
            f"{options.period:g} s, expected at most {MOST_STEPS:,}; its longest leg is {legs[longest]:.4g} m, to "
            f"{way_points.places[longest + 1]}. Is that in metres? Options speed, period and scale make steps longer."
        )
    t, ticks = times(steps, options.period)
    rolled = np.minimum(sizes.speed * ticks, way.length)
    return Drive(t, way.at(np.minimum(sizes.speed * t, way.length)), ticks, way.at(rolled), rolled)


def _out_of_reach(landmarks: Points, poses: Array, robot: Robot) -> InputError:
    from scipy.spatial import KDTree

    far, _ = KDTree(poses[:, :2]).query(landmarks.xy)
    row = int(np.argmin(far))
    return landmarks.fault(
        row,
        f"no landmark is ever in view; the nearest to the way is this one, at {far[row]:.4g} m, expected one from "
        f"{robot.nearest:.4g} to {robot.farthest:.4g} m ahead (options nearest, reach and view)",
    )


def _landmark_remarks(landmarks: Points, seen: Ints) -> list[str]:
    found = list[str]()
    unseen = np.setdiff1d(np.arange(len(landmarks.xy)), seen)
    if len(unseen):
        found.append(
            f"{landmarks.path}: {len(unseen)} of {len(landmarks.xy)} landmarks are never in view, the first in "
            f"{landmarks.places[unseen[0]]}"
        )
    order = np.lexsort(landmarks.xy.T)
    twin = np.flatnonzero((np.diff(landmarks.xy[order], axis=0) == 0).all(axis=1))
    if len(twin):
        first, second = sorted(order[[twin[0], twin[0] + 1]].tolist())
        found.append(
            f"{landmarks.path}: the landmarks in {landmarks.places[first]} and {landmarks.places[second]} are in the "
            "same place"
        )
    return found


def _way_remarks(way_points: Points, way: Route, near: float) -> list[str]:
    path, n = way_points.path, len(way_points.xy)
    passed, around = (np.unique(rows[rows < n]) for rows in (way.passed, way.around))
    found = list[str]()
    if len(passed):
        found.append(
            f"{path}: {len(passed)} of {n} way points are within near={near:.3g} m of the robot when it heads for them "
            f"and are left out, the first in {way_points.places[passed[0]]}"
        )
    if len(around):
        found.append(
            f"{path}: {len(around)} of {n} way points are too near for the robot to turn towards them, the first in "
            f"{way_points.places[around[0]]}: it drives a circle to the other side; a larger turn_rate turns shorter"
        )
    return found


source = Source(world, options=Options, seeded=True)
