"""The site's tables as CSV, for other programs: rankings, pairs, the overview, and the history."""

import csv
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, get_type_hints

from ...core.errors import InputError
from ...core.files import csv_text
from ..verdict.consistency import belief_word
from ..verdict.ranking import ordered, standing
from ..verdict.summary import typical
from .history import Summary
from .overview import Made, Named, Overview, Past, Score
from .standing import Standing

RANKED = (
    "ate_m", "final_ate_m", "relation_m", "relation_deg", "final_relation_m", "final_relation_deg", "map_rmse_m",
    "final_map_rmse_m", "nees", "nees_inside", "final_nees", "step_us_p50", "step_us_p99", "cpu_s", "peak_mb",
)  # fmt: skip
"""Columns of a ranking: each as the median over logs, with the ends of its 95 % interval or of its range."""

RANKING = (
    "dataset", "backend", "submitted", "implementation", "done", "cells", "logs", "units", "belief", "final_belief",
    *(f"{name}{end}" for name in RANKED for end in ("", "_low", "_high")), "interval", "timing_alone",
)  # fmt: skip

PAIRS = (
    "dataset", "column", "first", "second", "standing", "n", "units", "closer", "ratio", "low", "high", "p", "adjusted",
    "effect",
)  # fmt: skip

TABLES = {"named": Named, "backends": Score, "runs": Made, "changes": Past}
"""The tables of an overview, and their rows."""

CASTS: Mapping[type, Callable[[str], Any]] = {
    str: str,
    int: int,
    float: lambda text: float(text) if text else math.nan,
}
"""Reads a value of a table."""

HISTORY = (
    "suite", "version", "revision", "date", "machine", "processor", "run", "dataset", "backend", "done", "cells",
    *RANKED,
)  # fmt: skip


def ranking_csv(found: Standing) -> str:
    """Writes a dataset's lines, the most accurate first."""
    return _csv(RANKING, (_ranked(found, line) for line in ordered(found.lines)))


def _ranked(found: Standing, line: Any) -> list[Any]:
    submission = found.submitted.get(line.backend)
    values: list[Any] = []
    interval = ""
    for name in RANKED:
        if name not in line.values:
            values += [None] * 3
            continue
        value = typical(line, name)
        values += [value.value, value.low, value.high]
        interval = "95 %" if value.interval else "range"
    said = "" if submission is None else f"{submission.name}, {submission.mark(line.backend)}"
    counts = [line.done, len(line.rows), line.units.logs, line.units.n]
    beliefs = [belief_word(line), belief_word(line, "final_nees")]
    timed = "" if line.backend in found.elsewhere else int(line.alone)
    return [found.dataset, line.backend, said, line.implementation, *counts, *beliefs, *values, interval, timed]


def pairs_csv(found: Standing) -> str:
    """Writes every comparison behind a dataset's verdict."""
    return _csv(
        PAIRS,
        (
            [
                found.dataset, column, c.first, c.second, standing(c), c.n, c.units, c.closer, c.ratio, c.low, c.high,
                c.p, c.adjusted, c.effect,
            ]
            for column, comparisons in found.verdict.comparisons.items()
            for c in comparisons
        ),
    )  # fmt: skip


def overview_csv(found: Iterable[Named]) -> str:
    """Writes what is recommended on each dataset, by suite."""
    return _csv(Named._fields, found)


def overview_tables(found: Overview) -> dict[str, str]:
    """Writes the tables of an overview, by their names."""
    return {name: _csv(kind._fields, getattr(found, name)) for name, kind in TABLES.items()}


def read_overview(tables: Mapping[str, Path]) -> Overview:
    """Reads an overview from such tables, by their names. InputError for a file that is not one."""
    return Overview(**{name: _read(tables[name], kind) for name, kind in TABLES.items()})


def _read(path: Path, kind: Any) -> list[Any]:
    casts = {name: CASTS[hint] for name, hint in get_type_hints(kind).items()}
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        return [kind(**{name: cast(row[name]) for name, cast in casts.items()}) for row in rows]
    except (OSError, KeyError, ValueError, TypeError):
        raise InputError(f"{path}: is no table with {', '.join(casts)}; bench suite --standing writes it.") from None


def history_csv(found: Sequence[Summary]) -> str:
    """Writes the medians of all that is kept of a suite."""
    return _csv(HISTORY, (row for summary in found for row in _of_history(summary)))


def _of_history(one: Summary) -> Iterable[list[Any]]:
    about = [one.suite, one.version, one.revision, one.date, one.machine, one.processor]
    for run in one.runs:
        for (dataset, backend), line in one.lines(run).items():
            medians = [typical(line, name).value if name in line.values else None for name in RANKED]
            yield [*about, run, dataset, backend, line.done, len(line.rows), *medians]


def _csv(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    return csv_text(header, ([_blank(value) for value in row] for row in rows))


def _blank(value: Any) -> Any:
    return None if isinstance(value, float) and math.isnan(value) else value
