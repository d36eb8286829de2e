"""A run read back from its record, as far as that can be read, and from the files beside it where it cannot."""

import contextlib
import functools
import json
import sqlite3
from collections.abc import Collection, Iterator, Sequence
from fnmatch import fnmatch
from pathlib import Path
from typing import Any, Self

from ...frontend.errors import InputError
from .run_facts import completed
from .run_files import CELLS, RUN, Written, written
from .salvage import BROKEN, agree, opened, salvage
from .schema import COLUMNS, FILE, KEY, MORE, VERSION, Row, columns, label, rows, unpacked
from .study_schema import FILE as STUDY
from .validity import LOG_SHAPES, disbelief, incomplete, misfit, nonsense

OWN = (
    f"{FILE}*", "run.json", "cells.csv", "metrics.csv", "cost.csv", "report*", "figures", "tables*", "*.tex", "logs",
    "replay*", "compare*", "earlier", ".*",
)  # fmt: skip
"""What a run's folder may hold beside a folder a dataset: patterns of names."""

MEASURED = ("aligned", "final_aligned")
"""Arrays that mean nothing without the path they are measured from."""

STRANGERS = "not of this run, and left as they are."

NAMED = 4
"""Cells up to which each is named."""


class Store:
    """An open record. Reading is possible while another process writes.

    What cannot be read is left out, and `left_out` says so: a record that is damaged or missing gives what can be had
    from it and from the files that the run wrote beside it. Nothing is ever written to a record here.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._notes: dict[str, list[str]] = {}  # what was left out -> of which cells or logs
        self._rows: list[Row] | None = None
        self._trouble: Exception | None = None  # what is wrong with the record as a whole
        self._lengths: dict[tuple[str, str, int], int] = {}
        self._db = self._open()
        self._strangers = self._foreign()

    @property
    def recorded(self) -> bool:
        """Whether there is a record at all, and not only the files that were made from one."""
        return self._db is not None

    @property
    def left_out(self) -> list[str]:
        """Sentences on what could not be read so far, and on files that are not the run's."""
        notes = self._notes | ({STRANGERS: self._strangers} if self._strangers else {})
        return [f"{_some(of)}: {what}" if of else what for what, of in notes.items()]

    @property
    def damaged(self) -> bool:
        """Whether something of the run could not be read so far."""
        return bool(self._notes)

    def _note(self, what: str, of: str = "") -> None:
        cells = self._notes.setdefault(what, [])
        if of and of not in cells:
            cells.append(of)

    def _open(self) -> sqlite3.Connection | None:
        """The record, or None where there is nothing to read but the files beside it; InputError without those."""
        path = self.folder / FILE
        trouble = f"holds a study, {STUDY}, and no run" if (self.folder / STUDY).is_file() else f"{FILE} is not here"
        if path.is_file():
            try:
                db, self._trouble = opened(path, VERSION)
            except (*BROKEN, InputError) as error:
                trouble = f"{FILE} cannot be read ({_said(error)})"
            else:
                return db
        if not self._written.rows:
            raise InputError(f"{self.folder}: {trouble}; expected the folder of a run.")
        self._note(f"{trouble}: numbers are from cells.csv, and there are no figures.")
        for sentence in self._written.said:
            self._note(sentence)
        return None

    @functools.cached_property
    def _written(self) -> Written:
        """The run as the files beside the record tell it."""
        return written(self.folder)

    def _foreign(self) -> list[str]:
        """The names of the folder's files and folders that are not the run's."""
        own = set(self.run()["folders"].values())
        found: list[str] = []
        with contextlib.suppress(OSError):
            found = sorted(path.name for path in self.folder.iterdir())
        return [name for name in found if name not in own and not any(fnmatch(name, pattern) for pattern in OWN)]

    def close(self) -> None:
        """Close the file; what was written is in it."""
        if self._db is not None:
            self._db.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def run(self) -> dict[str, Any]:
        """Everything that is known about the run as a whole, with stand-ins for what is not."""
        found: dict[str, Any] = {}
        trouble: Exception | None = None
        try:
            found.update(self._words())  # what comes before the trouble is kept
        except (*BROKEN, ValueError, TypeError, RecursionError) as error:
            trouble = error
        if trouble:
            self._note(f"{FILE} does not tell all of the run as a whole ({trouble}): the rest is from {RUN}.")
        if trouble or not self.recorded:
            found = self._written.run | found
        cells = [row.columns for row in self.cells()]
        variants = {label(c["dataset"], c["dataset_options"]): c["dataset"] for c in cells}
        variants |= {label(c["backend"], c["options"]): c["backend"] for c in cells}
        whole, unknown = completed(found, variants.items(), self.folder.stat().st_mtime)
        if unknown and self._written.run.keys() - found.keys():
            self._note(f"what {FILE} does not say of the run as a whole is from {RUN}.")
            whole, unknown = completed(self._written.run | found, variants.items(), self.folder.stat().st_mtime)
        if unknown:
            self._note(f"Nothing is known, or nothing that can be used, of the run's {', '.join(sorted(unknown))}.")
        return whole

    def digest(self, dataset: str, options: str, seed: int) -> str | None:
        """The digest a log had when it was first prepared for this run."""
        query = "SELECT digest FROM logs WHERE dataset = ? AND dataset_options = ? AND seed = ?"
        found = self._all(query, (dataset, options, seed))
        return found[0][0] if found else None

    def truth(self, dataset: str, options: str, seed: int) -> dict[str, Any]:
        """A log's arrays: `t`, `poses`, and where the landmarks are known `ids` and `xy`; empty with no truth."""
        query = "SELECT arrays FROM logs WHERE dataset = ? AND dataset_options = ? AND seed = ?"
        of = f"{label(dataset, options)} · seed {seed}"
        try:
            found = self._all(query, (dataset, options, seed))
            arrays = unpacked(found[0][0]) if found else {}
            problem = misfit(arrays, {}, LOG_SHAPES)
        except Exception as error:  # a damaged archive may raise anything
            arrays, problem = {}, _said(error)
        if problem:
            self._note(f"the true path cannot be read ({problem}), and is in no figure.", of)
            arrays = {}
        self._lengths[dataset, options, seed] = len(arrays.get("t", ()))
        return arrays

    def cells(self) -> Iterator[Row]:
        """Every cell, in the order of the plan's names: by dataset, backend and seed.

        Left out are rows of which nothing can be made; what is no number where one belongs is None.
        """
        if self._rows is None:
            told = self._told()
            believed = [row for row in told if self._believed(row)]
            if self._trouble or len(believed) < len(told):
                believed += self._made_good({row.key for row in believed})
            self._rows = self._cleared(believed)
        yield from self._rows

    def _believed(self, row: Row) -> bool:
        problem = disbelief(row.columns)
        if problem:
            self._note(f"{problem}: left out.", _cell(row))
        return not problem

    def _cleared(self, told: Sequence[Row]) -> list[Row]:
        """In order, and without what is no number where one belongs."""
        found: list[Row] = []
        for row in sorted(told, key=lambda row: row.key):
            wrong = nonsense(row.columns)
            for name, value in wrong.items():
                self._note(f"{name} is {repr(value)[:40]}, expected a number: the value is left out.", _cell(row))
            found.append(Row({**row.columns, **dict.fromkeys(wrong)}, row.traceback) if wrong else row)
        return found

    def _told(self) -> list[Row]:
        """The cells as they stand in the record; where that is damaged, as much of it as can be read."""
        if self._db is None:
            return self._tabled()
        names: list[str] = [*COLUMNS, *MORE]
        found: list[Any] = []
        try:
            names = columns(self._db)
            found = self._db.execute(f"SELECT {', '.join(names)}, traceback FROM cells").fetchall()
            if not agree(self._db):
                raise sqlite3.DatabaseError("its table and its index of cells are at odds")
        except BROKEN as error:
            self._trouble = self._trouble or error
        if self._trouble:
            found = salvage(self._db, names)
            self._note(f"{FILE} is damaged ({_said(self._trouble)}): it still gave {len(found)} cells.")
        return rows(names, found)

    def _tabled(self) -> list[Row]:
        """The cells as cells.csv and metrics.csv have them."""
        return [Row({name: row.get(name) for name in (*COLUMNS, *MORE)}, "") for row in self._written.rows]

    def _made_good(self, known: Collection[Any]) -> list[Row]:
        """The cells that a damaged record no longer has, from cells.csv."""
        if not self.recorded:
            return []
        made = [row for row in self._tabled() if row.key not in known and self._believed(row)]
        for sentence in self._written.said:
            self._note(sentence)
        for row in made:
            self._note(f"the row is from {CELLS}.", _cell(row))
        return made

    def arrays(self, row: Row, names: Collection[str] | None = None) -> dict[str, Any]:
        """A cell's arrays by name; of `names`, where given, those that it has.

        They fit each other, the row and the log's truth: where one cannot be read, or does not fit, there are none.
        """
        where = " AND ".join(f"{name} = ?" for name in KEY)
        try:
            found = self._all(f"SELECT arrays FROM cells WHERE {where}", row.key)
            arrays = unpacked(found[0][0], names) if found else {}
            problem = misfit(arrays, {} if row.columns["steps"] is None else {"n": row.columns["steps"]})
            if names is None:
                problem = problem or incomplete(arrays)
            if self.recorded and not found:
                problem = "they are not in the record"
        except Exception as error:  # a damaged archive may raise anything
            arrays, problem = {}, _said(error)
        if problem:
            self._note(f"paths and costs over time cannot be read ({problem}), and are in no figure.", _cell(row))
            return {}
        return self._measured(row, arrays)

    def _measured(self, row: Row, arrays: dict[str, Any]) -> dict[str, Any]:
        """The arrays without those that say how far a path is from the truth, where that is not known any more."""
        aligned = next((arrays[name] for name in MEASURED if name in arrays), None)
        if aligned is None:
            return arrays
        log = row.columns["dataset"], row.columns["dataset_options"], row.columns["seed"]
        if log not in self._lengths:
            self.truth(*log)
        if self._lengths[log] == len(aligned):
            return arrays
        self._note("the path it is measured from is not known any more: its errors over time are left out.", _cell(row))
        return {name: array for name, array in arrays.items() if name not in MEASURED}

    def _all(self, query: str, values: Sequence[Any] = ()) -> list[Any]:
        return [] if self._db is None else self._db.execute(query, values).fetchall()

    def _words(self) -> Iterator[tuple[str, Any]]:
        """What is kept about the run as a whole, as it stands in the record."""
        for name, value in self._all("SELECT name, value FROM run"):
            yield str(name), json.loads(value)


def _cell(row: Row) -> str:
    dataset, dataset_options, backend, options, seed = row.key
    return f"{label(str(dataset), dataset_options)} · {label(str(backend), options)} · seed {seed}"


def _some(names: Sequence[str]) -> str:
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return f"{', '.join(names[:NAMED])}{more}"


def _said(error: Exception) -> str:
    return " ".join(str(error).split())[:120] or type(error).__name__
