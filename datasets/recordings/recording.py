"""Opens a robot's recording, of any kind, for the front end.

A recording's folder holds robot.toml and one of

    frames/*.png|jpg   and frames.csv: frame,t, or file names that are times, or a frame rate in robot.toml
    drive.mkv|avi|mp4  and frames.csv, or a frame rate, or the video's own time stamps
    drive.bag, drive.mcap, or a ROS 2 folder with metadata.yaml
    tags.csv           poses or corners of tags that another program found; a bag may have messages of them

Any kind comes with a file of the robot's motion, as `readings` reads it, unless a bag has that itself, and with
truth.tum and landmarks.csv, if known. `camera:0` is the first camera of this machine. Recordings of laser scans are
opened by `scans.open`.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.factors import Dataset, Truth
from ...core.options import option
from ...frontend.camera.camera import Camera
from ...frontend.markers.aruco import Detector
from ...frontend.markers.noise import PropagatedNoise
from ...frontend.markers.pipeline import Frame, Recording, build_log
from ...frontend.wheels.commands import Commanded, Commands, Speeds
from ...frontend.wheels.motion import Motion, Ticks, Track, Wheels
from ..bags.bag import Bag, is_bag
from ..bags.camera_info import of_images
from ..bags.topics import found as found_topics
from ..bags.topics import plain
from ..bags.window import Window
from ..depth.open import build as build_depth
from ..depth.open import open_depth
from ..prior import assumed
from ..readings import COMMANDS, ODOMETRY, TICKS, Readings
from ..registry import Named, Source
from ..robot_files import ROBOT, robot_beside, settings_beside
from ..scans.bag_scans import SCAN
from ..scans.open import ScanTopics, open_scans
from ..scans.open import build as build_scans
from ..tags.found_tags import Known, sightings
from ..truth import with_truth
from .open import is_live, read_streams
from .robot import Robot
from .settings import read_described
from .streams import Streams

OTHER_LENS = 0.02
"""Relative difference of two focal lengths of one lens: calibrations agree within 1 %, and ranges err by as much."""


class Opened(NamedTuple):
    """A recording, ready for `build`."""

    recording: Recording
    truth: Truth | None  # at the times of its measurement; `sample` interpolates it to a log's
    length: int | None  # number of frames, if known beforehand
    start_given: bool = True  # by [prior] in robot.toml
    pictures: bool = True  # False: tags that another program found, without the images


@dataclass(frozen=True)
class Options(Named):
    """The recording's path and robot."""

    path: str | None = option(None, "the folder of the recording, with its robot.toml; or a bag or video beside one")
    robot: str | None = option(None, "another robot.toml to use")
    scan: str | None = option(None, "topic of the laser scans in a bag with several")
    odometry: str | None = option(None, "topic of the odometry in a bag of laser scans with several")


def make(options: Options, rng: np.random.Generator) -> Dataset:  # noqa: ARG001 - files are not random
    """A recording of your own, of a camera, with or without depth, or a laser scanner: recording[path=FOLDER]."""
    if options.path is None:
        raise InputError("option path of dataset recording is not given, expected its folder: recording[path=FOLDER].")
    if is_live(Path(options.path)):
        raise InputError(f"option path of dataset recording: found {options.path}, expected a recording, not a camera.")
    file = None if options.robot is None else Path(options.robot)
    scans = open_scans(Path(options.path), file, ScanTopics(options.scan, options.odometry))
    if scans is not None:
        return build_scans(scans)
    depth = open_depth(Path(options.path), file)
    if depth is not None:
        return build_depth(depth)
    return build(open_recording(Path(options.path), None if file is None else read_described(file)))


source = Source(make, Options, portable=False)  # OpenCV's arithmetic


def build(opened: Opened) -> Dataset:
    """Builds the recording's log, with the ground truth at the log's times; InputError as in `build_log`."""
    return with_truth(build_log(opened.recording), opened.truth, start_given=opened.start_given)


