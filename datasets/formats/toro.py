"""Reads planar graphs in TORO's text format.

    VERTEX2 id x y theta                                             an optimiser's initial value: not used
    EDGE2 i j dx dy dtheta Iff Ifs Iss Irr Ifr Isr                   pose j in the body frame of pose i
    EQUIV i j                                                        poses that TORO merges first: a remark

G. Grisetti, C. Stachniss and W. Burgard, "Nonlinear constraint network optimization for efficient map learning", IEEE
Trans. Intelligent Transportation Systems 10(3), 2009. f is forward, s sideways, r the rotation: note the order. TORO's
error is the difference of Xi Z and Xj, in the world, weighted by R(theta_i) I R(theta_i)': its information is in the
body frame before the motion, as ours is. That of GTSAM, which reads such files too, is in the one after it; for the
usual numbers, the same forward as sideways and neither correlated with the rotation, both are the same.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...core.errors import InputError
from ...core.factors import REMARKS, Dataset
from ...core.options import option
from ...core.small_matrices import symmetric
from ...core.table import Table
from ..false_loops import FalseLoops
from ..registry import Named, Source
from .pose_graph import PoseGraph, inverted, log_of
from .tagged import read_tagged

KINDS = {"VERTEX2": "vertices", "VERTEX": "vertices", "EDGE2": "edges", "EDGE": "edges", "EQUIV": "equivalences"}
"""Rows of a planar file."""

ORDER = [0, 1, 4, 2, 5, 3]
"""Positions among TORO's six numbers of a triangle row by row: ff fs fr, ss sr, rr."""

_COLUMNS = {
    "vertices": ("id", "x", "y", "theta"),
    "edges": ("from", "to", "dx", "dy", "dtheta", "Iff", "Ifs", "Iss", "Irr", "Ifr", "Isr"),
    "equivalences": ("from", "to"),
    "points": ("id", "x", "y"),
    "sightings": ("pose", "id"),
}


@dataclass(frozen=True)
class Options(FalseLoops, Named):
    """Which graph."""

    path: str | None = option(None, "the file of the graph")


def make(options: Options, rng: np.random.Generator) -> Dataset:  # noqa: ARG001 - files are not random
    """A graph in TORO's format, poses in the plane: toro[path=FILE]."""
    if options.path is None:
        raise InputError("option path of dataset toro is not given, expected the file of a graph: toro[path=FILE].")
    return read(Path(options.path))


source = Source(make, Options)


def read(path: Path) -> Dataset:
    """Reads the log in the TORO file `path`; InputError names the file and line of what is invalid."""
    tables = read_tagged(path, KINDS, _COLUMNS, ("VERTEX3", "EDGE3"))
    edges = tables["edges"]
    cov = inverted(edges, symmetric(edges.rows[:, 5:][:, ORDER]))
    nothing = np.zeros((0, 2)), np.zeros((0, 2, 2))
    graph = PoseGraph(path, tables["vertices"], tables["points"], edges, cov, tables["sightings"], *nothing)
    notes = {
        "source": f"the TORO file {path.name}",
        "licence": "not stated in the file",
        "covariances": "TORO's are in the body frame before a motion, as ours are",
        **without_equivalences(tables["equivalences"]),
    }
    return Dataset(log_of(graph, path.stem, notes=notes), None)


def without_equivalences(table: Table) -> dict[str, Any]:
    """The notes of a log on EQUIV rows: a log has no place for poses that are the same."""
    left = len(table.rows)
    said = f"{table.path}: the EQUIV rows ({left}), of poses that TORO merges, are not used"
    return {"equivalences_not_used": left} | ({REMARKS: [said]} if left else {})
