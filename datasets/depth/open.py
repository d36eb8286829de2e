"""Opens a recording of a depth camera: a folder of images or a ROS bag, with the robot's robot.toml.

A folder has lists of images as `folder` reads them, or a bag, with robot.toml, and odometry.csv (t,x,y,heading) beside
images. Ground truth is truth.tum, of the robot, or groundtruth.txt, of the camera.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.factors import Dataset, Log, Prior, Truth
from ...core.files import check_regular
from ...frontend.depth.log import build_log
from ...frontend.depth.recording import DepthRecording
from ...frontend.depth.settings import Settings
from ...frontend.inertial.tilts import tilts
from ...frontend.wheels.commands import Speeds
from ...frontend.wheels.motion import Drift, Motion
from ...frontend.wheels.track import Poses, Track
from ..bags.bag import Bag, is_bag, is_whole
from ..bags.cameras import COMPRESSED, IMAGE
from ..bags.siblings import read_alone
from ..fixes.open import OpenedWorld, in_world, open_world
from ..inertial.open import OpenedImu, beside, open_imu
from ..prior import assumed
from ..readings import ODOMETRY, read_readings
from ..robot_files import ROBOT, recording_in, robot_beside
from ..truth import read_truth, with_truth
from .bag_frames import read_bag
from .bag_images import is_depth
from .folder import Folder, is_folder, read_camera_truth, read_folder
from .frames import Frames
from .registering import Registration
from .robot import DepthRobot, read_depth_robot
from .sources import Sources

_KINDS = (
    "a folder with rgb.txt and depth.txt or with frames.csv, or a ROS bag (.bag, .mcap, or a folder with metadata.yaml)"
)


class OpenedDepth(NamedTuple):
    """A recording of a depth camera, ready for `build`."""

    recording: DepthRecording
    settings: Settings
    truth: Truth | None  # at the times of its measurement
    length: int | None  # number of images
    start_given: bool = True  # by [prior] in robot.toml
    inertial: OpenedImu | None = None
    world: OpenedWorld | None = None

    def without_gyro(self) -> "OpenedDepth":
        """The recording without the turns of its gyro and without levels."""
        return self._replace(inertial=None, recording=replace(self.recording, tilts=None))


def open_depth(path: Path, robot_file: Path | None = None) -> OpenedDepth | None:
    """Opens the recording at `path`, with that robot.toml, or the one in its folder or beside it; None for another.

    Without a robot.toml a folder of images is read if it has lists of both kinds, and a bag if it has depth images.
    InputError for what is missing, ambiguous or cannot be used; for images, as they are read.
    """
    file = robot_file or robot_beside(path)
    robot = None if file is None else read_depth_robot(file)
    if robot is None:
        if file is not None or not _is_depth(path):
            return None
        robot = DepthRobot()
    if not path.exists():
        raise InputError(f"{path}: there is no such file or folder, expected a recording.")
    found = _source(path, robot)
    home = path if path.is_dir() and (not is_bag(path) or (path / ROBOT).is_file()) else found.absolute().parent
    opened = _opened(found, robot, home)
    recording, notes = opened.recording, dict(opened.recording.notes)
    motion = recording.motion
    odometry = Poses(motion.t, motion.poses) if isinstance(motion, Track) else None
    inertial = open_imu(found, home, robot.imu, odometry, notes, recording.remarks)
    tilted = None
    if inertial is not None and inertial.imu.accel is not None and motion is not None:
        tilted = tilts(inertial.imu, inertial.stood, motion, recording.remarks)
    felt = None if inertial is None else inertial.imu
    world = open_world(
        found, home, robot.world, felt, motion, notes, recording.remarks,
        None if tilted is None else tilted.levels, start_given=robot.prior is not None,
    )  # fmt: skip
    recording = replace(recording, notes=notes, tilts=tilted)
    return opened._replace(recording=recording, inertial=inertial, world=world)


def open_bag(path: Path, robot: DepthRobot) -> OpenedDepth:
    """Opens the bag at `path` of a known robot; InputError as for `open_depth`."""
    return _opened(path, robot, path.absolute().parent)


def build(opened: OpenedDepth) -> Dataset:
    """The log of the recording by the front end, with the ground truth at its times; InputError as in `build_log`."""
    log = finished(opened, build_log(opened.recording, opened.settings))
    return with_truth(log, opened.truth, start_given=opened.start_given)


def finished(opened: OpenedDepth, log: Log) -> Log:
    """The log of the frames with the gyro's turns, and with positions and headings in the world."""
    return in_world(beside(log, opened.inertial), opened.world)


