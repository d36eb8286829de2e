"""Keeps a suite's results over versions: per version, day and machine one small file with the values of every cell.

Two versions are compared as `bench compare` compares two runs: cell by cell on equal logs, times on equal machines.
"""

import hashlib
import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any

from ...core.errors import InputError
from ...core.files import write_whole
from ..record.schema import COLUMNS, KEY, MORE, Row
from ..record.store import Store
from ..verdict.changes import QUANTITIES, Change, changes
from ..verdict.pairing import Side, paired_runs
from ..verdict.summary import Line, lines
from .site_folder import SuiteFolder

FOLDER = "history"
FORMAT = 1

KEPT = tuple(
    dict.fromkeys(
        (
            *KEY, "status", "reason", "digest", "truth_kind", "cluster", "log_name", "timing_alone", "told", "surveyed",
            "reference", "nees_void", "final_map_rmse_m", "final_nees", *(quantity.column for quantity in QUANTITIES),
        )
    )
)  # fmt: skip
"""Columns of a cell that are kept: those of which two versions are compared, and what a comparison needs of them."""

NAMED = ("suite", "version", "revision", "date", "machine", "processor")
FACTS = ("environment", "workers", "random", "sketches", "truths", "plan", "started", "implementations")


@dataclass(frozen=True)
class Summary:
    """The results of one version of a suite, on one day and machine."""

    suite: str
    version: str
    revision: str
    date: str  # YYYY-MM-DD
    machine: str  # a short name that is the same for the same machine
    processor: str
    runs: Mapping[str, tuple[Mapping[str, Any], Sequence[Row]]]  # facts and cells, by the run's name

    @property
    def name(self) -> str:
        """The name of its file, without the ending."""
        return f"{self.version}_{self.date}_{self.machine}"

    @property
    def called(self) -> str:
        """Names it for readers: the version, and the revision of a checkout."""
        return self.version + f" ({self.revision[:7]}{'+' * self.revision.endswith('+')})" * bool(self.revision)

    def lines(self, run: str) -> dict[tuple[str, str], Line]:
        """The lines of a run, by dataset and backend."""
        return {(line.dataset, line.backend): line for line in lines(self.runs[run][1])}


def summarise(folder: SuiteFolder) -> Summary | None:
    """Summarises the runs of a suite; None where none has been made."""
    runs: dict[str, tuple[Mapping[str, Any], Sequence[Row]]] = {}
    for name, place in folder.runs.items():
        with Store(place) as store:
            facts, rows = store.run(), list(store.cells())
        cells = [Row({column: row.columns[column] for column in KEPT}, "") for row in rows]
        runs[name] = {fact: facts[fact] for fact in FACTS if fact in facts}, cells
    if not runs:
        return None
    facts = max((facts for facts, _ in runs.values()), key=lambda facts: facts["started"])
    known = facts["environment"]
    date = time.strftime("%Y-%m-%d", time.gmtime(facts["started"]))
    version, revision = str(known["packages"].get("slamduel") or "unknown"), str(known.get("revision") or "")
    return Summary(folder.suite.name, version, revision, date, _machine(known), str(known.get("processor")), runs)


def _machine(known: Mapping[str, Any]) -> str:
    """Returns six letters that stand for a machine by its processor, instructions and cores."""
    words = [str(known.get(name)) for name in ("processor", "instructions", "cores")]
    return hashlib.sha256("|".join(words).encode()).hexdigest()[:6]


def keep(site: Path, summary: Summary) -> Path:
    """Writes the summary, in place of one of the same version, day and machine."""
    path = site / FOLDER / summary.suite / f"{summary.name}.json"
    words = {
        "format": FORMAT,
        **{name: getattr(summary, name) for name in NAMED},
        "columns": KEPT,
        "runs": {
            name: {"facts": facts, "cells": [[_number(row.columns[column]) for column in KEPT] for row in rows]}
            for name, (facts, rows) in summary.runs.items()
        },
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, json.dumps(words, allow_nan=False) + "\n")
    return path


def _number(value: Any) -> Any:
    return "inf" if value == inf else value


def summaries(site: Path, suite: str) -> list[Summary]:
    """Reads what is kept of a suite, the oldest first."""
    found = [_read(path) for path in (site / FOLDER / suite).glob("*.json")]
    return sorted(found, key=lambda one: (one.date, _parts(one.version), one.machine))


def _parts(version: str) -> tuple[tuple[int, str], ...]:
    """Returns what a version is sorted by: 0.10 comes after 0.9."""
    return tuple((int(part), "") if part.isdecimal() else (0, part) for part in version.split("."))


def _read(path: Path) -> Summary:
    try:
        words: Any = json.loads(path.read_text(encoding="utf-8"))
        if words["format"] != FORMAT:
            raise ValueError
        runs = {
            name: (run["facts"], [_row(words["columns"], cell) for cell in run["cells"]])
            for name, run in words["runs"].items()
        }
        suite, version, revision, date, machine, processor = (str(words[name]) for name in NAMED)
        return Summary(suite, version, revision, date, machine, processor, runs)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        raise InputError(f"{path}: is no summary of this format, expected what bench suite wrote, whole.") from None


def _row(columns: Sequence[str], values: Sequence[Any]) -> Row:
    numbers = [inf if value == "inf" else value for value in values]
    return Row(dict.fromkeys((*COLUMNS, *MORE)) | dict(zip(columns, numbers, strict=True)), "")


def since(old: Summary, new: Summary) -> tuple[dict[tuple[str, str, str], Change], list[str]]:
    """Compares two summaries: each change by dataset, backend and column; and notes on what was left out."""
    found: dict[tuple[str, str, str], Change] = {}
    notes: list[str] = []
    columns = {quantity.words: quantity.column for quantity in QUANTITIES}
    for run in (name for name in new.runs if name in old.runs):
        try:
            pair = paired_runs(_side(old, run), _side(new, run))
        except InputError:  # nothing in common
            notes.append(f"{run}: no cell on the same log in both versions.")
            continue
        notes += pair.notes
        for change in changes(pair):
            found[change.dataset, change.backend, columns.get(change.quantity, change.quantity)] = change
    return found, list(dict.fromkeys(notes))


def _side(summary: Summary, run: str) -> Side:
    return Side(Path(summary.called), summary.runs[run][0], summary.lines(run))
