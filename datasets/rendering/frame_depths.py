"""Depth images beside a camera's frames: those of a colour and depth camera, as an option of the rendered room.

They are of the frames' own pixels, all taken at once in the middle of the exposure, with the noise of `depth`.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from ...core.options import option
from ...core.se2 import Array
from ...frontend.depth.recording import DepthFrame
from ...frontend.markers.pipeline import Frame
from .depth import kinect, true_depth
from .disturbances import raised, rocked
from .render import Renderer


@dataclass(frozen=True)
class RoomDepth:
    """Depth beside the images, by default none; a rendered world's options inherit it."""

    depth: bool = option(
        False, "the camera measures depth, too, as a Kinect does: the log then has motions by these frames as well"
    )


@dataclass(frozen=True, eq=False)
class FrameDepths:
    """Frames with their depth, the same ones whenever they are iterated."""

    frames: Callable[[], Iterator[Frame]]  # makes the camera's, from the first one on
    renderer: Callable[[], Renderer]  # makes the camera's
    poses: Array  # (n, 3) of the robot in the frames
    tilts: Array  # (n, 2) rad, of its body: pitch, forward, and roll, to the right
    seeds: np.random.SeedSequence

    def __len__(self) -> int:
        return len(self.poses)

    def __iter__(self) -> Iterator[DepthFrame]:
        renderer = self.renderer()
        for k, (frame, pose) in enumerate(zip(self.frames(), raised(self.poses), strict=True)):
            assert frame.image is not None
            camera = pose @ rocked(*self.tilts[k].tolist()) @ renderer.camera.mounting
            rng = np.random.default_rng(
                np.random.SeedSequence(self.seeds.entropy, spawn_key=(*self.seeds.spawn_key, k))
            )
            yield DepthFrame(frame.t, frame.image, kinect(true_depth(renderer.room, renderer.lens, camera), rng))
