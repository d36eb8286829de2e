"""Ranges and bearings alone, and measurements of poses in the world, in the files of graphs."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...core.errors import InputError
from ...core.factors import Log
from ...core.factors.check import problems
from ...core.fixes import FixTable
from ...core.partial import BEARING, RANGE, PartialTable
from ...core.se2 import Array, Ints
from ...core.table import Table


class Alone(NamedTuple):
    """Rows of a file that are ranges, or bearings, of landmarks."""

    kind: int  # of `core.partial`
    table: Table  # with the columns pose and id
    z: Array  # (p,)
    var: Array  # (p,)


class Placed(NamedTuple):
    """Rows of a file that measure poses in the world."""

    table: Table  # with the column id, of the pose
    z: Array  # (f, 3), NaN for what is not measured
    cov: Array  # (f, 3, 3) in the world frame, likewise


def with_parts(log: Log, ids: Ints, alone: Sequence[Alone], placed: Sequence[Placed]) -> Log:
    """The log of a graph whose steps are the poses `ids` (n,), with these rows; InputError with the line of a fault.

    Within a step they keep the order of the sequences and of the rows.
    """
    if any(len(one.table.rows) for one in alone):
        steps = [_steps(one.table, "pose", ids) for one in alone]
        order = np.argsort(np.concatenate(steps), kind="stable")
        partial = PartialTable.from_arrays(
            len(log),
            np.concatenate(steps)[order],
            np.concatenate([one.table.whole("id") for one in alone])[order],
            np.repeat([one.kind for one in alone], [len(one.z) for one in alone])[order],
            np.concatenate([one.z for one in alone])[order],
            np.concatenate([one.var for one in alone])[order],
        )
        log = replace(log, partial=partial)
        _check(log, ("ranges", "bearings"), [one.table for one in alone], order)
    if any(len(one.table.rows) for one in placed):
        steps = [_steps(one.table, "id", ids) for one in placed]
        order = np.argsort(np.concatenate(steps), kind="stable")
        z, cov = np.concatenate([one.z for one in placed]), np.concatenate([one.cov for one in placed])
        fixes = FixTable.from_arrays(len(log), np.concatenate(steps)[order], z[order], cov[order])
        log = replace(log, fixes=fixes)
        _check(log, ("fixes",), [one.table for one in placed], order)
    return log


def check_parts(path: Path, log: Log, file: str, kind: int | None, *, positions: bool = False) -> None:
    """Raises InputError for what a `file` cannot represent: signatures, turns, parts that are not of `kind`, and fixes.

    It can represent fixes of whole poses, and with `positions` of x and y.
    """
    partial, fixes = log.partial, log.fixes
    if log.gyro is not None:
        raise InputError(f"{path}: log {log.name} has turns by a gyro, which a {file} cannot represent.")
    if log.signatures is not None:
        raise InputError(f"{path}: log {log.name} has signatures, which a {file} cannot represent.")
    for other, words in ((RANGE, "ranges"), (BEARING, "bearings")):
        if partial is not None and other != kind and (partial.kind == other).any():
            raise InputError(f"{path}: log {log.name} has {words} alone, which a {file} cannot represent.")
    if fixes is None:
        return
    if fixes.arm.any():
        raise InputError(f"{path}: log {log.name} has fixes of an antenna elsewhere, which a {file} cannot represent.")
    measured = ~np.isnan(fixes.z)
    fits = measured.all(axis=1) | (positions & measured[:, :2].all(axis=1))
    if not fits.all():
        raise InputError(f"{path}: log {log.name} has fixes of a part of a pose, which a {file} cannot represent.")


def _check(log: Log, names: Sequence[str], tables: Sequence[Table], order: Ints) -> None:
    """Raises InputError with the first problem of these rows."""
    of = [(table, row) for table in tables for row in range(len(table.rows))]
    for name, row, message in problems(log):
        if name in names:
            table, own = of[order[row]]
            raise table.fault(own, message)


def _steps(table: Table, column: str, ids: Ints) -> Ints:
    """(r,) the step of every row."""
    pose = table.whole(column)
    step = np.minimum(np.searchsorted(ids, pose), len(ids) - 1)
    for row in np.flatnonzero(ids[step] != pose):
        raise table.fault(row, f"a measurement of pose {pose[row]}, expected a pose of an edge or a vertex")
    return step