def open_recording(path: Path, robot: Robot | None = None, seconds: float | None = None) -> Opened:
    """Opens the recording at `path`, with `robot`, or else with the robot.toml in its folder or beside it.

    `seconds` limits a live camera's; otherwise Ctrl-C ends it. InputError for anything missing, ambiguous or
    mismatched; for frames, as they are read.
    """
    if not is_live(path) and not path.exists():
        raise InputError(f"{path}: there is no such file or folder, expected a recording.")
    if robot is None:
        found = None if is_live(path) else robot_beside(path) or settings_beside(path)
        if found is None:
            raise InputError(f"{path}: found no {ROBOT}, expected one, or --robot FILE{_bare(path)}.")
        robot = read_described(found)
    streams = read_streams(path, robot, seconds)
    if robot.lens is not None and streams.tags is None:
        (width, height), frames = _sized(streams.frames, path)
        robot, streams = replace(robot, camera=robot.lens(width, height)), streams._replace(frames=frames)
    camera, recorded = (_of_frames(one, streams.window) for one in (robot.camera, streams.camera))
    if camera is not None:
        camera = of_images(camera, recorded, streams.topic, str(path), streams.remarks)
    if camera is not None and recorded is not None:
        streams.remarks.extend(_contradicted(camera, recorded, path))
    if camera is None and recorded is not None:
        camera = replace(recorded, mounting=robot.mounting, readout=robot.readout)
    if streams.tags is not None:
        camera = _of_tags(camera, robot, streams, path)
    if camera is None:
        lacking = f" ({streams.lacking})" if streams.lacking else ""
        raise InputError(
            f"{path}: the camera's calibration is unknown{lacking}, expected {ROBOT} to name its file: "
            '[camera] calibration = "calibration.yaml".'
        )
    detector = Detector(robot.markers, camera)
    frames = streams.frames
    if streams.tags is not None:
        known = Known(detector, robot.corner_sd, isinstance(robot.noise, PropagatedNoise), str(path))
        frames = (Frame(one.t, None, sightings(one, known)) for one in streams.tags)
    motion = _motion(streams.readings, robot, path)
    streams.remarks.extend(_assumed(streams.readings, robot, path))
    clock = robot.time_offset + (robot.exposure + robot.readout) / 2
    recording = Recording(
        name=robot.name,
        frames=_FramesOnClock(frames, motion, clock, camera, path),
        motion=motion,
        detector=detector,
        noise=robot.noise,
        prior=robot.prior or assumed(),
        max_range=robot.max_range,
        max_distance=robot.max_distance,
        clock=clock,
        notes={
            "source": path.name.encode("utf-8", "replace").decode(),
            "time_offset": robot.time_offset,
            "exposure": robot.exposure,
        },
        remarks=streams.remarks,
    )
    return Opened(recording, streams.truth, streams.length, robot.prior is not None, streams.tags is None)


