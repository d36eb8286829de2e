"""Converts a graph of poses and points to a log: the common part of the graph formats.

Poses are steps in the order of their ids. Between two consecutive poses the first edge of the file is the odometry; all
other edges are loop closures, measured from the earlier pose. An edge in the other direction is inverted, its
covariance to first order. The file has no times: t is the number of the step.

Positions of poses and points in such a file are initial values of an optimiser, not measurements; only the first pose's
is used, to place the map. A log can represent neither consecutive poses without an edge nor a prior of a pose other
than the first.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core import small_matrices
from ...core.coordinates import as_range_bearing
from ...core.elementary import hypot, sincos
from ...core.errors import InputError
from ...core.factors import Log, Map, Prior
from ...core.factors.check import problems
from ...core.se2 import Array, Ints, inverse, wrap
from ...core.small_matrices import propagated
from ...core.table import Table

START = 1e-9  # m^2 and rad^2: variance of the first pose if the file has none
_LEAST = 1e-15  # smallest eigenvalue, with a unit diagonal, that is not mere rounding


class PoseGraph(NamedTuple):
    """The content of a file. Rows of the arrays are those of the table before them."""

    path: Path
    vertices: Table  # id x y theta: initial values
    points: Table  # id x y: initial values
    edges: Table  # from to dx dy dtheta and more: pose `to` in the body frame of pose `from`
    edge_cov: Array  # (m, 3, 3) in the body frame of pose `from`
    sightings: Table  # pose id and more
    z: Array  # (s, 2) range, bearing
    z_cov: Array  # (s, 2, 2)
    shared_ids: bool = True  # a pose and a point cannot have the same id

    def ids(self) -> Ints:
        """(n,) the poses, in the order of the steps; InputError if there are none, or for invalid ids."""
        given = [_numbers(self.vertices, "id"), _numbers(self.edges, "from"), _numbers(self.edges, "to")]
        for table in (self.vertices, self.points):
            _once(table)
        found = np.unique(np.concatenate(given))
        if not len(found):
            raise InputError(f"{self.path}: found no poses, expected at least one.")
        return found

    def place(self, pose: int) -> Array | None:
        """(3,) the file's initial value of `pose`, None if it has none."""
        rows = np.flatnonzero(self.vertices.column("id") == pose)
        return None if not len(rows) else wrapped(self.vertices, "theta")[rows[0], 1:4]


def log_of(graph: PoseGraph, name: str, prior: Prior | None = None, notes: Mapping[str, object] | None = None) -> Log:
    """The log of `graph`; without `prior`, the first pose is fixed at its initial value, or at the origin.

    InputError, with the file and the line, for what a log cannot represent.
    """
    ids = graph.ids()
    edges = _Edges(graph, ids)
    step = _seen_from(graph, ids)
    order = np.argsort(step, kind="stable")
    if prior is None:
        place = graph.place(int(ids[0]))
        prior = Prior(np.zeros(3) if place is None else place, START * np.eye(3))
    counted = {
        "time": "the file has none: t is the number of the step",
        "first_guesses_not_used": len(graph.vertices.rows) + len(graph.points.rows),
        "edges_inverted": int(edges.inverted.sum()),
        "edges_beside_the_odometry_of_their_step": int(edges.repeated.sum()),
    }
    n, odometry, loops = len(ids), edges.odometry, edges.loops
    delta, delta_cov = np.zeros((n, 3)), np.zeros((n, 3, 3))
    delta[1:], delta_cov[1:] = edges.delta[odometry], edges.cov[odometry]
    log = Log.from_arrays(
        name,
        prior,
        np.arange(n, dtype=float),
        delta,
        delta_cov,
        step[order],
        graph.sightings.whole("id")[order],
        graph.z[order],
        graph.z_cov[order],
        loop_step=edges.later[loops],
        loop_to=edges.earlier[loops],
        loop_delta=edges.delta[loops],
        loop_cov=edges.cov[loops],
        notes={**(notes or {}), **counted},
    )
    for table, row, message in problems(log):
        if table == "prior":
            raise InputError(f"{graph.path}: the first pose: {message}.")
        if table == "sightings":
            raise graph.sightings.fault(order[row], message)
        raise graph.edges.fault(odometry[row - 1] if table == "odometry" else loops[row], message)
    return log


def loop_edges(graph: PoseGraph) -> Ints:
    """(l,) the edges that are the loop closures of the graph's log, in their order there; InputError as `log_of`."""
    return _Edges(graph, graph.ids()).loops


def wrapped(table: Table, column: str) -> Array:
    """The rows of `table`, that column (rad) wrapped to (-pi, pi]; InputError beyond a full turn."""
    k, rows = table.columns.index(column), table.rows.copy()
    for row in np.flatnonzero(np.abs(rows[:, k]) > 2 * np.pi + 1e-5):
        raise table.fault(row, f"{column} is {rows[row, k]!s}, expected radians from -2 pi to 2 pi")
    rows[:, k] = wrap(rows[:, k])
    return rows


def joined(tables: Sequence[Table], columns: int) -> tuple[Table, Ints]:
    """The first `columns` of all `tables` in the order of the file, and (r,) the original index of each row."""
    lines = np.concatenate([table.lines for table in tables])
    order = np.argsort(lines, kind="stable")
    rows = np.concatenate([table.rows[:, :columns] for table in tables])[order]
    return Table(tables[0].path, tables[0].columns[:columns], rows, lines[order]), order


def inverted(table: Table, matrices: Array) -> Array:
    """Inverts the information `matrices` (r, k, k), one per row of `table`; InputError for a singular one."""
    found, definite = inverses(matrices)
    for row in np.flatnonzero(~definite):
        raise table.fault(row, "the information is not positive definite, expected it to be")
    return found


