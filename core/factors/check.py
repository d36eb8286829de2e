"""Checks that a log is usable, for every reader, simulator and front end.

Columns are named as in a log's CSV files, so that a reader only adds the file and the line.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from ..arrays import ROUNDING, slices
from ..errors import InputError
from ..fixes import FixTable
from ..gyro import Gyro
from ..partial import BEARING, RANGE, PartialTable
from ..se2 import Array
from ..signatures import Signatures
from ..table import LARGEST, MOST
from .landmarks import UNKNOWN, Map
from .priors import STARTS, Prior
from .robot_log import Log

ODOMETRY = ("t", "dx", "dy", "dtheta", "cxx", "cxy", "cxt", "cyy", "cyt", "ctt")
SIGHTINGS = ("step", "id", "range", "bearing", "crr", "crb", "cbb")
LOOPS = ("step", "to", *ODOMETRY[1:])
PARTIAL = {RANGE: ("step", "id", "range", "crr"), BEARING: ("step", "id", "bearing", "cbb")}
SIGNATURES = ("signature", "css")
GYRO = ("step", "turn", "var", "dt", "walk")
FIXES = ("step", "x", "y", "heading", *ODOMETRY[4:], "arm_x", "arm_y")

_LEAST_PIVOT = 1e-12
"""A Cholesky pivot below this share of its diagonal entry leaves an update without significant digits."""

_HALF_TURN = np.pi + 1e-12
"""rad, with room for rounding of sums of angles. Angles beyond were not wrapped, or are in degrees."""

Table = Literal["prior", "odometry", "sightings", "loops", "ranges", "bearings", "fixes", "signatures", "gyro"]


class Problem(NamedTuple):
    """A reason why a log cannot be used."""

    table: Table
    row: int  # of the table: the step in odometry, the landmark in a prior's map; of all partial sightings
    message: str  # what was found and what was expected, without a full stop


def check(log: Log, where: str) -> None:
    """Raises InputError with the first of the log's problems, if any; `where` names the log."""
    for table, row, message in problems(log):
        raise InputError(f"{where}: {table} row {row}: {message}.")


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
    if log.partial is not None:
        yield from _partial(log.partial)
    if log.fixes is not None:
        yield from _fixes(log.fixes)
    if log.signatures is not None:
        yield from _signatures(log.signatures)
    if log.gyro is not None:
        yield from _gyro(log.gyro, len(log))


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
        yield from _columns(table, vars(log), columns)
    tables: list[tuple[Table, Any, int]] = [("sightings", log.sighting_first, s), ("loops", log.loop_first, m)]
    if log.partial is not None:
        p = len(log.partial)
        yield from _columns("ranges", vars(log.partial), {"ids": (p,), "kind": (p,), "z": (p,), "var": (p,)})
        tables.append(("ranges", log.partial.first, p))
    if log.fixes is not None:
        f = len(log.fixes)
        yield from _columns("fixes", vars(log.fixes), {"z": (f, 3), "cov": (f, 3, 3), "arm": (f, 2)})
        tables.append(("fixes", log.fixes.first, f))
    if log.signatures is not None:
        yield from _columns("signatures", vars(log.signatures), {"s": (s,), "var": (s,)})
    if log.gyro is not None:
        yield from _columns("gyro", vars(log.gyro), {name: (len(log.gyro),) for name in GYRO} | {"bias": (2,)})
    for table, first, rows in tables:
        if n and (first[0] != 0 or first[-1] != rows):
            yield Problem(table, 0, f"a row belongs to a step that does not exist, expected 0 to {n - 1}")


def _columns(table: Table, found: Mapping[str, Any], wanted: Mapping[str, tuple[int, ...]]) -> Iterator[Problem]:
    for name, shape in wanted.items():
        if found[name].shape != shape:
            yield Problem(table, 0, f"{name} has shape {found[name].shape}, expected {shape}")


def _prior(prior: Prior) -> Iterator[Problem]:
    if prior.pose.shape != (3,) or prior.cov.shape != (3, 3):
        found = f"shapes {prior.pose.shape} and {prior.cov.shape}"
        yield Problem("prior", 0, f"pose and cov have {found}, expected (3,) and (3, 3)")
        return
    yield from _finite("prior", ("x", "y", "heading"), prior.pose[None])
    yield from _angle("prior", "heading", prior.pose[2:])
    yield from _covariance("prior", prior.cov[None])
    for name in ("range_scale", "range_offset", "heading_offset", "wheel_scale"):
        if not 0 <= (sd := getattr(prior.systematic, name)) <= LARGEST:
            yield Problem("prior", 0, f"systematic {name} is {sd!s}, expected a standard deviation, 0 for none")
    if prior.start not in STARTS:
        yield Problem("prior", 0, f"start is {prior.start!r}, expected 'known' or 'unknown'")
    if prior.start == "unknown" and prior.map is None:
        yield Problem("prior", 0, "start is unknown without a map, expected a map to find it on")
    if prior.map is not None:
        yield from map_problems(prior.map)


def map_problems(known: Map) -> Iterator[Problem]:
    """Yields why a map cannot be used."""
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


