"""Checks that a log is usable, for every reader, simulator and front end.

Columns are named as in a log's CSV files, so that a reader only adds the file and the line.
"""

from collections.abc import Iterator, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from .errors import InputError
from .factors import ROUNDING, STARTS, UNKNOWN, Log, Map, Prior, Truth
from .relations import Relations, as_rows
from .se2 import Array
from .table import LARGEST, MOST

ODOMETRY = ("t", "dx", "dy", "dtheta", "cxx", "cxy", "cxt", "cyy", "cyt", "ctt")
SIGHTINGS = ("step", "id", "range", "bearing", "crr", "crb", "cbb")
LOOPS = ("step", "to", *ODOMETRY[1:])

_LEAST_PIVOT = 1e-12
"""A Cholesky pivot below this share of its diagonal entry leaves an update without significant digits."""

_HALF_TURN = np.pi + 1e-12
"""rad, with room for rounding of sums of angles. Angles beyond were not wrapped, or are in degrees."""

Table = Literal["prior", "odometry", "sightings", "loops"]


class Problem(NamedTuple):
    """A reason why a log cannot be used."""

    table: Table
    row: int  # of the table: the step in odometry, the landmark in a prior's map
    message: str  # what was found and what was expected, without a full stop


def check(log: Log, where: str) -> None:
    """Raises InputError with the first of the log's problems, if any; `where` names the log."""
    for table, row, message in problems(log):
        raise InputError(f"{where}: {table} row {row}: {message}.")


def check_truth(log: Log, truth: Truth, where: str) -> None:
    """Raises InputError with the first reason why `truth` does not fit `log`, itself checked; `where` as in `check`."""
    for message in _truth_problems(log, truth):
        raise InputError(f"{where}: truth: {message}.")


def problems(log: Log) -> Iterator[Problem]:
    """Yields every problem of `log`, table by table."""
    misshapen = list(_shapes(log))
    yield from misshapen
    if misshapen:
        return
    yield from _prior(log.prior)
    yield from _odometry(log)
    yield from _sightings(log)
    yield from _loops(log)


def _shapes(log: Log) -> Iterator[Problem]:
    n, s, m = len(log), len(log.ids), len(log.loop_to)
    if n == 0:
        yield Problem("odometry", 0, "found no steps, expected at least one")
    wanted: dict[Table, dict[str, tuple[int, ...]]] = {
        "odometry": {"delta": (n, 3), "delta_cov": (n, 3, 3)},
        "sightings": {"z": (s, 2), "z_cov": (s, 2, 2)},
        "loops": {"loop_delta": (m, 3), "loop_cov": (m, 3, 3)},
    }
    for table, columns in wanted.items():
        for name, shape in columns.items():
            if (found := getattr(log, name).shape) != shape:
                yield Problem(table, 0, f"{name} has shape {found}, expected {shape}")
    tables: tuple[tuple[Table, Any, int], ...] = (("sightings", log.sighting_first, s), ("loops", log.loop_first, m))
    for table, first, rows in tables:
        if n and (first[0] != 0 or first[-1] != rows):
            yield Problem(table, 0, f"a row belongs to a step that does not exist, expected 0 to {n - 1}")


def _prior(prior: Prior) -> Iterator[Problem]:
    if prior.pose.shape != (3,) or prior.cov.shape != (3, 3):
        found = f"shapes {prior.pose.shape} and {prior.cov.shape}"
        yield Problem("prior", 0, f"pose and cov have {found}, expected (3,) and (3, 3)")
        return
    yield from _finite("prior", ("x", "y", "heading"), prior.pose[None])
    yield from _angle("prior", "heading", prior.pose[2:])
    yield from _covariance("prior", prior.cov[None])
    if prior.start not in STARTS:
        yield Problem("prior", 0, f"start is {prior.start!r}, expected 'known' or 'unknown'")
    if prior.start == "unknown" and prior.map is None:
        yield Problem("prior", 0, "start is unknown without a map, expected a map to find it on")
    if prior.map is not None:
        yield from _known(prior.map)


def _known(known: Map) -> Iterator[Problem]:
    n = len(known.ids)
    if known.xy.shape != (n, 2) or (known.cov is not None and known.cov.shape != (2 * n, 2 * n)):
        yield Problem("prior", 0, f"the map's arrays do not fit its {n} ids, expected xy (n, 2) and cov (2n, 2n)")
        return
    for row in np.flatnonzero((known.ids < 0) | (known.ids > MOST)):
        yield Problem("prior", int(row), f"the map's id is {known.ids[row]}, expected 0 to {MOST}")
    _, first = np.unique(known.ids, return_index=True)
    for row in np.setdiff1d(np.arange(n), first):
        yield Problem("prior", int(row), f"the map's id {known.ids[row]} occurs twice, expected once")
    yield from _finite("prior", ("the map's x", "the map's y"), known.xy)
    if known.cov is not None and n:
        yield from _covariance("prior", known.cov[None], "the map's covariance")


