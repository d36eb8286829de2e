"""Writes a drive as the kinds of recording that `recording` reads, each a folder with robot.toml.

With several cameras each has a folder of its own, or in a bag topics of its own. PNG files, the video with the FFV1
codec and the bags preserve every pixel; MP4 does not. Known ground truth is written beside it, to truth.tum and
landmarks.csv. Frames without an image are left out.
"""

from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np

from ...core.errors import InputError
from ...core.factors import Truth
from ...frontend.camera.camera import Camera
from ...frontend.depth.recording import DepthFrame, DepthRecording
from ...frontend.depth.settings import Settings as DepthSettings
from ...frontend.inertial.imu import Imu
from ...frontend.laser.recording import LaserRecording
from ...frontend.laser.settings import Settings
from ...frontend.markers.aruco import Image
from ...frontend.markers.pipeline import Recording
from ...frontend.wheels.motion import Drift
from ...frontend.wheels.ticks import Wheels
from ...frontend.wheels.track import Track
from ..depth.robot import DepthRobot
from ..fixes.robot import WorldTables
from ..robot_files import ROBOT
from ..scans.robot import LaserRobot
from ..scans.scans_csv import SCANS, write_scans_csv
from ..truth import write_truth
from .new_folders import new_folders
from .robot import Robot, write_robot
from .robot_camera import FrameSource
from .rosbag import Topics
from .write_bag import DEPTH_INFO, ENCODINGS, NAMES, TOPICS, BagWriter, Kind, Positions, topics_of
from .write_files import depth_files, imu_table, write_imu, write_positions, write_rows, write_track

DEPTH = "depth"  # the folder of frames with depth

FORMATS = {
    "frames": "PNG files",
    "video": "a lossless video (FFV1)",
    "mp4": "a lossy video (MPEG-4)",
    "ros1": "a ROS 1 bag",
    "ros2": "a ROS 2 bag (sqlite3)",
    "mcap": "an MCAP bag (ROS 2)",
}
"""Formats of a drive."""

_Add = Callable[[float, Image, str, DepthFrame | None], None]
"""Writes the next frame, at its time (s), of the camera of that name, with its depth."""


class Located(NamedTuple):
    """Positions of a GPS receiver, and how robot.toml describes it and the compass."""

    positions: Positions | None = None
    tables: WorldTables = WorldTables()


class Beside(NamedTuple):
    """Readings of sensors beside the cameras."""

    inertial: Imu | None = None
    scans: LaserRecording | None = None
    settings: Settings | None = None  # of the scanner's front end
    world: Located | None = None
    depth: DepthRecording | None = None  # of frames of the first camera


def write(
    places: Mapping[Path, str],
    recording: Recording,
    truth: Truth | None,
    inertial: Imu | None = None,
    scans: LaserRecording | None = None,
    settings: Settings | None = None,
    world: Located | None = None,
    depth: DepthRecording | None = None,
) -> None:
    """Writes `recording`, whose frames are iterated once, to folders, each in one of `FORMATS`, with IMU and scans.

    `settings` are those of the scanner's front end. `world` are positions by GPS, and what is said of the compass.
    `depth` are the frames of its only camera that have depth, iterated once: in a bag beside these, else in a folder.

    A folder must not exist or be empty, and appears complete or not at all. InputError if one cannot be written, the
    recording has no image, or a depth image is at no frame's time.
    """
    readings = Beside(inertial, scans, settings, world, depth)
    with new_folders(places) as beside, ExitStack() as stack:
        writers = [
            stack.enter_context(_writer(beside[folder], kind, recording, readings)) for folder, kind in places.items()
        ]
        latest = dict.fromkeys(recording.detectors, -np.inf)
        deep = _Deep(depth)
        for number, frame in enumerate(recording.frames):
            if frame.image is None:
                continue
            before = latest[frame.camera]
            if not frame.t > before:
                raise InputError(f"{recording.name}: frame {number} is at {frame.t} s, expected later than {before} s.")
            latest[frame.camera] = frame.t
            beside_it = deep.at(frame.t)
            for add in writers:
                add(frame.t, frame.image, frame.camera, beside_it)
        deep.check_over()
        if max(latest.values()) == -np.inf:
            raise InputError(f"{recording.name}: found no frame with an image, expected at least one.")
        stack.close()
        for place in places:
            _write_words(beside[place], recording, truth, places[place], readings)


