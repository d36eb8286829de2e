"""A frame of a depth camera, and a recording of its frames with the wheels' motion."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from math import inf
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from ...core.factors import Prior
from ..camera.camera import Camera
from ..inertial.tilts import Tilts
from ..wheels.motion import Motion

Grey = NDArray[np.uint8]
Depth = NDArray[np.float32]
"""(h, w) m along the optical axis, not along the ray; 0 where there is none."""


class DepthFrame(NamedTuple):
    """A grey image and the depth of its pixels."""

    seconds: float  # s, the middle of the exposure, by the clock of the wheels' readings
    grey: Grey  # (h, w)
    depth: Depth  # (h, w) registered to `grey`: of the same pixels
    colour: NDArray[np.uint8] | None = None  # (h, w, 3) BGR; None: the camera has grey images only


@dataclass(frozen=True, eq=False)
class DepthRecording:
    """Frames in the order of time, and what is needed to make use of them.

    `frames` may be iterated any number of times and loads one frame at a time.
    """

    name: str
    camera: Camera  # of the grey images, and so of the registered depth; with its mounting on the robot
    frames: Iterable[DepthFrame]
    motion: Motion | None  # the wheels' readings; None without wheels
    prior: Prior
    notes: Mapping[str, Any] = field(default_factory=dict[str, Any])  # the source and what its reader has done
    tilts: Tilts | None = None  # by gravity, for frames that show no floor
    depth_camera: Camera | None = None  # the one that measured the depth, where it was registered by the reader
    left_out: Counter[str] = field(default_factory=Counter[str])  # frames that `frames` left out when it was last
    # iterated, by their reasons: "frames without depth"
    remarks: list[str] = field(default_factory=list[str])  # what is odd; grows while the frames are read

    def in_order(self) -> Iterator[DepthFrame]:
        """The frames; InputError for one that is not later than the one before."""
        latest = -inf
        for number, frame in enumerate(self.frames):
            if not frame.seconds > latest:
                raise InputError(
                    f"{self.name}: frame {number} is at {frame.seconds} s, expected later than {latest} s."
                )
            latest = frame.seconds
            yield frame
