"""Checks that ground truth fits its log."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..errors import InputError
from ..factors import UNKNOWN, Log, Truth
from ..factors.check import map_problems
from ..relations import Relations, as_rows
from ..table import LARGEST, MOST


def check_truth(log: Log, truth: Truth, where: str) -> None:
    """Raises InputError with the first reason why `truth` does not fit `log`, itself checked; `where` as in `check`."""
    for message in _truth_problems(log, truth):
        raise InputError(f"{where}: truth: {message}.")


def _truth_problems(log: Log, truth: Truth) -> Iterator[str]:
    if not isinstance(truth, Truth):  # pyright: ignore[reportUnnecessaryIsInstance] - it comes from a user
        yield f"found {type(truth).__name__}, expected a Truth"
        return
    if truth.kind not in ("truth", "reference", "relations"):
        yield f"kind is {truth.kind!r}, expected 'truth', 'reference' or 'relations'"
    if truth.places not in ("truth", "reference"):
        yield f"places is {truth.places!r}, expected 'truth' or 'reference'"
    if (truth.kind == "relations") != (truth.relations is not None):
        yield f"kind is {truth.kind!r}, expected 'relations' with relations, and only then"
    elif truth.relations is not None:
        yield from relation_problems(log, truth.relations)
    misshapen = list(_truth_shapes(log, truth))
    yield from misshapen
    if not misshapen:
        yield from _truth_rows(log, truth)


def relation_problems(log: Log, relations: Relations) -> Iterator[str]:
    """Yields why relations are not of a log's steps."""
    rows = as_rows(relations)
    for row in np.flatnonzero(~np.isfinite(rows).all(axis=1)):
        yield f"relations row {row}: found {rows[row].tolist()}, expected finite numbers"
    for ends in (relations.first, relations.second):
        for row in np.flatnonzero((ends.step < 0) | (ends.step >= len(log))):
            yield f"relations row {row}: found step {ends.step[row]}, expected 0 to {len(log) - 1}"


def _truth_shapes(log: Log, truth: Truth) -> Iterator[str]:
    m = np.size(truth.t)
    columns: list[tuple[str, Any, tuple[int, ...], str]] = [
        ("t", truth.t, (m,), "iuf"),
        ("poses", truth.poses, (m, 3), "iuf"),
    ]
    if truth.assigned is not None:
        columns.append(("assigned", truth.assigned, (len(log.ids),), "iu"))
    if truth.assigned_partial is not None:
        p = 0 if log.partial is None else len(log.partial)
        columns.append(("assigned_partial", truth.assigned_partial, (p,), "iu"))
    if truth.map is not None:
        n = np.size(truth.map.ids)
        columns += [("map.ids", truth.map.ids, (n,), "iu"), ("map.xy", truth.map.xy, (n, 2), "iuf")]
    if truth.moving is not None:
        columns.append(("moving", truth.moving, (np.size(truth.moving),), "iu"))
    if truth.false_loops is not None:
        columns.append(("false_loops", truth.false_loops, (np.size(truth.false_loops),), "iu"))
    for name, column, shape, kinds in columns:
        if not isinstance(column, np.ndarray):
            yield f"{name} is {type(column).__name__}, expected an array"
        elif column.shape != shape:
            yield f"{name} has shape {column.shape}, expected {shape}"
        elif column.dtype.kind not in kinds:
            expected = "numbers" if "f" in kinds else "whole numbers"
            yield f"{name} has entries of type {column.dtype}, expected {expected}"


def _truth_rows(log: Log, truth: Truth) -> Iterator[str]:
    t = truth.t
    for row in np.flatnonzero(~np.isin(t, log.t)):
        yield f"row {row}: t is {t[row]!s}, expected only times of the log's steps"
    for row in np.flatnonzero(t[1:] <= t[:-1]) + 1:
        yield f"row {row}: t is {t[row]!s}, expected later than {t[row - 1]!s}"
    for row in np.flatnonzero(~np.isfinite(truth.poses).all(axis=1)):
        yield f"row {row}: the pose is {truth.poses[row].tolist()}, expected finite numbers"
    for row in np.flatnonzero((np.abs(truth.poses[:, :2]) > LARGEST).any(axis=1)):
        yield f"row {row}: the pose is {truth.poses[row].tolist()}, expected metres, at most {LARGEST:g}"
    if truth.map is not None:
        for problem in map_problems(truth.map._replace(cov=None)):
            yield f"map row {problem.row}: {problem.message}"
    if truth.moving is not None:
        known = np.zeros(0, np.int64) if truth.map is None else truth.map.ids
        for row in np.flatnonzero(~np.isin(truth.moving, known)):
            yield f"moving row {row}: found {truth.moving[row]}, expected the id of a landmark of the map"
    if truth.false_loops is not None:
        false, last = truth.false_loops, len(log.loop_to) - 1
        for row in np.flatnonzero((false < 0) | (false > last)):
            yield f"false_loops row {row}: found {false[row]}, expected the row of a loop closure, 0 to {last}"
        for row in np.flatnonzero(false[1:] <= false[:-1]) + 1:
            yield f"false_loops row {row}: found {false[row]}, expected more than {false[row - 1]}"
    for name in ("assigned", "assigned_partial"):
        if (true := getattr(truth, name)) is not None:
            for row in np.flatnonzero((true < UNKNOWN) | (true > MOST)):
                yield f"{name} row {row}: found {true[row]}, expected 0 to {MOST}, or {UNKNOWN} for unknown"
