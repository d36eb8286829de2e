"""Runs a few cells in this process, and reads their rows."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from lasting_workers import local
from slamduel.bench.engine.engine import Watcher
from slamduel.bench.plan.plan import Plan
from slamduel.bench.plan.work import PlannedCell
from slamduel.bench.record.schema import Row
from slamduel.bench.record.store import Store
from slamduel.bench.run.runner import run
from slamduel.bench.words.columns import COLUMNS

TIMES = {column.name for column in COLUMNS.values() if column.kind.is_time} | {"peak_mb", "timing_alone"}
"""Columns that may differ between runs of a cell."""


class Silent:
    """A watcher that records the statuses."""

    def __init__(self) -> None:
        self.ended: list[str] = []

    def looking(self, logs: int) -> None: ...
    def looked(self, name: str) -> None: ...
    def say(self, sentence: str) -> None: ...
    def running(self, cells: Sequence[PlannedCell], done: int, slots: int, recorded: Iterable[Row]) -> None: ...
    def finished(self, cell: PlannedCell, row: Mapping[str, Any], seconds: float) -> None:
        self.ended.append(f"{cell.cell.backend.label} {row['status']}")

    def repeating(self, cells: Sequence[PlannedCell], number: int, of: int) -> None: ...
    def repeated(self, cell: PlannedCell, row: Mapping[str, Any], seconds: float) -> None:
        self.ended.append(f"{cell.cell.backend.label} again {row['status']}")


def go(
    folder: Path, backends: str, dataset: Path | str, workers: int = 2, seeds: int = 2, timeout_s: float = 60.0
) -> dict[str, Row]:
    """Runs, and returns the rows by backend label and seed."""
    words = {"backend": backends, "dataset": str(dataset), "seeds": seeds, "timeout_s": timeout_s, "memory_mb": 1000}
    return again(Plan.from_words(words), folder, Silent(), workers)


def again(plan: Plan, folder: Path, watcher: Watcher, workers: int = 1, *, strict: bool = False) -> dict[str, Row]:
    """Runs a plan, or resumes it."""
    run(plan, folder, local(workers), ["bench", "run"], watcher, strict=strict)
    return rows(folder)


def rows(folder: Path) -> dict[str, Row]:
    with Store(folder) as store:
        found = list(store.cells())
    return {
        f"{r.columns['dataset_options']} {r.columns['backend']} {r.columns['options']} {r.columns['seed']}": r
        for r in found
    }
