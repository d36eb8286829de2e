"""Drives of a Pioneer robot with a Kinect, of the TUM RGB-D benchmark, through the front end for depth cameras.

J. Sturm et al., A benchmark for the evaluation of RGB-D SLAM systems, IROS 2012. The bags have the wheels' odometry and
the camera's poses by motion capture, in tf's frames odom and world; the benchmark's folders of images have no wheels.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...core.factors import Dataset
from ...core.options import option
from ...frontend.camera.mounting import mounting
from ...frontend.depth.settings import RecordedSettings
from ..depth.open import build, open_bag
from ..depth.robot import DepthRobot
from ..hidden_ids import HiddenIds
from ..registry import Source
from ..truth_remarks import PARTIAL_NOTE
from .catalogue import PUBLISHED, fetched, place

WORLD = "world"  # tf's frame of the motion capture


@dataclass(frozen=True)
class Placed(RecordedSettings):
    """Which file, where the camera is, and the front end."""

    path: str | None = option(None, "the file of the bag; not given: the copy from bench fetch")
    ahead: float = option(0.0, "how far the camera sits ahead of the robot's origin, m", minimum=-2.0, maximum=2.0)
    up: float | None = option(
        None, "how high it sits above the floor, m; not given: as tf has it", minimum=0.05, maximum=3.0
    )
    tilt: float = option(0.0, "how far it looks down, rad", minimum=-1.5, maximum=1.5)


@dataclass(frozen=True)
class Options(HiddenIds, Placed):
    """The same for all drives."""


def bag_file(name: str) -> str:
    """The name of the file of a published drive."""
    return next(iter(PUBLISHED[name].files))


def _source(name: str, summary: str) -> Source:
    def make(options: Options, rng: np.random.Generator) -> Dataset:  # noqa: ARG001 - files are not random
        given = None if options.path is None else Path(options.path)
        path = given or fetched(name, f"{name}[path=FILE]") / bag_file(name)
        settings = RecordedSettings(**{one.name: getattr(options, one.name) for one in fields(RecordedSettings)})
        placed = None if options.up is None else mounting(options.ahead, 0.0, options.up, options.tilt)
        robot = DepthRobot(
            name=name,
            mounting=placed,
            placing=f"options up, tilt and ahead of {name}",
            settings=settings,
            truth_frame=WORLD,
        )
        opened = open_bag(path, robot)
        published = PUBLISHED[name]
        notes = {**opened.recording.notes, "source": published.citation, "licence": published.licence}
        notes[PARTIAL_NOTE] = "of the part of the drive that the motion capture sees"
        return build(opened._replace(recording=replace(opened.recording, notes=notes)))

    def files(options: Any) -> Sequence[Path]:
        return [Path(options.path) if options.path is not None else place(name) / bag_file(name)]

    make.__doc__ = summary
    return Source(make, Options, costly=True, portable=False, files=files)


pioneer_360 = _source("tum-pioneer-360", "TUM RGB-D, fr2/pioneer_360: a depth camera on a robot that turns in a hall.")
pioneer_slam = _source("tum-pioneer-slam", "TUM RGB-D, fr2/pioneer_slam: a depth camera on a robot in a hall.")
pioneer_slam2 = _source("tum-pioneer-slam2", "TUM RGB-D, fr2/pioneer_slam2: a depth camera on a robot in a hall.")
pioneer_slam3 = _source("tum-pioneer-slam3", "TUM RGB-D, fr2/pioneer_slam3: a depth camera on a robot in a hall.")
