"""Motion readings in files beside the frames.

ticks.csv                 t,left,right    the wheels' counters, cumulative; a cell is blank where one was not read
left.csv and right.csv    t,count         each counter at times of its own
odometry.csv              t,x,y,heading   poses integrated by the robot
commands.csv              t,v,omega       what the robot was told to do, m/s and rad/s, until the next row; or
                          t,left,right    speeds of its wheels, in m/s or as shares of full power
"""

import os
from pathlib import Path

import numpy as np

from ..core.csv_values import digits_lost, header_names
from ..core.errors import InputError
from ..core.se2 import Array
from ..core.table import Table, read_csv, text
from ..frontend.wheels.apart import joined
from ..frontend.wheels.commands import Speeds
from ..frontend.wheels.counters import WHEELS, unwrap
from ..frontend.wheels.ticks import Ticks
from ..frontend.wheels.track import Poses

TICKS = "ticks.csv"
SIDES = tuple(f"{wheel}.csv" for wheel in WHEELS)
ODOMETRY = "odometry.csv"
COMMANDS = "commands.csv"
FILES = (TICKS, *SIDES, ODOMETRY, COMMANDS)

Readings = Ticks | Poses | Speeds

RATES = ("t", "v", "omega")
BOTH = ("t", *WHEELS)


def read_readings(folder: Path, counter_bits: int | None, remarks: list[str]) -> Readings | None:
    """The readings in `folder`, None without a file of them; InputError names the file and line of a fault.

    Counters `counter_bits` wide are unwrapped. Rows that repeat the one before are left out, with one of the `remarks`.
    """
    found = [name for name in FILES if os.path.lexists(folder / name)]  # a link to nothing is no missing file
    if not found:
        return None
    if set(found) & set(SIDES) and len(found) == 1:
        missing = SIDES[found == [SIDES[0]]]
        raise InputError(f"{folder}: has {found[0]} without {missing}, expected both.")
    if len(found) > 1 and found != list(SIDES):
        raise InputError(f"{folder}: has {' as well as '.join(found)}, expected one of them.")
    if found == [TICKS]:
        return _ticks(folder / TICKS, counter_bits, remarks)
    if found == list(SIDES):
        tables = [_in_order(read_csv(folder / name, ("t", "count")), remarks) for name in SIDES]
        return _joined(str(folder), *((one.column("t"), one.column("count")) for one in tables), bits=counter_bits)
    if found == [ODOMETRY]:
        table = _in_order(read_csv(folder / ODOMETRY, ("t", "x", "y", "heading")), remarks)
        return Poses(table.column("t"), table.rows[:, 1:])
    return _commands(folder / COMMANDS, remarks)


def _ticks(path: Path, bits: int | None, remarks: list[str]) -> Ticks:
    table = read_csv(path, BOTH, blanks=True)
    table = _in_order(table, remarks, blanks=True)
    read = ~np.isnan(table.rows[:, 1:])
    for row in np.flatnonzero(~read.any(axis=1)):
        raise table.fault(row, "has no count, expected that of the left wheel, of the right one, or both")
    for wheel, name in enumerate(WHEELS):
        if not read[:, wheel].any():
            raise InputError(f"{path}: has no count of the {name} wheel, expected some.")
    t, counts = table.column("t"), table.rows[:, 1:]
    if read.all():
        return Ticks(t, counts if bits is None else unwrap(counts, bits))
    return _joined(str(path), *((t[of], counts[of, wheel]) for wheel, of in enumerate(read.T)), bits=bits)


def _joined(source: str, left: tuple[Array, Array], right: tuple[Array, Array], bits: int | None) -> Ticks:
    """The readings of two counters at times of their own."""
    one, other = (counts if bits is None else unwrap(counts[:, None], bits)[:, 0] for _, counts in (left, right))
    return joined((left[0], right[0]), (one, other), source)


def _commands(path: Path, remarks: list[str]) -> Speeds:
    names = header_names(text(path).split("\n", 1)[0])
    if set(names) not in (set(RATES), set(BOTH)):
        raise InputError(f"{path}, line 1: found the columns {','.join(names)}, expected t,v,omega or t,left,right.")
    wheels = set(names) == set(BOTH)
    table = _in_order(read_csv(path, BOTH if wheels else RATES), remarks)
    return Speeds(table.column("t"), table.rows[:, 1:], wheels)


def _in_order(table: Table, remarks: list[str], *, blanks: bool = False) -> Table:
    """Returns itself without rows that repeat the one before.

    InputError if it is empty, not finite, or has a time not later than the one before.
    """
    table = table.without_repeats(remarks)
    numbers = table._replace(rows=np.nan_to_num(table.rows, posinf=np.inf, neginf=-np.inf)) if blanks else table
    t = numbers.finite().column("t")
    if not len(t):
        raise InputError(f"{table.path}: found no rows, expected at least one.")
    for row in np.flatnonzero(~(np.diff(t) > 0)) + 1:
        raise table.fault(row, f"t is {t[row]!s}, expected later than {t[row - 1]!s}{digits_lost(t.tolist())}")
    return table
