"""The one record of a run: an SQLite file, written by one writer, a transaction a cell. Everything else is its export.

run    what was asked for and where it ran, as JSON by name
logs   a row a (dataset variant, seed): digest, and the truth as arrays
cells  a row a cell: the columns of cells.csv, and its arrays (numpy's .npz) for plots and exports
"""

import contextlib
import functools
import io
import json
import sqlite3
from collections.abc import Collection, Iterator, Mapping, Sequence
from fnmatch import fnmatch
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..frontend.errors import InputError
from .about import SOUND, completed, sound_plan
from .salvage import BROKEN, agree, columns, opened, salvage
from .soundness import KEY, LOG_SHAPES, disbelief, misfit, nonsense
from .written import CELLS, RUN, Written, written

COLUMNS = (
    "dataset", "dataset_options", "backend", "options", "seed", "status", "reason", "digest", "truth_kind",
    "steps", "sightings", "ignored", "landmarks", "ate_m", "ate_origin_m", "heading_rad", "rpe_m", "map_rmse_m",
    "nees", "nees_inside", "nis", "final_ate_m", "final_ate_origin_m", "final_map_rmse_m", "cost_j",
    "step_us_mean", "step_us_p50", "step_us_p95", "step_us_p99", "step_us_max", "belief_us_mean",
    "finish_s", "setup_s", "cpu_s", "peak_mb", "timing_alone",
)  # fmt: skip
"""The columns of cells.csv, in order."""

MORE = (
    "length_s", "real_time", "align_x_m", "align_y_m", "align_rad", "rpe_10m_m", "rpe_100m_m", "rpe_1s_m", "rpe_10s_m",
    "rpe_rad", "landmarks_missed", "landmarks_spurious", "landmark_nees", "landmark_nees_inside",
    "final_align_x_m", "final_align_y_m", "final_align_rad", "final_heading_rad", "final_rpe_m", "final_rpe_10m_m",
    "final_rpe_100m_m", "final_rpe_1s_m", "final_rpe_10s_m", "final_rpe_rad", "final_nees", "final_nees_inside",
    "final_landmarks_missed", "final_landmarks_spurious", "final_landmark_nees", "final_landmark_nees_inside",
    "step_us_fifth1", "step_us_fifth2", "step_us_fifth3", "step_us_fifth4", "step_us_fifth5",
    "growth_steps", "growth_steps_se", "growth_landmarks", "growth_landmarks_se",
    "j_prior", "j_odometry", "j_sightings", "j_loops", "j_final", "j_online",
    "n_eff_least", "ancestors_left", "refused_share",
)  # fmt: skip
"""The columns of metrics.csv after those that name the cell, in order."""

FILE = "results.sqlite"
VERSION = 1

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

