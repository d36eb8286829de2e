"""The rendered ArUco drive: a robot with a camera and wheel encoders drives around a room with markers.

The world is simulated, but its frames are images, processed by the same front end as a real recording.
"""

from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...core.elementary import hypot, sincos
from ...core.errors import InputError
from ...core.factors import UNKNOWN, Dataset, Log, Prior, Truth
from ...core.options import option
from ...core.se2 import Array, Ints
from ...frontend.camera.camera import Camera
from ...frontend.depth.recording import DepthRecording
from ...frontend.depth.settings import Settings as DepthSettings
from ...frontend.inertial.imu import Imu
from ...frontend.inertial.standing import standing
from ...frontend.inertial.tilts import tilts
from ...frontend.laser.log import build_log as build_scans
from ...frontend.laser.recording import LaserRecording
from ...frontend.laser.settings import Settings
from ...frontend.markers.aruco import Detector
from ...frontend.markers.markers import Markers, find
from ...frontend.markers.noise import Noise, PropagatedNoise, ProportionalNoise
from ...frontend.markers.pipeline import Frame, Recording, build_log
from ...frontend.several.log import Several
from ...frontend.several.log import build_log as build_several
from ...frontend.several.wheels_path import walked
from ...frontend.wheels.encoder import Encoder
from ...frontend.wheels.ticks import Ticks, Wheels
from ..hidden_ids import HiddenIds
from ..on_demand.fixes import WorldFixes
from ..on_demand.gyro import WorldGyro
from ..on_demand.imu import Drive, imu_of
from ..on_demand.parts import Parts
from ..on_demand.rocking import Rocking
from ..on_demand.signatures import WorldSignatures
from ..on_demand.slip import WorldSlip
from ..on_map import OnMap
from ..registry import Source
from ..rendering.cameras import CAMERAS
from ..rendering.depth_shots import FrameDepths, RoomDepth
from ..rendering.disturbances import Disturbances, raised, take, tilts_in
from ..rendering.render import Renderer
from ..rendering.room_scans import RoomScans, scanned
from ..rendering.sheet import scrambled
from ..rendering.surfaces import paint
from ..wheel_faults import WheelFaults, faulty_clock, faulty_wheels
from .camera_options import CameraOptions
from .outliers import swapped
from .rendered_world import SIDE, World, WorldOptions, world
from .wheeled_robot import count

DICTIONARY = "4X4_50"
TICK = 0.02  # s between encoder readings
GYRO = 0.01  # degrees/s per root Hz, of the unit of option imu where option gyro says nothing
START_SD = 1e-4  # m and rad; the robot starts exactly at the prior's mean
SOURCE = "slamduel's own world: frames are rendered, wheel counters simulated with the noise that the encoder states"


ENCODER = Encoder(left=1.6e-4, right=1.6e-4, base=0.36, k=0.01, noise="distance")

PROPORTIONAL = ProportionalNoise(k_range=0.002, k_bearing=0.002, floor_range=0.008, floor_bearing=0.003)
"""Eq. (10) with constants for this camera, and floors for a rocking body."""

LEVELLED = ProportionalNoise(k_range=0.0006, k_bearing=2e-5, floor_range=1e-4, floor_bearing=2e-5)
"""The same of a body whose rocking is stated by itself."""

AROUND = {"front": 0.0, "back": 180.0, "left": 90.0, "right": -90.0}
"""Names of several cameras, and by how many degrees they are turned about the robot's axis from the one ahead."""

MATCHING = Settings(stamp_sd=0.0)
"""Of the scanner's front end in the one room: its scans are taken at once, and at the times that they say."""

BY_DEPTH = DepthSettings(landmarks=False, loops=True)
"""Of the depth camera's front end: its ids would be those of the markers, and calibration and times are exact."""


