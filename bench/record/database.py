"""Opens or makes a record's SQLite file; refuses one that is damaged or something else in one sentence."""

import sqlite3
from pathlib import Path

from ...core.errors import InputError
from .schema import ABOUT, APPLICATION, FILE, KINDS, PLANNED, RESULT, ROUND, ROUNDS, SCHEMA, VERSION, VIEW

BROKEN = (sqlite3.Error, UnicodeDecodeError)  # raised by a damaged file: the words of an error may be damaged, too
DAMAGED = ("SQLITE_CORRUPT", "SQLITE_NOTADB", "SQLITE_ERROR")  # prefixes; the last: missing table or column
FORMER = "study.sqlite"  # a study's record before runs and studies shared a format


class Empty(InputError):
    """A record without tables: its writer was killed before it wrote anything."""


class Unwritable(InputError):
    """A file of a run or a study that cannot be written to, as on a full disk; the engine adds what is left."""


def damaged(path: Path, error: object) -> InputError:
    """Makes the refusal of a file that cannot be read."""
    said = " ".join(str(error).split())[:300]
    table = "; cells.csv beside it has the results" if path.with_name("cells.csv").is_file() else ""
    return InputError(
        f"{path}: {said}; expected the record of a run or a study, whole. Nothing was changed{table}; "
        f"sqlite3 {path} .recover gives what can still be read."
    )


def unwritable(path: Path, error: Exception) -> InputError:
    """Makes the refusal of a file that could not be written to."""
    code = getattr(error, "sqlite_errorname", "")
    if not code or code.startswith(DAMAGED):  # a failed check has no code
        return damaged(path, error)
    return Unwritable(f"{path}: cannot be written to: {error}.")


def writable(folder: Path) -> sqlite3.Connection:
    """Opens the record in the folder for writing; makes one where there is none."""
    path = folder / FILE
    if not path.exists() and (folder / FORMER).exists():
        raise InputError(f"--out {folder}: {_FORMER}; expected a new folder.")
    try:
        db = sqlite3.connect(path, isolation_level=None)
    except sqlite3.Error as error:
        raise unwritable(path, error) from None
    try:
        if _is_empty(db):
            db.execute("PRAGMA journal_mode = WAL")
            db.executescript(f"BEGIN; {SCHEMA} COMMIT;")
        _check(db, path)
        _make_sound(db)
        db.execute("PRAGMA synchronous = NORMAL")
    except BROKEN as error:
        db.close()
        raise unwritable(path, error) from None
    except BaseException:
        db.close()
        raise
    return db


def read_only(folder: Path) -> sqlite3.Connection:
    """Opens the record in the folder for reading, also while it is written and where nothing can be written."""
    path = folder / FILE
    if not path.is_file():
        found = _FORMER if (folder / FORMER).is_file() else f"{FILE} is not here"
        raise InputError(f"{folder}: {found}; expected the folder of a run or a study.")
    name = path.absolute().as_uri()
    log = path.with_name(f"{path.name}-wal")
    # A connection that may write removes SQLite's own files beside the record when it closes; a read-only one leaves
    # them, but does not touch the write-ahead log of a killed writer. A read-only folder has neither.
    written = log.exists() and log.stat().st_size > 0
    trouble: Exception | None = None
    for uri in (f"{name}?mode=ro" if written else name, f"{name}?mode=ro&immutable=1"):
        try:
            db = sqlite3.connect(uri, uri=True, isolation_level=None)
        except sqlite3.Error as error:
            trouble = trouble or error
            continue
        try:
            db.execute("PRAGMA query_only = ON")
            _check(db, path)
        except BROKEN as error:
            db.close()
            trouble = trouble or error
        except InputError:
            db.close()
            raise
        else:
            return db
    raise damaged(path, trouble)


_FORMER = f"holds a study of an earlier version, {FORMER}, that this one cannot read"


def _is_empty(db: sqlite3.Connection) -> bool:
    return not db.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]


def _check(db: sqlite3.Connection, path: Path) -> None:
    """Raises InputError unless it is a record of this version's format."""
    mark, version = (db.execute(f"PRAGMA {name}").fetchone()[0] for name in ("application_id", "user_version"))
    if mark != APPLICATION and version == 1 and _has(db, "run") and _has(db, "cells"):
        raise InputError(
            f"{path}: found a record of format 1, which slamduel 0.1 wrote, expected {VERSION}: the files beside it "
            "are as they were; bench run into a new folder makes a new one."
        )
    if mark != APPLICATION and _is_empty(db):
        raise Empty(f"{path}: found nothing, expected a record.")
    if mark != APPLICATION:
        raise InputError(f"{path}: found other tables, expected a record.")
    if version != VERSION:
        raise InputError(
            f"{path}: found a record of format {version}, expected {VERSION}: another version of slamduel wrote it."
        )


def _has(db: sqlite3.Connection, table: str) -> bool:
    return bool(db.execute("SELECT 1 FROM sqlite_master WHERE name = ?", (table,)).fetchone())


def _make_sound(db: sqlite3.Connection) -> None:
    """Refuses a damaged file, and adds the columns that a record of an earlier version lacks."""
    for table in ("about", "logs", "results", "plan"):
        fault = db.execute(f"PRAGMA integrity_check({table})").fetchone()[0]
        if fault != "ok":
            raise sqlite3.DatabaseError(fault)
    if "remarks" not in {row[1] for row in db.execute("PRAGMA table_info(logs)")}:
        db.execute("ALTER TABLE logs ADD COLUMN remarks TEXT")
    db.execute(ROUNDS)
    kinds = KINDS | ABOUT | ROUND
    lacking = [
        (table, name)
        for table, names in (("results", RESULT), ("plan", PLANNED), ("rounds", tuple(ROUND)))
        for there in [{row[1] for row in db.execute(f"PRAGMA table_info({table})")}]
        for name in names
        if name not in there
    ]
    if lacking:
        added = "".join(f"ALTER TABLE {table} ADD COLUMN {name} {kinds[name]};" for table, name in lacking)
        db.executescript(f"BEGIN; {added} DROP VIEW IF EXISTS cells; {VIEW} COMMIT;")
