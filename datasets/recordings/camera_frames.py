"""A camera of a recording: its frames on the motion's clock, and the detector that knows its calibration."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...core.errors import InputError
from ...frontend.camera.camera import Camera
from ...frontend.markers.aruco import Detector
from ...frontend.markers.noise import PropagatedNoise
from ...frontend.markers.pipeline import Frame, called
from ...frontend.wheels.motion import Motion
from ..bags.camera_info import of_images
from ..bags.window import Window
from ..robot_files import ROBOT
from ..tags.found_tags import Known, sightings
from .robot import Robot
from .robot_camera import table_of
from .streams import Streams

OTHER_LENS = 0.02
"""Relative difference of two focal lengths of one lens: calibrations agree within 1 %, and ranges err by as much."""


class CameraFrames(NamedTuple):
    """A camera's frames, and what finds markers in them."""

    frames: Iterable[Frame]
    detector: Detector


def of_camera(path: Path, robot: Robot, streams: Streams, motion: Motion, name: str) -> CameraFrames:
    """The frames of a recording's camera, called `name` if there are several, `robot` having that one.

    InputError for a camera that is unknown or of other images; for frames, as they are read.
    """
    if robot.unmarked:
        return CameraFrames((), Detector(robot.markers, robot.camera or Camera.unknown(robot.mounting)))
    where, table = called(str(path), name), table_of(name)
    if robot.lens is not None and streams.tags is None:
        (width, height), frames = _sized(streams.frames, path)
        robot, streams = replace(robot, camera=robot.lens(width, height)), streams._replace(frames=frames)
    camera, recorded = (_of_frames(one, streams.window) for one in (robot.camera, streams.camera))
    if camera is not None:
        camera = of_images(camera, recorded, streams.topic, where, streams.remarks)
    if camera is not None and recorded is not None:
        streams.remarks.extend(_contradicted(camera, recorded, where))
    if camera is None and recorded is not None:
        camera = replace(recorded, mounting=robot.mounting, readout=robot.readout, name=name)
    if streams.tags is not None:
        camera = _of_tags(camera, robot, streams, where, table, name)
    if camera is None:
        lacking = f" ({streams.lacking})" if streams.lacking else ""
        raise InputError(
            f"{where}: the camera's calibration is unknown{lacking}, expected {ROBOT} to name its file: "
            f'{table} calibration = "calibration.yaml".'
        )
    for key in _needed(streams, camera, robot):
        if key in robot.lacks:
            raise InputError(robot.lacks[key])
    detector = Detector(robot.markers, camera)
    frames = streams.frames
    if streams.tags is not None:
        known = Known(detector, robot.corner_sd, isinstance(robot.noise, PropagatedNoise), where, table)
        frames = (Frame(one.t, None, sightings(one, known)) for one in streams.tags)
    clock = robot.time_offset + (robot.exposure + robot.readout) / 2
    return CameraFrames(_FramesOnClock(frames, motion, clock, camera, where, table), detector)


def _needed(streams: Streams, camera: Camera, robot: Robot) -> tuple[str, ...]:
    """The keys of [markers] without which markers cannot be found, or tags tell too little."""
    if streams.tags is None:
        return "dictionary", "side"
    told = camera.known and isinstance(robot.noise, PropagatedNoise)  # by its corners where a pose has no covariance
    tags = (tag for frame in streams.tags for tag in frame.tags)
    return ("side",) if any(tag.pose is None or (told and tag.cov is None) for tag in tags) else ()


def _of_tags(camera: Camera | None, robot: Robot, streams: Streams, where: str, table: str, name: str) -> Camera | None:
    """The camera in whose images another program found tags; None where it is needed and unknown."""
    assert streams.tags is not None
    corners = any(tag.pose is None for frame in streams.tags for tag in frame.tags)
    if camera is None:
        return None if corners else replace(Camera.unknown(robot.mounting), name=name)
    if camera.readout:
        streams.remarks.append(
            f"{where}: the tags were found by another program: readout in {ROBOT} does not correct them"
        )
    if robot.rectified:
        if camera.rectified is None:
            raise InputError(
                f"{where}: {table} rectified: the calibration tells nothing of rectified images, expected one with a "
                "projection_matrix."
            )
        return camera.rectified
    if robot.rectified is None and corners and streams.topic and camera.distorted:
        raise InputError(
            f"{where}: the corners of topic {streams.topic} may be of raw or of rectified images, expected {table} "
            f"rectified = true or false in {ROBOT}; apriltag_ros finds tags in rectified ones, TagSLAM in raw ones."
        )
    return camera


