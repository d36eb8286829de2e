"""The file of a study's store opened, made where it is to be, and what is wrong with one said in a sentence."""

import sqlite3
from pathlib import Path

from ...frontend.errors import InputError
from .schema import COLUMNS, MORE
from .schema import FILE as RUN
from .study_schema import APPLICATION, CELLS, FILE, SCHEMA, VERSION, kind

BROKEN = (sqlite3.Error, UnicodeDecodeError)
"""What a damaged file may raise: the words of an error may be damaged, too."""

DAMAGED = ("SQLITE_CORRUPT", "SQLITE_NOTADB", "SQLITE_ERROR")
"""How the names of errors begin that are about what is in the file; the last is that a table or column is missing."""


def damaged(path: Path, error: object) -> InputError:
    """What to say of a file that cannot be read as it should."""
    said = " ".join(str(error).split())[:120]
    return InputError(f"{path}: {said}; expected the store of a study, whole. Nothing was changed.")


def unwritable(path: Path, error: Exception) -> InputError:
    """What to say of a file that could not be written to."""
    code = getattr(error, "sqlite_errorname", "")
    if not code or code.startswith(DAMAGED):  # what a check found has none
        return damaged(path, error)
    return InputError(f"{path}: cannot be written to: {error}. What was written before is safe.")


def writable(folder: Path) -> sqlite3.Connection:
    """The store in the folder, a new one where there is none."""
    path = folder / FILE
    if not path.exists() and (folder / RUN).exists():
        raise InputError(f"--out {folder}: holds a run, {RUN}; expected a new folder, or a study's.")
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
    """The store in the folder, for reading alone: while it is written, and where nothing can be."""
    path = folder / FILE
    if not path.is_file():
        found = f"holds a run, {RUN}, and no study" if (folder / RUN).is_file() else f"{FILE} is not here"
        raise InputError(f"{folder}: {found}; expected the folder of a study.")
    name = path.absolute().as_uri()
    log = path.with_name(f"{path.name}-wal")
    # a connection that may write clears away what SQLite needs beside the file; one that may not leaves it lying about,
    # but also leaves alone the log of writes that a killed writer has left; a folder that cannot be written to has
    # neither
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


def _is_empty(db: sqlite3.Connection) -> bool:
    return not db.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]


def _check(db: sqlite3.Connection, path: Path) -> None:
    """InputError where it is no store of this version's format."""
    mark, version = (db.execute(f"PRAGMA {name}").fetchone()[0] for name in ("application_id", "user_version"))
    if mark != APPLICATION:
        raise InputError(f"{path}: found {'nothing' if _is_empty(db) else 'other tables'}, expected a study's store.")
    if version != VERSION:
        raise InputError(
            f"{path}: found a store of format {version}, expected {VERSION}: another version of slamduel wrote it."
        )


def _make_sound(db: sqlite3.Connection) -> None:
    """Refuse what is damaged, and add the columns that a store of an earlier version lacks."""
    for table in ("study", "logs", "results", "plan"):
        fault = db.execute(f"PRAGMA integrity_check({table})").fetchone()[0]
        if fault != "ok":
            raise sqlite3.DatabaseError(fault)
    there = {row[1] for row in db.execute("PRAGMA table_info(results)")}
    lacking = [name for name in (*COLUMNS, *MORE) if name not in there]
    if lacking:
        added = "".join(f"ALTER TABLE results ADD COLUMN {name} {kind(name)};" for name in lacking)
        db.executescript(f"BEGIN; {added} DROP VIEW IF EXISTS cells; {CELLS} COMMIT;")
