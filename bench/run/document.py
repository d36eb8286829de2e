"""A run as one JSON document: what `bench run --json` prints."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from ..measure.repeats import COMPARED
from ..record.schema import Row
from ..verdict.costs import cost
from ..verdict.summary import Line, units_of
from ..verdict.verdict import Verdict

ESTIMATES = (
    "ate_m", "final_ate_m", "relation_m", "relation_deg", "final_relation_m", "final_relation_deg",
    "heading_rad", "map_rmse_m", "final_map_rmse_m", "nees", "nees_inside", "step_us_p50",
    "step_us_p99", "cpu_s",
)  # fmt: skip
"""columns whose medians over the logs are given"""

SCHEMA = """\
folder, report    where everything is, and its page
status            the exit status
datasets          one each:
  dataset, name   its label, and its display name
  truth_kind      "truth", of all logs or of some, "relations", "reference" or ""
  logs            the number of different ones
  units           the number of independent ones: of clusters, else of logs
  cluster         the one that all logs are of, else null
  remarks         [text], what is legal in them yet odd
  verdict         basis: text, uses: [{purpose, backend, why}], sentences: [text],
                  comparisons: {column: [{first, second, n, closer, ratio, low,
                  high, p, adjusted, effect, units}]},
                  costs: {column: [{first, second, ratio, low, high, logs,
                  rounds}]}, of backends timed in rounds
  lines           one per backend: backend, implementation, done, cells,
                  timing_alone, estimates: {column: {value, low,
                  high, n, units}}, costs: {column: {value, low, high,
                  logs, rounds}}, geometric means over logs and rounds
cells             one each, by column of cells.csv and of metrics.csv
remarks           on a given map, and on logs that are not there

An estimate is the median over n logs of so many units with its 95 %
interval, whose ends are null where there are too few. Errors are infinite where the backend failed:
infinity is the text "inf", and what is not a number is null."""
"""the document's content"""


def document(
    folder: str,
    report: str,
    status: int,
    lines: Sequence[Line],
    verdicts: Mapping[str, Verdict],
    remarks: str,
    odd: Mapping[str, Sequence[str]],
) -> dict[str, Any]:
    """Makes the document, as SCHEMA says; `verdicts` and remarks on logs, `odd`, are by dataset label."""
    rows: list[Row] = [row for line in lines for row in line.rows]
    return _valid(
        {
            "folder": folder,
            "report": report,
            "status": status,
            "datasets": [
                _dataset([line for line in lines if line.dataset == dataset], verdict, odd.get(dataset, ()))
                for dataset, verdict in verdicts.items()
            ],
            "cells": [dict(row.columns) for row in rows],
            "remarks": remarks,
        }
    )


def _dataset(lines: Sequence[Line], verdict: Verdict, remarks: Sequence[str]) -> dict[str, Any]:
    return {
        "dataset": lines[0].dataset,
        "name": lines[0].name,
        "truth_kind": lines[0].truth_kind,
        "logs": units_of(lines).logs,
        "units": units_of(lines).n,
        "cluster": units_of(lines).within or None,
        "remarks": list(remarks),
        "verdict": verdict,
        "lines": [_line(line) for line in lines],
    }


def _line(line: Line) -> dict[str, Any]:
    return {
        "backend": line.backend,
        "implementation": line.implementation,
        "done": line.done,
        "cells": len(line.rows),
        "timing_alone": line.alone,
        "estimates": {column: line.estimate(column) for column in ESTIMATES if column in line.values},
        "costs": {column: found for column in COMPARED if (found := cost(line, column)) is not None},
    }


def _valid(value: Any) -> Any:
    if hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, Mapping):
        return {name: _valid(part) for name, part in value.items()}  # pyright: ignore[reportUnknownVariableType]
    if isinstance(value, list | tuple):
        return [_valid(part) for part in value]  # pyright: ignore[reportUnknownVariableType]
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else str(value)
    return value
