"""Simulated pose graphs with their truth, of iSAM's repository: Manhattan, City10000 and CityTrees10000.

M. Kaess et al., iSAM2: incremental smoothing and mapping using the Bayes tree, IJRR 31(2), 2012, measures with them.
Each is a text graph (`gtsam_text`) whose covariances are roots of the information, beside a file of the same rows
without noise. The walks are on a grid, so that the truth is exact. Measured against it, errors are as stated: chi2 is
1.03, 1.00 and 0.99 of its degrees of freedom. iSAM's residual is in the body frame before a motion, GTSAM's in that
after it; a motion's noise is the same in x and y here, so that both read the same.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...core.errors import InputError
from ...core.factors import Dataset, Truth
from ...core.options import option
from ...core.table import Table
from ..false_loops import FalseLoops
from ..formats import gtsam_text
from ..graphs.grid_walk import standing, walked
from ..hidden_ids import HiddenIds
from ..redrawn import Drawn
from ..registry import Source
from .catalogue import PUBLISHED, fetched, place


@dataclass(frozen=True)
class Copy:
    """Which file."""

    path: str | None = option(
        None, "the file of the graph, with its truth, NAME_groundtruth.txt, beside it; not given: that of bench fetch"
    )


@dataclass(frozen=True)
class Graph(Drawn, FalseLoops, Copy):
    """A graph with loop closures."""


@dataclass(frozen=True)
class Trees(Drawn, HiddenIds, Copy):
    """A graph with landmarks."""


def read(path: Path, name: str) -> Dataset:
    """Reads the graph `path` and the truth beside it; InputError names the file and line of what is invalid."""
    published = PUBLISHED[name]
    notes = {
        "source": f"{path.name} of iSAM's repository; {published.citation}",
        "licence": published.licence,
        "truth": "the poses and landmarks of the simulation, which are on a grid",
    }
    log = gtsam_text.read(path, "root", name, notes).log
    graph, right = gtsam_text.read_tables(path), gtsam_text.read_tables(_beside(path, name))
    for kind in ("edges", "landmarks"):
        _check_same(graph[kind], right[kind])
    walk = walked(right["edges"])
    trees = standing(walk, right["landmarks"]) if len(right["landmarks"].rows) else None
    return Dataset(log, Truth(log.t, walk.poses, trees))


def _beside(path: Path, name: str) -> Path:
    """The file of the truth beside that of a graph: as it is called in the repository, or in a copy of it."""
    published, stem = PUBLISHED[name], path.name.partition(".")[0]
    known = next(iter(published.files)).partition(".")[0]
    endings = [file.removeprefix(known) for file in (*published.files, *published.also) if file.startswith(f"{known}_")]
    found = [file for ending in endings if (file := path.with_name(stem + ending)).is_file()]
    if not found:
        raise InputError(f"{path}: found no {stem}{endings[0]} beside it, expected the truth there.")
    return found[0]


def _check_same(graph: Table, right: Table) -> None:
    """Raises InputError where a truth is of other edges or sightings than its graph."""
    if len(graph.rows) != len(right.rows):
        raise InputError(f"{right.path}: found {len(right.rows)} rows of {graph.path.name}'s {len(graph.rows)}.")
    for row in np.flatnonzero((graph.rows[:, :2] != right.rows[:, :2]).any(axis=1)):
        first, last = graph.rows[row, :2].astype(int).tolist()
        raise right.fault(row, f"expected that of {first} and {last}, as in {graph.path.name}")


def _source(name: str, summary: str, options: type[Copy]) -> Source:
    file = next(iter(PUBLISHED[name].files))

    def make(options: Any, rng: np.random.Generator) -> Dataset:  # noqa: ARG001 - files are not random
        given = None if options.path is None else Path(options.path)
        return read(given or fetched(name, f"{name}[path=FILE]") / file, name)

    def files(options: Any) -> Sequence[Path]:
        return [Path(options.path) if options.path is not None else place(name) / file]

    make.__doc__ = summary
    return Source(make, options, files=files)


manhattan = _source(
    "manhattan", "Manhattan: Olson's simulated walk, 3,500 poses, 2,099 loop closures, true path.", Graph
)
city10000 = _source("city10000", "City10000: a simulated walk, 10,000 poses, 10,688 loop closures, true path.", Graph)
city_trees10000 = _source(
    "city-trees10000", "CityTrees10000: a simulated walk, 10,000 poses, 4,443 sightings of 100 trees, all true.", Trees
)