def _odometry(log: Log) -> Iterator[Problem]:
    yield from _finite("odometry", ODOMETRY[:1], log.t[:, None])
    for row in np.flatnonzero(log.t[1:] <= log.t[:-1]) + 1:
        yield Problem("odometry", int(row), f"t is {log.t[row]!s}, expected later than {log.t[row - 1]!s}")
    yield from _finite("odometry", ODOMETRY[1:4], log.delta[1:], 1)
    yield from _angle("odometry", "dtheta", log.delta[1:, 2], 1)
    yield from _covariance("odometry", log.delta_cov[1:], first=1)


def _sightings(log: Log) -> Iterator[Problem]:
    yield from _finite("sightings", SIGHTINGS[2:4], log.z)
    for row in np.flatnonzero((log.ids < UNKNOWN) | (log.ids > MOST)):
        yield Problem("sightings", int(row), f"id is {log.ids[row]}, expected 0 to {MOST}, or {UNKNOWN} for unknown")
    for row in np.flatnonzero(log.z[:, 0] <= 0):
        yield Problem("sightings", int(row), f"range is {log.z[row, 0]!s}, expected more than 0")
    yield from _angle("sightings", "bearing", log.z[:, 1])
    yield from _covariance("sightings", log.z_cov)
    step = log.sighting_step
    order = np.lexsort((log.ids, step))
    twin = (np.diff(step[order]) == 0) & (np.diff(log.ids[order]) == 0) & (log.ids[order[1:]] != UNKNOWN)
    for row in np.sort(order[1:][twin]):
        yield Problem("sightings", int(row), f"id {log.ids[row]} occurs twice in step {step[row]}, expected once")


def _loops(log: Log) -> Iterator[Problem]:
    step = log.loop_step
    for row in np.flatnonzero((log.loop_to < 0) | (log.loop_to >= step)):
        expected = f"expected a step from 0 to before its own, {step[row]}"
        yield Problem("loops", int(row), f"to is {log.loop_to[row]}, {expected}")
    yield from _finite("loops", LOOPS[2:5], log.loop_delta)
    yield from _angle("loops", "dtheta", log.loop_delta[:, 2])
    yield from _covariance("loops", log.loop_cov)


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
        for problem in _known(truth.map._replace(cov=None)):
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
    if truth.assigned is not None:
        for row in np.flatnonzero((truth.assigned < UNKNOWN) | (truth.assigned > MOST)):
            yield f"assigned row {row}: found {truth.assigned[row]}, expected 0 to {MOST}, or {UNKNOWN} for unknown"


def _finite(table: Table, names: Sequence[str], columns: Array, first: int = 0) -> Iterator[Problem]:
    """Problems of `columns` (m, len(names)), whose row 0 is row `first` of the table."""
    for row, column in np.argwhere(~np.isfinite(columns)):
        yield Problem(table, int(row) + first, f"{names[column]} is {columns[row, column]!s}, expected a finite number")


def _angle(table: Table, name: str, angles: Array, first: int = 0) -> Iterator[Problem]:
    for row in np.flatnonzero(np.abs(angles) > _HALF_TURN):
        yield Problem(table, int(row) + first, f"{name} is {angles[row]!s}, expected radians from -pi to pi")


def _covariance(table: Table, cov: Array, name: str = "the covariance", first: int = 0) -> Iterator[Problem]:
    """Checks `cov` (m, k, k): finite, symmetric to rounding, and positive definite with some digits to spare."""
    k = cov.shape[-1]
    with np.errstate(all="ignore"):
        diagonal = np.einsum("mii->mi", cov)
        scale = np.sqrt(np.abs(diagonal[:, :, None] * diagonal[:, None, :]))
        even = (np.abs(cov - cov.swapaxes(1, 2)) <= ROUNDING * scale).all((1, 2))
        rest, definite = cov.copy(), np.ones(len(cov), bool)
        for i in range(k):
            definite &= rest[:, i, i] > _LEAST_PIVOT * diagonal[:, i]
            rest[:, i + 1 :, i + 1 :] -= (
                rest[:, i + 1 :, i, None] * (rest[:, i, i + 1 :] / rest[:, i, i, None])[:, None]
            )
    for row in np.flatnonzero(~(even & definite)):
        if not np.isfinite(cov[row]).all():
            message = f"{name} has an entry that is not finite, expected finite numbers"
        elif not even[row]:
            message = f"{name} is not symmetric, expected it symmetric and positive definite"
        else:
            least, *_, most = np.linalg.eigvalsh(cov[row])
            found = f"its smallest eigenvalue is {least:.6g}, its largest {most:.6g}"
            message = f"{name} is not positive definite: {found}, expected all above 0"
        yield Problem(table, int(row) + first, message)
