"""What the record of a run holds: an SQLite file, from which everything else in its folder can be made again.

run    what was asked for and where it ran, as JSON by name
logs   a row a (dataset variant, seed): digest, and the truth as arrays
cells  a row a cell: the columns of cells.csv and of metrics.csv, and its arrays (numpy's .npz) for plots and exports
"""

import io
import sqlite3
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..words.columns import CELLS, METRICS

COLUMNS = tuple(column.name for column in CELLS)
"""The columns of cells.csv, in order."""

KEY = tuple(column.name for column in CELLS if column.kind.names_cell)
"""Those that name a cell."""

MORE = tuple(column.name for column in METRICS)
"""The columns of metrics.csv after those that name the cell, in order."""

TEXTS = tuple(column.name for column in (*CELLS, *METRICS) if column.kind.sql_type == "TEXT")
"""Those of both that hold no number."""

FILE = "results.sqlite"
VERSION = 1

SCHEMA = f"""
CREATE TABLE run (name TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE logs (dataset TEXT, dataset_options TEXT, seed INTEGER, digest TEXT, truth_kind TEXT, arrays BLOB,
                   PRIMARY KEY (dataset, dataset_options, seed));
CREATE TABLE cells ({", ".join((*COLUMNS, *MORE))}, arrays BLOB, traceback TEXT,
                    PRIMARY KEY (dataset, dataset_options, backend, options, seed));
PRAGMA user_version = {VERSION};
"""


def label(name: str, options: str) -> str:
    """A variant as the command line takes it."""
    return f"{name}[{options}]" if options else name


class Row(NamedTuple):
    """A cell of the record: its columns by name, those of MORE among them; None where there is no value."""

    columns: Mapping[str, Any]
    traceback: str

    @property
    def key(self) -> tuple[str, str, str, str, int]:
        """What tells this cell from every other."""
        c = self.columns
        return c["dataset"], c["dataset_options"], c["backend"], c["options"], c["seed"]


def columns(db: sqlite3.Connection) -> list[str]:
    """Those of COLUMNS and MORE that its table of cells has: a record of an earlier version has not all."""
    there = {row[1] for row in db.execute("PRAGMA table_info(cells)")}
    return [name for name in (*COLUMNS, *MORE) if name in there]


def rows(names: Sequence[str], found: Iterable[Sequence[Any]]) -> list[Row]:
    """From (*values of `names`, traceback), as read; what is not among them is None."""
    none = dict.fromkeys((*COLUMNS, *MORE))
    return [Row(none | dict(zip(names, values, strict=True)), traceback) for *values, traceback in found]


def packed(arrays: Mapping[str, Any]) -> bytes:
    """An archive of arrays, as numpy has it."""
    file = io.BytesIO()
    np.savez_compressed(file, allow_pickle=False, **arrays)
    return file.getvalue()


def unpacked(blob: Any, names: Collection[str] | None = None) -> dict[str, Any]:
    """The arrays of an archive; any exception at all where it is damaged."""
    if not isinstance(blob, bytes) or not blob.startswith(b"PK"):
        raise ValueError("found no archive of arrays")
    with np.load(io.BytesIO(blob), allow_pickle=False) as members:
        return {name: members[name] for name in members.files if names is None or name in names}