@dataclass(frozen=True)
class Options(
    HiddenIds,
    OnMap,
    Parts,
    WorldFixes,
    WorldGyro,
    WorldSlip,
    WorldSignatures,
    WheelFaults,
    RoomScans,
    RoomDepth,
    CameraOptions,
    WorldOptions,
):
    """The drive and the room."""

    seconds: float = option(60.0, "length of the drive, s", minimum=1.0, maximum=3600.0)
    frame_rate: float = option(5.0, "camera frames per second, each a keyframe", minimum=0.5, maximum=30.0)
    noise: str = option(
        "propagated", "stated noise of the sightings: that of the corners and of `sway`, or ArUco EKF SLAM's eq. (10)",
        choices=("propagated", "proportional"),
    )  # fmt: skip
    k_range: float | None = option(
        None,
        "with noise=proportional: stated range noise, of the range; none: 0.002, with an IMU 0.0006",
        minimum=0.0,
        maximum=1.0,
    )
    k_bearing: float | None = option(
        None, "with noise=proportional: stated bearing noise, of the bearing; none: 0.002, with an IMU 2e-5",
        minimum=0.0, maximum=1.0,
    )  # fmt: skip
    floor_range: float | None = option(
        None, "stated range noise that is added, m; none: 0.008 with noise=proportional, 1e-4 with an IMU, else 0",
        minimum=1e-4, maximum=1.0,
    )  # fmt: skip
    floor_bearing: float | None = option(
        None, "stated bearing noise that is added, rad; none: 0.003 with noise=proportional, 2e-5 with an IMU, else 0",
        minimum=1e-4, maximum=1.0,
    )  # fmt: skip
    camera: str = option("pinhole", "lens of the camera; calibrations are in cameras.py", choices=tuple(CAMERAS))
    cameras: int = option(
        1, "cameras on the robot, all alike: one ahead, then behind, to the left, to the right",
        minimum=1, maximum=len(AROUND),
    )  # fmt: skip
    blur: float = option(0.6, "defocus, standard deviation in px", minimum=0.0, maximum=8.0)
    vignetting: float = option(0.4, "darkness of the corners, 1 being cos^4", minimum=0.0, maximum=1.0)
    sway: float = option(
        0.02, "rocking of the body, standard deviation of pitch and roll, rad", minimum=0.0, maximum=0.2
    )
    imu: bool = option(
        False,
        "an inertial measurement unit, by whose gravity sightings are levelled; the body then rocks smoothly, as it "
        "does in recordings with option gyro",
    )
    gain_drift: float = option(0.0, "drift of the brightness, sd of its logarithm", minimum=0.0, maximum=1.0)
    shadow: float = option(0.0, "share of the light blocked by a soft shadow", minimum=0.0, maximum=0.9)
    occlusion: float = option(0.0, "share of partly covered frames", minimum=0.0, maximum=1.0)
    slip: float = option(0.0, "wheel slips per metre, not covered by the stated noise", minimum=0.0, maximum=5.0)
    counts_per_metre: float = option(6250.0, "resolution of the wheel counters", minimum=10.0, maximum=1e7)
    unreadable: float = option(
        0.0, "share of the markers whose bits are no marker's: found, but without an id", minimum=0.0, maximum=1.0
    )
    outliers: float = option(0.0, "share of sightings with another marker's id", minimum=0.0, maximum=0.5)

    @property
    def frames(self) -> int:
        """The number of frames of a camera."""
        # A little more, so that 2.3 s at 10 Hz are 23 frames after the first and not 22.
        return int(self.seconds * self.frame_rate + 1e-9) + 1


def aruco_room(options: Options, rng: np.random.Generator) -> Dataset:
    """Rendered camera frames of a room with ArUco markers, and wheel encoders; one room per seed."""
    if options.unreadable and options.outliers:
        raise InputError(
            f"dataset aruco-room: found options unreadable={options.unreadable:g} and outliers={options.outliers:g}, "
            "expected one of them: a marker without an id has none to be wrong."
        )
    if options.sensors == "laser" and not options.scan_rate:
        raise InputError("dataset aruco-room: found option sensors=laser, expected it beside scan_rate.")
    if options.sensors == "markers" and not (options.scan_rate or options.depth):
        raise InputError(
            "dataset aruco-room: found option sensors=markers, expected it beside scan_rate or depth: without these "
            "there are markers alone."
        )
    if options.sensors == "laser":
        for name in ("unreadable", "outliers"):
            if getattr(options, name):
                raise InputError(
                    f"dataset aruco-room: found options sensors=laser and {name}={getattr(options, name):g}, expected "
                    "one of them: there are no sightings."
                )
    made = recorded(options, rng)
    truth, log = made.truth, _log(made, options)
    rows = np.searchsorted(truth.t, log.t)
    truth = truth._replace(t=truth.t[rows], poses=truth.poses[rows])
    if options.unreadable:
        truth = truth._replace(assigned=_nearest(log, truth))
    if options.outliers == 0:
        return Dataset(log, truth)
    # Drawn after everything else, so that the log is the clean one except for its outliers.
    return swapped(log, truth, options.outliers, rng.spawn(1)[0])


