"""Writes the files of a run's folder from its record: cells.csv, metrics.csv, run.json, and paths that evo reads."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.files import csv_text, number_rows, replaced, write_whole
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


def _constants(row: Row, arrays: dict[str, Any]) -> Iterator[list[Any]]:
    for one in arrays.get("constants", np.zeros((0, 5))):
        kind, landmark = int(one[0]), None if one[1] == OF_ALL else int(one[1])
        yield [*row.key, KINDS[kind], UNITS[kind], landmark, *_blank(one[2:])]


def _export_cell(place: Path, arrays: dict[str, Any], truth: dict[str, Any]) -> None:
    place.mkdir(parents=True, exist_ok=True)
    if "online" in arrays:
        write_tum(place / "online.tum", arrays["t"], arrays["online"])
        with replaced(place / "steps.csv") as part, part.open("w", encoding="utf-8", newline="\n") as file:
            file.write(",".join(STEPS) + "\n")
            file.writelines(_steps(arrays, truth))
    if "final" in arrays:
        write_tum(place / "final.tum", arrays["t"], arrays["final"])
    prefix = "final_map" if "final_map_ids" in arrays else "map"
    if f"{prefix}_ids" not in arrays:
        return
    ids, xy, cov = arrays[f"{prefix}_ids"], arrays[f"{prefix}_xy"], arrays.get(f"{prefix}_cov")
    blocks = np.full((len(ids), 3), np.nan) if cov is None else cov[:, [0, 0, 1], [0, 1, 1]]
    rows = ([i, *_blank(p), *_blank(b)] for i, p, b in zip(ids.tolist(), xy, blocks, strict=True))
    write_whole(place / "map.csv", csv_text(MAP, rows))


def _steps(arrays: dict[str, Any], truth: dict[str, Any]) -> Iterator[str]:
    """Yields the lines of steps.csv, many in a text."""
    n = len(arrays["t"])
    error, consistency = np.full((2, n), np.nan)

    def known(name: str) -> Array:
        return arrays.get(name, np.full(n, np.nan))  # an earlier version's record may lack some

    if "aligned" in arrays:
        error[arrays["at"]] = np.hypot(*(arrays["aligned"] - poses_judged(truth, arrays))[:, :2].T)
    if "nees" in arrays:
        consistency[arrays["at"]] = arrays["nees"]
    cov = arrays.get("cov", np.full((n, 3, 3), np.nan))[:, *np.triu_indices(3)]
    numbers = [arrays["t"], *arrays["online"].T, *cov.T, error, consistency, known("nis")]
    dof, ancestors, refused = (_counts(known(name)) for name in ("nis_dof", "ancestors", "refused"))
    after = [known("n_eff"), *(known(name) / 1e3 for name in ("step_ns", "wall_ns", "belief_ns"))]
    floats = [[np.asarray(column, float) for column in columns] for columns in (numbers, after)]
    return number_rows([np.arange(n), *floats[0], dof, *floats[1], ancestors, refused])


def _counts(values: Array) -> NDArray[np.int64]:
    """Whole numbers; those that are not finite, or beyond 64 bits, are masked."""
    unknown = ~(np.abs(values) < 2.0**63)
    return np.ma.array(np.where(unknown, 0, values).astype(np.int64), mask=unknown)


def _blank(values: Array) -> list[float | None]:
    return [None if value != value else value for value in values.tolist()]
