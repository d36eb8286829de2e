"""Reads laser logs of CARMEN, the Carnegie Mellon robot navigation toolkit, gzipped or not.

    FLASER n r1 ... rn x y theta odom_x odom_y odom_theta ipc_time host time
    ROBOTLASER1 type start fov resolution most accuracy remission n r1 ... rn m e1 ... em laser_x laser_y laser_theta
                odom_x odom_y odom_theta tv rv forward side turn ipc_time host time
    RAWLASER1 type start fov resolution most accuracy remission n r1 ... rn m e1 ... em ipc_time host time
    ODOM x y theta tv rv accel ipc_time host time

Metres, radians, seconds. RAWLASER1 and ODOM count where there are no others: a scan's odometry is interpolated between
those around it. Other lines (PARAM, RLASER, ...) are not used. Times are those of `ipc_time`: relations
of the Freiburg benchmark (Kuemmerle et al., Autonomous Robots 27(4), 2009) are given by them, exactly; scans a few
microseconds apart are different scans. Where most stamps are alike (0 in every row, or rounded to six digits, as some
published logs have them), the scans are taken in the order of their rows. NAME.relations beside NAME.clf is the ground
truth. In FLASER, 180 or 360 beams start at -90 degrees and stop a step before +90, and an odd number takes in both
ends; each scan counts at the angles of its own number of beams, and scans without any are left out.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.factors import Dataset
from ...core.options import option
from ...core.se2 import Array
from ...frontend.laser.recording import FARTHEST, LaserRecording, jump
from ...frontend.laser.scanner import CODES, Scanner, evenly, padded, spread, without_codes
from ...frontend.laser.settings import Settings
from ..false_loops import FalseLoops
from ..grid_file import grid_files, localised
from ..prior import assumed
from ..registry import Named, Source
from .carmen_lines import KINDS, Line, read_lines
from .relations import beside, build

APART = 1e-6  # s; stamps that are closer are of the same scan

ROW = 1.0
"""s from one scan to the next where the stamps tell nothing: slow enough for no speed to matter."""

SPARSE = 0.4
"""m between scans, in the median, from which on they cannot be matched without the wheels' motion."""


class Reading(NamedTuple):
    """The scanner, and whether the wheels count."""

    pose: Array  # (3,) of the scanner on the robot
    least: float  # m, of a return
    most: float  # m
    odometry: str  # wheels, none or auto


@dataclass(frozen=True)
class Options(FalseLoops, Settings, Named):
    """Which log, what its scanner is, and the front end."""

    path: str | None = option(None, "the file of the log")
    odometry: str = option(
        "auto", "motion between scans: the wheels', or none; auto: none if they never move",
        choices=("auto", "wheels", "none"),
    )  # fmt: skip
    ahead: float = option(0.0, "how far the scanner sits ahead of the robot's origin, m", minimum=-10.0, maximum=10.0)
    max_range: float = option(25.0, "range beyond which a beam says nothing, m", minimum=1.0, maximum=100.0)
    min_range: float = option(0.15, "range below which a beam has hit the robot, m", minimum=0.0, maximum=10.0)

    @property
    def reading(self) -> Reading:
        """The scanner, and whether the wheels count."""
        return Reading(np.array([self.ahead, 0.0, 0.0]), self.min_range, self.max_range, self.odometry)


def make(options: Options, rng: np.random.Generator) -> Dataset:  # noqa: ARG001 - files are not random
    """Laser scans and odometry in CARMEN's format, through the laser front end: carmen[path=FILE]."""
    if options.path is None:
        raise InputError("option path of dataset carmen is not given, expected a laser log's file: carmen[path=FILE].")
    return dataset(Path(options.path), options)


def dataset(path: Path, options: "Options", name: str | None = None, notes: Mapping[str, Any] | None = None) -> Dataset:
    """The log at `path` through the front end, by its file's name and with no other notes where these are not given."""
    recording, remarks = read(path, options)
    recording = replace(recording, name=name or recording.name, notes={**recording.notes, **(notes or {})})
    recording = localised(recording, options)
    return build(recording, options, path, remarks).dataset


