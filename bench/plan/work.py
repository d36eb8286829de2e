"""The cells to be run and their limits, as the engine takes them from a run's plan or a study."""

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from ...core.errors import InputError
from ..record.schema import label
from ..record.store import Store
from .given_map import GivenMap
from .plan import Cell, Plan
from .spec import backend_variants, dataset_variants
from .variant import BackendVariant, DatasetVariant


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
    repeats: int | None = 1  # rounds in which every cell is timed, the first one the cell itself; None: ROUNDS if small


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
        repeats=plan.repeats,
    )


def recorded(store: Store) -> Work:
    """Restores the work of the run or study in `store`; InputError for a name that is no longer known."""
    about = store.about()
    planned = store.planned()
    if not planned:
        raise InputError(f"{store.folder}: no cell is planned in its record; expected a run or study that was begun.")
    if about.get("kind") == "run":
        return work_of(Plan.from_words(about.get("plan")))
    cells: list[PlannedCell] = []
    for (dataset, dataset_options, backend, options, seed), parameters, _, _ in planned:
        cell = Cell(_dataset(label(dataset, dataset_options)), _backend(label(backend, options)), seed)
        cells.append(PlannedCell(cell, parameters))
    limits: dict[str, Any] = {name: about.get(name) for name in ("keep", "oracle", "timeout_s", "memory_mb")}
    if None in limits.values():
        lacks = next(name for name, value in limits.items() if value is None)
        raise InputError(f"{store.folder}: its record has no {lacks}, expected that of a study, whole.")
    return Work(cells=tuple(cells), **limits)


@functools.cache
def _dataset(name: str) -> DatasetVariant:
    return dataset_variants(name)[0]


@functools.cache
def _backend(name: str) -> BackendVariant:
    return backend_variants(name)[0]
