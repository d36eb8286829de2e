"""Reads imu.csv: a time and a gyro's rates, perhaps an accelerometer and a magnetometer, one reading a row.

    t,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z,mag_x,mag_y,mag_z

Columns are found by name, in any order, and others are ignored: gx, wx, angular_velocity_x, acc_x, ax, mx and the like
are known, too. A unit may stand behind a name: `gyro_x [deg/s]`, `ax (g)`, `gyro_z_dps`. A row without a reading of
the magnetometer leaves its cells blank.
"""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...core.csv_values import digits_lost, header_names, no_number, number, other_count, shown
from ...core.errors import InputError
from ...core.se2 import Array
from ...core.table import HUGE, first_of_repeats, text
from .units import UNITS, unit

IMU = "imu.csv"

AXES = "xyz"

SENSORS = {
    "gyro": r"gyro|gyros|gyroscope|angular_?velocity|angular_?rate|ang_?vel|omega|g|w",
    "accelerometer": r"accel|acc|accelerometer|acceleration|linear_?acceleration|lin_?acc|a",
    "magnetometer": r"mag|magn|magnetometer|magnetic_?field|field|b|m",
}
"""Sensor -> the names of its columns, before the axis."""

TIMES = ("t", "time", "timestamp", "stamp", "seconds")

LETTERS = {"gyro": "gyro", "accelerometer": "accel", "magnetometer": "mag"}


class Raw(NamedTuple):
    """Readings in their own units and axes."""

    t: Array  # (n,) s, strictly increasing
    gyro: Array  # (n, 3)
    accel: Array | None  # (n, 3)
    mag: Array | None  # (n, 3); NaN in rows without a reading
    units: dict[str, str | None]  # by sensor, where the header says them
    frame: str = ""  # tf's


class _Column(NamedTuple):
    """A column by its name."""

    sensor: str  # t: the time
    axis: int
    unit: str | None


def read_imu_csv(path: Path, columns: Sequence[str] | None = None, remarks: list[str] | None = None) -> Raw:
    """Reads the file, whose header is `columns` where it has none; InputError names the file, line and column.

    A row that repeats the one before is left out, with one of the `remarks`.
    """
    lines = text(path).split("\n")
    first = 0 if columns is not None else 1
    header = list(columns) if columns is not None else header_names(lines[0].lstrip("#"))
    if columns is None and all(number(cell) is not None for cell in header):
        raise InputError(
            f"{path}, line 1: found numbers, expected a header such as t,gyro_x,gyro_y,gyro_z, or [imu] columns in "
            "robot.toml."
        )
    places = _places(path, header)
    if "t" not in places:
        raise InputError(
            f"{path}, line 1: has no column of the time, found {shown(header)}, expected t, in seconds, among them."
        )
    if "gyro" not in places:
        raise InputError(
            f"{path}, line 1: has no gyro, found {shown(header)}, expected gyro_x,gyro_y,gyro_z among them."
        )
    numbers = [line for line in range(first, len(lines)) if lines[line].strip()]
    if len(numbers) < 2:
        raise InputError(f"{path}: found {len(numbers)} rows, expected at least 2.")
    wanted = [(sensor, axis) for sensor, found in places.items() for axis in found]
    rows = _rows(path, lines, numbers, header, [places[sensor][axis][0] for sensor, axis in wanted], wanted)
    kept = first_of_repeats(path, rows, [line + 1 for line in numbers], remarks)
    rows, numbers = rows[kept], [line for line, first in zip(numbers, kept.tolist(), strict=True) if first]
    if len(rows) < 2:
        raise InputError(f"{path}: found {len(rows)} rows that differ, expected at least 2.")
    found = {sensor: rows[:, [wanted.index((sensor, axis)) for axis in sorted(places[sensor])]] for sensor in places}
    units = {sensor: _unit_of(path, sensor, places[sensor]) for sensor in places}
    t = found["t"][:, 0] * UNITS["t"][units.pop("t") or "s"]
    for row in np.flatnonzero(~(np.diff(t) > 0)) + 1:
        raise InputError(
            f"{path}, line {numbers[row] + 1}: t is {t[row]!s}, expected later than {t[row - 1]!s}"
            f"{digits_lost(t.tolist())}."
        )
    return Raw(t, found["gyro"], found.get("accelerometer"), found.get("magnetometer"), units)


