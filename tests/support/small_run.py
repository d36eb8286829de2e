"""A run of a few cells in this process, and the rows that it leaves."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from slamduel.bench.plan.plan import Cell, Plan
from slamduel.bench.record.reader import Store
from slamduel.bench.record.schema import Row
from slamduel.bench.run.runner import run
from slamduel.bench.words.columns import COLUMNS

TIMES = {column.name for column in COLUMNS.values() if column.kind.is_time} | {"peak_mb", "timing_alone"}
"""The columns that may differ when a cell is run again."""


class Silent:
    """Watches, and keeps the statuses."""

    def __init__(self) -> None:
        self.ended: list[str] = []

    def preparing(self, logs: int) -> None: ...
    def prepared(self, name: str) -> None: ...
    def running(self, cells: Sequence[Cell], before: Sequence[Row], workers: int) -> None: ...
    def finished(self, cell: Cell, row: dict[str, Any], seconds: float) -> None:
        self.ended.append(f"{cell.backend.label} {row['status']}")

    def reporting(self) -> None: ...


def go(
    folder: Path, backends: str, dataset: Path | str, workers: int = 2, seeds: int = 2, timeout_s: float = 60.0
) -> dict[str, Row]:
    """Run, and the rows by backend label and seed."""
    words = {"backend": backends, "dataset": str(dataset), "seeds": seeds, "timeout_s": timeout_s, "memory_mb": 1000}
    run(Plan.from_words(words), folder, workers, ["bench", "run"], Silent())
    return rows(folder)


def rows(folder: Path) -> dict[str, Row]:
    with Store(folder) as store:
        found = list(store.cells())
    return {
        f"{r.columns['dataset_options']} {r.columns['backend']} {r.columns['options']} {r.columns['seed']}": r
        for r in found
    }
