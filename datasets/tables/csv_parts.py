"""Ranges and bearings alone of a log from CSV tables."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...core.factors import UNKNOWN
from ...core.partial import BEARING, RANGE, PartialTable
from ...core.se2 import Array, Ints
from ...core.table import MOST, Table
from ...frontend.wheels.holes import outside
from ..formats.columns import in_order, read_columns
from .csv_options import Options

FILES = {RANGE: ("ranges", ("t", "id", "range")), BEARING: ("bearings", ("t", "id", "bearing"))}


class Alone(NamedTuple):
    """Ranges and bearings alone in order of time, ranges first, and the number outside the odometry's time."""

    t: Array  # (p,)
    ids: Ints  # (p,)
    kind: Ints  # (p,)
    z: Array  # (p,)
    var: Array  # (p,)
    outside: int

    def table(self, t: Array) -> PartialTable:
        """The sightings of a log with steps at the times `t` (n,), all of these among them."""
        return PartialTable.from_arrays(len(t), np.searchsorted(t, self.t), self.ids, self.kind, self.z, self.var)


def alone(options: Options, start: float, end: float, remarks: list[str]) -> Alone:
    """Reads the sightings from `start` to `end`, s, of the files that the options name; there may be none."""
    parts = list[Alone]()
    for kind, (name, columns) in FILES.items():
        if (given := getattr(options, name)) is not None:
            parts.append(_read(Path(given), columns, kind, options, start, end, remarks))
    columns = [np.concatenate(column) for column in list(zip(*parts, strict=True))[:5]] if parts else [np.zeros(0)] * 5
    order = np.argsort(columns[0], kind="stable")
    t, ids, kinds, z, var = (column[order] for column in columns)
    return Alone(t, ids.astype(np.int64), kinds.astype(np.int64), z, var, sum(part.outside for part in parts))


def _read(
    path: Path, columns: tuple[str, ...], kind: int, options: Options, start: float, end: float, remarks: list[str]
) -> Alone:
    table = in_order(read_columns(path, columns), strictly=False)
    t, ids, z = table.column("t") - options.sensor_delay, _ids(table), table.rows[:, 2]
    if kind == RANGE:
        for row in np.flatnonzero(z <= 0):
            raise table.fault(row, f"the range is {z[row]!s}, expected more than 0")
        var = (options.range_sd + options.range_share * z) ** 2
    else:
        z = z * options.unit("bearings")
        for row in np.flatnonzero(np.abs(z) > np.pi):
            found, unit = table.rows[row, 2], "degrees" if options.unit("bearings") != 1 else "radians"
            hint = "" if unit == "degrees" else f"; bearings in degrees take option {options.with_degrees('bearings')}"
            raise table.fault(row, f"bearing is {found!s} {unit}, expected at most half a turn: wrap it{hint}")
        var = np.full(len(z), options.bearing_sd**2)
    inside = (start <= t) & (t <= end)
    clock = f"before or after the odometry, {start:.10g} to {end:.10g} s"
    remarks += outside(str(path), int((~inside).sum()), len(t), columns[2], clock)
    kept = t[inside], ids[inside], np.full(int(inside.sum()), kind), z[inside], var[inside]
    return Alone(*kept, int((~inside).sum()))


def _ids(table: Table) -> Ints:
    """(r,) the ids; InputError for one that is none, or that occurs twice at a time."""
    ids, t = table.whole("id"), table.column("t")
    for row in np.flatnonzero((ids < UNKNOWN) | (ids > MOST)):
        raise table.fault(row, f"id is {ids[row]}, expected 0 to {MOST}, or {UNKNOWN} for unknown")
    order = np.lexsort((ids, t))
    twin = (np.diff(t[order]) == 0) & (np.diff(ids[order]) == 0) & (ids[order[1:]] != UNKNOWN)
    for row in np.sort(order[1:][twin]):
        raise table.fault(row, f"id {ids[row]} occurs twice at t {t[row]!s}, expected once")
    return ids
