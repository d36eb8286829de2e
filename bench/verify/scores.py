"""Computes the scores of cells again from their path files, without their backends.

Errors of paths against the truth made here; of online paths the NEES by the covariances that the record has.
"""

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from ...core.arrays import length
from ...core.errors import InputError
from ...core.factors import Map
from ...core.se2 import Array
from ...core.truth.doubts import headings_known, judges
from ...core.truth.tum import read_tum
from ..measure.accuracy import path_accuracy, stretches
from ..measure.nees import nees, nees_columns
from ..measure.relations import relation_columns
from ..record.schema import label
from ..record.store import Store
from ..words.numerals import counted
from .folder import HOLDS, OPEN, Finding, ResultsFolder, faults
from .logs import TrustedLog

TOLERANCE = 1e-6
"""Share by which a score may differ from the one computed again: the same path, on another processor."""

ROUNDED = 1e-9  # m, rad or of a share: what is smaller is rounding

NO_MAP = Map(np.zeros(0, np.int64), np.zeros((0, 2)), None)


def check_scores(found: ResultsFolder, trusted: Mapping[str, TrustedLog]) -> list[Finding]:
    """Scores every cell that is done on a trusted log again."""
    wrong, scored, values, unscored = list[str](), 0, 0, 0
    slugs: dict[str, str] = found.run["folders"]
    with Store(found.folder) as store:
        for cell in found.cells:
            log, c = trusted.get(cell.log_label), cell.row.columns
            if c["status"] != "done":
                continue
            if log is None or log.dataset.truth is None:
                unscored += 1
                continue
            dataset, options, backend, more, seed = cell.row.key
            place = found.folder / slugs[label(dataset, options)] / str(seed) / slugs[label(backend, more)]
            try:
                there = [path for name in ("online", "final") if (path := place / f"{name}.tum").is_file()]
                paths = {path.stem: read_tum(path) for path in there}
                again = scores(log, paths, store.arrays(cell.row, ("t", "at", "cov", "online")))
            except InputError as error:
                wrong.append(str(error))
                continue
            scored, values = scored + 1, values + len(again)
            wrong += [f"{cell}: {said}" for said in different(c, again)]
    said = faults("scores", [f"{one.removesuffix('.')}." for one in wrong])
    if scored and not wrong:
        what = f"{counted(values, 'score')} of {counted(scored, 'cell')} computed again from the paths"
        said.append(Finding("scores", HOLDS, f"{what}: the same to one part in a million."))
    if unscored:
        said.append(Finding("scores", OPEN, f"{counted(unscored, 'cell')} on logs that were not made again here."))
    return said


def scores(log: TrustedLog, paths: Mapping[str, tuple[Array, Array]], arrays: Mapping[str, Any]) -> dict[str, Any]:
    """Computes the columns of a cell's paths, times (n,) and poses (n, 3) by name. InputError for a path of other
    times than the log's."""
    truth = log.dataset.truth
    assert truth is not None
    t, judged, row = log.dataset.log.t, truth, dict[str, Any]()
    if log.dataset.log.prior.start != "known" and "at" in arrays:  # steps count from the fix on
        counts = np.isin(truth.t, t[arrays["at"]])
        judged = truth._replace(t=truth.t[counts], poses=truth.poses[counts])
    at = np.searchsorted(t, judged.t)
    headings = headings_known(log.dataset.log, truth)
    over = stretches(judged, timed=length(t) is not None, headings=headings) if len(at) else {}
    for name, (times, path) in paths.items():
        if not np.array_equal(times, t):
            raise InputError(f"the {name} path has other times than the log, expected one pose for each of its steps")
        prefix = "final_" if name == "final" else ""
        if truth.relations is not None:
            row |= {prefix + column: value for column, value in relation_columns(truth.relations, path).items()}
        if len(at):
            errors = path_accuracy(judged, path[at], NO_MAP, over, headings=headings).row
            row |= {prefix + column: value for column, value in errors.items() if column != "map_rmse_m"}
    if "online" in paths and len(truth.t) and "cov" in arrays and judges(log.dataset.log, truth):
        values = nees(paths["online"][1][at], arrays["cov"][at], judged.poses)
        row |= nees_columns("nees", values, 3)
    return {name: value for name, value in row.items() if value is not None}


def different(row: Mapping[str, Any], again: Mapping[str, Any]) -> Iterator[str]:
    """Yields a sentence for each score that is not the one computed again."""
    for name, value in again.items():
        said = row[name]
        if said is None or not math.isclose(said, value, rel_tol=TOLERANCE, abs_tol=ROUNDED):
            yield f"{name} is {'none' if said is None else f'{said:.6g}'}, its path gives {value:.6g}"
