"""A graph of poses and points as a log: what the formats that write one down have in common.

Poses are steps in the order of their ids. Between two neighbours the first edge of the file is the odometry; every
other edge is a loop closure, the earlier of its poses being the one that it is seen from. An edge written the other way
round is inverted, its covariance to first order. The file has no times: t is the number of the step.

The places that such a file gives for its poses and points are where an optimiser starts: they are no measurements, and
nothing of them is used but the first pose's, which says where the map is. A log can hold neither two poses that no
edge joins to their neighbours nor a belief about a pose other than the first.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...frontend import small_matrices
from ...frontend.check import problems
from ...frontend.coordinates import as_range_bearing
from ...frontend.elementary import hypot, sincos
from ...frontend.errors import InputError
from ...frontend.factors import Log, Map, Prior
from ...frontend.se2 import Array, Ints, inverse, wrap
from ...frontend.small_matrices import propagated
from ...frontend.table import Table

START = 1e-9
"""m^2 and rad^2: variance of the first pose where the file does not say how well it is known."""

_LEAST = 1e-15
"""Smallest eigenvalue, with a diagonal of ones, that is not rounding alone."""


class PoseGraph(NamedTuple):
    """What a file says. Rows of the arrays are those of the table before them."""

    path: Path
    vertices: Table  # id x y theta: first guesses
    points: Table  # id x y: first guesses
    edges: Table  # from to dx dy dtheta and more: pose `to` in the body frame of pose `from`
    edge_cov: Array  # (m, 3, 3) in the body frame of pose `from`
    sightings: Table  # pose id and more
    z: Array  # (s, 2) range, bearing
    z_cov: Array  # (s, 2, 2)
    shared_ids: bool = True  # a pose and a point cannot have the same id

    def ids(self) -> Ints:
        """(n,) the poses, in the order of the steps; InputError where there is none, or an id is no such thing."""
        given = [_numbers(self.vertices, "id"), _numbers(self.edges, "from"), _numbers(self.edges, "to")]
        for table in (self.vertices, self.points):
            _once(table)
        found = np.unique(np.concatenate(given))
        if not len(found):
            raise InputError(f"{self.path}: there is no pose, expected at least one.")
        return found

    def place(self, pose: int) -> Array | None:
        """(3,) where the file puts `pose`, None where it does not."""
        rows = np.flatnonzero(self.vertices.column("id") == pose)
        return None if not len(rows) else wrapped(self.vertices, "theta")[rows[0], 1:4]


def log_of(graph: PoseGraph, name: str, prior: Prior | None = None, notes: Mapping[str, object] | None = None) -> Log:
    """The log of `graph`; without `prior`, the first pose is held where the file puts it, or at the origin.

    InputError, with the file and the line, for what a log cannot hold.
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
        edges.later[loops],
        edges.earlier[loops],
        edges.delta[loops],
        edges.cov[loops],
        notes={**(notes or {}), **counted},
    )
    for table, row, message in problems(log):
        if table == "prior":
            raise InputError(f"{graph.path}: the first pose: {message}.")
        if table == "sightings":
            raise graph.sightings.fault(order[row], message)
        raise graph.edges.fault(odometry[row - 1] if table == "odometry" else loops[row], message)
    return log


def wrapped(table: Table, column: str) -> Array:
    """The rows of `table`, that column (rad) in (-pi, pi]; InputError beyond a full turn: degrees, most likely."""
    k, rows = table.columns.index(column), table.rows.copy()
    for row in np.flatnonzero(np.abs(rows[:, k]) > 2 * np.pi + 1e-5):
        raise table.fault(row, f"{column} is {rows[row, k]!s}, expected radians from -2 pi to 2 pi")
    rows[:, k] = wrap(rows[:, k])
    return rows


def joined(tables: Sequence[Table], columns: int) -> tuple[Table, Ints]:
    """The first `columns` of all `tables` in the order of the file, and (r,) which of all their rows each was."""
    lines = np.concatenate([table.lines for table in tables])
    order = np.argsort(lines, kind="stable")
    rows = np.concatenate([table.rows[:, :columns] for table in tables])[order]
    return Table(tables[0].path, tables[0].columns[:columns], rows, lines[order]), order


def inverted(table: Table, matrices: Array) -> Array:
    """The inverses of the information `matrices` (r, k, k), one a row of `table`; InputError where one has none."""
    found, definite = inverses(matrices)
    for row in np.flatnonzero(~definite):
        raise table.fault(row, "the information is not positive definite, expected it so")
    return found


def inverses(matrices: Array) -> tuple[Array, NDArray[np.bool_]]:
    """The inverses of symmetric `matrices` (r, k, k), and (r,) which are positive definite: the others have none.

    Each is inverted with ones on its diagonal, so that units do not cost digits.
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
    """Range and bearing (s, 2), and (s, 2, 2), of the points x, y of `table`, with `cov` (s, 2, 2), by first order."""
    xy = np.stack((table.column("x"), table.column("y")), axis=-1)
    with np.errstate(all="ignore"):  # what overflows is named, with its line, when the log is looked at
        for row in np.flatnonzero(hypot(*xy.T) == 0):
            raise table.fault(row, "x and y are both 0, expected a point away from the robot")
        return as_range_bearing(xy, cov)


def map_of(table: Table) -> Map | None:
    """The points in `table` as a given map that is held fixed; None where there is none."""
    return Map(table.whole("id"), table.rows[:, 1:3], None) if len(table.rows) else None


class _Edges:
    """Every edge from the earlier to the later pose, and which of them are odometry."""

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
            pair = f"pose {ids[step - 1]} and pose {ids[step]}"
            raise InputError(
                f"{graph.path}: no edge joins {pair}, the next by id; expected one between any two neighbours."
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
        raise table.fault(row, f"a sighting from pose {pose[row]}, expected one that an edge or a vertex names")
    if graph.shared_ids:
        for named, numbers in ((table, points), (graph.points, graph.points.whole("id"))):
            for row in np.flatnonzero(np.isin(numbers, ids)):
                raise named.fault(row, f"id {numbers[row]} is a point's and a pose's, expected ids of their own")
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
        raise table.fault(row, f"vertex {ids[row]} is there twice, expected once")


def _inverse_covariance(delta: Array, cov: Array) -> Array:
    """(m, 3, 3) of inverse(delta), in its coordinates, of `cov` in those of `delta` (m, 3): J C J'.

    With delta' = inverse(delta), J = d delta' / d delta = [[-c, -s, y'], [s, -c, -x'], [0, 0, -1]].
    """
    (s, c), back = sincos(delta[:, 2]), inverse(delta)
    J = np.zeros_like(cov)
    J[:, 0, 0] = J[:, 1, 1] = -c
    J[:, 0, 1], J[:, 1, 0] = -s, s
    J[:, 0, 2], J[:, 1, 2], J[:, 2, 2] = back[:, 1], -back[:, 0], -1.0
    found = propagated(J, cov)
    return (found + found.swapaxes(1, 2)) / 2
