"""What a recording holds, before anything is known of the robot that made it; every reader of recordings returns it."""

from collections.abc import Iterable
from typing import NamedTuple

from ...frontend.camera.camera import Camera
from ...frontend.factors import Truth
from ...frontend.markers.pipeline import Frame
from ...frontend.se2 import Array
from ...frontend.wheels.motion import Ticks


class Poses(NamedTuple):
    """Odometry that the robot summed up by itself."""

    t: Array  # (m,) s, strictly increasing
    poses: Array  # (m, 3) in the odometry's own world frame


class Streams(NamedTuple):
    """Frames and motion readings by one clock."""

    frames: Iterable[Frame]  # read as they are asked for, once through, in order; t as recorded
    length: int | None  # number of frames, where it is known beforehand
    readings: Ticks | Poses | None  # None: nothing tells how the robot moved
    camera: Camera | None  # what the recording itself says of the camera, mounted at the robot's origin
    truth: Truth | None
