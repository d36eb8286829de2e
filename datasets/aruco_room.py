"""The rendered ArUco drive: a robot with a camera and wheel encoders goes round a room with markers.

The world is made up; the frames are not labels but images, and go through the same front end as a real recording.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..frontend.aruco import Detector
from ..frontend.camera import Camera, mounting
from ..frontend.encoder import Encoder
from ..frontend.factors import Dataset, Prior, Truth
from ..frontend.markers import Markers
from ..frontend.motion import Wheels
from ..frontend.noise import ProportionalNoise
from ..frontend.options import option
from ..frontend.pipeline import Frame, Recording, build_log
from ..frontend.se2 import Array
from .registry import Source
from .render import Renderer
from .simulate import Loop, count, drive
from .surfaces import paint
from .world import furnish

DICTIONARY = "4X4_50"
SIDE = 0.16  # m, of a marker
ROOM = (6.0, 5.0, 2.5)  # m
TICK = 0.02  # s between encoder readings
START_SD = 1e-3  # m and rad; the robot starts exactly where the prior says
SOURCE = "slamduel's own world: frames are rendered, wheel counters simulated with the noise that the encoder states"

CAMERA = Camera(
    width=640,
    height=480,
    focal=(576.4, 575.8),
    centre=(321.7, 238.4),
    distortion=(-0.208, 0.062, 0.0008, -0.0006, 0.0),
    mounting=mounting(forward=0.12, left=0.0, up=0.75, tilt=np.deg2rad(20)),
)

ENCODER = Encoder(left=1.6e-4, right=1.6e-4, base=0.36, k=0.01, noise="distance")

LOOP = Loop(
    cos=np.array([[1.4, 0.0], [0.0, 0.0], [0.25, 0.0]]),
    sin=np.array([[0.0, 0.0], [0.0, 1.0], [0.0, 0.0]]),
)
"""A figure of eight of 11.3 m: as much turning left as right, and no bend tighter than 0.54 m."""


@dataclass(frozen=True)
class Options:
    """The drive and the room."""

    markers: int = option(24, "markers in the room, half of them on the floor", minimum=2, maximum=50)
    seconds: float = option(60.0, "length of the drive, s", minimum=1.0, maximum=3600.0)
    frame_rate: float = option(5.0, "camera frames a second, each a keyframe", minimum=0.5, maximum=30.0)
    speed: float = option(0.4, "speed of the robot, m/s", minimum=0.05, maximum=1.0)
    k_range: float = option(0.02, "stated range noise, of the range", minimum=0.0, maximum=1.0)
    k_bearing: float = option(0.02, "stated bearing noise, of the bearing", minimum=0.0, maximum=1.0)
    floor_range: float = option(0.02, "stated range noise at no range, m", minimum=1e-4, maximum=1.0)
    floor_bearing: float = option(0.01, "stated bearing noise straight ahead, rad", minimum=1e-4, maximum=1.0)


def aruco_room(options: Options, rng: np.random.Generator) -> Dataset:
    """Rendered camera frames of a room with ArUco markers, and wheel encoders; another room a seed."""
    recording, truth = record(options, rng)
    return Dataset(build_log(recording), truth)


def record(options: Options, rng: np.random.Generator) -> tuple[Recording, Truth]:
    """What the robot's sensors give, frames rendered as they are asked for, and where it was."""
    layout, wheels, sensor, decoration = rng.spawn(4)
    room = furnish(*ROOM, SIDE, options.markers, layout)
    # A little more, so that 2.3 s at 10 Hz are 23 frames after the first and not 22.
    frame_times = np.arange(int(options.seconds * options.frame_rate + 1e-9) + 1) / options.frame_rate
    tick_times = TICK * np.arange(int(np.ceil(frame_times[-1] / TICK)) + 2.0)
    poses, _ = drive(LOOP, options.speed, frame_times)
    ticks = count(*drive(LOOP, options.speed, tick_times), tick_times, ENCODER, wheels)
    renderer = Renderer(room, CAMERA, DICTIONARY, paint(room, decoration))
    recording = Recording(
        name="aruco-room",
        frames=_frames(renderer, frame_times, poses, sensor),
        motion=Wheels(ticks, ENCODER),
        detector=Detector(Markers(DICTIONARY, SIDE), CAMERA),
        noise=ProportionalNoise(options.k_range, options.k_bearing, options.floor_range, options.floor_bearing),
        prior=Prior(poses[0], START_SD**2 * np.eye(3)),
        notes={"source": SOURCE},
    )
    return recording, Truth(frame_times, poses, room.landmarks, None, "truth")


def _frames(renderer: Renderer, t: Array, poses: Array, rng: np.random.Generator) -> Iterator[Frame]:
    """The pictures taken on the way, one at a time."""
    for time, (x, y, heading) in zip(t, poses, strict=True):
        c, s = np.cos(heading), np.sin(heading)
        robot = np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, 0], [0, 0, 0, 1]])
        yield Frame(float(time), renderer.frame(robot @ renderer.camera.mounting, rng))


source = Source(aruco_room, options=Options, seeded=True, costly=True)
