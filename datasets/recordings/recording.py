"""Opens a robot's recording, of any kind, for the front end.

A recording's folder holds robot.toml and one of

    frames/*.png|jpg   and frames.csv: frame,t, or file names that are times, or a frame rate in robot.toml
    drive.mkv|avi|mp4  and frames.csv, or a frame rate, or the video's own time stamps
    drive.bag, drive.mcap, or a ROS 2 folder with metadata.yaml
    tags.csv           poses or corners of tags that another program found; a bag may have messages of them

Any kind comes with a file of the robot's motion, as `readings` reads it, unless a bag has that itself, and with
truth.tum and landmarks.csv, if known. Of several cameras robot.toml names the place of each one's frames. `camera:0`
is the first camera of this machine. Recordings of laser scans are opened by `scans.open`.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.factors import Dataset, Log, Truth
from ...frontend.inertial.tilts import tilts, unlevelled
from ...frontend.markers.pipeline import Recording, build_log
from ...frontend.several.wheels_path import walked
from ...frontend.wheels.commands import Commanded, Commands, Speeds
from ...frontend.wheels.motion import Motion
from ...frontend.wheels.ticks import Ticks, Wheels
from ...frontend.wheels.track import Poses, Track
from ..bags.bag import Bag, is_bag
from ..bags.topics import found as found_topics
from ..bags.topics import plain
from ..fixes.open import OpenedWorld, in_world, open_world, without_compass
from ..inertial.open import NOTE, OpenedImu, beside, open_imu
from ..prior import assumed
from ..readings import COMMANDS, ODOMETRY, TICKS, Readings
from ..robot_files import ROBOT, robot_beside, settings_beside
from ..scans.bag_scans import SCAN
from ..truth import with_truth
from .camera_frames import of_camera
from .in_order import InOrder
from .open import is_live, places, read_streams
from .robot import Robot
from .settings import read_described

EVERY = 0.5  # s, of which turns of the wheels are compared with those of a gyro

DRIFT = f"in {ROBOT} how far it may drift unmeasured: [drift] position = 0.5, turning = 0.5."


class Opened(NamedTuple):
    """A recording, ready for `build`."""

    recording: Recording
    truth: Truth | None  # at the times of its measurement; `sample` interpolates it to a log's
    length: int | None  # number of frames, if known beforehand
    start_given: bool = True  # by [prior] in robot.toml
    inertial: OpenedImu | None = None
    world: OpenedWorld | None = None
    told: Sequence[str] = ()  # remarks on inertial readings, positions and headings, which a log of any sensor gets
    pictures: bool = True  # False: only tags that another program found, without the images

    def without_gyro(self) -> "Opened":
        """The recording without the turns of its gyro and without levels."""
        return self._replace(inertial=None, recording=replace(self.recording, tilts=None))


def build(opened: Opened) -> Dataset:
    """Builds the recording's log, with the ground truth at the log's times; InputError as in `build_log`."""
    log = finished(opened, build_log(opened.recording))
    return with_truth(log, opened.truth, start_given=opened.start_given)


def finished(opened: Opened, log: Log) -> Log:
    """The log of the frames with the gyro's turns, and with positions and headings in the world."""
    return in_world(beside(log, opened.inertial), opened.world)


def without_imu(opened: Opened) -> Opened:
    """The recording as if it had no inertial readings, and so no compass."""
    return opened._replace(
        world=without_compass(opened.world), inertial=None, recording=replace(opened.recording, tilts=None)
    )


