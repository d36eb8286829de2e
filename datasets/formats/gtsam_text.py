"""Reads the planar text graphs that GTSAM reads and ships: their rows originate from several programs.

    VERTEX2 id x y theta (or VERTEX_SE2, VERTEX)                     an optimiser's initial value: not used
    VERTEX_XY id x y                                                 likewise of a point
    EDGE2 i j dx dy dtheta + 6 numbers (or EDGE_SE2, EDGE, ODOMETRY) pose j in the body frame of pose i
    BR i l bearing range sd_bearing sd_range                         point l from pose i
    LANDMARK i l x y cxx cxy cyy                                     the same, in the body frame of pose i; with
                                                                     noise=root a root, as in iSAM's files
    LANDMARK2 i l x y rxx rxy ryy                                    the same, with a root of the information
    EQUIV i j                                                        from TORO; only counted here

The file does not say what the 6 numbers are. GTSAM's load2D takes an argument, or guesses from the zeros of the first
row; the names below are its own. `root`, an upper triangular R with information R'R, is iSAM's (M. Kaess et al., 2008),
which no option of load2D stands for: victoriaPark_reduced_1k.g2o has 100 and 500 where victoria_park.txt has 1e-4 and
4e-6, and 1.581139 in its LANDMARK2 where that has 0.4. The 3.16228 and 5 of w20000.txt look like roots too, but are
guessed to be covariances, as GTSAM does: give noise=root. An EDGE_SE2 is guessed to have g2o's information.

A BetweenFactor's error is the logarithm of Z^-1 (Xi^-1 Xj): its covariance is in the body frame after the motion, and
is converted to the one before it. Poses and points are numbered separately. load2D converts a LANDMARK's covariance to
deviations of range and bearing, as if from 10 m; here it is propagated to first order.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...core.coordinates import before_motion
from ...core.errors import InputError
from ...core.factors import Dataset
from ...core.options import option
from ...core.se2 import Array
from ...core.small_matrices import product, symmetric
from ...core.table import Table
from ..false_loops import FalseLoops
from ..registry import Named, Source
from .pose_graph import PoseGraph, inverted, joined, log_of, points_seen, wrapped
from .tagged import read_tagged
from .toro import ORDER, without_equivalences

KINDS = {
    **dict.fromkeys(("VERTEX2", "VERTEX_SE2", "VERTEX"), "vertices"),
    "VERTEX_XY": "points",
    **dict.fromkeys(("EDGE2", "EDGE", "ODOMETRY"), "edges"),
    "EDGE_SE2": "g2o_edges",
    "BR": "bearing_ranges",
    "LANDMARK": "landmarks",
    "LANDMARK2": "roots",
    "EQUIV": "equivalences",
}
"""Rows of a planar file."""

NOISES = ("auto", "g2o", "toro", "graph", "cov", "root")
"""An edge's numbers: guessed; information by rows or in TORO's order; covariance in TORO's or by rows; a root."""

_SIX = ("n1", "n2", "n3", "n4", "n5", "n6")
_EDGE = ("from", "to", "dx", "dy", "dtheta", *_SIX)
_COLUMNS = {
    "vertices": ("id", "x", "y", "theta"),
    "points": ("id", "x", "y"),
    "edges": _EDGE,
    "g2o_edges": _EDGE,
    "bearing_ranges": ("pose", "id", "bearing", "range", "sd_bearing", "sd_range"),
    "landmarks": ("pose", "id", "x", "y", "cxx", "cxy", "cyy"),
    "roots": ("pose", "id", "x", "y", "rxx", "rxy", "ryy"),
    "equivalences": ("from", "to"),
}


@dataclass(frozen=True)
class Options(FalseLoops, Named):
    """The graph and the meaning of its numbers."""

    path: str | None = option(None, "the file of the graph, or the name of one that ships with GTSAM")
    noise: str = option("auto", "an edge's numbers after its motion, in load2D's names; root: iSAM's", choices=NOISES)


def make(options: Options, rng: np.random.Generator) -> Dataset:  # noqa: ARG001 - files are not random
    """A planar text graph as GTSAM's load2D reads them, such as gtsam[path=example.graph], which ships with it."""
    if options.path is None:
        raise InputError("option path of dataset gtsam is not given, expected the file of a graph: gtsam[path=FILE].")
    path = Path(options.path)
    if not path.exists() and path.parent == Path():
        path = shipped(options.path)
    return read(path, options.noise)


source = Source(make, Options)


def shipped(name: str) -> Path:
    """The file of that name among GTSAM's examples; `name` itself if there is none."""
    import gtsam

    try:
        return Path(gtsam.findExampleDataFile(name))
    except (OSError, RuntimeError, ValueError):
        return Path(name)


