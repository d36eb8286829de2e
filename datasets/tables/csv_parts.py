"""Ranges and bearings alone of a log from CSV tables."""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...core.factors import UNKNOWN
from ...core.partial import BEARING, RANGE, PartialTable
from ...core.se2 import Array, Ints
from ...core.table import MOST, Table, first_of_repeats
from ...frontend.wheels.holes import other_unit, outside
from ..formats.columns import Fault, in_order, read_columns
from .csv_options import Options, within_half

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
    unit = options.unit("bearings")

    def faults(table: Table) -> Iterator[Fault]:
        yield from _bad_ids(table)
        yield from _bad_ranges(table) if kind == RANGE else _bad_bearings(table, options)

    table = in_order(read_columns(path, columns, faults=faults), strictly=False).without_repeats(remarks)
    t, ids, z = table.column("t") - options.sensor_delay, table.whole("id"), table.rows[:, 2]
    if kind == RANGE:
        var = (options.range_sd + options.range_share * z) ** 2
    else:
        z, var = within_half(z * unit), np.full(len(z), options.bearing_sd**2)
    inside = (start <= t) & (t <= end)
    clock = f"before or after the odometry, {start:.10g} to {end:.10g} s"
    remarks += outside(str(path), int((~inside).sum()), len(t), columns[2], clock, other_unit(t, start, end))
    kept = t[inside], ids[inside], np.full(int(inside.sum()), kind), z[inside], var[inside]
    return Alone(*kept, int((~inside).sum()))


def _bad_ranges(table: Table) -> Iterator[Fault]:
    for row in np.flatnonzero(table.rows[:, 2] <= 0):
        yield int(row), f"the range is {table.rows[row, 2]!s}, expected more than 0"


def _bad_bearings(table: Table, options: Options) -> Iterator[Fault]:
    """Those beyond half a turn by more than noise: a direction is as well one of a turn less, but degrees are none."""
    unit = options.unit("bearings")
    hint = "" if unit != 1 else f"; bearings in degrees take option {options.with_degrees('bearings')}"
    for row in np.flatnonzero(np.abs(table.rows[:, 2] * unit) > options.largest_bearing):
        found, words = table.rows[row, 2], "degrees" if unit != 1 else "radians"
        yield int(row), f"bearing is {found!s} {words}, expected at most half a turn: wrap it{hint}"
        hint = ""  # once is enough


def _bad_ids(table: Table) -> Iterator[Fault]:
    """Ids that are none, or that occur twice at a time with other values."""
    ids, t = table.column("id"), table.column("t")
    for row in np.flatnonzero(~((np.abs(ids) <= MOST) & (ids == np.rint(ids)))):
        yield int(row), f"id is {ids[row]!s}, expected a whole number up to {MOST}"
    for row in np.flatnonzero((ids < UNKNOWN) | (ids > MOST)):
        yield int(row), f"id is {ids[row]:.0f}, expected 0 to {MOST}, or {UNKNOWN} for unknown"
    once = np.flatnonzero(first_of_repeats(table.path, table.rows, table.lines, None))
    order = once[np.lexsort((ids[once], t[once]))]
    twin = (np.diff(t[order]) == 0) & (np.diff(ids[order]) == 0) & (ids[order[1:]] != UNKNOWN)
    for row in np.sort(order[1:][twin]):
        yield int(row), f"id {ids[row]:.0f} occurs twice at t {t[row]!s}, expected once"
