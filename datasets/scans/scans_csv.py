"""Laser scans in a CSV file, scans.csv: a row for each scan.

    t,first,step,r0,r1,...       s, rad, rad, m

`first` is the direction of the first beam, counter-clockwise from straight ahead of the scanner, and `step` the angle
from one beam to the next. Beams without a return are blank, nan or inf; rows may have different numbers of beams.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...core.csv_values import finite, no_number, number, shortened
from ...core.errors import InputError
from ...core.se2 import Array
from ...core.table import text
from ...frontend.laser.recording import LaserRecording
from ...frontend.laser.scanner import CODES, Fan, Scanner, padded, spread, without_codes
from ..prior import assumed
from .robot import LaserRobot
from .scan_messages import is_like

SCANS = "scans.csv"
COLUMNS = ("t", "first", "step")
UNITS = ((1000.0, "millimetres"), (100.0, "centimetres"))  # per metre
MOST = 0.5  # share of the ranges that a unit brings within the scanner's, from which on it may be theirs


def read_scans_csv(path: Path, robot: LaserRobot) -> tuple[LaserRecording, list[str]]:
    """The scans, without odometry, and remarks; InputError names the line of a fault."""
    t, fans, rows = list[float](), list[Fan](), list[Array]()
    for line, time, fan, ranges in _rows(path):
        if t and not time > t[-1]:
            raise InputError(f"{path}, line {line}: t is {time!s}, expected later than {t[-1]!s}.")
        t.append(time)
        fans.append(fan)
        rows.append(ranges)
    if len(t) < 2:
        raise InputError(f"{path}: found {len(t)} scans, expected at least 2.")
    alike = all(is_like(fan, fans[0]) for fan in fans)
    scanner = Scanner(
        fans[0].angles(fans[0].beams),
        np.zeros(3) if robot.pose is None else robot.pose,
        robot.min_range,
        robot.max_range,
    )
    ranges = padded(rows)
    if scanner.most > CODES[0]:
        ranges = without_codes(ranges)
    if not ((ranges > scanner.least) & (ranges < scanner.most)).any():
        raise InputError(
            f"{path}: no range is between {scanner.least:g} and {scanner.most:g} m, expected returns in metres; "
            f"{_found(ranges, scanner)}."
        )
    name = robot.name or path.absolute().parent.name
    recording = LaserRecording(
        name,
        scanner,
        np.array(t),
        ranges,
        None,
        robot.prior or assumed(),
        {"source": path.name},
        fans=None if alike else fans,
    )
    return recording, [] if alike else [f"{path}: {spread(fans)}"]


def _found(ranges: Array, scanner: Scanner) -> str:
    """Says what ranges (n, b), m, there are instead of those that the scanner measures, and what may be the reason."""
    some = ranges[np.isfinite(ranges)]
    if not len(some):
        return "found none that is a number"
    least, middle, most = (f"{value:.4g}" for value in (some.min(), np.median(some), some.max()))
    said = f"found {least} to {most}, median {middle}"
    if not (some > 0).any():
        return f"{said}: none is above 0" if (some == 0).any() else f"{said}: all are negative"
    for factor, unit in UNITS:
        metres = some / factor
        if ((metres > scanner.least) & (metres < scanner.most)).mean() > MOST:
            return f"{said}: perhaps {unit}"
    return said


def write_scans_csv(path: Path, t: Array, scanner: Scanner, ranges: Array) -> None:
    """Writes scans (n, b), m, taken at `t` (n,), s, by a scanner of even steps."""
    angles, beams = scanner.angles, ranges.shape[1]
    step = float(angles[1] - angles[0])
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(",".join((*COLUMNS, *(f"r{k}" for k in range(beams)))) + "\n")
        for time, row in zip(t.tolist(), ranges.tolist(), strict=True):
            file.write(",".join(map(str, (time, float(angles[0]), step, *row))) + "\n")


def _rows(path: Path) -> Iterator[tuple[int, float, Fan, Array]]:
    """The number of each row's line, with its time, beams and ranges."""
    lines = text(path).split("\n")
    header = [cell.strip() for cell in lines[0].split(",")]
    if tuple(header[:3]) != COLUMNS or len(header) < len(COLUMNS) + 2:
        raise InputError(
            f"{path}, line 1: found {shortened(lines[0])}, expected the columns t,first,step,r0,r1 and so on, one for "
            "each beam."
        )
    for at, line in enumerate(lines[1:], start=2):
        if not line.strip():
            continue
        cells = line.split(",")
        if not len(COLUMNS) + 2 <= len(cells) <= len(header):
            raise InputError(
                f"{path}, line {at}: found {len(cells)} columns, expected {_counts(header)}, as the header has."
            )
        told = [_told(path, at, name, cell) for name, cell in zip(COLUMNS, cells, strict=False)]
        fan = Fan(len(cells) - len(COLUMNS), told[1], told[2])
        if not 0 < fan.step < np.pi or fan.last - fan.first > 2 * np.pi + 1e-3:
            raise InputError(
                f"{path}, line {at}: step is {fan.step:.5g} rad for {fan.beams} beams, expected a step above 0, "
                "counter-clockwise, and a full turn at most, in radians."
            )
        ranges = np.array([_range(path, at, header[3 + k], cell) for k, cell in enumerate(cells[3:])])
        yield at, told[0], fan, ranges


def _counts(header: list[str]) -> str:
    """Words the number of cells that a row may have."""
    least = len(COLUMNS) + 2
    return str(least) if least == len(header) else f"{least} to {len(header)}"


def _told(path: Path, line: int, name: str, cell: str) -> float:
    value = finite(cell)
    if value is None:
        raise InputError(f"{path}, line {line}: {name} {no_number(cell)}.")
    return value


def _range(path: Path, line: int, name: str, cell: str) -> float:
    """m; NaN for a blank cell."""
    if not cell.strip():
        return np.nan
    value = number(cell)
    if value is None:
        raise InputError(f"{path}, line {line}: {name} {no_number(cell)}.")
    return value
