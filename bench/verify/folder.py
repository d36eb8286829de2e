"""The results folder that is checked: its record, and each of its cells as far as it can be made again here."""

from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, Literal, NamedTuple

from ...core.errors import InputError
from ..plan.spec import backend_variants, dataset_variants
from ..plan.variant import BackendVariant, OneLog
from ..record.schema import Row, label
from ..record.store import Known, Store

Subject = Literal["files", "logs", "scores", "cells"]
HOLDS, FAILS, OPEN = "holds", "fails", "not checked"
NAMED = 8  # faults of a subject that are named one by one


class Finding(NamedTuple):
    """One thing that was checked, or could not be."""

    subject: Subject
    verdict: Literal["holds", "fails", "not checked"]
    sentence: str


def faults(subject: Subject, sentences: Sequence[str]) -> list[Finding]:
    """The findings of faults; of more than NAMED, their number."""
    said = [*sentences[:NAMED], *[f"{len(sentences) - NAMED} more like these."] * (len(sentences) > NAMED)]
    return [Finding(subject, FAILS, one) for one in said]


class CheckedCell(NamedTuple):
    """A cell that has ended, with its log and its backend where these are known here."""

    row: Row
    known: Known | None  # its log, as the record has it
    log: OneLog | None
    backend: BackendVariant | None
    unknown: str  # why its log or backend is not known here; "" where both are

    @property
    def log_label(self) -> str:
        """Names its log: dataset and seed."""
        dataset, options, _, _, seed = self.row.key
        return f"{label(dataset, options)}, seed {seed}"

    @property
    def backend_label(self) -> str:
        """Names its backend with its options."""
        return label(self.row.columns["backend"], self.row.columns["options"])

    def __str__(self) -> str:
        return f"{self.log_label}, {self.backend_label}"


class ResultsFolder(NamedTuple):
    """A run's folder with its facts and its cells."""

    folder: Path
    run: Mapping[str, Any]  # the content of run.json, as the record has it
    cells: tuple[CheckedCell, ...]

    @property
    def backends(self) -> list[str]:
        """Lists the backends that have a cell that is done."""
        return list(dict.fromkeys(cell.backend_label for cell in self.cells if cell.row.columns["status"] == "done"))


def read(folder: Path) -> ResultsFolder:
    """Reads the record of a run; InputError where there is none, where it is damaged, and for a study's."""
    with Store(folder) as store:
        run = store.run()
        if run.get("kind", "run") != "run":
            raise InputError(f"{folder}: holds a study, expected the folder of a run.")
        logs, cells, log_of, backend_of = store.logs(), list[CheckedCell](), cache(_log), cache(_backend)
        for row in store.cells():
            log, unknown = log_of(label(*row.key[:2]), row.key[-1])
            backend, lacks = backend_of(label(*row.key[2:4]))
            cells.append(CheckedCell(row, logs.get(row.log), log, backend, unknown or lacks))
        return ResultsFolder(folder, run, tuple(cells))


def _log(dataset: str, seed: int) -> tuple[OneLog | None, str]:
    try:
        return dataset_variants(dataset)[0].log(seed), ""
    except InputError as error:
        return None, str(error)


def _backend(name: str) -> tuple[BackendVariant | None, str]:
    try:
        found = backend_variants(name)[0]
    except InputError as error:
        return None, str(error)
    return (found, "") if found.builder is not None else (None, found.missing)