def _sized(frames: Iterable[Frame], path: Path) -> tuple[tuple[int, int], Iterable[Frame]]:
    """The width and height of the first image, px, and all frames. InputError without an image."""
    rest, begun = iter(frames), list[Frame]()
    for frame in rest:
        begun.append(frame)
        if frame.image is not None:
            height, width = frame.image.shape[:2]
            return (width, height), chain(begun, rest)
    raise InputError(f"{path}: none of its {len(begun)} frames can be decoded, expected at least one.")


def _of_frames(camera: Camera | None, window: Window | None) -> Camera | None:
    """The camera of the frames, which may be a part of those of a whole one."""
    if camera is None or window is None or (camera.width, camera.height) != window.whole:
        return camera
    return window.of(camera)


def _contradicted(given: Camera, recorded: Camera, where: str) -> Iterator[str]:
    """Compares the calibration in robot.toml, which is used, with the recording's own."""
    sizes = [f"{camera.width}x{camera.height}" for camera in (given, recorded)]
    if sizes[0] != sizes[1]:
        yield f"{where}: camera_info is of {sizes[1]} pixels, the calibration in {ROBOT}, which is used, of {sizes[0]}"
        return
    numbers = [(*camera.focal, *camera.centre) for camera in (given, recorded)]
    for k, (name, one, other) in enumerate(zip(("fx", "fy", "cx", "cy"), *numbers, strict=True)):
        if abs(one - other) > OTHER_LENS * given.focal[k % 2]:
            effect = "ranges differ by the same share" if k < 2 else "bearings and heights differ"
            yield (
                f"{where}: camera_info has {name} = {other:.6g} px, the calibration in {ROBOT}, which is used, "
                f"{one:.6g} px: {effect}"
            )
    apart = _lens_apart(given, recorded)
    if apart is not None:
        yield (
            f"{where}: camera_info has another lens ({_lens(recorded)}) than the calibration in {ROBOT}, which is used "
            f"({_lens(given)}): near the edge of the image they differ by {apart:.3g} px"
        )


def _lens(camera: Camera) -> str:
    return f"{camera.model}, [{', '.join(f'{one:.3g}' for one in camera.distortion)}]"


def _lens_apart(given: Camera, recorded: Camera) -> float | None:
    """px between where two lenses see the middles of the image's edges, of one focal length and centre; None: alike."""
    (cx, cy), right, low = given.centre, given.width - 1.0, given.height - 1.0
    pixels = np.array([(0.0, cy), (right, cy), (cx, 0.0), (cx, low)])
    rays = given.undistort(pixels)
    same = replace(recorded, focal=given.focal, centre=given.centre)
    seen = same.project(np.column_stack((rays, np.ones(4))))
    off, out = (np.hypot(*(pixels - other).T) for other in (seen, given.centre))
    off = np.where(np.isfinite(off), off, 0.0)
    return float(off.max()) if (off > OTHER_LENS * out).any() else None


@dataclass(frozen=True, eq=False)
class _FramesOnClock:
    """The frames on the motion's clock; InputError, while iterating, if they do not fit the rest."""

    frames: Iterable[Frame]
    motion: Motion
    clock: float  # s, added to the frames' stamps
    camera: Camera
    where: str
    table: str  # of the camera in robot.toml

    def __iter__(self) -> Iterator[Frame]:
        first, last = self.motion.t[[0, -1]]
        number, decoded, inside, begin, end = 0, 0, 0, np.inf, -np.inf
        for number, frame in enumerate(self.frames, start=1):
            t = frame.t + self.clock
            begin, end = min(begin, t), max(end, t)
            inside += bool(first <= t <= last)
            if frame.image is not None:
                decoded += 1
                height, width = frame.image.shape[:2]
                if (width, height) != (self.camera.width, self.camera.height):
                    raise InputError(
                        f"{self.where}: frame {number - 1} has {width}x{height} pixels, expected the "
                        f"{self.camera.width}x{self.camera.height} of the camera's calibration."
                    )
            decoded += frame.found is not None
            yield frame._replace(t=t, camera=self.camera.name, clock=self.clock)
        if not number:
            raise InputError(f"{self.where}: found no frames, expected at least one.")
        if not decoded:
            raise InputError(f"{self.where}: none of its {number} frames can be decoded, expected at least one.")
        if not inside:
            raise InputError(
                f"{self.where}: no frame is within the time of the motion's readings: frames are from {begin} to {end} "
                f"s, readings from {first} to {last} s; {self.table} time_offset in {ROBOT} is added to the frames' "
                "times."
            )
