"""The streams of a recording, independent of the robot; the result of every reader of recordings."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from ...core.factors import Truth
from ...frontend.camera.camera import Camera
from ...frontend.markers.pipeline import Frame
from ..bags.window import Window
from ..readings import Readings
from ..tags.found_tags import TagFrame


class Streams(NamedTuple):
    """Frames and motion readings on one clock."""

    frames: Iterable[Frame]  # read on demand, once, in order; t as recorded
    length: int | None  # number of frames, if known beforehand
    readings: Readings | None  # None: unmeasured motion
    camera: Camera | None  # from the recording itself, mounted at the robot's origin
    lacking: str  # why the recording has no camera, where it has some of one
    topic: str  # of the frames in a bag; "" elsewhere
    truth: Truth | None
    remarks: list[str]  # what is legal yet odd; grows while the frames are read
    window: Window | None = None  # the part of the camera that the frames are of; None: all of it
    tags: Sequence[TagFrame] | None = None  # found by another program, in place of frames
