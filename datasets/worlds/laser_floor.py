"""The made-up floor: a wheeled robot with a laser scanner drives laps of a corridor and looks into rooms.

Scans are computed from walls and people, and go through the same front end as recorded ones.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...core.elementary import arctan2, hypot, sincos
from ...core.factors import REMARKS, Dataset, Prior, Truth
from ...core.options import option
from ...core.se2 import Array, between, compose, wrap
from ...frontend.inertial.imu import Imu
from ...frontend.inertial.standing import standing
from ...frontend.inertial.tilts import leaned, tilts
from ...frontend.laser.log import build_log, first_scan
from ...frontend.laser.recording import LaserRecording
from ...frontend.laser.scanner import Scanner
from ...frontend.laser.settings import Settings
from ...frontend.laser.tilted import Leaning, levelled
from ...frontend.wheels.track import Poses, Track, TrackNoise
from ..false_loops import FalseLoops
from ..grid_file import grid_files, localised
from ..on_demand.fixes import WorldFixes
from ..on_demand.gyro import WorldGyro
from ..on_demand.imu import imu_of
from ..on_demand.rocking import Rocking
from ..on_demand.slip import WheelSlip, slipping_poses
from ..registry import Source
from ..rendering._casting import cast
from ..wheel_faults import WheelFaults, faulty_clock, faulty_poses
from .floor_plan import CORRIDOR, Plan, floor_plan

SIZE, DEPTH = (36.0, 22.0), 5.0  # m: the floor, and the rooms outside of the corridor
TICK = 0.02  # s between positions of the drive
ENOUGH = 0.15  # m from a way point at which the robot turns to the next one

TURNING, FASTEST, STRAIGHT, LAG = 2.5, 1.0, 0.6, 0.2
"""1/s and rad/s of the steering; rad off its course at which the robot stands still to turn; s in which the motors of a
robot with inertia follow."""

SPEED, CREEP, PUSH = 0.5, 0.1, 0.5  # m/s, m/s at way points, and m/s^2 of a robot that rocks
GYRO = 0.01  # degrees/s per root Hz, of the unit of option imu where option gyro says nothing

VISITED = 0.25  # share of the rooms that the robot looks into, each lap

FURTHEST, NO_RETURN, LOST = 20.0, 81.83, 0.02
"""m of a return at most; what the scanner says where there is none; share of beams without a return by themselves."""

RESOLUTION = 0.01  # m

LEG, APART, STRIDE, PACE = 0.09, 0.18, 0.12, 4.0
"""m, radius of a person's legs, how far they are apart, how far they swing; rad/s of the swing."""

CLEAR = 0.6  # m around the robot into which nobody steps
START_SD = 1e-3  # m and rad; the robot starts exactly at the prior's mean


@dataclass(frozen=True)
class Options(FalseLoops, WorldFixes, WorldGyro, WheelSlip, WheelFaults, Settings):
    """The drive, the scanner, and the front end."""

    drive: int = option(
        0, "which drive on the seed's floor: 1 and up begin elsewhere, odd ones go the other way", minimum=0
    )
    laps: float = option(2.0, "laps of the corridor, of 71 m each", minimum=0.05, maximum=1000.0)
    people: int = option(4, "people who walk about in the corridor", minimum=0, maximum=100)
    beams: int = option(181, "beams of the scanner, over half a circle", minimum=31, maximum=2000)
    range_sd: float = option(0.015, "noise of a range, m", minimum=0.0, maximum=0.5)
    scan_rate: float = option(5.0, "scans per second", minimum=1.0, maximum=50.0)
    slip: float = option(1.0, "noise of the wheels, 1 being 3 cm and 1 degree in a metre", minimum=0.0, maximum=20.0)
    sway: float = option(
        0.0, "rocking of the body, standard deviation of pitch and roll, rad; 0: its floor is even",
        minimum=0.0, maximum=0.2,
    )  # fmt: skip
    scanner_height: float = option(
        0.3, "height of the scanner over the floor, m", minimum=0.02, maximum=3.0, beside="sway"
    )
    stamp_sd: float = option(
        0.0, "sd of a scan's time, s, as stated: scans are taken at once, and at the times that they say",
        minimum=0.0, maximum=0.1,
    )  # fmt: skip
    imu: bool = option(
        False, "an inertial measurement unit, by whose gravity scans are levelled, and returns of the floor left out",
        beside="sway",
    )  # fmt: skip
    max_tilt: float | None = option(
        None, "lean, rad, beyond which scans are left out, too; none: no scan", minimum=0.001, maximum=1.5, beside="imu"
    )