def matching(options: Options) -> Settings:
    """The settings of the scanner's front end.

    Those for made-up floors are for the building, too: along a corridor a match errs by more than its points know.
    Steps are shorter, as the scans between them are lost to a log of both sensors.
    """
    if not options.building:
        return MATCHING
    return replace(MATCHING, stamp_sd=Settings().stamp_sd, dense_start=2.0, step=0.2, turn=0.16)


def _log(made: "Recorded", options: Options) -> Log:
    """Makes the log of the sensors that the options name, by the front ends of each."""
    if made.scans is not None and options.sensors == "laser":
        return build_scans(made.scans, matching(options))
    if options.sensors == "markers" or (made.scans is None and made.depth is None):
        return build_log(made.recording)
    return build_several(Several(made.recording, made.scans, matching(options), made.depth, BY_DEPTH))


class Recorded(NamedTuple):
    """A drive."""

    recording: Recording
    truth: Truth  # at the times of frames and scans
    scans: LaserRecording | None  # with the wheels' motion
    imu: Imu | None
    depth: DepthRecording | None  # of the camera's own frames, with the wheels' motion
    drive: Drive
    body: Rocking | None  # that rocks smoothly


def record(options: Options, rng: np.random.Generator) -> tuple[Recording, Truth]:
    """The camera's part of `recorded`, and the ground truth."""
    made = recorded(options, rng)
    return made.recording, made.truth


def recorded(options: Options, rng: np.random.Generator) -> Recorded:
    """Simulates the robot's sensors, with frames rendered on demand, and the ground truth.

    InputError for exposures that overlap the next frame's, a shutter slower than the frames, boxes without room, and
    an option of the other noise.
    """
    seen_by = options.made_sensor
    for name, seconds in (("exposure", seen_by.exposure), ("readout", seen_by.readout)):
        if seconds * options.frame_rate > 1:
            raise InputError(
                f"dataset aruco-room: option {name}={seconds:g}: expected at most the time between frames, "
                f"{1 / options.frame_rate:.4g} s at frame_rate={options.frame_rate:g}."
            )
    if options.depth:
        _check_depth(options)
    layout, wheels, sensor, decoration = rng.spawn(4)
    inside = world(options, options.seconds, layout)
    room = inside.room
    frame_times = np.arange(options.frames) / options.frame_rate
    tick_times = TICK * np.arange(int(np.ceil(frame_times[-1] / TICK)) + 2.0)
    poses, _ = inside.drive(frame_times)
    (chance,) = layout.spawn(1)
    rocking, imu = _felt(options, inside, float(frame_times[-1]), layout)
    unreadable = np.flatnonzero(chance.uniform(size=options.markers) < options.unreadable).tolist()
    encoder = replace(ENCODER, left=1 / options.counts_per_metre, right=1 / options.counts_per_metre)
    ticks = count(*inside.drive(tick_times), tick_times, encoder, wheels, options.slip)
    motion = Wheels(_with_faults(ticks, encoder, options, wheels), encoder)
    cameras = _cameras(CAMERAS[options.camera], options.cameras)
    printed = scrambled(find(DICTIONARY), unreadable, chance)

    def path(t: Array) -> Array:
        return inside.drive(t)[0]

    walls, noise = deepcopy(decoration), deepcopy(sensor)  # as they are before the first frames are made
    disturbances = Disturbances(options.sway, options.gain_drift, options.shadow, options.occlusion)

    def renderers() -> list[Renderer]:
        painted = paint(room, deepcopy(walls))
        return [
            Renderer(
                room,
                camera,
                DICTIONARY,
                painted,
                blur=options.blur,
                sensor=seen_by,
                vignetting=options.vignetting,
                printed=printed,
                prints=options.prints,
            )
            for camera in cameras
        ]

    def frames() -> Iterator[Frame]:
        yield from take(renderers(), path, frame_times, disturbances, deepcopy(noise), rocking, inside.people)

    detector, *others = (
        Detector(Markers(DICTIONARY, SIDE), options.known(camera), unread=options.unreadable > 0) for camera in cameras
    )
    recording = Recording(
        name="aruco-room",
        frames=frames(),
        motion=replace(motion, max_speed=np.inf) if options.has_wheel_faults else motion,
        detector=detector,
        others=others,
        noise=_noise(options),
        prior=Prior(poses[0], START_SD**2 * np.eye(3)),
        notes={"source": SOURCE},
        tilts=tilts(imu, standing(imu, motion.ticks), motion, []) if imu is not None and options.imu else None,
    )
    truth = Truth(frame_times, poses, room.landmarks, None, "truth")
    t = options.scan_times(float(frame_times[-1]))
    depth = None
    if options.depth:
        tilted = tilts_in(frame_times, disturbances, deepcopy(noise), rocking)
        *_, deep = deepcopy(noise).spawn(5)  # beyond those of `take`
        seeds = np.random.SeedSequence(int(deep.integers(2**63)))
        depth = DepthRecording(
            name=recording.name,
            camera=detector.camera,
            frames=FrameDepths(frames, lambda: renderers()[0], poses, tilted, seeds),
            motion=recording.motion,
            prior=recording.prior,
            notes=recording.notes,
            tilts=recording.tilts,
        )
    if not len(t):
        return Recorded(recording, truth, None, imu, depth, inside.drive, rocking)
    (beams,) = rng.spawn(1)
    scans = scanned(room, path, inside.people, t, beams)
    scans = replace(scans, odometry=walked(recording.motion, t), prior=recording.prior)
    truth = _at(np.union1d(frame_times, t), truth, inside)
    return Recorded(recording, truth, scans, imu, depth, inside.drive, rocking)


