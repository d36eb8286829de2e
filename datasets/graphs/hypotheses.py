"""Reads pose graphs whose edges have several hypotheses, as GTSAM's hybrid examples do.

    EDGE2 i 1 j 0 n  dx dy dtheta  ...              n measurements of pose j in the body frame of pose i

At most one of them is right. The file states no noise. A log takes a further hypothesis of a motion as a loop closure
to the step before, and the truth marks those that are false.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...core.csv_values import no_number, number, shortened
from ...core.errors import InputError
from ...core.factors import Dataset, Truth
from ...core.se2 import Array, Ints, between, wrap
from ...core.table import LARGEST, MOST, Table, text
from ..formats.pose_graph import PoseGraph, log_of, loop_edges

ALL, FIRST, TRUE = CHOICES = ("all", "first", "true")
"""Which hypotheses a log has: all of them, the first of each edge, or the one nearest to the truth."""

_COLUMNS = ("from", "to", "dx", "dy", "dtheta")
_TAG, _HEAD = "EDGE2", 6  # the words before the first measurement


class Hypotheses(NamedTuple):
    """All measurements of a file, in its order."""

    edges: Table  # from to dx dy dtheta, a row each
    edge: Ints  # (m,) the line's number among the edges: those of one edge are hypotheses


def read_hypotheses(path: Path) -> Hypotheses:
    """Reads the file `path`; InputError names the line of what is invalid."""
    rows, edge, lines = list[list[float]](), list[int](), list[int]()
    count = 0
    for line, content in enumerate(text(path).split("\n"), start=1):
        words = content.split()
        if not words or words[0].startswith("#"):
            continue
        ends, measured = _row(path, line, words)
        rows += [[*ends, *measured[k : k + 3]] for k in range(0, len(measured), 3)]
        edge += [count] * (len(measured) // 3)
        lines += [line] * (len(measured) // 3)
        count += 1
    table = Table(path, _COLUMNS, np.array(rows).reshape(-1, 5), np.array(lines, np.int64))
    return Hypotheses(table.finite().bounded(-LARGEST, LARGEST, "dx", "dy"), np.array(edge, np.int64))


def log_and_truth(
    found: Hypotheses, poses: Array, cov: Array, choice: str, name: str, notes: Mapping[str, object]
) -> Dataset:
    """The log of the chosen hypotheses, each with the covariance `cov` (3, 3), and the true `poses` (n, 3)."""
    graph = _graph(found.edges, cov)
    ids = graph.ids()
    if len(ids) != len(poses):
        raise InputError(f"{graph.path}: found {len(ids)} poses, but {len(poses)} true ones.")
    first, last = (np.searchsorted(ids, found.edges.whole(end)) for end in ("from", "to"))
    error = found.edges.rows[:, 2:] - between(poses[first], poses[last])
    error[:, 2] = wrap(error[:, 2])
    squared = np.einsum("ri,ij,rj->r", error, np.linalg.inv(cov), error)
    order = np.lexsort((squared, found.edge))
    begins = np.flatnonzero(np.diff(found.edge, prepend=-1))
    right = np.zeros(len(error), bool)
    right[order[begins]] = True
    is_first = np.zeros(len(error), bool)
    is_first[begins] = True

    kept = np.flatnonzero({ALL: np.ones(len(error), bool), FIRST: is_first, TRUE: right}[choice])
    graph = _graph(found.edges.take(kept), cov)
    several = np.bincount(found.edge) > 1
    counted = {
        "hypotheses": f"{choice}, of {several.sum()} edges that have several; the first is the true one of "
        f"{(right & is_first & several[found.edge]).sum()}"
    }
    log = log_of(graph, name, notes={**notes, **counted})
    false = np.flatnonzero(~right[kept[loop_edges(graph)]])
    return Dataset(log, Truth(log.t, poses, false_loops=false if choice == ALL else None))


def _graph(edges: Table, cov: Array) -> PoseGraph:
    path, nothing = edges.path, np.zeros(0, np.int64)
    vertices = Table(path, ("id", "x", "y", "theta"), np.zeros((0, 4)), nothing)
    points = Table(path, ("id", "x", "y"), np.zeros((0, 3)), nothing)
    sightings = Table(path, ("pose", "id"), np.zeros((0, 2)), nothing)
    covs = np.broadcast_to(cov, (len(edges.rows), 3, 3))
    return PoseGraph(path, vertices, points, edges, covs, sightings, np.zeros((0, 2)), np.zeros((0, 2, 2)))


def _row(path: Path, line: int, words: list[str]) -> tuple[list[float], list[float]]:
    """The two poses of a line, and its measurements one after the other."""
    where = f"{path}, line {line}:"
    if words[0] != _TAG:
        raise InputError(f"{where} found {shortened(words[0])}, expected {_TAG}.")
    values = list[float]()
    for word in words[1:]:
        if (value := number(word)) is None:
            raise InputError(f"{where} a number {no_number(word)}.")
        values.append(value)
    if len(words) < _HEAD or (count := values[4]) * 3 != len(words) - _HEAD or count < 1:
        raise InputError(
            f"{where} found {len(words)} words, expected {_TAG}, a pose, 1, another pose, 0, the number of "
            "hypotheses, at least 1, and three numbers for each."
        )
    for value in (values[0], values[2]):
        if not (0 <= value <= MOST and value == int(value)):
            raise InputError(f"{where} a pose is {value!s}, expected a whole number, 0 or more.")
    return [values[0], values[2]], values[5:]
