"""The one writer of a run's record: a transaction a cell, so that what is written outlasts whatever comes after it."""

import json
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from ...frontend.errors import InputError
from .reader import Store
from .run_facts import SOUND, sound_plan
from .salvage import BROKEN
from .schema import COLUMNS, FILE, MORE, SCHEMA, VERSION, Row, columns, packed, rows


class Recorder(Store):
    """A record open for writing, made where it is not there yet. What is read of it is read anew each time.

    A run is to go on by it, so no damage is put up with: InputError, as where the file is not a record of ours.
    """

    _ready = False  # whether the tables are as they have to be for writing

    def put_run(self, name: str, value: Any) -> None:
        """Keep something about the run as a whole."""
        self._write("INSERT OR REPLACE INTO run VALUES (?, ?)", (name, json.dumps(value)))

    def put_log(self, dataset: str, options: str, seed: int, digest: str, kind: str, arrays: Mapping[str, Any]) -> None:
        """Keep a log's digest and truth."""
        values = (dataset, options, seed, digest, kind, packed(arrays))
        self._write("INSERT OR REPLACE INTO logs VALUES (?, ?, ?, ?, ?, ?)", values)

    def put_cell(self, row: Mapping[str, Any], arrays: Mapping[str, Any], traceback: str) -> None:
        """Keep a cell, in one transaction."""
        names = (*COLUMNS, *MORE, "arrays", "traceback")
        values = (*(row.get(name) for name in names[:-2]), packed(arrays), traceback)
        marks = ", ".join("?" * len(names))
        self._write(f"INSERT OR REPLACE INTO cells ({', '.join(names)}) VALUES ({marks})", values)

    def run(self) -> dict[str, Any]:
        """What has been kept about the run as a whole; nothing in a record that is only beginning."""
        try:
            if not columns(self._opened):
                return {}
            found = dict(self._words())
        except (*BROKEN, ValueError, TypeError, RecursionError) as error:
            raise self._damaged(error) from None
        if not sound_plan(found.get("plan", SOUND)):
            raise self._damaged(ValueError("the plan of the run cannot be read"))
        return found

    def cells(self) -> Iterator[Row]:
        """Every cell that is in the record by now, by dataset, backend and seed."""
        try:
            names = columns(self._opened)
            told = rows(names, self._opened.execute(f"SELECT {', '.join(names)}, traceback FROM cells").fetchall())
        except BROKEN as error:
            raise self._damaged(error) from None
        yield from self._cleared([row for row in told if self._believed(row)])

    def _open(self) -> sqlite3.Connection:
        path = self.folder / FILE
        db = sqlite3.connect(path, isolation_level=None)
        try:
            version = db.execute("PRAGMA user_version").fetchone()[0]
            strange = version == 0 and db.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
            if version not in (0, VERSION) or strange:
                raise InputError(f"{path}: found a record of format {version}, expected {VERSION}.")
            fault = db.execute("PRAGMA integrity_check(1)").fetchone()[0]
            if fault != "ok":
                raise sqlite3.DatabaseError(" ".join(fault.split()))
            there = columns(db)
            if there and (lost := sorted(set(COLUMNS) - set(there))):
                raise sqlite3.DatabaseError(f"the table of cells has no column {lost[0]}")
        except BaseException as error:
            db.close()
            if isinstance(error, BROKEN):
                raise InputError(
                    f"{path}: {error}; expected the record of a run, whole. Nothing was changed; bench report gives "
                    "what can still be read."
                ) from None
            raise
        return db

    def _make_ready(self) -> None:
        """Make the tables, or the columns that a run of an earlier version lacks, once something is to be kept."""
        db = self._opened
        if not columns(db):
            db.execute("PRAGMA journal_mode = WAL")
            db.executescript(f"BEGIN; {SCHEMA} COMMIT;")
        there = columns(db)
        for name in (name for name in (*COLUMNS, *MORE) if name not in there):
            db.execute(f"ALTER TABLE cells ADD COLUMN {name}")
        self._ready = True

    def _foreign(self) -> list[str]:
        """Not looked for: a run leaves alone what is not its own."""
        return []

    @property
    def _opened(self) -> sqlite3.Connection:
        assert self._db is not None
        return self._db

    def _damaged(self, error: Exception) -> InputError:
        return InputError(f"{self.folder / FILE}: {error}; expected the record of a run, whole. Nothing was changed.")

    def _write(self, statement: str, values: Sequence[Any]) -> None:
        """One transaction; InputError where the file can no longer be written to, with all before it safe."""
        try:
            if not self._ready:
                self._make_ready()
            self._opened.execute(statement, values)
        except sqlite3.Error as error:
            raise InputError(f"{self.folder / FILE}: cannot be written to: {error}.") from None
