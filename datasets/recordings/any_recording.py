"""The dataset `recording`: a recording of any kind, by the sensors that its robot.toml describes."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...core.errors import InputError
from ...core.factors import Dataset
from ...core.options import option
from ..depth.open import OpenedDepth, open_depth
from ..depth.open import build as build_depth
from ..fixes.open import without_compass
from ..registry import Named, Source
from ..scans.open import OpenedScans, ScanTopics, open_scans
from ..scans.open import build as build_scans
from .open import is_live
from .recording import Opened, build, open_recording, without_imu
from .sensors import ALL, SENSORS, WHEELS, beside_them, chosen, sensors_in
from .settings import read_described
from .several import OpenedSeveral, open_several
from .several import build as build_several


@dataclass(frozen=True)
class Options(Named):
    """The recording's path and robot."""

    path: str | None = option(None, "the folder of the recording, with its robot.toml; or a bag or video beside one")
    robot: str | None = option(None, "another robot.toml to use")
    scan: str | None = option(None, "topic of the laser scans in a bag with several")
    odometry: str | None = option(None, "topic of the odometry in a bag of laser scans with several")
    imu: bool = option(True, "the turns of the recording's gyro are in the log, and its gravity levels sightings")
    sensors: str = option(
        ALL, f"those that the log is made of: {','.join(SENSORS)}; all: what the recording has", parted="+"
    )


def make(options: Options, rng: np.random.Generator) -> Dataset:  # noqa: ARG001 - files are not random
    """A recording of your own, of cameras, with or without depth, and laser scanners: recording[path=FOLDER]."""
    if options.path is None:
        raise InputError("option path of dataset recording is not given, expected its folder: recording[path=FOLDER].")
    if is_live(Path(options.path)):
        raise InputError(f"option path of dataset recording: found {options.path}, expected a recording, not a camera.")
    path, file = Path(options.path), None if options.robot is None else Path(options.robot)
    topics = ScanTopics(options.scan, options.odometry)
    sensors = sensors_in(options.sensors, "option sensors")
    several = open_several(path, file, topics, sensors)
    scans = open_scans(path, file, topics) if several is None else several
    if isinstance(scans, OpenedSeveral):
        if not options.imu:
            level = None if scans.depth is None else replace(scans.depth, tilts=None)
            scans = scans._replace(frames=without_imu(scans.frames), depth=level)
        return build_several(scans)
    if isinstance(scans, OpenedScans):
        scans = chosen(scans, sensors)
        return build_scans(scans if options.imu else scans._replace(inertial=None, world=without_compass(scans.world)))
    depth = scans if isinstance(scans, OpenedDepth) else None
    if scans is None:
        depth = open_depth(path, file)
    if depth is not None:
        depth = chosen(depth, sensors)
        if not options.imu:
            depth = depth.without_gyro()._replace(world=without_compass(depth.world))
        return build_depth(depth)
    frames = scans if isinstance(scans, Opened) else None
    if frames is None:
        robot = None if file is None else read_described(file)
        frames = chosen(open_recording(path, robot, wheels=WHEELS in beside_them(sensors)), sensors)
    return build(frames if options.imu else without_imu(frames))


source = Source(make, Options, portable=False)  # OpenCV's arithmetic