_SCHEMA = f"""
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


class Store:
    """An open record. Reading is possible while another process writes.

    What cannot be read is left out, and `left_out` says so: a record that is damaged or missing gives what can be had
    from it and from the files that the run wrote beside it. Without `create` nothing is ever written to a record.
    """

    def __init__(self, folder: Path, *, create: bool = False) -> None:
        self.folder = folder
        self._create = create
        self._notes: dict[str, list[str]] = {}  # what was left out -> of which cells or logs
        self._strangers: list[str] = []  # files and folders that are not the run's
        self._rows: list[Row] | None = None
        self._trouble: Exception | None = None  # what is wrong with the record as a whole
        self._lengths: dict[tuple[str, str, int], int] = {}
        self._db = self._open_to_write() if create else self._open_to_read()
        if not create:
            self._name_strangers()

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

    def _open_to_write(self) -> sqlite3.Connection:
        """The record, made where it is not there; InputError where it is damaged, or not one of ours."""
        path = self.folder / FILE
        db = sqlite3.connect(path, isolation_level=None)
        try:
            version = db.execute("PRAGMA user_version").fetchone()[0]
            strange = version == 0 and db.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
            if version not in (0, VERSION) or strange:
                raise InputError(f"{path}: found a record of format {version}, expected {VERSION}.")
            if version == 0:
                db.execute("PRAGMA journal_mode = WAL")
                db.executescript(f"BEGIN; {_SCHEMA} COMMIT;")
            fault = db.execute("PRAGMA integrity_check(1)").fetchone()[0]
            if fault != "ok":
                raise sqlite3.DatabaseError(" ".join(fault.split()))
            there = columns(db)
            for name in (name for name in (*COLUMNS, *MORE) if name not in there):  # a run of an earlier version
                db.execute(f"ALTER TABLE cells ADD COLUMN {name}")
        except BaseException as error:
            db.close()
            if isinstance(error, BROKEN):
                raise InputError(
                    f"{path}: {error}; expected the record of a run, whole. Nothing was changed; bench report gives "
                    "what can still be read."
                ) from None
            raise
        return db

    def _open_to_read(self) -> sqlite3.Connection | None:
        """The record, or None where there is nothing to read but the files beside it; InputError without those."""
        path = self.folder / FILE
        trouble = f"{FILE} is not here"
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

    def _name_strangers(self) -> None:
        """Note the files and folders that are not the run's."""
        own = set(self.run()["folders"].values())
        with contextlib.suppress(OSError):
            for path in sorted(self.folder.iterdir()):
                if path.name not in own and not any(fnmatch(path.name, pattern) for pattern in OWN):
                    self._strangers.append(path.name)

    def close(self) -> None:
        """Close the file; what was written is in it."""
        if self._db is not None:
            self._db.close()

    def __enter__(self) -> "Store":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def put_run(self, name: str, value: Any) -> None:
        """Keep something about the run as a whole."""
        self._write("INSERT OR REPLACE INTO run VALUES (?, ?)", (name, json.dumps(value)))

    def run(self) -> dict[str, Any]:
        """Everything that is kept about the run as a whole; InputError where a run cannot go on by it."""
        found: dict[str, Any] = {}
        trouble: Exception | None = None
        try:
            for name, value in self._all("SELECT name, value FROM run"):
                found[str(name)] = json.loads(value)
        except (*BROKEN, ValueError, TypeError, RecursionError) as error:
            trouble = error
        if self._create:
            if trouble or not sound_plan(found.get("plan", SOUND)):
                raise self._damaged(trouble or ValueError("the plan of the run cannot be read"))
            return found
        if trouble:
            self._note(f"{FILE} does not tell all of the run as a whole ({trouble}): the rest is from {RUN}.")
        if trouble or not self.recorded:
            found = self._written.run | found
        columns = [row.columns for row in self.cells()]
        variants = {label(c["dataset"], c["dataset_options"]): c["dataset"] for c in columns}
        variants |= {label(c["backend"], c["options"]): c["backend"] for c in columns}
        whole, unknown = completed(found, variants.items(), self.folder.stat().st_mtime)
        if unknown and self._written.run.keys() - found.keys():
            self._note(f"what {FILE} does not say of the run as a whole is from {RUN}.")
            whole, unknown = completed(self._written.run | found, variants.items(), self.folder.stat().st_mtime)
        if unknown:
            self._note(f"Nothing is known, or nothing that can be used, of the run's {', '.join(sorted(unknown))}.")
        return whole

    def put_log(self, dataset: str, options: str, seed: int, digest: str, kind: str, arrays: Mapping[str, Any]) -> None:
        """Keep a log's digest and truth."""
        values = (dataset, options, seed, digest, kind, _packed(arrays))
        self._write("INSERT OR REPLACE INTO logs VALUES (?, ?, ?, ?, ?, ?)", values)

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
            arrays = _unpacked(found[0][0]) if found else {}
            problem = misfit(arrays, {}, LOG_SHAPES)
        except Exception as error:  # a damaged archive may raise anything
            arrays, problem = {}, _said(error)
        if problem:
            self._note(f"the true path cannot be read ({problem}), and is in no figure.", of)
            arrays = {}
        self._lengths[dataset, options, seed] = len(arrays.get("t", ()))
        return arrays

    def put_cell(self, row: Mapping[str, Any], arrays: Mapping[str, Any], traceback: str) -> None:
        """Keep a cell, in one transaction."""
        names = (*COLUMNS, *MORE, "arrays", "traceback")
        values = (*(row.get(name) for name in names[:-2]), _packed(arrays), traceback)
        marks = ", ".join("?" * len(names))
        self._write(f"INSERT OR REPLACE INTO cells ({', '.join(names)}) VALUES ({marks})", values)

    def cells(self) -> Iterator[Row]:
        """Every cell, in the order of the plan's names: by dataset, backend and seed.

        Left out are rows of which nothing can be made; what is no number where one belongs is None.
        """
        if self._create or self._rows is None:
            told = self._told()
            rows = [row for row in told if self._believed(row)]
            if self._trouble or len(rows) < len(told):
                rows += self._made_good({row.key for row in rows})
            self._rows = [self._cleared(row) for row in sorted(rows, key=lambda row: row.key)]
        yield from self._rows

    def _believed(self, row: Row) -> bool:
        problem = disbelief(row.columns)
        if problem:
            self._note(f"{problem}: left out.", _cell(row))
        return not problem

    def _cleared(self, row: Row) -> Row:
        wrong = nonsense(row.columns)
        for name, value in wrong.items():
            self._note(f"{name} is {repr(value)[:40]}, expected a number: the value is left out.", _cell(row))
        return Row({**row.columns, **dict.fromkeys(wrong)}, row.traceback) if wrong else row

    def _told(self) -> list[Row]:
        """The cells as they stand in the record; where that is damaged, as much of it as can be read."""
        none = dict.fromkeys((*COLUMNS, *MORE))
        if self._db is None:
            return [Row({name: row.get(name) for name in none}, "") for row in self._written.rows]
        names = list(none)
        found: list[Any] = []
        try:
            there = columns(self._db)
            names = [name for name in none if name in there]
            found = self._db.execute(f"SELECT {', '.join(names)}, traceback FROM cells").fetchall()
            if not self._create and not agree(self._db):
                raise sqlite3.DatabaseError("its table and its index of cells are at odds")
        except BROKEN as error:
            if self._create:
                raise self._damaged(error) from None
            self._trouble = self._trouble or error
        if self._trouble:
            found = salvage(self._db, names)
            self._note(f"{FILE} is damaged ({_said(self._trouble)}): it still gave {len(found)} cells.")
        return [Row(none | dict(zip(names, values, strict=True)), traceback) for *values, traceback in found]

    def _made_good(self, known: Collection[Any]) -> list[Row]:
        """The cells that a damaged record no longer has, from cells.csv."""
        if self._create or not self.recorded:
            return []
        none = dict.fromkeys((*COLUMNS, *MORE))
        rows = [Row({name: row.get(name) for name in none}, "") for row in self._written.rows]
        rows = [row for row in rows if row.key not in known and self._believed(row)]
        for sentence in self._written.said:
            self._note(sentence)
        for row in rows:
            self._note(f"the row is from {CELLS}.", _cell(row))
        return rows

    def arrays(self, row: Row, names: Collection[str] | None = None) -> dict[str, Any]:
        """A cell's arrays by name; of `names`, where given, those that it has.

        They fit each other, the row and the log's truth: where one cannot be read, or does not fit, there are none.
        """
        where = " AND ".join(f"{name} = ?" for name in KEY)
        try:
            found = self._all(f"SELECT arrays FROM cells WHERE {where}", row.key)
            arrays = _unpacked(found[0][0], names) if found else {}
            problem = misfit(arrays, {} if row.columns["steps"] is None else {"n": row.columns["steps"]})
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

    def _damaged(self, error: Exception) -> InputError:
        return InputError(f"{self.folder / FILE}: {error}; expected the record of a run, whole. Nothing was changed.")

    def _write(self, statement: str, values: Sequence[Any]) -> None:
        """One transaction; InputError where the file can no longer be written to, with all before it safe."""
        assert self._db is not None
        try:
            self._db.execute(statement, values)
        except sqlite3.Error as error:
            raise InputError(f"{self.folder / FILE}: cannot be written to: {error}.") from None


def _cell(row: Row) -> str:
    dataset, dataset_options, backend, options, seed = row.key
    return f"{label(str(dataset), dataset_options)} · {label(str(backend), options)} · seed {seed}"


def _some(names: Sequence[str]) -> str:
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return f"{', '.join(names[:NAMED])}{more}"


def _said(error: Exception) -> str:
    return " ".join(str(error).split())[:120] or type(error).__name__


def _packed(arrays: Mapping[str, Any]) -> bytes:
    file = io.BytesIO()
    np.savez_compressed(file, allow_pickle=False, **arrays)
    return file.getvalue()


def _unpacked(blob: Any, names: Collection[str] | None = None) -> dict[str, Any]:
    """The arrays of an archive; any exception at all where it is damaged."""
    if not isinstance(blob, bytes) or not blob.startswith(b"PK"):
        raise ValueError("found no archive of arrays")
    with np.load(io.BytesIO(blob), allow_pickle=False) as members:
        return {name: members[name] for name in members.files if names is None or name in names}
