"""Chooses the cells that are timed again in a round of repeats."""

import random
from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any

from ..measure.repeats import MOST_CELLS, ROUNDS, SMALL_S
from ..plan.work import PlannedCell, Work
from ..record.schema import FAILED
from ..workers.executor import Executor
from .request import RunRequest

Rounds = Mapping[str, Sequence[Mapping[str, Any]]]  # the columns of a result's rounds, by its key


def last_round(work: Work, executor: Executor) -> int:
    """The number of the last round; what nobody asked for is not repeated where times are not comparable."""
    return work.repeats or (ROUNDS if executor.times else 1)


def lacking(
    work: Work, keys: Sequence[str | None], statuses: Mapping[str, str], found: Rounds, number: int, request: RunRequest
) -> list[int]:
    """The places of the cells that lack that round, shuffled; one of those with the same key.

    Only cells whose result is done are repeated; where the work does not say how often, small ones.
    """
    ended = {key: {one["round"]: one["status"] for one in rounds} for key, rounds in found.items()}
    repeated = None if work.repeats else _small(work.cells, keys, found)
    places: dict[str, int] = {}
    for place, (cell, key) in enumerate(zip(work.cells, keys, strict=True)):
        if key is None or statuses.get(key) != "done" or not request.chosen(cell):
            continue
        status = ended.get(key, {}).get(number)
        wanted = status is None or (request.retry and status in FAILED)
        if wanted and (repeated is None or _kind(cell) in repeated):
            places.setdefault(key, place)
    todo = list(places.values())
    random.Random(number).shuffle(todo)
    return todo


def _small(cells: Sequence[PlannedCell], keys: Sequence[str | None], found: Rounds) -> set[tuple[str, str]]:
    """The backends whose cells on a dataset are small, by the median of their first rounds, and few: all or none.

    A backend is compared by the rounds that all of its cells have, so that a few without would void the others'.
    """
    took: dict[tuple[str, str], list[float]] = {}
    for cell, key in zip(cells, keys, strict=True):
        first = next((one for one in found.get(key or "", ()) if one["round"] == 1), None)
        if first is not None and first["cpu_s"] is not None:
            took.setdefault(_kind(cell), []).append(first["cpu_s"])
    return {kind for kind, seconds in took.items() if median(seconds) <= SMALL_S and len(seconds) <= MOST_CELLS}


def _kind(cell: PlannedCell) -> tuple[str, str]:
    return cell.cell.dataset.label, cell.cell.backend.label
