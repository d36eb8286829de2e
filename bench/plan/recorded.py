"""Restores a record's work, so that a cell of it can be run once more."""

import functools

from ...frontend.errors import InputError
from ..record.schema import label
from ..record.store import Store
from .plan import Cell, Plan
from .spec import BackendVariant, DatasetVariant, backend_variants, dataset_variants
from .work import PlannedCell, Work, work_of


def recorded(store: Store) -> Work:
    """Restores the work of the run or study in `store`; InputError for a name that is no longer known."""
    about = store.about()
    planned = store.planned()
    if not planned:
        raise InputError(f"{store.folder}: no cell is planned in its record; expected a run or study that was begun.")
    if about.get("kind") == "run":
        return work_of(Plan.from_words(about["plan"]))
    cells: list[PlannedCell] = []
    for (dataset, dataset_options, backend, options, seed), parameters, _, _ in planned:
        cell = Cell(_dataset(label(dataset, dataset_options)), _backend(label(backend, options)), seed)
        cells.append(PlannedCell(cell, parameters))
    limits = {name: about[name] for name in ("keep", "oracle", "timeout_s", "memory_mb")}
    return Work(cells=tuple(cells), **limits)


@functools.cache
def _dataset(name: str) -> DatasetVariant:
    return dataset_variants(name)[0]


@functools.cache
def _backend(name: str) -> BackendVariant:
    return backend_variants(name)[0]
