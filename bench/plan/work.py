"""The cells to be run and their limits, as the engine takes them from a run's plan or a study."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from .given_map import GivenMap
from .plan import Cell, Plan


class PlannedCell(NamedTuple):
    """A cell with its parameters."""

    cell: Cell
    parameters: Mapping[str, Any]  # dataset, backend, seed and swept options; None: it has no such option
    timed: bool = False  # it must run alone on its machine


@dataclass(frozen=True, kw_only=True)
class Work:
    """Everything that the engine runs."""

    cells: tuple[PlannedCell, ...]
    keep: bool  # paths and other arrays go into the record, too
    oracle: bool
    timeout_s: float  # a cell, or the making of a log
    memory_mb: int  # a cell
    map: GivenMap | None = None  # goes into the prior of every log
    logs_first: bool = False  # every log is made before any cell runs; one that cannot be made ends the run


def work_of(plan: Plan) -> Work:
    """Converts a run's plan for the engine."""
    cells = ((c, {"dataset": c.dataset.label, "backend": c.backend.label, "seed": c.seed}) for c in plan.cells())
    return Work(
        cells=tuple(PlannedCell(*cell) for cell in cells),
        keep=True,
        oracle=plan.oracle,
        timeout_s=plan.timeout_s,
        memory_mb=plan.memory_mb,
        map=plan.map,
        logs_first=True,
    )
