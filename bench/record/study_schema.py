"""What the store of a study holds, an SQLite file in which every result is under the key of all that determines it.

study    what the study is and where it ran, as JSON by name
logs     a row a log: under the key of what it was made from, its digest; none where it could not be made
results  a row a result: the columns of cells.csv and metrics.csv, under its key; nothing is ever taken out
arrays   under the key of a log or a result, its arrays as numpy's .npz, where they are kept
plan     a row a cell of the study as it stands: its parameters, and the key of its result once that is known
cells    the plan with its results: what a reader wants
"""

from ..words.columns import about
from .schema import COLUMNS, KEY, MORE

FILE = "study.sqlite"
VERSION = 1
APPLICATION = 0x536C6144
"""SQLite's application_id: "SlaD"."""


def kind(column: str) -> str:
    """The type, to SQLite, of a column of cells.csv or metrics.csv."""
    return about(column).kind.sql_type


MEASURED = {name: kind(name) for name in (*COLUMNS, *MORE) if name not in (*KEY, "status", "reason")}
"""What a result says, with the types."""

ABOUT = {"seconds": "REAL", "host": "TEXT", "executor": "TEXT", "recorded": "REAL"}
"""How it was come by: wall time, and when it was recorded, since 1970."""

RESULT = (*COLUMNS, *MORE, *ABOUT, "traceback")
"""The columns of a result after its key."""

_LAST = ", ".join(f"results.{name}" for name in (*MEASURED, *ABOUT, "key"))
_FIRST = ", ".join(f"plan.{name}" for name in ("place", *KEY, "parameters"))

CELLS = f"""
CREATE VIEW cells AS
    SELECT {_FIRST}, results.status, results.reason, {_LAST} FROM plan JOIN results ON plan.key = results.key
    UNION ALL
    SELECT {_FIRST}, CASE WHEN plan.trouble IS NULL THEN 'waiting' ELSE 'error' END, plan.trouble, {_LAST}
    FROM plan LEFT JOIN results ON plan.key = results.key WHERE results.key IS NULL
    ORDER BY 1;
"""
"""In two halves, since a column of a view has a type only where it is a table's."""

SCHEMA = f"""
CREATE TABLE study (name TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE logs (key TEXT PRIMARY KEY, dataset TEXT, dataset_options TEXT, seed INTEGER, digest TEXT,
                   truth_digest TEXT, truth_kind TEXT);
CREATE TABLE results (key TEXT PRIMARY KEY, {", ".join(f"{name} {kind(name)}" for name in (*COLUMNS, *MORE))},
                      {", ".join(f"{name} {what}" for name, what in ABOUT.items())}, traceback TEXT);
CREATE TABLE arrays (key TEXT PRIMARY KEY, archive BLOB NOT NULL);
CREATE TABLE plan (place INTEGER PRIMARY KEY, dataset TEXT, dataset_options TEXT, backend TEXT, options TEXT,
                   seed INTEGER, parameters TEXT, key TEXT, trouble TEXT);
{CELLS}
PRAGMA application_id = {APPLICATION};
PRAGMA user_version = {VERSION};
"""
