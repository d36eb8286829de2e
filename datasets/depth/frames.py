"""The frames of a depth camera's recording: pairs of images, decoded, checked and registered one by one."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

import cv2
import numpy as np

from ...core.errors import InputError
from ...frontend.camera.camera import Camera
from ...frontend.depth.recording import DepthFrame
from .registering import Registration
from .shots import Flaw, Pixels, Shot, pairs

WITHIN = 0.02
"""s between an image and the depth image that belongs to it, at most; Kinects take 30 of each a second."""

UNMEASURED = "frames without odometry around them"


@dataclass(frozen=True, eq=False)
class Frames:
    """Frames that are read on demand, any number of times.

    What cannot be used is left out, and counted in `left_out` by the last pass over the frames; the first of a kind
    is among the `remarks`. InputError, at the end of a pass, if there was no frame that could be used.
    """

    where: str  # the recording, in messages
    images: Callable[[], Iterable[Shot]]  # grey or BGR, in the order of time
    depths: Callable[[], Iterable[Shot]]  # (h, w) m
    camera: Camera
    registration: Registration | None  # None: the depths are registered
    within: float = WITHIN
    shift: float = 0.0  # s, added to the images' times
    span: tuple[float, float] = (-np.inf, np.inf)  # s, in which there is odometry
    left_out: Counter[str] = field(default_factory=Counter[str])
    remarks: list[str] = field(default_factory=list[str])

    def __iter__(self) -> Iterator[DepthFrame]:
        """The frames in the order of time."""
        self.left_out.clear()
        first: dict[str, str] = {}
        used, ends = 0, list[float]()
        for image, depth in pairs(self.images(), self.depths(), self.within, self.left_out):
            t = image.t + self.shift
            ends = [ends[0] if ends else t, t]
            if not self.span[0] <= t <= self.span[1]:
                self.left_out[UNMEASURED] += 1
                continue
            frame = self._frame(t, image, depth)
            if isinstance(frame, DepthFrame):
                used += 1
                yield frame
            else:
                self.left_out[frame.reason] += 1
                first.setdefault(frame.reason, frame.found)
        self._finish(used, first, ends)

    def _frame(self, t: float, image: Shot, depth: Shot) -> DepthFrame | Flaw:
        """The frame of two images; a flaw names the file it is of."""
        picture = image.load()
        if isinstance(picture, Flaw):
            return picture._replace(found=f"{image.name} {picture.found}")
        measured = depth.load()
        if isinstance(measured, Flaw):
            return measured._replace(found=f"{depth.name} {measured.found}")
        source = self.camera if self.registration is None else self.registration.source
        for shot, pixels, camera, what in ((image, picture, self.camera, ""), (depth, measured, source, "depth ")):
            height, width = pixels.shape[:2]
            if (width, height) != (camera.width, camera.height):
                expected = f"the {camera.width}x{camera.height} of its camera's calibration"
                if what and self.registration is None:
                    expected = f"the {camera.width}x{camera.height} of the image that it is registered to"
                return Flaw(
                    f"{what}images of another size", f"{shot.name} has {width}x{height} pixels, expected {expected}"
                )
        registered = measured if self.registration is None else self.registration.registered(measured)
        grey, colour = _grey(picture)
        return DepthFrame(t, grey, registered, colour)

    def _finish(self, used: int, first: dict[str, str], ends: list[float]) -> None:
        """Adds the remarks of this pass; InputError if no frame was used."""
        if not used:
            raise InputError(f"{self.where}: {self._nothing(first, ends)}.")
        for reason, found in first.items():
            remark = f"{self.where}: {self.left_out[reason]} {reason} are left out; {found}"
            if remark not in self.remarks:
                self.remarks.append(remark)

    def _nothing(self, first: dict[str, str], ends: list[float]) -> str:
        """Why no frame was used."""
        if first:
            reason = max(first, key=lambda one: self.left_out[one])
            return f"no frame can be used; {first[reason]}"
        if ends:
            return (
                f"no frame is within the time of the odometry: frames are from {ends[0]} to {ends[1]} s, readings from "
                f"{self.span[0]} to {self.span[1]} s"
            )
        found = " and ".join(f"{count} {reason}" for reason, count in self.left_out.items() if count) or "no images"
        return f"found {found}, expected an image and a depth image at most {self.within:g} s apart"


def _grey(picture: Pixels) -> tuple[Pixels, Pixels | None]:
    """The grey image, and the colours if it has any."""
    if picture.ndim == 2:
        return picture, None
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), np.uint8), picture
