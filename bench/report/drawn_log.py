"""Chooses the log that a dataset's figures show: the known path, and every backend's run along it."""

import math
from collections.abc import Hashable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ...core.arrays import length
from ...core.beside import Clouds, Scans
from ...core.se2 import Array
from ..record.schema import Row
from ..record.store import Store
from ..verdict.ranking import path_errors
from ..verdict.statistics import Comparison
from ..verdict.summary import Line, logs
from ..words.names import short
from ..words.styles import BASELINE, Look


class Trace(NamedTuple):
    """One backend's cell, as drawn."""

    label: str
    slug: str  # the label as it is in paths
    look: Look
    alone: bool  # no other cell ran at the same time
    arrays: Mapping[str, Any]  # as in the record


class DrawnLog(NamedTuple):
    """One log of a dataset: of those on which most backends are done, the one with errors nearest to the medians.

    Where the true path is known of some logs alone, it is one of them.
    """

    kind: str  # what is known of the true path: "truth", "reference", "relations" or "" for nothing
    seed: int
    known: Mapping[str, Any]  # the log's arrays: t, poses, ids, xy; empty where no path is known
    traces: Sequence[Trace]
    missing: Sequence[str]  # the backends that have no cell to draw
    lengths: Mapping[int, float | None]  # s that each seed's log covers; None where its times are no times
    lines: Sequence[Line] = ()  # the dataset's, over all its logs
    looks: Mapping[str, Look] = {}  # by backend
    comparisons: Mapping[str, Sequence[Comparison]] = {}  # the verdict's, by column
    order: Sequence[str] = ()  # the backends, the lowest median error first
    nees: Mapping[str, Sequence[tuple[Array, Array]]] = {}  # by backend, times and NEES of one run on every log
    units: Mapping[str, Sequence[Hashable]] = {}  # of each of these runs, as in the verdict
    nis: Mapping[str, Sequence[tuple[Array, Array, Array]]] = {}  # the same of NIS, with its degrees of freedom
    logs: int = 1  # different ones that the dataset has
    name: str = ""  # of the log, where the dataset names its logs
    typical: bool = False  # the log was chosen among several by its errors
    scans: Scans | None = None  # of a laser log
    clouds: Clouds | None = None  # of a depth camera's

    @property
    def clock(self) -> str:
        """The label of the time axis."""
        return "step" if self.lengths.get(self.seed) is None else "time, s"

    @property
    def which(self) -> str:
        """Says which of the logs is drawn; "" where there is one."""
        if self.logs == 1:
            return ""
        return (
            f"seed {self.seed}" + f", {self.name}" * bool(self.name) + ", the log nearest to the medians" * self.typical
        )


def drawn_log(
    store: Store,
    lines: Sequence[Line],
    looks: Mapping[str, Look],
    slugs: Mapping[str, str],
    comparisons: Mapping[str, Sequence[Comparison]] | None = None,
) -> DrawnLog | None:
    """Chooses the log of a dataset's lines; None where no cell is done."""
    done = [(line, row) for line in lines for row in line.rows if row.columns["status"] == "done"]
    if not done:
        return None
    of_path = [(line, row) for line, row in done if row.columns["truth_kind"] == line.truth_kind]
    seed, typical = _drawn(of_path or done)
    shown = [(line, row) for line, row in done if row.columns["seed"] == seed]
    first = {row.columns["seed"]: row for _, row in reversed(done)}  # of each log
    nees = {line.backend: _nees(store, line) for line in lines}
    return DrawnLog(
        kind=lines[0].truth_kind,
        seed=seed,
        known=store.truth(shown[0][1]),
        traces=[
            Trace(name, slugs[name], looks[name], bool(row.columns["timing_alone"]), store.arrays(row))
            for name, row in ((line.backend, row) for line, row in shown)
        ],
        missing=[line.backend for line in lines if all(line is not drawn for drawn, _ in shown)],
        lengths={seed: length(store.arrays(row, ("t",)).get("t", np.zeros(0))) for seed, row in first.items()},
        lines=lines,
        looks=looks,
        comparisons=comparisons or {},
        order=[line.backend for line in sorted(lines, key=_error)],
        nees={backend: [*runs.values()] for backend, runs in nees.items()},
        units={line.backend: [line.units.unit(log) for log in nees[line.backend]] for line in lines},
        nis={line.backend: found for line in lines if (found := _nis(store, line))},
        logs=logs(lines),
        name=short(shown[0][1].columns["log_name"] or ""),
        typical=typical,
        scans=store.scans(shown[0][1]),
        clouds=store.clouds(shown[0][1]),
    )


def _drawn(done: Sequence[tuple[Line, Row]]) -> tuple[int, bool]:
    """The seed that is drawn, and True if errors chose it."""
    by_seed: dict[int, list[tuple[Line, Row]]] = {}
    for line, row in done:
        by_seed.setdefault(row.columns["seed"], []).append((line, row))
    most = max(map(len, by_seed.values()))
    off = {seed: _off(cells) for seed, cells in by_seed.items() if len(cells) == most}
    seed = min(off, key=lambda seed: (off[seed], seed))
    return seed, len(set(off.values())) > 1


def _off(cells: Sequence[tuple[Line, Row]]) -> float:
    """The distance of the cells' errors from their medians: the sum of absolute log ratios."""
    total = 0.0
    for line, row in cells:
        online, final = path_errors(line.truth_kind).values()
        column = online if row.columns[online] is not None else final
        error, middle = row.columns[column], line.values[column].median if column in line.values else 0.0
        if line.backend != BASELINE and error is not None and middle > 0 and 0 < error / middle < math.inf:
            total += abs(math.log(error / middle))
    return total


def _error(line: Line) -> tuple[int, float]:
    """Ranks lines: those that lost no run first, then by their median error."""
    names = (*path_errors(line.truth_kind).values(), "map_rmse_m")
    medians = [line.values[name].median for name in names if name in line.values]
    return len(line.rows) - line.done, medians[0] if medians else np.inf


def _nees(store: Store, line: Line) -> dict[str, tuple[Array, Array]]:
    """Reads NEES of the first run that has it, by log: several on one log are not independent."""
    by_log: dict[str, tuple[Array, Array]] = {}
    for row in line.rows:
        if row.columns["nees"] is not None and row.columns["digest"] not in by_log:
            arrays = store.arrays(row, ("t", "at", "nees"))
            if "nees" in arrays and "at" in arrays:
                by_log[row.columns["digest"]] = arrays["t"][arrays["at"]], arrays["nees"]
    return by_log


def _nis(store: Store, line: Line) -> list[tuple[Array, Array, Array]]:
    """Reads NIS of each log's first run that has it: s since the log began, NIS and degrees of freedom."""
    by_log: dict[str, tuple[Array, Array, Array]] = {}
    for row in line.rows:
        if row.columns["nis"] is not None and row.columns["digest"] not in by_log:
            a = store.arrays(row, ("t", "nis", "nis_dof"))
            if len(a) == 3:
                seen = (a["nis_dof"] > 0) & np.isfinite(a["nis"])
                by_log[row.columns["digest"]] = (a["t"] - a["t"][0])[seen], a["nis"][seen], a["nis_dof"][seen]
    return list(by_log.values())
