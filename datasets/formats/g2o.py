"""Reads planar graphs in g2o's text format.

    VERTEX_SE2 id x y theta                                          an optimiser's initial value: not used
    VERTEX_XY id x y                                                 likewise of a point
    EDGE_SE2 i j dx dy dtheta I11 I12 I13 I22 I23 I33                pose j in the body frame of pose i
    EDGE_SE2_XY i l x y I11 I12 I22                                  point l in the body frame of pose i
    EDGE_BEARING_SE2_XY i l bearing I                                the bearing alone of point l from pose i
    EDGE_PRIOR_SE2 i x y theta I11 I12 I13 I22 I23 I33               the prior of the first pose, or a fix of pose i
    EDGE_PRIOR_SE2_XY i x y I11 I12 I22                              the position of pose i in the world
    FIX id ...                                                       vertices held at their initial values

R. Kuemmerle, G. Grisetti, H. Strasdat, K. Konolige and W. Burgard, "g2o: a general framework for graph optimization",
ICRA 2011. The error of an EDGE_SE2 is the vector of Z^-1 (Xi^-1 Xj), Z being the measurement, so that its information
is in the body frame after the motion, and that of an EDGE_PRIOR_SE2, of Z^-1 Xi, in the body frame of Z. Both are
converted to ours: before the motion, and the world's. That of an EDGE_SE2_XY, Xi^-1 l - z, is in the body frame of pose
i, that of an EDGE_PRIOR_SE2_XY in the world.

A log has its prior at the first pose: from its first EDGE_PRIOR_SE2, or its initial value, whether fixed or by default;
other priors are fixes. A single other pose that is fixed only says where the graph is. Fixed points become a given
map. Landmarks whose ids are all negative, as rtabmap has them, lose the sign.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...core.coordinates import before_motion
from ...core.errors import InputError
from ...core.factors import Dataset, Prior
from ...core.options import option
from ...core.partial import BEARING
from ...core.se2 import Ints
from ...core.small_matrices import symmetric
from ...core.table import Table
from ..false_loops import FalseLoops
from ..registry import Named, Source
from ..remarks import remarked
from .graph_parts import Alone, Placed, with_parts
from .pose_graph import START, PoseGraph, inverted, log_of, map_of, points_seen, wrapped
from .tagged import LIST, read_tagged

KINDS = {
    "VERTEX_SE2": "vertices",
    "VERTEX_XY": "points",
    "EDGE_SE2": "edges",
    "EDGE_SE2_XY": "sightings",
    "EDGE_BEARING_SE2_XY": "bearings",
    "EDGE_PRIOR_SE2": "priors",
    "EDGE_PRIOR_SE2_XY": "positions",
    "FIX": "fixed",
}
"""The rows that can be represented in a log."""

REFUSED = (
    "PARAMS_SE2OFFSET", "CACHE_SE2_OFFSET", "EDGE_PRIOR_XY", "EDGE_SE2_XY_CALIB", "EDGE_SE2_CALIB", "EDGE_SE2_OFFSET",
    "EDGE_SE2_POINTXY_OFFSET", "EDGE_SE2_POINTXY_CALIB", "EDGE_POINTXY", "EDGE_SE2_TWOPOINTSXY", "EDGE_SE2_LOTSOFXY",
)  # fmt: skip
"""The other rows of g2o's types_slam2d."""

_INFORMATION = ("I11", "I12", "I13", "I22", "I23", "I33")
_COLUMNS = {
    "vertices": ("id", "x", "y", "theta"),
    "points": ("id", "x", "y"),
    "edges": ("from", "to", "dx", "dy", "dtheta", *_INFORMATION),
    "sightings": ("pose", "id", "x", "y", "I11", "I12", "I22"),
    "bearings": ("pose", "id", "bearing", "I"),
    "priors": ("id", "x", "y", "theta", *_INFORMATION),
    "positions": ("id", "x", "y", "I11", "I12", "I22"),
    "fixed": LIST,
}


@dataclass(frozen=True)
class Options(FalseLoops, Named):
    """Which graph."""

    path: str | None = option(None, "the file of the graph")


def make(options: Options, rng: np.random.Generator) -> Dataset:  # noqa: ARG001 - files are not random
    """A graph in g2o's format, poses and points in the plane: g2o[path=FILE]."""
    if options.path is None:
        raise InputError("option path of dataset g2o is not given, expected the file of a graph: g2o[path=FILE].")
    return read(Path(options.path))


source = Source(make, Options)


