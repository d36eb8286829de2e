"""Reads and writes what few logs have in their folder: ranges.csv, bearings.csv, fixes.csv and gyro.csv.

In the log the ranges of a step precede its bearings, in the order of their files.
"""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.factors import Log
from ...core.factors.check import FIXES, GYRO, PARTIAL, Problem
from ...core.fixes import FixTable
from ...core.gyro import Bias, Gyro
from ...core.partial import BEARING, RANGE, PartialTable
from ...core.scan import Scan, attempted
from ...core.se2 import Array, Ints
from ...core.small_matrices import symmetric, upper
from ...core.table import Table, scan_csv
from .steps import by_step

TRUE_ID = ("true_id",)
FILES = {RANGE: "ranges.csv", BEARING: "bearings.csv"}
FIXES_FILE = "fixes.csv"
GYRO_FILE = "gyro.csv"
PARTS = (*FILES.values(), FIXES_FILE)

_ARM = FIXES[-2:]
_NOBODY = "id is blank, expected that of a landmark, or -1 for an unknown one"


class Parts(NamedTuple):
    """The tables of a folder and what they have for a log."""

    tables: Mapping[str, Table] = {}  # by their file
    counts: Mapping[str, int] = {}  # of all their rows, bad ones included
    partial: PartialTable | None = None
    fixes: FixTable | None = None
    gyro: Gyro | None = None
    assigned: Ints | None = None  # (p,) true ids, where a file has them
    origin: Ints = np.zeros((0, 2), np.int64)  # (p, 2) kind and row of its table, of each partial sighting

    def fault(self, problem: Problem) -> InputError:
        """The error about a row of ranges, bearings, fixes or turns."""
        if problem.table in ("fixes", "gyro"):
            return self.tables[f"{problem.table}.csv"].fault(problem.row, problem.message)
        kind, row = self.origin[problem.row]
        return self.tables[FILES[kind]].fault(row, problem.message)


def scan_parts(folder: Path, steps: int, bias: Bias | None) -> Scan[Parts]:
    """Scans those of the files that are there, of a log of that many steps; bad rows are left out."""
    tables, counts = dict[str, Table](), dict[str, int]()
    for kind, name in FILES.items():
        if os.path.lexists(folder / name):
            table = yield from attempted(_scan_partial(folder / name, PARTIAL[kind], steps, counts))
            tables |= {} if table is None else {name: table}
    partial = assigned = None
    origin = np.zeros((0, 2), np.int64)
    if tables:
        partial, assigned, origin = _joined(
            {kind: tables[name] for kind, name in FILES.items() if name in tables}, steps
        )
    fixes = None
    if os.path.lexists(folder / FIXES_FILE):
        table = yield from attempted(_scan_fixes(folder / FIXES_FILE, steps, counts))
        if table is not None:
            tables[FIXES_FILE] = table
            arm = table.rows[:, 10:] if table.columns == FIXES else None
            cov = symmetric(table.rows[:, 4:10])
            fixes = FixTable.from_arrays(steps, table.whole("step"), table.rows[:, 1:4], cov, arm)
    gyro = None
    if os.path.lexists(folder / GYRO_FILE):
        table = yield from attempted(scan_csv(folder / GYRO_FILE, GYRO))
        if table is not None:
            counts[GYRO_FILE] = len(table.rows)
            table = tables[GYRO_FILE] = yield from by_step(table.sound(), steps)
            gyro = Gyro.from_arrays(table.whole("step"), *table.rows[:, 1:].T, bias=bias)
    return Parts(tables, counts, partial, fixes, gyro, assigned, origin)


def _scan_partial(path: Path, columns: tuple[str, ...], steps: int, counts: dict[str, int]) -> Scan[Table]:
    table = yield from scan_csv(path, columns, TRUE_ID, blanks=True)
    counts[path.name] = len(table.rows)
    blank = np.isnan(table.column("id"))
    table = yield from table.refuse(blank, lambda _: _NOBODY)
    for name in table.columns[2:]:
        table = yield from table.refuse(
            np.isnan(table.column(name)), lambda _, name=name: f"{name} is blank, expected a number"
        )
    return (yield from by_step(table.sound(), steps, "id", *table.columns[4:]))