def _check_depth(options: Options) -> None:
    """Raises InputError for what has no depth: several cameras, and a building, whose walls and people it lacks."""
    for name, plain in (("cameras", 1), ("building", False)):
        found = getattr(options, name)
        if found != plain:
            raise InputError(
                f"dataset aruco-room: found options depth=true and {name}={str(found).lower()}, expected one of them: "
                "depth is that of one camera in the one room."
            )


def _felt(options: Options, inside: World, end: float, rng: np.random.Generator) -> tuple[Rocking | None, Imu | None]:
    """The rocking body, and the readings of its inertial measurement unit up to `end`, s; None without one."""
    if not (options.gyro or options.imu or options.compass):
        return None, None
    body, readings = rng.spawn(2)
    rocking = Rocking.drawn(options.sway, body)
    given = options if options.gyro else replace(options, gyro=GYRO)
    return rocking, imu_of(given, inside.drive, end, readings, rocking)


def _at(t: Array, truth: Truth, inside: World) -> Truth:
    """The truth at the times `t`, s."""
    return truth._replace(t=t, poses=inside.drive(t)[0])


def _cameras(ahead: Camera, count: int) -> list[Camera]:
    """The camera that looks ahead, or that many on one robot, each with a name."""
    if count == 1:
        return [ahead]
    turns = raised(np.deg2rad([[0.0, 0.0, degrees] for degrees in AROUND.values()]))
    named = list(zip(AROUND, turns, strict=True))[:count]
    return [replace(ahead, mounting=turn @ ahead.mounting, name=name) for name, turn in named]


def _with_faults(ticks: Ticks, encoder: Encoder, faults: WheelFaults, rng: np.random.Generator) -> Ticks:
    """The readings with the faults that the options name."""
    if not faults.has_wheel_faults:
        return ticks
    odd, stamped = rng.spawn(2)
    metres = np.array([encoder.left, encoder.right])
    read = faulty_wheels(ticks.counts * metres, ticks.t, faults, odd)
    return Ticks(faulty_clock(ticks.t, faults, stamped), np.round(read / metres))


def _nearest(log: Log, truth: Truth) -> Ints:
    """(s,) the ids of the log's sightings; of those without one the marker that is there, UNKNOWN if none is."""
    assert truth.map is not None
    ids, step = log.ids.copy(), log.sighting_step
    poses = truth.poses[np.searchsorted(truth.t, log.t)]
    for k in np.flatnonzero(ids == UNKNOWN):
        x, y, heading = poses[step[k]]
        s, c = sincos(heading + log.z[k, 1])
        away = hypot(*(np.array([x + log.z[k, 0] * c, y + log.z[k, 0] * s]) - truth.map.xy).T)
        if away.min() < SIDE:
            ids[k] = truth.map.ids[away.argmin()]
    ids.flags.writeable = False
    return ids


def _noise(options: Options) -> Noise:
    """The noise stated for the sightings; InputError for an option of the other model."""
    names = ("k_range", "k_bearing", "floor_range", "floor_bearing")
    given = {name: value for name in names if (value := getattr(options, name)) is not None}
    if options.noise == "proportional":
        levelled = replace(LEVELLED, sway=options.sway)
        return replace(levelled if options.imu or options.gyro else PROPORTIONAL, **given)
    for name in names[:2]:
        if name in given:
            raise InputError(
                f"dataset aruco-room: found option {name}={given[name]:g} beside noise={options.noise}, expected it "
                "beside noise=proportional."
            )
    return PropagatedNoise(sway=options.sway, **given)


source = Source(aruco_room, options=Options, seeded=True, costly=True, portable=False)  # OpenCV's arithmetic