def read(path: Path) -> Dataset:
    """Reads the log in the g2o file `path`; InputError names the file and line of what is invalid."""
    tables = read_tagged(path, KINDS, _COLUMNS, REFUSED)
    edges, sightings, points, bearings = (tables[name] for name in ("edges", "sightings", "points", "bearings"))
    negative = any((table.column("id") < 0).any() for table in (points, sightings, bearings))
    if negative:
        points, sightings, bearings = _positive(points), _positive(sightings), _positive(bearings)
    cov = inverted(edges, symmetric(edges.rows[:, 5:]))
    graph = PoseGraph(
        path,
        tables["vertices"],
        points,
        edges,
        before_motion(wrapped(edges, "dtheta")[:, 2:5], cov),
        sightings,
        *points_seen(sightings, inverted(sightings, symmetric(sightings.rows[:, 4:]))),
        shared_ids=not negative,
    )
    notes = {
        "source": f"the g2o file {path.name}",
        "licence": "not stated in the file",
        "covariances": "g2o's are in the body frame after a motion, converted to the one before it",
    }
    if negative:
        notes["landmarks"] = "their negative ids without the sign"
    remarks, fixed = list[str](), tables["fixed"]
    priors, first = tables["priors"], int(graph.ids()[0])
    own = np.flatnonzero(priors.whole("id") == first)[:1]
    others = priors.take(np.setdiff1d(np.arange(len(priors.rows)), own))
    prior = _prior(graph, tables["points"].whole("id"), priors.take(own), fixed, remarks)
    log = log_of(graph, path.stem, prior, notes)
    log = with_parts(log, graph.ids(), [_bearings(bearings)], [_poses(others), _positions(tables["positions"])])
    return Dataset(remarked(log, remarks), None)


def _bearings(table: Table) -> Alone:
    return Alone(BEARING, table, wrapped(table, "bearing")[:, 2], inverted(table, table.rows[:, 3:, None])[:, 0, 0])


def _poses(priors: Table) -> Placed:
    """The poses that are measured, with covariances in the world frame."""
    poses = wrapped(priors, "theta")[:, 1:4]
    return Placed(priors, poses, before_motion(poses, inverted(priors, symmetric(priors.rows[:, 4:]))))


def _positions(table: Table) -> Placed:
    z, cov = np.full((len(table.rows), 3), np.nan), np.full((len(table.rows), 3, 3), np.nan)
    z[:, :2], cov[:, :2, :2] = table.rows[:, 1:3], inverted(table, symmetric(table.rows[:, 3:]))
    return Placed(table, z, cov)


def _positive(table: Table) -> Table:
    """The rows of points whose ids are all negative, as rtabmap numbers landmarks beside poses, with positive ids."""
    column = table.columns.index("id")
    rows = table.rows.copy()
    for row in np.flatnonzero(rows[:, column] >= 0):
        raise table.fault(row, f"id is {rows[row, column]:.0f}, expected one below 0, as other points have")
    rows[:, column] *= -1
    return Table(table.path, table.columns, rows, table.lines)


def _prior(graph: PoseGraph, points: Ints, priors: Table, fixed: Table, remarks: list[str]) -> Prior | None:
    """The prior of the first pose, and the fixed points as a given map; `points` are their ids in the file.

    `priors` are those of the first pose, at most one. A single pose that is fixed in place of the first only says where
    the graph is: the first is held instead.
    """
    first = int(graph.ids()[0])
    poses_fixed = ~np.isin(fixed.whole("id"), points)
    held = np.isin(points, fixed.whole("id"))
    named = np.unique(fixed.whole("id")[poses_fixed])
    other = len(named) == 1 and named[0] != first and np.isin(named, graph.ids()).all()
    if other and not (len(priors.rows) or held.any()):
        remarks.append(
            f"{graph.path}: FIX holds pose {named[0]}, a log the first, {first}, at its initial value: the graph is "
            "the same, but it may lie elsewhere"
        )
        return None
    for row in np.flatnonzero(poses_fixed & (fixed.whole("id") != first)):
        expected = f"expected only that of the first pose, {first}, and of points"
        raise fixed.fault(row, f"vertex {fixed.whole('id')[row]} is fixed, {expected}")
    if len(priors.rows) and poses_fixed.any():
        row = np.flatnonzero(poses_fixed)[0]
        raise fixed.fault(row, "the first pose has two priors, expected one EDGE_PRIOR_SE2 or FIX")
    place = graph.place(first)
    if poses_fixed.any() and place is None:
        row = np.flatnonzero(poses_fixed)[0]
        raise fixed.fault(row, f"vertex {first} is fixed, expected a VERTEX_SE2 with its position")
    known = map_of(Table(graph.path, graph.points.columns, graph.points.rows[held], graph.points.lines[held]))
    if len(priors.rows):
        own = _poses(priors)
        return Prior(own.z[0], own.cov[0], known)
    return Prior(np.zeros(3) if place is None else place, START * np.eye(3), known)