class _Deep:
    """Depth frames in the order of time, each asked for by its own."""

    def __init__(self, depth: DepthRecording | None) -> None:
        self._name = "" if depth is None else depth.name
        self._frames: Iterator[DepthFrame] = iter(()) if depth is None else depth.in_order()
        self._next = next(self._frames, None)

    def at(self, t: float) -> DepthFrame | None:
        """The one at `t`, s; None for none. InputError for one before that is at no frame's time."""
        found = self._next
        if found is None or found.seconds > t:
            return None
        if found.seconds < t:
            raise InputError(f"{self._name}: a depth image is at {found.seconds} s, expected the time of a frame.")
        self._next = next(self._frames, None)
        return found

    def check_over(self) -> None:
        """Raises InputError for one after the last frame."""
        if self._next is not None:
            _ = self.at(np.inf)


def _writer(folder: Path, kind: str, recording: Recording, readings: Beside) -> AbstractContextManager[_Add]:
    match kind:
        case "frames":
            return _of_cameras(folder, recording, readings, _files)
        case "video":
            return _of_cameras(folder, recording, readings, partial(_video, name="drive.mkv", codec="FFV1"))
        case "mp4":
            return _of_cameras(folder, recording, readings, partial(_video, name="drive.mp4", codec="mp4v"))
        case "ros1" | "ros2" | "mcap":
            return _bag(folder, recording, kind, readings)
        case _:
            raise InputError(f"format: found {kind!r}, expected one of {', '.join(FORMATS)}.")


_Next = Callable[[float, Image], None]  # as _Add, of one camera


@contextmanager
def _of_cameras(
    folder: Path, recording: Recording, readings: Beside, writer: Callable[[Path], AbstractContextManager[_Next]]
) -> Generator[_Add]:
    """The frames of an only camera in `folder`, those of several in a folder for each, and the motion beside them.

    Frames with depth are in a folder of their own, too.
    """
    with ExitStack() as stack:
        writers = dict[str, _Next]()
        for name in recording.detectors:
            (folder / name).mkdir(exist_ok=True)
            writers[name] = stack.enter_context(writer(folder / name))
        deep = None
        if readings.depth is not None:
            (folder / DEPTH).mkdir()
            deep = stack.enter_context(depth_files(folder / DEPTH))

        def add(t: float, image: Image, camera: str, depth: DepthFrame | None) -> None:
            writers[camera](t, image)
            if deep is not None and depth is not None:
                deep(depth)

        yield add
    _write_motion(folder, recording)


@contextmanager
def _files(folder: Path) -> Generator[_Next]:
    """One picture per frame, with its tables."""
    times = list[tuple[str, float]]()

    def add(t: float, image: Image) -> None:
        name = f"{len(times):06}.png"
        _, content = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 1])
        (folder / "frames" / name).write_bytes(content.tobytes())
        times.append((name, t))

    (folder / "frames").mkdir()
    yield add
    _write_times(folder, times)


@contextmanager
def _video(folder: Path, name: str, codec: str) -> Generator[_Next]:
    """One file for all frames, with its tables."""
    times = list[tuple[int, float]]()
    first = list[Image]()  # held back until the second one determines the frame rate
    video = cv2.VideoWriter()

    def start(rate: float) -> None:
        (height, width), colour = first[0].shape[:2], first[0].ndim == 3
        if width % 2 or height % 2:  # OpenCV would drop the last column or row
            raise InputError(f"{name}: found frames of {width}x{height} pixels, expected even numbers for a video.")
        code = cv2.VideoWriter.fourcc(*codec)
        if not video.open(str(folder / name), cv2.CAP_FFMPEG, code, rate, (width, height), colour):
            raise InputError(f"{name}: this OpenCV cannot write videos of {width}x{height} pixels with codec {codec}.")
        video.write(first[0])

    def add(t: float, image: Image) -> None:
        times.append((len(times), t))
        if len(times) == 1:
            first.append(image)
            return
        if len(times) == 2:
            start(1 / (t - times[0][1]))
        video.write(image)

    try:
        yield add
        if len(times) == 1:
            start(1.0)
    finally:
        video.release()
    _write_times(folder, times)