def files(options: Options) -> Sequence[Path]:
    """The log, and what is known of its truth."""
    return [] if options.path is None else [Path(options.path), beside(Path(options.path)), *grid_files(options)]


source = Source(make, Options, costly=True, portable=False, files=files)


def read(path: Path, options: Options) -> tuple[LaserRecording, list[str]]:
    """As `read_scans`, with the options of the dataset."""
    return read_scans(path, options.reading)


def read_scans(path: Path, given: Reading) -> tuple[LaserRecording, list[str]]:
    """The scans in the order of time, and remarks; InputError names the file and line of a fault.

    The log starts where the odometry does.
    """
    logged, remarks = read_lines(path)
    lines = [line for line in logged if len(line.ranges)]
    if len(lines) < 2:
        raise InputError(f"{path}: found {len(lines)} scans ({' or '.join(KINDS)}), expected at least 2.")
    first = lines[0]
    alike = all(len(line.ranges) == len(first.ranges) and line.angles == first.angles for line in lines)
    kept, said = _in_order(lines)
    remarks += said
    if len(lines) < len(logged):
        remarks.append(f"{len(logged) - len(lines)} of {len(logged)} scans are empty and are left out")
    if not alike:
        remarks.append(spread([line.fan for line in kept]))
    odometry = np.array([line.odometry for line in kept])
    moves = bool((odometry != odometry[0]).any())
    if given.odometry == "wheels" and not moves:
        raise InputError(f"{path}: option odometry=wheels: the odometry never moves, expected odometry=none.")
    if given.odometry == "auto" and not moves:
        remarks.append("its odometry never moves: the front end goes by the scans alone")
    way = float(np.median(np.hypot(*np.diff(odometry[:, :2], axis=0).T)))
    if given.odometry == "none" and way > SPARSE:
        raise InputError(
            f"{path}: option odometry=none: the robot moves {way:.2g} m from scan to scan (median, by its odometry), "
            f"expected at most {SPARSE:g} m, or the odometry: farther apart, scans alone do not tell how it moved."
        )
    if moves and given.odometry != "none":
        jumped = jump(odometry)
        if jumped is not None:
            raise InputError(
                f"{path}, line {kept[jumped[0]].number}: the odometry jumps by {jumped[1]:.6g} m from the scan before, "
                f"expected at most {FARTHEST:g} m; odometry=none goes by the scans alone."
            )
    count = len(first.ranges)
    angles = (
        evenly(count)
        if first.angles is None
        else first.angles[0] + first.angles[1] * np.arange(count, dtype=np.float64)
    )
    scanner = Scanner(angles, given.pose, given.least, given.most)
    ranges = padded([line.ranges for line in kept])
    if given.most > CODES[0]:
        ranges = without_codes(ranges)
    if not ((ranges > given.least) & (ranges < given.most)).any():
        raise InputError(f"{path}: no range is between {given.least:g} and {given.most:g} m, expected metres.")
    return LaserRecording(
        path.name.partition(".")[0],
        scanner,
        np.array([line.t for line in kept]),
        ranges,
        odometry if moves and given.odometry != "none" else None,
        assumed(odometry[0]),
        {"source": path.name.encode("utf-8", "replace").decode()},
        fans=None if alike else [line.fan for line in kept],
    ), remarks


def _in_order(lines: list[Line]) -> tuple[list[Line], list[str]]:
    """The scans in the order of time, each once, and remarks; in that of their rows where most stamps are alike."""
    in_time = sorted(lines, key=lambda line: line.t)
    kept = [in_time[0], *(line for before, line in pairwise(in_time) if line.t - before.t > APART)]
    different = [lines[0], *(line for before, line in pairwise(lines) if not line.is_repeated(before))]
    if len(kept) >= 2 and 2 * len(kept) > len(different):
        left_out = len(lines) - len(kept)
        why = f"{left_out} of {len(lines)} scans have the stamp of another one and are left out"
        return kept, [why] if left_out else []
    why = (
        f"its time stamps are of no use, {len(kept)} different for {len(lines)} scans: scans are taken in the order of "
        f"their rows, {ROW:g} s apart"
    )
    return [line._replace(t=ROW * row) for row, line in enumerate(different)], [why]