def laser_floor(options: Options, rng: np.random.Generator) -> Dataset:
    """Laser scans on a made-up floor with rooms, doors and people, and wheel odometry; one floor per seed."""
    recording, truth = record(options, rng)
    log = build_log(localised(recording, options), options)
    rows = np.searchsorted(truth.t, log.t[first_scan(log) :])
    return Dataset(log, Truth(truth.t[rows], truth.poses[rows]))


def record(options: Options, rng: np.random.Generator) -> tuple[LaserRecording, Truth]:
    """The robot's sensors, and the true poses at the times of its scans."""
    building, walking, seeing, rolling = rng.spawn(4)
    plan = floor_plan(*SIZE, DEPTH, building)
    way, ring = building, plan.ring
    for _ in range(options.drive):
        way, walking, seeing, rolling = rng.spawn(4)
        ring = np.roll(ring[::-1], -1, axis=0)
    points, body, imu = way_points(plan, ring, options.laps, way), None, None
    every = max(1, round(1 / (options.scan_rate * TICK)))
    if options.sway:
        driven = steered(points, SPEED, PUSH)
        poses = driven.poses[::every]
        body, imu = _felt(options, driven, rng)
    else:
        poses = _drive(points)[::every]
    t = TICK * every * np.arange(len(poses), dtype=np.float64)
    angles = np.linspace(-np.pi / 2, np.pi / 2, options.beams)
    people = passers_by(plan, options.people, walking)
    leans = np.zeros((len(t), 2)) if body is None else body.at(t)
    ranges = np.empty((len(t), len(angles)))
    for k, (x, y, heading) in enumerate(poses.tolist()):
        around = legs(plan, people, float(t[k]), x, y)
        if body is None:
            s, c = sincos(heading + angles)
            ranges[k] = cast(plan.walls, around, x, y, np.stack((c, s), -1), FURTHEST)
            continue
        ahead, flat, floor = _leaning(heading, angles, leans[k], options.scanner_height)
        ranges[k] = np.minimum(cast(plan.walls, around, x, y, ahead, FURTHEST) / flat, floor)
    missing = (ranges >= FURTHEST) | (seeing.random(ranges.shape) < LOST)
    ranges += options.range_sd * seeing.standard_normal(ranges.shape)
    ranges = np.where(missing, NO_RETURN, RESOLUTION * np.round(ranges / RESOLUTION))
    prior = Prior(poses[0] + 0.0, START_SD**2 * np.eye(3))
    scanner = Scanner(angles, np.zeros(3))
    odometry = wheels(poses, options.slip, rolling)
    odd, stamped, slipping = rolling.spawn(3)
    odometry = slipping_poses(odometry, options, slipping)
    odometry, t = faulty_poses(odometry, t, options, odd), faulty_clock(t, options, stamped)
    recording = LaserRecording("laser-floor", scanner, t, ranges, odometry, prior)
    if imu is None:
        return recording, Truth(t, poses)
    recording = _by_gravity(recording, options, imu)
    kept = np.isin(t, recording.t)
    return recording, Truth(t[kept], poses[kept])


def _felt(options: Options, driven: "Steered", rng: np.random.Generator) -> tuple[Rocking, Imu | None]:
    """The rocking body, and the readings of its inertial measurement unit; None without one."""
    (felt,) = rng.spawn(1)
    rocking, readings = felt.spawn(2)
    body = Rocking.drawn(options.sway, rocking)
    if not options.imu:
        return body, None
    given = options if options.gyro else replace(options, gyro=GYRO)
    return body, imu_of(given, driven.at, TICK * (len(driven.poses) - 1), readings, body)