def inverses(matrices: Array) -> tuple[Array, NDArray[np.bool_]]:
    """The inverses of symmetric `matrices` (r, k, k), and (r,) a mask of positive definite ones: only these have one.

    Each is scaled to a unit diagonal first, so that units do not cost precision.
    """
    if not len(matrices):
        return matrices, np.zeros(0, bool)
    with np.errstate(all="ignore"):
        scale = 1 / np.sqrt(np.einsum("rii->ri", matrices))
        outer = scale[:, :, None] * scale[:, None, :]
        even = matrices * outer
        definite = np.isfinite(even).all((1, 2)) & np.isfinite(outer).all((1, 2))
        even[~definite] = np.eye(matrices.shape[-1])
        definite &= np.linalg.eigvalsh(even)[:, 0] > _LEAST
        even[~definite] = np.eye(matrices.shape[-1])
        found = small_matrices.inverse(even) * outer
    return (found + found.swapaxes(1, 2)) / 2, definite


def points_seen(table: Table, cov: Array) -> tuple[Array, Array]:
    """Range and bearing (s, 2), and (s, 2, 2), of the points x, y of `table`, with `cov` (s, 2, 2), to first order."""
    xy = np.stack((table.column("x"), table.column("y")), axis=-1)
    with np.errstate(all="ignore"):  # overflow is reported, with its line, when the log is checked
        for row in np.flatnonzero(hypot(*xy.T) == 0):
            raise table.fault(row, "x and y are both 0, expected a point away from the robot")
        return as_range_bearing(xy, cov)


def map_of(table: Table) -> Map | None:
    """The points in `table` as a given map that is held fixed; None if there are none."""
    return Map(table.whole("id"), table.rows[:, 1:3], None) if len(table.rows) else None


class _Edges:
    """All edges from the earlier to the later pose, with those that are odometry marked."""

    def __init__(self, graph: PoseGraph, ids: Ints) -> None:
        table = graph.edges
        start, end = np.searchsorted(ids, table.whole("from")), np.searchsorted(ids, table.whole("to"))
        for row in np.flatnonzero(start == end):
            raise table.fault(row, f"an edge from pose {ids[start[row]]} to itself, expected two poses")
        self.earlier, self.later = np.minimum(start, end), np.maximum(start, end)
        self.inverted = start > end
        column = table.columns.index("dx")
        delta = wrapped(table, "dtheta")[:, column : column + 3]
        with np.errstate(all="ignore"):
            back = _inverse_covariance(delta, graph.edge_cov)
            self.delta = np.where(self.inverted[:, None], inverse(delta), delta)
            self.cov = np.where(self.inverted[:, None, None], back, graph.edge_cov)
        neighbours = np.flatnonzero(self.later - self.earlier == 1)
        joined, first = np.unique(self.later[neighbours], return_index=True)
        for step in np.setdiff1d(np.arange(1, len(ids)), joined):
            pair = f"pose {ids[step - 1]} to pose {ids[step]}"
            raise InputError(
                f"{graph.path}: no edge connects {pair}, the next by id; expected one between all consecutive poses."
            )
        self.odometry = neighbours[first]
        self.repeated = np.zeros(len(start), bool)
        self.repeated[neighbours] = True
        self.repeated[self.odometry] = False
        others = np.setdiff1d(np.arange(len(start)), self.odometry)
        self.loops = others[np.argsort(self.later[others], kind="stable")]


def _seen_from(graph: PoseGraph, ids: Ints) -> Ints:
    """(s,) the step of every sighting."""
    table = graph.sightings
    pose, points = _numbers(table, "pose"), _numbers(table, "id")
    step = np.minimum(np.searchsorted(ids, pose), len(ids) - 1)
    for row in np.flatnonzero(ids[step] != pose):
        raise table.fault(row, f"a sighting from pose {pose[row]}, expected a pose of an edge or a vertex")
    if graph.shared_ids:
        for named, numbers in ((table, points), (graph.points, graph.points.whole("id"))):
            for row in np.flatnonzero(np.isin(numbers, ids)):
                raise named.fault(row, f"id {numbers[row]} is used for a point and a pose, expected distinct ids")
    return step


def _numbers(table: Table, name: str) -> Ints:
    """(r,) the ids in a column."""
    ids = table.whole(name)
    for row in np.flatnonzero(ids < 0):
        raise table.fault(row, f"{name} is {ids[row]}, expected 0 or more")
    return ids


def _once(table: Table) -> None:
    ids = _numbers(table, "id")
    _, first = np.unique(ids, return_index=True)
    for row in np.setdiff1d(np.arange(len(ids)), first):
        raise table.fault(row, f"vertex {ids[row]} occurs twice, expected once")


def _inverse_covariance(delta: Array, cov: Array) -> Array:
    """(m, 3, 3) covariance of inverse(delta), in its coordinates, from `cov` in those of `delta` (m, 3): J C J'.

    With delta' = inverse(delta), J = d delta' / d delta = [[-c, -s, y'], [s, -c, -x'], [0, 0, -1]].
    """
    (s, c), back = sincos(delta[:, 2]), inverse(delta)
    J = np.zeros_like(cov)
    J[:, 0, 0] = J[:, 1, 1] = -c
    J[:, 0, 1], J[:, 1, 0] = -s, s
    J[:, 0, 2], J[:, 1, 2], J[:, 2, 2] = back[:, 1], -back[:, 0], -1.0
    found = propagated(J, cov)
    return (found + found.swapaxes(1, 2)) / 2
