"""The record of a run or of a study: an SQLite file with every result under the key of all that determines it.

about    facts of the whole, as JSON by name: what was asked for, the machine, the command
logs     one row per log: under the key of what it was made from, its digest; none where it could not be made; remarks
results  one row per result: the columns of cells.csv and metrics.csv, under its key; nothing is ever taken out
rounds   one row per round of a result, under its key: its times and what the machine did; results has their medians
arrays   under the key of a log or a result, its arrays as numpy's .npz, where they are kept
plan     one row per cell as it stands: its parameters, and the keys of its log and, once it is known, of its result
cells    the plan with its results: the view for readers
"""

import io
from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..words.columns import CELLS, METRICS, TIMED

STATUSES = ("done", "diverged", "timeout", "error", "skipped")  # of a cell

FAILED = ("diverged", "timeout", "error")  # statuses that count as the worst error

COLUMNS = tuple(column.name for column in CELLS)  # the columns of cells.csv, in order
KEY = tuple(column.name for column in CELLS if column.kind.names_cell)  # those that name a cell
MORE = tuple(column.name for column in METRICS)  # the columns of metrics.csv after those that name the cell, in order
PLANNED = tuple(column.name for column in (*CELLS, *METRICS) if column.kind.of_plan)  # those of the plan alone
KINDS = {column.name: column.kind.sql_type for column in (*CELLS, *METRICS)}  # the SQL types of both
TEXTS = tuple(name for name, kind in KINDS.items() if kind == "TEXT")  # those of both that hold no number

FILE = "results.sqlite"
VERSION = 2
APPLICATION = 0x536C6144  # SQLite's application_id: "SlaD"

SKIPPED = "skipped: "  # what begins the trouble of a cell that is skipped as its log is not there

MEASURED = {name: kind for name, kind in KINDS.items() if name not in (*KEY, *PLANNED, "status", "reason")}

ABOUT = {"seconds": "REAL", "host": "TEXT", "executor": "TEXT", "recorded": "REAL", "traceback": "TEXT"}
"""where a result came from: wall time, machine, time of recording (s since 1970), and an error's traceback"""

RESULT = tuple(name for name in (*COLUMNS, *MORE, *ABOUT) if name not in PLANNED)  # those of a result after its key

ROUND = {
    "round": "INTEGER", "status": "TEXT", "reason": "TEXT", "path": "TEXT", **{name: KINDS[name] for name in TIMED},
    "timing_alone": "INTEGER", "host": "TEXT", "recorded": "REAL",
}  # fmt: skip
"""The columns of a round after the key of its result: `path` is the digest of what the backend found."""

ROUNDS = f"""
CREATE TABLE IF NOT EXISTS rounds (key TEXT, {", ".join(f"{name} {kind}" for name, kind in ROUND.items())},
                                   PRIMARY KEY (key, round));
"""

_LAST = ", ".join(f"results.{name}" for name in (*MEASURED, *ABOUT, "key"))
_FIRST = ", ".join(f"plan.{name}" for name in ("place", *KEY, "parameters", "log", *PLANNED))

VIEW = f"""
CREATE VIEW cells AS
    SELECT {_FIRST}, results.status, results.reason, {_LAST} FROM plan JOIN results ON plan.key = results.key
    UNION ALL
    SELECT {_FIRST}, CASE WHEN plan.trouble IS NULL THEN 'waiting' WHEN plan.trouble LIKE '{SKIPPED}%' THEN 'skipped'
                          ELSE 'error' END,
           CASE WHEN plan.trouble LIKE '{SKIPPED}%' THEN substr(plan.trouble, {len(SKIPPED) + 1}) ELSE plan.trouble END,
           {_LAST}
    FROM plan LEFT JOIN results ON plan.key = results.key WHERE results.key IS NULL
    ORDER BY 1;
"""
"""In two halves: a column of a view has a type only where it is a table's."""

SCHEMA = f"""
CREATE TABLE about (name TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE logs (key TEXT PRIMARY KEY, dataset TEXT, dataset_options TEXT, seed INTEGER, digest TEXT,
                   truth_digest TEXT, truth_kind TEXT, sketch TEXT, remarks TEXT);
CREATE TABLE results (key TEXT PRIMARY KEY, {", ".join(f"{name} {(KINDS | ABOUT)[name]}" for name in RESULT)});
CREATE TABLE arrays (key TEXT PRIMARY KEY, archive BLOB NOT NULL);
CREATE TABLE plan (place INTEGER PRIMARY KEY, dataset TEXT, dataset_options TEXT, backend TEXT, options TEXT,
                   seed INTEGER, parameters TEXT, log TEXT, key TEXT, trouble TEXT,
                   {", ".join(f"{name} {KINDS[name]}" for name in PLANNED)});
{ROUNDS}
{VIEW}
PRAGMA application_id = {APPLICATION};
PRAGMA user_version = {VERSION};
"""


def label(name: str, options: str) -> str:
    """Writes a variant as on the command line."""
    return f"{name}[{options}]" if options else name


class Row(NamedTuple):
    """A cell that has ended: its columns by name, those of MORE included; None where there is no value."""

    columns: Mapping[str, Any]
    traceback: str
    log: str = ""  # the key of its log
    result: str = ""  # the key of its result
    rounds: Sequence[Mapping[str, Any]] = ()  # the columns of ROUND of every round that has ended

    @property
    def key(self) -> tuple[str, str, str, str, int]:
        """Returns what identifies the cell in its record."""
        c = self.columns
        return c["dataset"], c["dataset_options"], c["backend"], c["options"], c["seed"]


def packed(arrays: Mapping[str, Any]) -> bytes:
    """Packs arrays into an archive, as numpy writes it."""
    file = io.BytesIO()
    np.savez_compressed(file, allow_pickle=False, **arrays)
    return file.getvalue()


def unpacked(blob: Any, names: Collection[str] | None = None) -> dict[str, Any]:
    """Unpacks the arrays of an archive; any exception at all where it is damaged."""
    if not isinstance(blob, bytes) or not blob.startswith(b"PK"):
        raise ValueError("found no archive of arrays")
    with np.load(io.BytesIO(blob), allow_pickle=False) as members:
        return {name: members[name] for name in members.files if names is None or name in names}