def open_recording(
    path: Path, robot: Robot | None = None, seconds: float | None = None, *, wheels: bool = True
) -> Opened:
    """Opens the recording at `path`, with `robot`, or else with the robot.toml in its folder or beside it.

    `seconds` limits a live camera's; otherwise Ctrl-C ends it. Without `wheels` the motion is [drift] of robot.toml.
    InputError for anything missing, ambiguous or mismatched; for frames, as they are read.
    """
    if not is_live(path) and not path.exists():
        raise InputError(f"{path}: there is no such file or folder, expected a recording.")
    if robot is None:
        found = None if is_live(path) else robot_beside(path) or settings_beside(path)
        if found is None:
            raise InputError(f"{path}: found no {ROBOT}, expected one, or --robot FILE{_bare(path)}.")
        robot = read_described(found)
    streams = read_streams(path, robot, seconds)
    first = next(iter(streams.values()))
    if first.readings is not None and robot.drift is None and not wheels:
        raise InputError(
            f"{path}: the robot's motion is unknown, as wheels are left out of the sensors; expected wheels among "
            f"them, as in --sensors markers,wheels, or {DRIFT}"
        )
    motion = _motion(first.readings if wheels else None, robot, path)
    views = robot.views or {"": robot}
    cameras = [of_camera(path, views[name], one, motion, name) for name, one in streams.items()]
    frames, remarks = cameras[0].frames, first.remarks
    if len(cameras) > 1:
        said = [one.remarks for one in streams.values()]
        remarks = list(dict.fromkeys(chain(*said)))
        frames = InOrder([one.frames for one in cameras], said, remarks)
    remarks.extend(_assumed(first.readings, robot, path))
    notes: dict[str, Any] = {
        "source": path.name.encode("utf-8", "replace").decode(),
        **{key: _told(key, views) for key in ("time_offset", "exposure")},
    }
    inertial, before = None, len(remarks)
    if not is_live(path):
        path_of = partial(_path, motion) if isinstance(motion, Wheels) else None
        inertial = open_imu(*places(path, robot), robot.imu, first.readings, notes, remarks, path_of)
    tilted = None
    if inertial is not None and inertial.imu.accel is not None:
        motion.check()
        tilted = tilts(inertial.imu, inertial.stood, motion, remarks)
        inertial = inertial._replace(levels=None if tilted is None else tilted.levels)
        if tilted is None:
            notes[NOTE] += (
                f"; sightings are not levelled: {unlevelled(inertial.imu, motion) or 'gravity is along another axis'}"
            )
    world = None
    if not is_live(path):
        felt = None if inertial is None else inertial.imu
        world = open_world(
            *places(path, robot), robot.world, felt, motion, notes, remarks,
            None if inertial is None else inertial.levels, start_given=robot.prior is not None,
        )  # fmt: skip
    told = remarks[before:]
    recording = Recording(
        name=robot.name,
        frames=frames,
        motion=motion,
        detector=cameras[0].detector,
        noise=robot.noise,
        prior=robot.prior or assumed(),
        max_range=robot.max_range,
        max_distance=robot.max_distance,
        notes=notes,
        remarks=remarks,
        others=[one.detector for one in cameras[1:]],
        tilts=tilted,
    )
    lengths = [one.length for one in streams.values()]
    length = None if None in lengths else sum(one or 0 for one in lengths)
    pictures = any(one.tags is None for one in streams.values())
    return Opened(recording, first.truth, length, robot.prior is not None, inertial, world, told, pictures)


def _told(key: str, views: Mapping[str, Robot]) -> Any:
    """A setting of the only camera, or of each by name."""
    told = {name: getattr(view, key) for name, view in views.items()}
    return told.get("", told)


def _bare(path: Path) -> str:
    """Says at the end of a sentence what a bag without a robot.toml has to have, and what it has."""
    if is_live(path) or not is_bag(path):
        return ""
    listed = found_topics(Bag(path).listed()).removesuffix(".")
    return f"; without one a bag is of a laser scanner ({plain(SCAN)}) or a depth camera (images of depth); {listed}"


def _assumed(readings: Readings | None, robot: Robot, path: Path) -> Iterator[str]:
    """Names what nobody gave of the robot, as far as it is used."""
    for key, kind in (("encoder", Ticks), ("commands", Speeds)):
        if key in robot.assumed and isinstance(readings, kind):
            yield f"{path}: {robot.assumed[key]}"
    if "" in robot.assumed:
        yield robot.assumed[""]


def _path(motion: Motion) -> Poses:
    """The path by the wheels, every half second."""
    motion.check()
    t = np.arange(motion.t[0], motion.t[-1], EVERY)
    return Poses(t, walked(motion, t))


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
            f"messages of them in a bag, or {DRIFT}"
        )
    return robot.drift
