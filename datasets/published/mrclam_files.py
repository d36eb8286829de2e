"""Reads and checks the files of one robot in a folder of the MRCLAM logs.

    Robot<n>_Odometry.dat       t v omega             commanded, each held until the next
    Robot<n>_Measurement.dat    t barcode range bearing
    Robot<n>_Groundtruth.dat    t x y theta           Vicon, about 100 Hz, with gaps; some copies have none
    Barcodes.dat                subject barcode       subjects 1-5 are the robots, 6-20 the landmarks
    Landmark_Groundtruth.dat    subject x y sd sd

Times are in seconds since 1970, to the millisecond; lines that begin with # are comments. InputError names the file and
the line of a fault.
"""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.factors import Map
from ...core.se2 import Array, Ints
from ...core.table import Table, read_spaced
from .mrclam_sets import LAST_ROBOT, MARK

NOBODY = 0  # the subject of a barcode that is not in Barcodes.dat

LATE = 0.2
"""s. In set 9, as published, the first command of robots 1 to 4 is 0.10 s later than the second."""

EXCHANGED = {18: (11, 3.15071999, 2.38294871), 61: (17, 0.03596156, -2.84396626)}
"""Barcode -> subject and place (m) of two landmarks in set 1, as published. All five robots see each where the other
one is said to be, 6.1 m away, and the other thirteen within 0.15 m of their places."""

_LATEST = 1e10
"""s; later times, beyond the year 2286, are invalid, and would leave microseconds unresolved."""

_LARGEST = 1e4
"""m, rad, m/s, rad/s; larger numbers are invalid: the room is 15 m long, and the robots drive at 0.3 m/s."""


class Recorded(NamedTuple):
    """One robot's data; tables are sorted by time, with possible ties."""

    odometry: Table  # t v omega
    truth: Table | None  # t x y theta
    sightings: Table  # t barcode range bearing
    subjects: Ints  # (s,) subject of each sighting: a robot, a landmark or NOBODY
    landmarks: Map
    remarks: list[str]  # what is odd in the files


def read_files(folder: Path, robot: int) -> Recorded:
    """The files of `robot` in `folder`."""
    robots, remarks = f"Robot{robot}", list[str]()
    odometry = _timed(folder / f"{robots}_Odometry.dat", ("t", "v", "omega"), early=remarks)
    known = folder / f"{robots}_Groundtruth.dat"  # a link to nothing is no missing file
    truth = _timed(known, ("t", "x", "y", "theta")) if os.path.lexists(known) else None
    subjects = _subjects(folder)
    landmarks = _landmarks(folder, subjects, remarks)
    sightings = _timed(folder / f"{robots}_Measurement.dat", ("t", "barcode", "range", "bearing"), empty=True)
    for row in np.flatnonzero(sightings.column("range") <= 0):
        raise sightings.fault(row, f"range is {sightings.column('range')[row]!s}, expected more than 0")
    for row in np.flatnonzero(np.abs(sightings.column("bearing")) > np.pi):
        found = f"bearing is {sightings.column('bearing')[row]!s}"
        raise sightings.fault(row, f"{found}, expected radians from -pi to pi")
    of = np.array([subjects.get(code, NOBODY) for code in sightings.whole("barcode").tolist()], np.int64)
    return Recorded(odometry, truth, sightings, of, landmarks, remarks)


def _timed(path: Path, columns: tuple[str, ...], *, empty: bool = False, early: list[str] | None = None) -> Table:
    """The rows of `path`, sorted by time; at least one unless it may be `empty`.

    A first row that is late alone is left out, with a remark, where `early` takes remarks.
    """
    table = read_spaced(path, columns).finite()
    if not len(table.rows):
        if empty:
            return table._replace(rows=np.zeros((0, len(columns))), lines=np.zeros(0, np.int64))
        raise InputError(f"{path}: found no rows, expected the columns {' '.join(columns)}.")
    table.bounded(0.0, _LATEST, "t").bounded(-_LARGEST, _LARGEST, *(name for name in columns[1:] if name != "barcode"))
    if early is not None:
        table = _without_late_first(table, early)
    t = table.column("t")
    for row in np.flatnonzero(np.diff(t) < 0) + 1:
        raise table.fault(row, f"t is {t[row]!s}, expected no earlier than {t[row - 1]!s}")
    return table


def _without_late_first(table: Table, remarks: list[str]) -> Table:
    """Leaves out a first command that is up to LATE later than the second, with a remark.

    It is left out, not sorted in, as no robot drove it. In set 9 it is 0.294 m/s, as for robot 5, whose rows are in
    order; no later command of any robot is above 0.167 m/s, and all that surround it are 0: the robots stand for
    another 54 to 118 s. Sorted in, it would move a robot by 6 mm.
    """
    t = table.column("t")[:2]
    if len(t) < 2 or not 0 < t[0] - t[1] <= LATE:
        return table
    found = f"t is {t[0]!s}, {t[0] - t[1]:.2f} s later than in the next row"
    remarks.append(f"{table.path}, line {table.lines[0]}: {found}; the row is left out")
    return table.take(np.arange(1, len(table.rows)))


def _subjects(folder: Path) -> dict[int, int]:
    """Barcode -> subject, a robot or a landmark, which has one barcode."""
    table = read_spaced(folder / MARK, ("subject", "barcode")).finite()
    subjects, codes = _distinct(table, "subject"), _distinct(table, "barcode")
    for row in np.flatnonzero(subjects <= NOBODY):
        raise table.fault(row, f"subject is {subjects[row]}, expected 1 or more")
    return dict(zip(codes.tolist(), subjects.tolist(), strict=True))


def _landmarks(folder: Path, barcodes: Mapping[int, int], remarks: list[str]) -> Map:
    """The landmarks' positions, those EXCHANGED put right with a remark; not every barcode is among them."""
    table = read_spaced(folder / "Landmark_Groundtruth.dat", ("subject", "x", "y", "x_sd", "y_sd")).finite()
    subjects = _distinct(table, "subject")
    for row in np.flatnonzero(subjects <= LAST_ROBOT):
        raise table.fault(row, f"subject is {subjects[row]}, expected a landmark, {LAST_ROBOT + 1} or more")
    xy = table.bounded(-_LARGEST, _LARGEST, "x", "y").rows[:, 1:3].copy()
    stated = {code: (subject, *xy[subjects == subject].ravel().tolist()) for code, subject in barcodes.items()}
    if all(stated.get(code) == known for code, known in EXCHANGED.items()):
        first, second = (int(np.flatnonzero(subjects == known[0])[0]) for known in EXCHANGED.values())
        xy[[first, second]] = xy[[second, first]]
        where = f"{table.path}, lines {table.lines[first]} and {table.lines[second]}"
        remarks.append(
            f"{where}: the places of landmarks {subjects[first]} and {subjects[second]} are exchanged, as all robots "
            "of set 1 see them; they are read the other way round"
        )
    return Map(subjects, xy, None)


def _distinct(table: Table, name: str) -> Ints:
    column = table.whole(name)
    _, first = np.unique(column, return_index=True)
    for row in np.setdiff1d(np.arange(len(column)), first):
        raise table.fault(row, f"{name} {column[row]} occurs twice, expected once")
    return column


def since(table: Table, start: float) -> Array:
    """(r,) seconds since `start`, rounded to the microsecond, the resolution of doubles that count from 1970."""
    return np.round(table.column("t") - start, 6)
