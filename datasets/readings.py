"""Motion readings in a file beside the frames.

ticks.csv       t,left,right     the wheels' counters, cumulative odometry.csv    t,x,y,heading    poses integrated by
the robot
"""

import os
from pathlib import Path

import numpy as np

from ..core.csv_values import digits_lost
from ..core.errors import InputError
from ..core.table import Table, read_csv
from ..frontend.wheels.counters import unwrap
from ..frontend.wheels.motion import Poses, Ticks

TICKS = "ticks.csv"
ODOMETRY = "odometry.csv"


def read_readings(folder: Path, counter_bits: int | None) -> Ticks | Poses | None:
    """The readings in `folder`, None without a file of them; InputError names the file and line of a fault.

    Counters `counter_bits` wide are unwrapped.
    """
    ticks, odometry = folder / TICKS, folder / ODOMETRY
    counted, posed = map(os.path.lexists, (ticks, odometry))  # a link to nothing is no missing file
    if counted and posed:
        raise InputError(f"{folder}: has {TICKS} as well as {ODOMETRY}, expected one of them.")
    if counted:
        table = _in_order(read_csv(ticks, ("t", "left", "right")))
        counts = table.rows[:, 1:]
        return Ticks(table.column("t"), counts if counter_bits is None else unwrap(counts, counter_bits))
    if posed:
        table = _in_order(read_csv(odometry, ("t", "x", "y", "heading")))
        return Poses(table.column("t"), table.rows[:, 1:])
    return None


def _in_order(table: Table) -> Table:
    """Returns itself; InputError if it is empty, not finite, or has a time not later than the one before."""
    t = table.finite().column("t")
    if not len(t):
        raise InputError(f"{table.path}: found no rows, expected at least one.")
    for row in np.flatnonzero(~(np.diff(t) > 0)) + 1:
        raise table.fault(row, f"t is {t[row]!s}, expected later than {t[row - 1]!s}{digits_lost(t.tolist())}")
    return table