def _of_tags(camera: Camera | None, robot: Robot, streams: Streams, path: Path) -> Camera | None:
    """The camera in whose images another program found tags; None where it is needed and unknown."""
    assert streams.tags is not None
    corners = any(tag.pose is None for frame in streams.tags for tag in frame.tags)
    if camera is None:
        return None if corners else Camera.unknown(robot.mounting)
    if camera.readout:
        streams.remarks.append(
            f"{path}: the tags were found by another program: readout in {ROBOT} does not correct them"
        )
    if robot.rectified:
        if camera.rectified is None:
            raise InputError(
                f"{path}: [camera] rectified: the calibration tells nothing of rectified images, expected one with a "
                "projection_matrix."
            )
        return camera.rectified
    if robot.rectified is None and corners and streams.topic and camera.distorted:
        raise InputError(
            f"{path}: the corners of topic {streams.topic} may be of raw or of rectified images, expected [camera] "
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


def _bare(path: Path) -> str:
    """Says at the end of a sentence what a bag without a robot.toml has to have, and what it has."""
    if is_live(path) or not is_bag(path):
        return ""
    listed = found_topics(Bag(path).listed()).removesuffix(".")
    return f"; without one a bag is of a laser scanner ({plain(SCAN)}) or a depth camera (images of depth); {listed}"


def _of_frames(camera: Camera | None, window: Window | None) -> Camera | None:
    """The camera of the frames, which may be a part of those of a whole one."""
    if camera is None or window is None or (camera.width, camera.height) != window.whole:
        return camera
    return window.of(camera)


def _contradicted(given: Camera, recorded: Camera, path: Path) -> Iterator[str]:
    """Compares the calibration in robot.toml, which is used, with the recording's own."""
    sizes = [f"{camera.width}x{camera.height}" for camera in (given, recorded)]
    if sizes[0] != sizes[1]:
        yield f"{path}: camera_info is of {sizes[1]} pixels, the calibration in {ROBOT}, which is used, of {sizes[0]}"
        return
    numbers = [(*camera.focal, *camera.centre) for camera in (given, recorded)]
    for k, (name, one, other) in enumerate(zip(("fx", "fy", "cx", "cy"), *numbers, strict=True)):
        if abs(one - other) > OTHER_LENS * given.focal[k % 2]:
            effect = "ranges differ by the same share" if k < 2 else "bearings and heights differ"
            yield (
                f"{path}: camera_info has {name} = {other:.6g} px, the calibration in {ROBOT}, which is used, "
                f"{one:.6g} px: {effect}"
            )
    apart = _lens_apart(given, recorded)
    if apart is not None:
        yield (
            f"{path}: camera_info has another lens ({_lens(recorded)}) than the calibration in {ROBOT}, which is used "
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


def _assumed(readings: Readings | None, robot: Robot, path: Path) -> Iterator[str]:
    """Names what nobody gave of the robot, as far as it is used."""
    for key, kind in (("encoder", Ticks), ("commands", Speeds)):
        if key in robot.assumed and isinstance(readings, kind):
            yield f"{path}: {robot.assumed[key]}"
    if "" in robot.assumed:
        yield robot.assumed[""]


def _motion(readings: Readings | None, robot: Robot, path: Path) -> Motion:
    """Combines the readings with the robot's parameters."""
    if isinstance(readings, Ticks):
        if robot.encoder is None:
            raise InputError(f"{path}: has wheel counts, expected [encoder] in {ROBOT} to convert them.")
        return Wheels(readings, robot.encoder, robot.max_speed, f"{path}: encoder")
    if isinstance(readings, Speeds):
        return Commanded.by(readings, robot.commands or Commands(), robot.max_speed, f"{path}: commands")
    if readings is not None:
        return Track(*readings, robot.track_noise, robot.max_speed, f"{path}: odometry")
    if robot.drift is None:
        raise InputError(
            f"{path}: the robot's motion is unknown; expected {TICKS}, {ODOMETRY} or {COMMANDS} beside the frames, "
            f"messages of them in a bag, or in {ROBOT} how far it may drift unmeasured: [drift] position = 0.5, "
            "turning = 0.5."
        )
    return robot.drift


@dataclass(frozen=True, eq=False)
class _FramesOnClock:
    """The frames on the motion's clock; InputError, while iterating, if they do not fit the rest."""

    frames: Iterable[Frame]
    motion: Motion
    clock: float  # s, added to the frames' stamps
    camera: Camera
    path: Path

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
                        f"{self.path}: frame {number - 1} has {width}x{height} pixels, expected the "
                        f"{self.camera.width}x{self.camera.height} of the camera's calibration."
                    )
            decoded += frame.found is not None
            yield frame._replace(t=t)
        if not number:
            raise InputError(f"{self.path}: found no frames, expected at least one.")
        if not decoded:
            raise InputError(f"{self.path}: none of its {number} frames can be decoded, expected at least one.")
        if not inside:
            raise InputError(
                f"{self.path}: no frame is within the time of the motion's readings: frames are from {begin} to {end} "
                f"s, readings from {first} to {last} s; [camera] time_offset in {ROBOT} is added to the frames' times."
            )
