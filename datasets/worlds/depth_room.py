"""The rendered drive of a robot with a depth camera around a room with posters, rugs and boxes.

The world is simulated, but its frames are images, processed by the same front end as a real recording.
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...core.elementary import hypot
from ...core.errors import InputError
from ...core.factors import Dataset, Prior, Truth
from ...core.options import option
from ...core.se2 import Array, between, compose
from ...frontend.depth.log import build_log
from ...frontend.depth.recording import DepthRecording
from ...frontend.depth.settings import Settings
from ...frontend.inertial.imu import Imu
from ...frontend.inertial.standing import standing
from ...frontend.inertial.tilts import tilts
from ...frontend.wheels.track import Track, TrackNoise
from ..hidden_ids import HiddenIds
from ..on_demand.fixes import WorldFixes
from ..on_demand.gyro import WorldGyro
from ..on_demand.imu import imu_of
from ..on_demand.parts import Parts
from ..on_demand.rocking import Rocking
from ..on_demand.signatures import WorldSignatures
from ..on_demand.slip import WheelSlip, slipping_poses
from ..registry import Source
from ..rendering.cameras import CAMERAS
from ..rendering.depth import NOISE_SD
from ..rendering.depth_shots import DepthShots
from ..rendering.posters import decorated
from ..rendering.render import Renderer
from ..rendering.room import Room, furnish_with_boxes
from ..rendering.sensor import Sensor
from ..rendering.surfaces import paint
from ..wheel_faults import WheelFaults, faulty_clock, faulty_poses
from .aruco_room import DICTIONARY, GYRO, TICK
from .measurements import START_SD
from .mover import crossings
from .rendered_world import BERTH, LOOP, ROOM, SIDE
from .wheeled_robot import RISE, drive

WHEELS = TrackNoise(forward=0.015, turning=0.02, turning_by_turn=0.02)

SOURCE = "slamduel's own world: frames are rendered, odometry simulated with the noise that is stated for it"


@dataclass(frozen=True)
class Drive(WheelSlip, WheelFaults):
    """The room, the drive and the camera."""

    laps: float = option(2.0, "laps of a figure of eight of 11.3 m", minimum=0.05, maximum=100.0)
    frame_rate: float = option(5.0, "camera frames per second", minimum=0.5, maximum=30.0)
    speed: float = option(0.4, "speed of the robot, m/s", minimum=0.05, maximum=1.0)
    posters: int = option(14, "posters on the walls", minimum=0, maximum=50)
    alike: bool = option(False, "all posters are of the same picture")
    rugs: int = option(3, "rugs on the floor", minimum=0, maximum=20)
    boxes: int = option(4, "boxes in the room", minimum=0, maximum=8)
    mover: float = option(
        0.0, "width of a box that crosses the view again and again, m; 0: none", minimum=0.0, maximum=1.2
    )
    rocking: float = option(
        0.02, "rocking of the body, standard deviation of pitch and roll, rad", minimum=0.0, maximum=0.2
    )
    readout: float = option(0.0, "rolling shutter: time from the first row to the last, s", minimum=0.0, maximum=0.1)
    grain: float = option(2.0, "standard deviation of the image's noise, grey levels", minimum=0.0, maximum=40.0)
    disparity_sd: float = option(
        NOISE_SD,
        "noise of the depth camera, px of disparity; 0.12 is a Kinect's, 0.003 z^2 m",
        minimum=0.0,
        maximum=2.0,
    )
    imu: bool = option(
        False, "an inertial measurement unit, whose gravity levels frames without a floor; the body then rocks smoothly"
    )
    slip: float = option(1.0, "noise of the odometry, of the one stated for it", minimum=0.0, maximum=20.0)


@dataclass(frozen=True)
class Options(HiddenIds, Parts, WorldFixes, WorldGyro, WorldSignatures, Settings, Drive):
    """The drive and the front end."""


def depth_room(options: Options, rng: np.random.Generator) -> Dataset:
    """Rendered frames of a depth camera in a room with posters, rugs and boxes, and odometry; one room per seed."""
    recording, truth = record(options, rng)
    log = build_log(recording, options)
    rows = np.searchsorted(truth.t, log.t)
    return Dataset(log, Truth(truth.t[rows], truth.poses[rows]))


def record(options: Drive, rng: np.random.Generator) -> tuple[DepthRecording, Truth]:
    """The robot's frames, rendered on demand, and odometry; and the true poses at the times of the frames.

    `shots_of` has the true poses of the camera. InputError for a shutter slower than the frames, and for boxes without
    room.
    """
    if options.readout * options.frame_rate > 1:
        raise InputError(
            f"option readout={options.readout:g}: expected at most the time between frames, "
            f"{1 / options.frame_rate:.4g} s at frame_rate={options.frame_rate:g}."
        )
    layout, decoration, rolling, crossing, sensor, start = rng.spawn(6)
    path, _ = LOOP.at(np.linspace(0, 2 * np.pi, 200))
    room = furnish_with_boxes(Room(*ROOM, SIDE, ()), options.boxes, path, BERTH, layout)
    painted = decorated(room, paint(room, decoration), options.posters, options.rugs, options.alike, decoration)
    seconds = options.laps * LOOP.lap / options.speed + RISE
    t = np.arange(int(seconds * options.frame_rate + 1e-9) + 1) / options.frame_rate
    poses, _ = drive(LOOP, options.speed, t)
    camera = CAMERAS["pinhole"]
    half_view = float(np.abs(camera.rays[camera.height // 2, [0, -1], 0]).max())  # tangent, to the farther side
    visitors = crossings(room, poses, t, options.mover, half_view, crossing) if options.mover else ()
    body = imu = None
    if options.imu:
        (felt,) = rng.spawn(1)
        body, imu = _felt(options, float(t[-1]), felt)
    shots = DepthShots(
        Renderer(room, camera, DICTIONARY, painted, sensor=Sensor(grain=options.grain, readout=options.readout)),
        lambda at: drive(LOOP, options.speed, at)[0],
        t,
        options.rocking,
        np.random.SeedSequence(int(sensor.integers(2**63))),
        visitors,
        options.disparity_sd,
        body,
    )
    ticks = TICK * np.arange(int(np.ceil(t[-1] / TICK)) + 2.0)
    wheels = integrated(drive(LOOP, options.speed, ticks)[0], WHEELS, options.slip, rolling)
    odd, stamped, slipping = rolling.spawn(3)
    wheels = slipping_poses(wheels, options, slipping)
    track = Track(faulty_clock(ticks, options, stamped), faulty_poses(wheels, ticks, options, odd), WHEELS)
    recording = DepthRecording(
        name="depth-room",
        camera=camera,
        frames=shots,
        motion=replace(track, max_speed=np.inf) if options.has_wheel_faults else track,
        prior=known(poses[0], start),
        notes={"source": SOURCE},
        tilts=None if imu is None else tilts(imu, standing(imu), track, []),
    )
    return recording, Truth(t, poses)


def _felt(options: Drive, end: float, rng: np.random.Generator) -> tuple[Rocking, Imu | None]:
    """The rocking body, and the readings of its inertial measurement unit up to `end`, s."""
    rocking, readings = rng.spawn(2)
    body = Rocking.drawn(options.rocking, rocking)
    given = options if isinstance(options, WorldGyro) and options.gyro else WorldGyro(gyro=GYRO)
    return body, imu_of(given, partial(drive, LOOP, options.speed), end, readings, body)


def shots_of(recording: DepthRecording) -> DepthShots:
    """The frames of a recording that is made here: they know the true poses of the camera and the exact depth."""
    assert isinstance(recording.frames, DepthShots)
    return recording.frames


def known(pose: Array, rng: np.random.Generator) -> Prior:
    """A prior of the start `pose` (3,) that is off by as much as it states: what is seen here is as exact as that."""
    return Prior(pose + START_SD * rng.standard_normal(3), START_SD**2 * np.eye(3))


def integrated(poses: Array, noise: TrackNoise, times: float, rng: np.random.Generator) -> Array:
    """Odometry's poses (n, 3) along the true `poses` (n, 3), with `times` the standard deviation of `noise`."""
    motion = between(poses[:-1], poses[1:])
    way, turned = hypot(motion[:, 0], motion[:, 1]), np.abs(motion[:, 2])
    errors = times * rng.standard_normal((2, len(motion)))
    motion[:, 0] += noise.forward * np.sqrt(way) * errors[0]
    motion[:, 2] += np.sqrt(noise.turning**2 * way + noise.turning_by_turn**2 * turned) * errors[1]
    out = [poses[0]]
    for one in motion:
        out.append(compose(out[-1], one))
    return np.array(out)


source = Source(depth_room, options=Options, seeded=True, costly=True, portable=False)  # OpenCV's arithmetic