@contextmanager
def _bag(folder: Path, recording: Recording, kind: Kind, readings: Beside) -> Generator[_Add]:
    """A bag, with readings and frames in order of time."""
    topics = {name: topics_of(name) for name in recording.detectors}
    found = None if readings.world is None else readings.world.positions
    with BagWriter(folder, kind, recording.motion, readings.inertial, readings.scans, found) as bag:

        def add(t: float, image: Image, camera: str, depth: DepthFrame | None) -> None:
            bag.readings(t)
            bag.camera_info(t, recording.detectors[camera].camera, topics[camera].camera_info)
            bag.image(t, image, topics[camera].image)
            if depth is not None:
                bag.camera_info(t, recording.detectors[camera].camera, DEPTH_INFO)
                bag.depth(t, depth.depth, ENCODINGS[kind])

        yield add
        bag.readings(np.inf)


def _write_times(folder: Path, times: Sequence[tuple[object, float]]) -> None:
    """frames.csv."""
    write_rows(folder / "frames.csv", "frame,t", times)


def _write_motion(folder: Path, recording: Recording) -> None:
    """ticks.csv or odometry.csv."""
    motion = recording.motion
    if isinstance(motion, Wheels):
        rows = zip(motion.t.tolist(), *motion.ticks.counts.T.tolist(), strict=True)
        write_rows(folder / "ticks.csv", "t,left,right", rows)
    if isinstance(motion, Track):
        write_track(folder, motion)


def _write_words(folder: Path, recording: Recording, truth: Truth | None, kind: str, readings: Beside) -> None:
    """robot.toml, calibration.yaml, the ground truth if known, imu.csv and scans.csv where readings are in files."""
    robot, (inertial, scans, settings, world, depth) = _robot(recording), readings
    if world is not None:
        robot = replace(robot, world=world.tables)
        if world.positions is not None and kind not in NAMES:
            write_positions(folder, world.positions)
    if scans is not None:
        robot = replace(robot, laser=LaserRobot(pose=scans.scanner.pose, settings=settings or Settings()))
        if kind not in NAMES:
            write_scans_csv(folder / SCANS, scans.t, scans.scanner, scans.ranges)
    if depth is not None:
        source = None if kind in NAMES else DEPTH
        robot = replace(robot, depth=DepthRobot(source=source, registered=True, settings=DepthSettings()))
        if kind in NAMES:  # which has images of both kinds
            robot = replace(robot, topics=Topics(image=TOPICS.image, camera_info=TOPICS.camera_info))
    if inertial is not None:
        robot = replace(robot, imu=imu_table(inertial, bag=kind in NAMES))
        if kind not in NAMES:
            write_imu(folder, inertial)
    if len(recording.detectors) > 1:
        cameras = {name: one.camera for name, one in recording.detectors.items()}
        robot = replace(robot, views={name: _view(robot, camera, kind) for name, camera in cameras.items()})
    write_robot(folder / ROBOT, robot)
    if truth is not None:
        write_truth(folder, truth)


def _view(robot: Robot, camera: Camera, kind: str) -> Robot:
    """The robot with one of its cameras."""
    own = replace(robot, **_seen_by(camera))
    if kind in NAMES:
        topics = topics_of(camera.name)
        return replace(own, topics=Topics(image=topics.image, camera_info=topics.camera_info))
    return replace(own, frames=FrameSource(camera.name))


def _seen_by(camera: Camera) -> dict[str, Any]:
    """A camera as a robot has it: its frames are at the middle of their rows' exposures, on the motion's clock."""
    return {
        "camera": camera,
        "mounting": camera.mounting,
        "time_offset": -camera.readout / 2,
        "readout": camera.readout,
    }


def _robot(recording: Recording) -> Robot:
    """robot.toml of the recording, with its only, or first, camera."""
    motion = recording.motion
    robot = Robot(
        name=recording.name,
        markers=recording.detector.markers,
        **_seen_by(recording.detector.camera),
        max_range=recording.max_range,
        max_distance=recording.max_distance,
        noise=recording.noise,
        prior=recording.prior,
    )
    if isinstance(motion, Wheels):
        return replace(robot, encoder=motion.stated, max_speed=motion.max_speed)
    if isinstance(motion, Track):
        return replace(robot, track_noise=motion.noise, max_speed=motion.max_speed)
    if isinstance(motion, Drift):
        return replace(robot, drift=motion)
    raise InputError(f"{recording.name}: found {type(motion).__name__} readings, expected Wheels, Track or Drift.")