def _scan_fixes(path: Path, steps: int, counts: dict[str, int]) -> Scan[Table]:
    table = yield from scan_csv(path, FIXES[:-2], _ARM, blanks=True)
    counts[path.name] = len(table.rows)
    for name in table.columns[10:]:
        table = yield from table.refuse(
            np.isnan(table.column(name)), lambda _, name=name: f"{name} is blank, expected a number"
        )
    return (yield from by_step(table.sound(), steps))


def _joined(tables: Mapping[int, Table], steps: int) -> tuple[PartialTable, Ints | None, Ints]:
    """The sightings of both kinds, sorted by step, their true ids, and where they come from."""
    kinds = np.repeat([*tables], [len(table.rows) for table in tables.values()])
    rows = np.concatenate([table.rows[:, :4] for table in tables.values()])
    own = np.concatenate([np.arange(len(table.rows)) for table in tables.values()])
    order = np.argsort(rows[:, 0], kind="stable")
    kinds, rows, own = kinds[order], rows[order], own[order]
    step, ids = rows[:, :2].astype(np.int64).T
    partial = PartialTable.from_arrays(steps, step, ids, kinds, rows[:, 2], rows[:, 3])
    told = [table.columns[-1:] == TRUE_ID for table in tables.values()]
    assigned = None
    if any(told):
        true = [table.whole("true_id" if has else "id") for table, has in zip(tables.values(), told, strict=True)]
        assigned = np.concatenate(true)[order]
        assigned.flags.writeable = False
    return partial, assigned, np.column_stack((kinds, own))


def rows_of(log: Log) -> dict[str, int]:
    """The number of rows of each file that the log needs."""
    rows = dict[str, int]()
    if log.partial is not None:
        counts = {name: int((log.partial.kind == kind).sum()) for kind, name in FILES.items()}
        rows |= {name: count for name, count in counts.items() if count}
    rows |= {} if log.fixes is None else {FIXES_FILE: len(log.fixes)}
    return rows if log.gyro is None else rows | {GYRO_FILE: len(log.gyro)}


def columns_of(log: Log, assigned: Ints | None) -> dict[str, tuple[tuple[str, ...], list[Array | Ints]]]:
    """Header and columns of each of these files; NaN is blank."""
    found = dict[str, tuple[tuple[str, ...], list[Array | Ints]]]()
    if log.partial is not None:
        for kind, name in FILES.items():
            rows = log.partial.kind == kind
            if rows.any():
                head, one = PARTIAL[kind], log.partial
                columns: list[Array | Ints] = [one.step[rows], one.ids[rows], one.z[rows], one.var[rows]]
                if assigned is not None:
                    head, columns = head + TRUE_ID, [*columns, assigned[rows]]
                found[name] = head, columns
    if log.fixes is not None:
        one = log.fixes
        found[FIXES_FILE] = FIXES, [one.step, *one.z.T, *upper(one.cov), *one.arm.T]
    if log.gyro is not None:
        found[GYRO_FILE] = GYRO, [getattr(log.gyro, name) for name in GYRO]
    return found


def as_read(log: Log, assigned: Ints | None) -> tuple[dict[str, Any], Ints | None]:
    """The partial sightings and fixes of a log, and the former's true ids, as they will be read again."""
    found = dict[str, Any]()
    if (partial := log.partial) is not None:
        order = np.lexsort((partial.kind, partial.step))
        found["partial"] = partial.rows(order)
        assigned = None if assigned is None else np.asarray(assigned, np.int64)[order]
    if log.fixes is not None:
        one = log.fixes
        found["fixes"] = FixTable.from_arrays(len(log), one.step, one.z, symmetric(upper(one.cov).T), one.arm)
    return found, assigned