def _partial(found: PartialTable) -> Iterator[Problem]:
    for row in np.flatnonzero((found.kind != RANGE) & (found.kind != BEARING)):
        expected = f"expected {RANGE} for a range, or {BEARING} for a bearing"
        yield Problem("ranges", int(row), f"kind is {found.kind[row]}, {expected}")
    tables: tuple[tuple[Table, int], ...] = (("ranges", RANGE), ("bearings", BEARING))
    for table, kind in tables:
        rows, (_, _, name, variance) = np.flatnonzero(found.kind == kind), PARTIAL[kind]
        z, var, ids = found.z[rows], found.var[rows], found.ids[rows]
        for i in np.flatnonzero(~np.isfinite(z)):
            yield Problem(table, int(rows[i]), f"{name} is {z[i]!s}, expected a finite number")
        for i in np.flatnonzero((ids < UNKNOWN) | (ids > MOST)):
            yield Problem(table, int(rows[i]), f"id is {ids[i]}, expected 0 to {MOST}, or {UNKNOWN} for unknown")
        odd = z <= 0 if kind == RANGE else np.abs(z) > _HALF_TURN
        wanted = "more than 0" if kind == RANGE else "radians from -pi to pi"
        for i in np.flatnonzero(odd & np.isfinite(z)):
            yield Problem(table, int(rows[i]), f"{name} is {z[i]!s}, expected {wanted}")
        for i in np.flatnonzero(~(np.isfinite(var) & (var > 0))):
            yield Problem(table, int(rows[i]), f"{variance} is {var[i]!s}, expected a variance, more than 0")
        step = found.step[rows]
        order = np.lexsort((ids, step))
        twin = (np.diff(step[order]) == 0) & (np.diff(ids[order]) == 0) & (ids[order[1:]] != UNKNOWN)
        for i in np.sort(order[1:][twin]):
            message = f"the {name} of id {ids[i]} occurs twice in step {step[i]}, expected once"
            yield Problem(table, int(rows[i]), message)


def _fixes(found: FixTable) -> Iterator[Problem]:
    measured = ~np.isnan(found.z)
    for row in np.flatnonzero(~measured.any(axis=1)):
        yield Problem("fixes", int(row), "x, y and heading are all missing, expected at least one of them")
    for row, column in np.argwhere(np.isinf(found.z)):
        yield Problem("fixes", int(row), f"{FIXES[1 + column]} is {found.z[row, column]!s}, expected a finite number")
    far = (np.abs(found.z[:, :2]) > LARGEST) & np.isfinite(found.z[:, :2])
    for row in np.flatnonzero(far.any(axis=1)):
        message = f"the position is {found.z[row, :2].tolist()}, expected metres, at most {LARGEST:g}"
        yield Problem("fixes", int(row), message)
    yield from _angle("fixes", "heading", found.z[:, 2])
    yield from _finite("fixes", FIXES[-2:], found.arm)
    wanted = measured[:, :, None] & measured[:, None, :]
    for row in np.flatnonzero((np.isnan(found.cov) == wanted).any(axis=(1, 2))):
        names = ", ".join(name for name, has in zip(FIXES[1:4], measured[row], strict=True) if has)
        yield Problem("fixes", int(row), f"the covariance does not fit, expected that of {names} and nothing else")
    filled = np.where(wanted, found.cov, np.eye(3))
    yield from _covariance("fixes", np.where(np.isnan(found.cov) & wanted, 0.0, filled))


def _signatures(found: Signatures) -> Iterator[Problem]:
    yield from _finite("signatures", SIGNATURES[:1], found.s[:, None])
    for row in np.flatnonzero(~(np.isfinite(found.var) & (found.var > 0))):
        yield Problem("signatures", int(row), f"css is {found.var[row]!s}, expected a variance, more than 0")


def _gyro(found: Gyro, steps: int) -> Iterator[Problem]:
    step = found.step
    for row in np.flatnonzero((step < 1) | (step >= steps)):
        yield Problem("gyro", int(row), f"step is {step[row]}, expected 1 to {steps - 1}, steps with one before")
    for row in np.flatnonzero(np.diff(step) <= 0) + 1:
        yield Problem("gyro", int(row), f"step is {step[row]} after {step[row - 1]}, expected one row a step, sorted")
    yield from _finite("gyro", GYRO[1:2], found.turn[:, None])
    yield from _angle("gyro", "turn", found.turn)
    for name, least, wanted in (("var", False, "a variance"), ("dt", False, "seconds"), ("walk", True, "a variance")):
        column = getattr(found, name)
        sound = np.isfinite(column) & ((column >= 0) if least else (column > 0)) & (column <= LARGEST)
        for row in np.flatnonzero(~sound):
            limit = "0 or more" if least else "more than 0"
            yield Problem("gyro", int(row), f"{name} is {column[row]!s}, expected {wanted}, {limit}")
    mean, sd = found.prior
    if not abs(mean) <= LARGEST:
        yield Problem("prior", 0, f"the gyro's bias is {mean!s}, expected a finite number, in rad/s")
    if not 0 <= sd <= LARGEST:
        yield Problem("prior", 0, f"the gyro's bias_sd is {sd!s}, expected a standard deviation, 0 if it is known")


def _finite(table: Table, names: Sequence[str], columns: Array, first: int = 0) -> Iterator[Problem]:
    """Problems of `columns` (m, len(names)), whose row 0 is row `first` of the table."""
    for row, column in np.argwhere(~np.isfinite(columns)):
        yield Problem(table, int(row) + first, f"{names[column]} is {columns[row, column]!s}, expected a finite number")


def _angle(table: Table, name: str, angles: Array, first: int = 0) -> Iterator[Problem]:
    for row in np.flatnonzero((np.abs(angles) > _HALF_TURN) & np.isfinite(angles)):
        yield Problem(table, int(row) + first, f"{name} is {angles[row]!s}, expected radians from -pi to pi")


def _covariance(table: Table, cov: Array, name: str = "the covariance", first: int = 0) -> Iterator[Problem]:
    """Checks `cov` (m, k, k): finite, symmetric to rounding, and positive definite with some digits to spare."""
    for some in slices(len(cov)):
        yield from _covariance_block(table, cov[some], name, first + some.start)


def _covariance_block(table: Table, cov: Array, name: str, first: int) -> Iterator[Problem]:
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
