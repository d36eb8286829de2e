"""What can still be read of a damaged record: row by row, past the pages that cannot."""

import contextlib
import sqlite3
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...frontend.errors import InputError

INDEX = "sqlite_autoindex_cells_1"
"""What SQLite calls the index of the table's primary key."""

WALKS = (f"INDEXED BY {INDEX}", "NOT INDEXED", "NOT INDEXED ORDER BY rowid DESC")
"""Ways through the table: each gets to rows that are beyond another's first unreadable page."""


BROKEN = (sqlite3.Error, UnicodeDecodeError)
"""What a damaged record may raise: the words of an error may be damaged, too."""


def opened(path: Path, expected: int) -> tuple[sqlite3.Connection, Exception | None]:
    """A record of the `expected` version, for reading alone, and what is wrong with it as a whole.

    Of BROKEN, or InputError, where nothing can be read of it.
    """
    name = path.absolute().as_uri()
    log = path.with_name(f"{path.name}-wal")
    # a connection that may write makes what SQLite needs beside the file and clears it away; one that may not leaves
    # that lying about, but also leaves alone the log of writes that a killed run has left
    ways = (
        (f"{name}?mode=ro" if log.exists() and log.stat().st_size else name, "OFF"),
        (f"{name}?mode=ro&immutable=1", "OFF"),  # without a file beside it: the folder cannot be written to
        (f"{name}?mode=ro&immutable=1", "ON"),  # so that a file shorter than it says is read as far as it goes
    )
    trouble: Exception | None = None
    for uri, lenient in ways:
        db = sqlite3.connect(uri, uri=True, isolation_level=None)
        db.text_factory = _text
        try:
            db.execute("PRAGMA query_only = ON")
            db.execute(f"PRAGMA writable_schema = {lenient}")
            version = db.execute("PRAGMA user_version").fetchone()[0]
            tables = {found[0] for found in db.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
            if version != expected or "cells" not in tables:
                raise InputError(f"found a record of format {version}, expected {expected}")
        except InputError:
            db.close()
            raise
        except BROKEN as error:
            db.close()
            trouble = trouble or error
        else:
            return db, trouble if lenient == "ON" else None
    assert trouble is not None
    raise trouble


def _text(raw: bytes) -> str:
    return raw.decode(errors="replace")


def agree(db: sqlite3.Connection) -> bool:
    """Whether the table and its index have as many rows: a damaged page may hide some without a complaint.

    Of BROKEN where either cannot be walked through.
    """
    counts = [db.execute(f"SELECT count(*) FROM cells {walk}").fetchone()[0] for walk in WALKS[:2]]
    return counts[0] == counts[1]


def salvage(db: sqlite3.Connection, names: Sequence[str]) -> list[tuple[Any, ...]]:
    """Every row that some way leads to and that can be read: `names`, and the traceback, "" where it cannot be read."""
    found: set[int] = set()
    for walk in WALKS:
        with contextlib.suppress(*BROKEN):
            for (rowid,) in db.execute(f"SELECT rowid FROM cells {walk}"):
                found.add(rowid)
    rows = [_row(db, names, rowid) for rowid in sorted(found)]
    return [row for row in rows if row is not None]


def _row(db: sqlite3.Connection, names: Sequence[str], rowid: int) -> tuple[Any, ...] | None:
    for traceback in ("traceback", "''"):  # a traceback lies behind the arrays, which may be in the damaged part
        with contextlib.suppress(*BROKEN):
            query = f"SELECT {', '.join(names)}, {traceback} FROM cells NOT INDEXED WHERE rowid = ?"
            return db.execute(query, (rowid,)).fetchone()
    return None
