"""Reads and writes the rounds of results: the times of every repeat, and what the machine did meanwhile."""

import math
import sqlite3
from collections.abc import Mapping, Sequence
from typing import Any

from ..words.columns import TIMED
from .schema import ROUND, STATUSES

NAMES = ", ".join(ROUND)


def put(db: sqlite3.Connection, key: str, row: Mapping[str, Any]) -> None:
    """Writes a round, columns of ROUND; the first one begins anew."""
    if row["round"] == 1:
        db.execute("DELETE FROM rounds WHERE key = ?", (key,))
    marks = ", ".join("?" * (1 + len(ROUND)))
    db.execute(f"INSERT OR REPLACE INTO rounds (key, {NAMES}) VALUES ({marks})", (key, *map(row.get, ROUND)))


def read(db: sqlite3.Connection, key: str | None = None) -> dict[str, list[dict[str, Any]]]:
    """Reads the rounds of all results, or of one, by their key, in order; ValueError for an invalid one."""
    there = {row[1] for row in db.execute("PRAGMA table_info(rounds)")}
    if not there:
        return {}  # an earlier version's record
    asked = ", ".join(name if name in there else f"NULL AS {name}" for name in ROUND)
    found: dict[str, list[dict[str, Any]]] = {}
    where, of = ("", ()) if key is None else ("WHERE key = ?", (key,))
    for result, *values in db.execute(f"SELECT key, {asked} FROM rounds {where} ORDER BY key, round", of):
        row = dict(zip(ROUND, values, strict=True))
        if problem := _wrong(row):
            raise ValueError(f"round {row['round']!r:.20} of {result}: {problem}")
        found.setdefault(result, []).append(row)
    return found


def put_medians(db: sqlite3.Connection, key: str, columns: Mapping[str, Any]) -> None:
    """Writes the columns of a result that sum up its rounds."""
    named = ", ".join(f"{name} = ?" for name in columns)
    db.execute(f"UPDATE results SET {named} WHERE key = ?", (*columns.values(), key))


def _wrong(row: Mapping[str, Any]) -> str:
    if not isinstance(row["round"], int) or row["round"] < 1:
        return "expected a whole number from 1 on"
    if row["status"] not in STATUSES:
        return f"status is {row['status']!r:.40}, expected {', '.join(STATUSES)}"
    if not all(isinstance(row[name], str | None) for name in ("reason", "path", "host")):
        return "reason, path or host is no text"
    for name in (*TIMED, "timing_alone"):
        value: Any = row[name]
        if value is not None and not (isinstance(value, int | float) and math.isfinite(value) and value >= 0):
            return f"{name} is {value!r:.40}, expected a number, 0 or more"
    return ""


def as_table(rounds: Sequence[Mapping[str, Any]], key: Sequence[Any]) -> list[list[Any]]:
    """The rows of times.csv of a cell with that key."""
    return [[*key, *(one[name] for name in ROUND)] for one in rounds]