def _leaning(heading: float, angles: Array, lean: Array, height: float) -> tuple[Array, Array, Array]:
    """The beams (b, 2) of a scanner that leans by pitch and roll, `lean` (2,), as unit vectors on the floor.

    With the metres along the floor of a metre of each beam, (b,), and the range of the floor, (b,), m.
    """
    s, c = sincos(angles)
    x, y, z = leaned(*lean) @ np.stack((c, s, np.zeros_like(c)))
    flat = hypot(x, y)
    turned, ahead = sincos(heading)
    floor = np.full(len(angles), np.inf)
    floor[z < 0] = height / -z[z < 0]
    return np.stack((ahead * x - turned * y, turned * x + ahead * y), -1) / flat[:, None], flat, floor


def _by_gravity(recording: LaserRecording, options: Options, imu: Imu) -> LaserRecording:
    """The scans levelled by the unit's accelerometer, and by the wheels' speed."""
    assert recording.odometry is not None
    motion, remarks = Track(recording.t, recording.odometry, TrackNoise()), list[str]()
    by = tilts(imu, standing(imu, Poses(recording.t, recording.odometry)), motion, remarks)
    if by is not None:
        recording = levelled(recording, by, Leaning(options.max_tilt, options.scanner_height), remarks)
    return replace(recording, notes={**recording.notes, REMARKS: remarks} if remarks else recording.notes)


def way_points(plan: Plan, ring: Array, laps: float, rng: np.random.Generator) -> Array:
    """Way points (w, 2): round the corridor's corners `ring` (4, 2), into some of the rooms and back."""
    points = [ring[0]]
    for side in range(int(np.ceil(4 * laps))):
        start, end = ring[side % 4], ring[(side + 1) % 4]
        length = float(np.abs(end - start).sum())
        along = (end - start) / length
        end = start + along * length * min(1.0, 4 * laps - side)
        beside = list[tuple[float, Array]]()
        for door in plan.doors:
            way = float((door.at - start) @ along)
            off = door.at - start - along * way
            if hypot(*off) < 0.75 * CORRIDOR and 1 < way < length - 1:
                beside.append((way, door.at + 0.5 * door.inward))
        for way, inside in sorted(beside, key=lambda one: one[0]):
            if rng.random() < VISITED and way < float((end - start) @ along):
                points += [start + along * way, inside, start + along * way]
        points.append(end)
    return np.array(points)


def _drive(way: Array) -> Array:
    """The poses (n, 3), TICK apart, of a robot that steers from way point to way point."""
    pose = np.array([*way[0], 0.0])
    path = [pose]
    for target in way[1:]:
        while True:
            off = target - pose[:2]
            if hypot(*off) < ENOUGH:
                break
            turn = float(wrap(arctan2(off[1], off[0]) - pose[2]))
            speed = SPEED * max(0.0, 1 - abs(turn) / STRAIGHT)
            pose = compose(pose, TICK * np.array([speed, 0.0, np.clip(TURNING * turn, -FASTEST, FASTEST)]))
            path.append(pose)
    return np.array(path)


class Steered(NamedTuple):
    """A drive from way point to way point."""

    poses: Array  # (n + 1, 3) TICK apart
    motions: Array  # (n, 3) from one to the next
    way: Array  # (n + 1,) m

    def at(self, t: Array) -> tuple[Array, Array]:
        """The true poses (n, 3) at `t` (n,), s, and the way driven, (n,) m; it stands before and after."""
        ticks = np.clip(t / TICK, 0.0, len(self.motions))
        k = np.minimum(ticks.astype(np.int64), len(self.motions) - 1)
        share = ticks - k
        poses = compose(self.poses[k], share[:, None] * self.motions[k])
        return poses, self.way[k] + share * (self.way[k + 1] - self.way[k])


