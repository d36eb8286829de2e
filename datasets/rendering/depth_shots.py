"""The frames of a depth camera on a robot that rocks as it drives, rendered as they are asked for.

It is alone on its robot, or it is the camera among markers, whose images then have depth: of their own pixels, all
taken at once in the middle of the exposure.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...core.options import option
from ...core.se2 import Array
from ...frontend.depth.recording import DepthFrame
from ...frontend.markers.aruco import Image
from ...frontend.markers.pipeline import Frame
from ..on_demand.rocking import Rocking
from .boxes import Box
from .depth import NOISE_SD, kinect, true_depth
from .disturbances import raised, rocked
from .lens import Singles
from .render import Renderer


class Visitor(NamedTuple):
    """A box that is not always there. Its circle is disjoint from those of the room's boxes."""

    box: Box
    textures: tuple[Image, ...]  # of its faces, upright


@dataclass(frozen=True, eq=False)
class DepthShots:
    """Frames, the same ones whenever they are iterated."""

    renderer: Renderer  # a sensor with a time of readout is a rolling shutter
    path: Callable[[Array], Array]  # the robot's poses (m, 3) at any times (m,), s
    t: Array  # (n,) s, the middles of the exposures
    sway: float  # rad, standard deviation of the body's pitch and of its roll, both of each frame
    seeds: np.random.SeedSequence
    visitors: Sequence[Visitor | None] = ()  # of each frame; none: nobody ever comes
    noise: float = NOISE_SD  # px, of a disparity
    rocking: Rocking | None = None  # a body that rocks smoothly; None: anew in every frame, by the sway

    def __len__(self) -> int:
        return len(self.t)

    def __iter__(self) -> Iterator[DepthFrame]:
        return (self.shot(k) for k in range(len(self.t)))

    def shot(self, k: int) -> DepthFrame:
        """The k-th frame."""
        rng = np.random.default_rng(np.random.SeedSequence(self.seeds.entropy, spawn_key=(*self.seeds.spawn_key, k)))
        bands, poses = self._bands(k), self._poses(k)
        light = np.vstack([band.scene(pose) for band, pose in zip(bands, poses, strict=True)])
        pairs = zip(bands, poses, strict=True)
        depth = np.vstack([true_depth(band.room, band.lens, pose) for band, pose in pairs])
        grey = self.renderer.exposed(light, rng)
        return DepthFrame(float(self.t[k]), grey, kinect(depth, rng, self.noise))

    def exact_depth(self, k: int) -> Singles:
        """(height, width) m, the k-th frame's depth without noise, steps and holes."""
        pairs = zip(self._bands(k), self._poses(k), strict=True)
        return np.vstack([true_depth(band.room, band.lens, pose) for band, pose in pairs])

    @cached_property
    def poses(self) -> Array:
        """(n, 4, 4) T_world_camera at the times of the frames."""
        return raised(self.path(self.t)) @ self._mountings

    @cached_property
    def tilts(self) -> Array:
        """(n, 2) rad, the body's pitch, forward, and roll, to the right, in each frame."""
        if self.rocking is not None:
            return self.rocking.at(self.t)
        first = np.random.default_rng(self.seeds)
        return self.sway * first.standard_normal((len(self.t), 2))

    @cached_property
    def _mountings(self) -> Array:
        """(n, 4, 4) of the camera on a level robot."""
        return np.array([rocked(*tilt) @ self.renderer.camera.mounting for tilt in self.tilts])

    def _poses(self, k: int) -> Array:
        """(bands, 4, 4) T_world_camera when the middle of each band of rows is exposed."""
        later = self.renderer.sensor.delays(self.renderer.camera.height)
        return raised(self.path(self.t[k] + later)) @ self._mountings[k]

    def _bands(self, k: int) -> list[Renderer]:
        """A renderer of the k-th frame, or one for each band of its rows that have a pose of their own."""
        rolling, visitor = self.renderer.sensor.readout, self.visitors[k] if self.visitors else None
        return [_with(band, visitor) for band in (self.renderer.bands if rolling else [self.renderer])]


def _with(renderer: Renderer, visitor: Visitor | None) -> Renderer:
    """The renderer of the room with the visitor in it."""
    if visitor is None:
        return renderer
    room, surfaces = renderer.room, renderer.surfaces
    return replace(
        renderer,
        room=replace(room, boxes=(*room.boxes, visitor.box)),
        surfaces=surfaces._replace(boxes=(*surfaces.boxes, visitor.textures)),
    )


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
