"""Reads and checks the files of one robot in a folder of the MRCLAM logs.

    Robot<n>_Odometry.dat       t v omega             commanded, each held until the next
    Robot<n>_Measurement.dat    t barcode range bearing
    Robot<n>_Groundtruth.dat    t x y theta           Vicon, about 100 Hz, with gaps
    Barcodes.dat                subject barcode       subjects 1-5 are the robots, 6-20 the landmarks
    Landmark_Groundtruth.dat    subject x y sd sd

Times are in seconds since 1970, to the millisecond; lines that begin with # are comments. InputError names the file and
the line of a fault.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.factors import Map
from ...core.se2 import Array, Ints
from ...core.table import Table, read_spaced

LAST_ROBOT = 5  # subjects up to this one are robots
NOBODY = 0  # the subject of a barcode that is not in Barcodes.dat
MARK = "Barcodes.dat"  # the file that identifies a dataset's folder

_LATEST = 1e10
"""s; later times, beyond the year 2286, are invalid, and would leave microseconds unresolved."""

_LARGEST = 1e4
"""m, rad, m/s, rad/s; larger numbers are invalid: the room is 15 m long, and the robots drive at 0.3 m/s."""


class Recorded(NamedTuple):
    """One robot's data; tables are sorted by time, with possible ties."""

    odometry: Table  # t v omega
    truth: Table  # t x y theta
    sightings: Table  # t barcode range bearing
    subjects: Ints  # (s,) subject of each sighting: a robot, a landmark or NOBODY
    landmarks: Map


def folder_of(path: Path, number: int) -> Path:
    """The folder of dataset `number`: `path` itself, or one in it; `path` if there is neither."""
    if (path / MARK).exists():
        return path
    named = (path / f"{family}_Dataset{number}" for family in ("MRCLAM", "MRSLAM"))  # set 4 has the latter
    return next((folder for folder in named if folder.is_dir()), path)


def read_files(folder: Path, robot: int) -> Recorded:
    """The files of `robot` in `folder`."""
    robots = f"Robot{robot}"
    odometry = _timed(folder / f"{robots}_Odometry.dat", ("t", "v", "omega"))
    truth = _timed(folder / f"{robots}_Groundtruth.dat", ("t", "x", "y", "theta"))
    subjects, landmarks = _subjects(folder), _landmarks(folder)
    sightings = _timed(folder / f"{robots}_Measurement.dat", ("t", "barcode", "range", "bearing"), empty=True)
    for row in np.flatnonzero(sightings.column("range") <= 0):
        raise sightings.fault(row, f"range is {sightings.column('range')[row]!s}, expected more than 0")
    for row in np.flatnonzero(np.abs(sightings.column("bearing")) > np.pi):
        found = f"bearing is {sightings.column('bearing')[row]!s}"
        raise sightings.fault(row, f"{found}, expected radians from -pi to pi")
    of = np.array([subjects.get(code, NOBODY) for code in sightings.whole("barcode").tolist()], np.int64)
    return Recorded(odometry, truth, sightings, of, landmarks)


def _timed(path: Path, columns: tuple[str, ...], *, empty: bool = False) -> Table:
    """The rows of `path`, sorted by time; at least one unless it may be `empty`."""
    table = read_spaced(path, columns).finite()
    if not len(table.rows):
        if empty:
            return table._replace(rows=np.zeros((0, len(columns))), lines=np.zeros(0, np.int64))
        raise InputError(f"{path}: found no rows, expected the columns {' '.join(columns)}.")
    t = table.column("t")
    table.bounded(0.0, _LATEST, "t").bounded(-_LARGEST, _LARGEST, *(name for name in columns[1:] if name != "barcode"))
    for row in np.flatnonzero(np.diff(t) < 0) + 1:
        raise table.fault(row, f"t is {t[row]!s}, expected no earlier than {t[row - 1]!s}")
    return table


def _subjects(folder: Path) -> dict[int, int]:
    """Barcode -> subject, a robot or a landmark, which has one barcode."""
    table = read_spaced(folder / MARK, ("subject", "barcode")).finite()
    subjects, codes = _distinct(table, "subject"), _distinct(table, "barcode")
    for row in np.flatnonzero(subjects <= NOBODY):
        raise table.fault(row, f"subject is {subjects[row]}, expected 1 or more")
    return dict(zip(codes.tolist(), subjects.tolist(), strict=True))


def _landmarks(folder: Path) -> Map:
    """The landmarks' positions; not every barcode is among them."""
    table = read_spaced(folder / "Landmark_Groundtruth.dat", ("subject", "x", "y", "x_sd", "y_sd")).finite()
    subjects = _distinct(table, "subject")
    for row in np.flatnonzero(subjects <= LAST_ROBOT):
        raise table.fault(row, f"subject is {subjects[row]}, expected a landmark, {LAST_ROBOT + 1} or more")
    return Map(subjects, table.bounded(-_LARGEST, _LARGEST, "x", "y").rows[:, 1:3], None)


def _distinct(table: Table, name: str) -> Ints:
    column = table.whole(name)
    _, first = np.unique(column, return_index=True)
    for row in np.setdiff1d(np.arange(len(column)), first):
        raise table.fault(row, f"{name} {column[row]} occurs twice, expected once")
    return column


def since(table: Table, start: float) -> Array:
    """(r,) seconds since `start`, rounded to the microsecond, the resolution of doubles that count from 1970."""
    return np.round(table.column("t") - start, 6)