def steered(points: Array, speed: float, most: float = np.inf) -> Steered:
    """Steers along way points (w, 2), m, at most at `speed`, m/s, from rest at the first one, with heading 0.

    It speeds up and brakes by at most `most`, m/s^2: where that is finite, it brakes in front of way points, and at the
    end to a stand.
    """
    pose, forward, turning = np.array([*points[0], 0.0]), 0.0, 0.0
    poses, motions = [pose], list[Array]()
    for target in points[1:]:
        while hypot(*(off := target - pose[:2])) >= ENOUGH:
            turn = float(wrap(arctan2(off[1], off[0]) - pose[2]))
            wanted = speed * max(0.0, 1 - abs(turn) / STRAIGHT)
            if np.isfinite(most):
                wanted = min(wanted, float(np.sqrt(CREEP**2 + 2 * most * float(hypot(*off)))))
            forward += min(max(TICK / LAG * (wanted - forward), -TICK * most), TICK * most)
            turning += TICK / LAG * (float(np.clip(TURNING * turn, -FASTEST, FASTEST)) - turning)
            motions.append(TICK * np.array([forward, 0.0, turning]))
            pose = compose(pose, motions[-1])
            poses.append(pose)
    while np.isfinite(most) and forward > 0:
        forward, turning = max(forward - TICK * most, 0.0), (1 - TICK / LAG) * turning
        motions.append(TICK * np.array([forward, 0.0, turning]))
        pose = compose(pose, motions[-1])
        poses.append(pose)
    made = np.array(motions)
    return Steered(np.array(poses), made, np.concatenate(([0.0], np.cumsum(made[:, 0]))))


def passers_by(plan: Plan, count: int, rng: np.random.Generator) -> Array:
    """Place along the ring (m), speed (m/s, either way) and offset from its middle (m) of each: (count, 3)."""
    around = float(np.abs(np.diff(plan.ring, axis=0, append=plan.ring[:1])).sum())
    speed = rng.uniform(0.5, 1.3, count) * rng.choice([-1.0, 1.0], count)
    return np.stack((rng.uniform(0, around, count), speed, rng.uniform(-0.6, 0.6, count)), axis=-1)


def legs(plan: Plan, people: Array, t: float, x: float, y: float) -> Array:
    """Discs (2 m, 3) of the legs of people in the corridor who are not too close to (x, y)."""
    sides = np.diff(plan.ring, axis=0, append=plan.ring[:1])
    lengths = np.abs(sides).sum(axis=1)
    ends = np.cumsum(lengths)
    discs = list[tuple[float, float, float]]()
    swing = STRIDE * float(sincos(PACE * t)[0])
    for start, speed, off in people.tolist():
        way = (start + speed * t) % float(ends[-1])
        side = int(np.searchsorted(ends, way, side="right"))
        along = sides[side] / lengths[side]
        left = np.array([-along[1], along[0]])
        at = plan.ring[side] + along * (way - (ends[side] - lengths[side])) + off * left
        if hypot(at[0] - x, at[1] - y) > CLEAR:
            discs += [(*(at + swing * along), LEG), (*(at - swing * along + APART * left), LEG)]
    return np.array(discs).reshape(-1, 3)


def wheels(poses: Array, slip: float, rng: np.random.Generator) -> Array:
    """Odometry's poses (n, 3): scaled by 1 %, pulling to a side, and with noise that grows with the way."""
    motion = between(poses[:-1], poses[1:])
    way, turned = hypot(motion[:, 0], motion[:, 1]), np.abs(motion[:, 2])
    scale, pull = 1 + 0.01 * slip * rng.standard_normal(), 0.02 * slip * rng.standard_normal()
    noise = slip * rng.standard_normal((3, len(motion)))
    motion[:, 0] = scale * motion[:, 0] + 0.03 * np.sqrt(way) * noise[0]
    motion[:, 1] += 0.01 * np.sqrt(way) * noise[1]
    motion[:, 2] += pull * way + (0.02 * np.sqrt(way) + 0.05 * np.sqrt(turned)) * noise[2]
    out = [poses[0]]
    for one in motion:
        out.append(compose(out[-1], one))
    return np.array(out)


source = Source(laser_floor, Options, seeded=True, costly=True, portable=False, files=grid_files)
