"""Writes a depth camera's drive as the kinds of recording that `depth` reads, each a folder with robot.toml.

All keep every pixel, and depths in whole millimetres; "tum" and "frames" are folders of PNG files. Known ground truth
is written beside it: truth.tum, and in TUM's layout groundtruth.txt, of the camera.
"""

from collections.abc import Callable, Generator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path

import numpy as np

from ...core.errors import InputError
from ...core.factors import Truth
from ...core.se2 import Array
from ...frontend.camera.quaternions import quaternion
from ...frontend.depth.recording import DepthFrame, DepthRecording
from ...frontend.inertial.imu import Imu
from ...frontend.wheels.track import Track
from ..depth.folder import TRUTH, TUM_UNITS
from ..depth.robot import DepthTopics, write_depth_robot
from ..robot_files import ROBOT
from ..truth import write_truth
from .new_folders import new_folders
from .write import Located
from .write_bag import DEPTH_INFO, ENCODINGS, TOPICS, BagWriter, Kind, Positions
from .write_files import depth_files, imu_table, in_units, pixels_of, write_imu, write_png, write_positions, write_track

FORMATS = {
    "tum": "PNG files in the layout of TUM's benchmark",
    "frames": "PNG files",
    "ros1": "a ROS 1 bag",
    "ros2": "a ROS 2 bag (sqlite3)",
    "mcap": "an MCAP bag (ROS 2)",
}
"""Formats of a drive."""

_Add = Callable[[DepthFrame], None]


def write_depth(
    places: Mapping[Path, str],
    recording: DepthRecording,
    truth: Truth | None,
    cameras: Array,
    inertial: Imu | None = None,
    world: Located | None = None,
) -> None:
    """Writes `recording`, whose frames are iterated once, to folders, each in one of `FORMATS`, with its IMU.

    `world` are positions by GPS, and what is said of the compass.
    `cameras` (n, 4, 4) are the true T_world_camera at the times of `truth`. A folder must not exist or be empty, and
    appears complete or not at all. InputError if one cannot be written, or the recording has no frame.
    """
    found = None if world is None else world.positions
    with new_folders(places) as beside, ExitStack() as stack:
        writers = [
            stack.enter_context(_writer(beside[place], kind, recording, inertial, found))
            for place, kind in places.items()
        ]
        empty = True
        for frame in recording.in_order():
            empty = False
            for add in writers:
                add(frame)
        if empty:
            raise InputError(f"{recording.name}: found no frame, expected at least one.")
        stack.close()
        for place, kind in places.items():
            folder = beside[place]
            bag = kind not in ("tum", "frames")
            topics = DepthTopics(odometry=TOPICS.odometry, image=TOPICS.image, camera_info=TOPICS.camera_info)
            imu = None if inertial is None else imu_table(inertial, bag=bag)
            write_depth_robot(
                folder / ROBOT, recording, topics if bag else None, imu, None if world is None else world.tables
            )
            if found is not None and not bag:
                write_positions(folder, found)
            if inertial is not None and not bag:
                write_imu(folder, inertial)
            if isinstance(recording.motion, Track) and not bag:
                write_track(folder, recording.motion)
            if truth is not None and kind == "tum":
                _write_cameras(folder / TRUTH, truth.t, cameras)
            elif truth is not None:
                write_truth(folder, truth)


def _writer(
    folder: Path, kind: str, recording: DepthRecording, inertial: Imu | None, found: Positions | None
) -> AbstractContextManager[_Add]:
    match kind:
        case "tum":
            return _tum(folder)
        case "frames":
            return depth_files(folder)
        case "ros1" | "ros2" | "mcap":
            return _bag(folder, recording, kind, inertial, found)
        case _:
            raise InputError(f"format: found {kind!r}, expected one of {', '.join(FORMATS)}.")


@contextmanager
def _tum(folder: Path) -> Generator[_Add]:
    """Files named by their times, in two folders, and a list of each."""
    stamps = list[str]()

    def add(frame: DepthFrame) -> None:
        stamp = f"{frame.seconds:.6f}"
        write_png(folder / "rgb" / f"{stamp}.png", pixels_of(frame))
        write_png(folder / "depth" / f"{stamp}.png", in_units(frame, TUM_UNITS))
        stamps.append(stamp)

    for name in ("rgb", "depth"):
        (folder / name).mkdir()
    yield add
    for name, what in (("rgb", "color images"), ("depth", "depth maps")):
        lines = [f"# {what}", "# timestamp filename", *(f"{stamp} {name}/{stamp}.png" for stamp in stamps)]
        (folder / f"{name}.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


@contextmanager
def _bag(
    folder: Path, recording: DepthRecording, kind: Kind, inertial: Imu | None, found: Positions | None
) -> Generator[_Add]:
    """A bag, with odometry and images in order of time."""
    with BagWriter(folder, kind, recording.motion, inertial, positions=found) as bag:

        def add(frame: DepthFrame) -> None:
            t = frame.seconds
            bag.readings(t)
            bag.camera_info(t, recording.camera)
            bag.camera_info(t, recording.camera, DEPTH_INFO)
            bag.image(t, pixels_of(frame))
            bag.depth(t, frame.depth, ENCODINGS[kind])

        yield add
        bag.readings(np.inf)


def _write_cameras(path: Path, t: Array, cameras: Array) -> None:
    """groundtruth.txt: t x y z qx qy qz qw of the camera."""
    lines = ["# ground truth trajectory", "# timestamp tx ty tz qx qy qz qw"]
    for time, pose in zip(t.tolist(), cameras, strict=True):
        lines.append(" ".join(map(repr, [time, *pose[:3, 3].tolist(), *quaternion(pose[:3, :3]).tolist()])))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