def _places(path: Path, header: Sequence[str]) -> dict[str, dict[int, tuple[int, str | None]]]:
    """Sensor -> axis -> the column's place and unit. InputError for a column twice and for a sensor of two axes."""
    places = dict[str, dict[int, tuple[int, str | None]]]()
    for place, name in enumerate(header):
        column = _column(path, name)
        if column is None:
            continue
        axes = places.setdefault(column.sensor, {})
        if column.axis in axes:
            other = header[axes[column.axis][0]]
            raise InputError(f"{path}, line 1: found the columns {other} and {name}, expected one of them.")
        axes[column.axis] = place, column.unit
    for sensor, axes in places.items():
        if sensor != "t" and len(axes) < len(AXES):
            missing = ", ".join(f"{LETTERS[sensor]}_{AXES[axis]}" for axis in range(3) if axis not in axes)
            raise InputError(f"{path}, line 1: found no {missing}, expected three axes of the {sensor}.")
    return places


def _column(path: Path, name: str) -> _Column | None:
    """The column that is called `name`; None for another's. InputError for a unit that is unknown."""
    plain, said = name.strip().strip('"'), None
    if (bracket := re.fullmatch(r"(.*?)\s*[\[(]\s*(.*?)\s*[\])]", plain)) is not None:
        plain, said = bracket[1], bracket[2]
    plain = plain.lower()
    for sensor, names in (("t", "|".join(TIMES)), *SENSORS.items()):
        axis = "()" if sensor == "t" else r"(?:_rs_s)?[_. -]?([xyz])"
        match = re.fullmatch(rf"(?:{names}){axis}(?:_(?P<unit>\S+))?", plain)
        if match is None:
            continue
        given = said or match["unit"]
        found = None if given is None else unit(sensor, given)
        if given is not None and found is None:
            if said is None:
                continue  # a_x_filtered and its like are no units
            raise InputError(
                f"{path}, line 1: {name} has the unit {said!r}, expected one of {', '.join(UNITS[sensor])}."
            )
        return _Column(sensor, AXES.index(match[1]) if sensor != "t" else 0, found)
    return None


def _unit_of(path: Path, sensor: str, axes: dict[int, tuple[int, str | None]]) -> str | None:
    """The unit of a sensor's columns; InputError where they have several."""
    found = {said for _, said in axes.values()}
    if len(found) > 1:
        named = " and ".join(sorted(one or "none" for one in found))
        raise InputError(f"{path}, line 1: the axes of the {sensor} have the units {named}, expected one.")
    return found.pop()


def _rows(
    path: Path,
    lines: Sequence[str],
    numbers: Sequence[int],
    header: Sequence[str],
    places: Sequence[int],
    wanted: Sequence[tuple[str, int]],
) -> Array:
    """(n, columns) the cells; of the magnetometer a blank is NaN."""
    rows = np.empty((len(numbers), len(places)))
    for row, line in enumerate(numbers):
        cells = lines[line].split(",")
        if len(cells) != len(header):
            raise InputError(f"{path}, line {line + 1}: {other_count(cells, header, ',')}.")
        for column, place in enumerate(places):
            cell = cells[place]
            if not cell.strip() and wanted[column][0] == "magnetometer":
                rows[row, column] = np.nan
                continue
            found = number(cell)
            if found is None:
                raise InputError(f"{path}, line {line + 1}: {header[place]} {no_number(cell)}.")
            if not abs(found) <= HUGE:
                raise InputError(f"{path}, line {line + 1}: {header[place]} is {found}, expected a finite number.")
            rows[row, column] = found
    return rows