def _opened(found: Path, robot: DepthRobot, home: Path) -> OpenedDepth:
    """Opens a bag or folder; the readings and the truth of a folder lie in `home`."""
    if is_bag(found):
        check_regular(found)
        sources = read_bag(found, robot)
        sources.remarks.extend(read_alone(found))
    else:
        sources = _of_folder(found, robot)
    recording = _recording(found, sources, robot, home)
    truth = sources.truth or read_truth(home) or read_camera_truth(home, sources.camera.mounting)
    return OpenedDepth(recording, robot.settings, truth, sources.length, robot.prior is not None)


def _is_depth(path: Path) -> bool:
    """Tells if there are depth images at `path`."""
    if is_bag(path):
        if not path.exists():
            return False
        bag = Bag(path)
        images = (topic for topic in bag.listed() if topic.type in (IMAGE, COMPRESSED) and topic.messages)
        return any(is_depth(bag, topic) for topic in images)
    return is_folder(path)


def _source(path: Path, robot: DepthRobot) -> Path:
    """The bag or folder that `path` is or contains; of several the one that robot.toml names."""
    if is_whole(path, robot.source) or (robot.source is None and is_folder(path)):
        return path
    if not path.is_dir():
        raise InputError(f"{path}: found a file of an unknown kind, expected {_KINDS}.")
    return recording_in(path, "depth", robot.source, sorted(one for one in path.iterdir() if is_bag(one)), _KINDS)


def _of_folder(path: Path, robot: DepthRobot) -> Sources:
    """The images of a folder, with what only robot.toml knows of their cameras."""
    if robot.camera is None or robot.mounting is None:
        missing = 'calibration = "calibration.yaml"' if robot.camera is None else "mounting"
        raise InputError(f"{path}: images in files have no camera_info, expected [camera] {missing} in {ROBOT}.")
    folder: Folder = read_folder(path, robot.units)
    registration = None
    if robot.depth_camera is not None:
        if robot.pose is None:
            raise InputError(f"{path}: [depth] has a calibration, expected its pose, in the images' camera, as well.")
        registration = Registration(robot.depth_camera, robot.camera, robot.pose)
    elif robot.registered is False:
        raise InputError(
            f"{path}: [depth] registered is false, expected calibration and pose of its camera in {ROBOT}."
        )
    return Sources(
        folder.pictures, folder.measured, robot.camera, registration, None, {}, len(folder.images), list[str]()
    )


def _recording(path: Path, sources: Sources, robot: DepthRobot, home: Path) -> DepthRecording:
    """Joins images and odometry."""
    readings = sources.readings or read_readings(home, None, sources.remarks)
    if readings is not None and not isinstance(readings, Poses):
        found = "commands" if isinstance(readings, Speeds) else "counts of wheels"
        raise InputError(f"{home}: has {found}, expected {ODOMETRY} (t,x,y,heading) beside a depth camera.")
    motion = None
    if readings is not None:
        motion = Track(readings.t, readings.poses, robot.noise, robot.max_speed, f"{path}: odometry")
        motion.check()
    start = robot.prior or assumed(None if readings is None else readings.poses[0])
    return _moved(path, sources, robot, motion, start)


def open_beside(path: Path, robot: DepthRobot, motion: Motion, prior: Prior) -> DepthRecording:
    """The frames of a robot whose motion and start another sensor's recording tells; InputError as in `open_depth`."""
    found = _source(path, robot)
    if is_bag(found):
        check_regular(found)
        sources = read_bag(found, robot, moved=False)
        sources.remarks.extend(read_alone(found))
    else:
        sources = _of_folder(found, robot)
    return _moved(found, sources, robot, None if isinstance(motion, Drift) else motion, prior)


def _moved(path: Path, sources: Sources, robot: DepthRobot, motion: Motion | None, prior: Prior) -> DepthRecording:
    """Joins images and motion."""
    span = (-np.inf, np.inf) if motion is None else (float(motion.t[0]), float(motion.t[-1]))
    shift = robot.time_offset + robot.exposure / 2
    frames = Frames(
        str(path),
        sources.images,
        sources.depths,
        sources.camera,
        sources.registration,
        robot.within,
        shift,
        span,
        remarks=sources.remarks,
    )
    notes: dict[str, Any] = {
        "source": path.name.encode("utf-8", "replace").decode(),
        "depth_registered": "by the recording" if sources.registration is None else "on reading",
    }
    if sources.topics:
        notes |= {"topics": sources.topics}
    return DepthRecording(
        name=robot.name or path.name.partition(".")[0],
        camera=sources.camera,
        frames=frames,
        motion=motion,
        prior=prior,
        notes=notes,
        depth_camera=None if sources.registration is None else sources.registration.source,
        left_out=frames.left_out,
        remarks=frames.remarks,
    )