def read(
    path: Path,
    noise: str = "auto",
    name: str | None = None,
    notes: Mapping[str, object] | None = None,
    edge_cov: Array | None = None,
) -> Dataset:
    """Reads the log in the file `path`; InputError names the file and line of what is invalid.

    The log's `name` and the `notes` on its source default to the file's. `edge_cov` (3, 3) replaces the covariance of
    every edge, in the body frame of its first pose.
    """
    tables = read_tables(path)
    edges, stated, found = _edges(tables, noise)
    covs = stated if edge_cov is None else np.broadcast_to(edge_cov, stated.shape)
    sightings, z, z_cov = _sightings(tables, noise)
    graph = PoseGraph(path, tables["vertices"], tables["points"], edges, covs, sightings, z, z_cov, shared_ids=False)
    said = {"source": f"the text graph {path.name}, as GTSAM reads it", "licence": "not stated in the file"}
    counted = {
        "covariances": "GTSAM's are in the body frame after a motion, converted to the one before it",
        "edge_noise": ", ".join(found) or "no edges",
        **without_equivalences(tables["equivalences"]),
    }
    return Dataset(log_of(graph, name or path.stem, notes={**said, **(notes or {}), **counted}), None)


def read_tables(path: Path) -> dict[str, Table]:
    """Reads the rows of the file `path`, a table for each of `KINDS`; InputError as from `read`."""
    return read_tagged(path, KINDS, _COLUMNS, ("VERTEX3", "EDGE3", "VERTEX_SE3:QUAT", "EDGE_SE3:QUAT"))


def _edges(tables: Mapping[str, Table], noise: str) -> tuple[Table, Array, list[str]]:
    """The edges, their covariances before the motion, and the meaning of their numbers."""
    rows = [tables["edges"], tables["g2o_edges"]]
    kinds = [noise] * 2
    if noise == "auto":
        kinds = ["root"] * 2 if len(tables["roots"].rows) else [_guess(rows[0]), "g2o"]
    covs = [_covariance(table, table.rows[:, 5:], kind) for table, kind in zip(rows, kinds, strict=True)]
    edges, order = joined(rows, 5)
    cov = np.concatenate(covs)[order]
    found = [kind for table, kind in zip(rows, kinds, strict=True) if len(table.rows)]
    return edges, before_motion(wrapped(edges, "dtheta")[:, 2:], cov), found


def _guess(table: Table) -> str:
    """Guesses the meaning of the edges' numbers from the zeros of the first row, as load2D does."""
    if not len(table.rows):
        return "cov"
    zeros = (table.rows[0, 5:] == 0).nonzero()[0].tolist()
    found = [kind for kind, where in _ZEROS.items() if where == zeros]
    if not found:
        wanted = "expected option noise to say what they are: gtsam[path=...,noise=...]"
        raise table.fault(0, f"the six numbers of an edge have no zeros from which to guess their order, {wanted}")
    return found[0]


_ZEROS = {"graph": [1, 4, 5], "cov": [1, 2, 4]}


def _covariance(table: Table, numbers: Array, kind: str) -> Array:
    """(r, k, k) in the frame of the source, from the numbers of a triangle (r, k (k + 1) / 2)."""
    matrices = symmetric(numbers[:, ORDER] if kind in ("toro", "graph") else numbers)
    if kind in ("g2o", "toro"):
        return inverted(table, matrices)
    if kind == "root":
        with np.errstate(all="ignore"):
            root = np.triu(matrices)
            return inverted(table, product(root.swapaxes(1, 2), root))
    return matrices


def _sightings(tables: Mapping[str, Table], noise: str) -> tuple[Table, Array, Array]:
    """The sightings in the order of the file, range and bearing (s, 2), and (s, 2, 2)."""
    direct, landmarks, roots = (tables[kind] for kind in ("bearing_ranges", "landmarks", "roots"))
    with np.errstate(all="ignore"):  # overflow is reported, with its line, when the log is checked
        sd = direct.rows[:, [5, 4]]
        parts = [
            (wrapped(direct, "bearing")[:, [3, 2]], sd[:, :, None] ** 2 * np.eye(2)),
            points_seen(landmarks, _covariance(landmarks, landmarks.rows[:, 4:], "root" if noise == "root" else "cov")),
            points_seen(roots, _covariance(roots, roots.rows[:, 4:], "root")),
        ]
    sightings, order = joined([direct, landmarks, roots], 2)
    z, cov = (np.concatenate(column)[order] for column in zip(*parts, strict=True))
    return sightings, z, cov
