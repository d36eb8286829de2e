"""Reads gps.csv: t,lat,lon or t,lat,lon,sd; s, degrees, m. A row without a fix leaves lat and lon blank."""

from pathlib import Path

import numpy as np

from ...core.errors import InputError
from ...core.table import read_csv
from .degrees import Degrees

FILE = "gps.csv"

COLUMNS, SD = ("t", "lat", "lon"), ("sd",)


def read_gps_csv(path: Path, remarks: list[str]) -> Degrees:
    """Reads the file; `remarks` grows by rows without a fix. InputError names the file and line of a fault."""
    with path.open(encoding="utf-8", errors="replace") as file:
        many = file.readline().count(",") >= len(COLUMNS)
    table = read_csv(path, (*COLUMNS, *SD) if many else COLUMNS, blanks=True)
    fixed = np.isfinite(table.rows[:, 1]) & np.isfinite(table.rows[:, 2])
    if not fixed.any():
        raise InputError(f"{path}: none of its {len(table.rows)} rows has a position, expected lat and lon in degrees.")
    if not fixed.all():
        remarks.append(f"{path}: {int((~fixed).sum())} of {len(fixed)} rows have no position, and are left out")
    table = table.take(np.flatnonzero(fixed)).finite()
    latitude, t = table.column("lat"), table.column("t")
    for row in np.flatnonzero(np.abs(latitude) > 90):
        raise table.fault(
            int(row),
            f"lat is {latitude[row]!s}, expected -90 to 90 degrees; perhaps latitude and longitude are swapped",
        )
    table.bounded(-360, 360, "lon")
    for row in np.flatnonzero(~(np.diff(t) > 0)) + 1:
        raise table.fault(int(row), f"t is {t[row]!s}, expected later than {t[row - 1]!s}")
    if not many:
        return Degrees(str(path), t, table.rows[:, 1:3], None)
    sd = table.column("sd")
    for row in np.flatnonzero(~(sd > 0)):
        raise table.fault(int(row), f"sd is {sd[row]!s}, expected a standard deviation above 0, m")
    return Degrees(str(path), t, table.rows[:, 1:3], sd[:, None, None] ** 2 * np.eye(2))
