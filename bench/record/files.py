"""Writes the files of a run's folder from its record: cells.csv, metrics.csv, run.json, and paths that evo reads."""

import json
from collections.abc import Iterable, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from ...core.files import csv_text, write_whole
from ...core.se2 import Array
from ...core.truth.tum import write_tum
from ..measure.constants import KINDS, OF_ALL, UNITS
from ..measure.locating import poses_judged
from ..measure.misfit import TERMS
from .rounds import as_table
from .schema import COLUMNS, KEY, MORE, ROUND, Row, label
from .store import Store

STEPS = (
    "step", "t", "x", "y", "heading", "cxx", "cxy", "cxt", "cyy", "cyt", "ctt",
    "error_m", "nees", "nis", "nis_dof", "n_eff", "step_us", "wall_us", "belief_us", "ancestors", "refused",
)  # fmt: skip
"""The columns of steps.csv: error_m is of the aligned path; blank where not known."""

COST = (*KEY, "path", *TERMS, "total")  # the columns of cost.csv; path: final or online

CONSTANTS = (*KEY, "constant", "unit", "landmark", "value", "sd", "true")
"""The columns of constants.csv; landmark: blank for an error that all have."""

MAP = ("id", "x", "y", "cxx", "cxy", "cyy")


def export(store: Store, folder: Path | None = None) -> None:
    """Writes every file of the run's folder again, there or into another `folder`."""
    run, folder, rows = store.run(), folder or store.folder, list(store.cells())
    slugs: dict[str, str] = run["folders"]
    write_whole(folder / "run.json", json.dumps(run, indent=2) + "\n")
    write_whole(folder / "cells.csv", csv_text(COLUMNS, ([row.columns[name] for name in COLUMNS] for row in rows)))
    write_whole(
        folder / "metrics.csv", csv_text((*KEY, *MORE), ([row.columns[name] for name in (*KEY, *MORE)] for row in rows))
    )
    write_whole(
        folder / "times.csv", csv_text((*KEY, *ROUND), (line for r in rows for line in as_table(r.rounds, r.key)))
    )
    terms: list[list[Any]] = []
    estimated: list[list[Any]] = []
    for row in rows:
        c = row.columns
        place = folder / slugs[label(c["dataset"], c["dataset_options"])] / str(c["seed"])
        truth = store.truth(row)
        if truth and not (place / "truth.tum").exists():
            place.mkdir(parents=True, exist_ok=True)
            write_tum(place / "truth.tum", truth["t"], truth["poses"])
        if c["status"] == "done":
            arrays = store.arrays(row)
            _export_cell(place / slugs[label(c["backend"], c["options"])], arrays, truth)
            terms += _terms(row, arrays)
            estimated += _constants(row, arrays)
    write_whole(folder / "cost.csv", csv_text(COST, terms))
    write_whole(folder / "constants.csv", csv_text(CONSTANTS, estimated))


def _terms(row: Row, arrays: dict[str, Any]) -> list[list[Any]]:
    if "cost_terms" not in arrays:
        return []
    values = arrays["cost_terms"].tolist()
    return [[*row.key, "final" if "final" in arrays else "online", *values, sum(values)]]


def _constants(row: Row, arrays: dict[str, Any]) -> Iterable[list[Any]]:
    for one in arrays.get("constants", np.zeros((0, 5))):
        kind, landmark = int(one[0]), None if one[1] == OF_ALL else int(one[1])
        yield [*row.key, KINDS[kind], UNITS[kind], landmark, *_blank(one[2:])]


def _export_cell(place: Path, arrays: dict[str, Any], truth: dict[str, Any]) -> None:
    place.mkdir(parents=True, exist_ok=True)
    if "online" in arrays:
        write_tum(place / "online.tum", arrays["t"], arrays["online"])
        write_whole(place / "steps.csv", csv_text(STEPS, _steps(arrays, truth)))
    if "final" in arrays:
        write_tum(place / "final.tum", arrays["t"], arrays["final"])
    prefix = "final_map" if "final_map_ids" in arrays else "map"
    if f"{prefix}_ids" not in arrays:
        return
    ids, xy, cov = arrays[f"{prefix}_ids"], arrays[f"{prefix}_xy"], arrays.get(f"{prefix}_cov")
    blocks = np.full((len(ids), 3), np.nan) if cov is None else cov[:, [0, 0, 1], [0, 1, 1]]
    rows = ([i, *_blank(p), *_blank(b)] for i, p, b in zip(ids.tolist(), xy, blocks, strict=True))
    write_whole(place / "map.csv", csv_text(MAP, rows))


def _steps(arrays: dict[str, Any], truth: dict[str, Any]) -> Iterable[Sequence[Any]]:
    n = len(arrays["t"])
    error, consistency = np.full((2, n), np.nan)

    def known(name: str) -> Array:
        return arrays.get(name, np.full(n, np.nan))  # an earlier version's record may lack some

    if "aligned" in arrays:
        error[arrays["at"]] = np.hypot(*(arrays["aligned"] - poses_judged(truth, arrays))[:, :2].T)
    if "nees" in arrays:
        consistency[arrays["at"]] = arrays["nees"]
    cov = arrays.get("cov", np.full((n, 3, 3), np.nan))[:, *np.triu_indices(3)]
    table = np.column_stack((arrays["t"], arrays["online"], cov, error, consistency, known("nis")))
    clocks = (known(name) / 1e3 for name in ("step_ns", "wall_ns", "belief_ns"))
    after = np.column_stack((known("n_eff"), *clocks))
    inside = np.column_stack([known(name) for name in ("nis_dof", "ancestors", "refused")])
    for k in range(n):
        dof, *counts = (int(count) if isfinite(count) else None for count in inside[k].tolist())
        yield k, *_blank(table[k]), dof, *_blank(after[k]), *counts


def _blank(values: Array) -> list[float | None]:
    return [None if value != value else value for value in values.tolist()]
