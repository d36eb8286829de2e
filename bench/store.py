"""The one record of a run: an SQLite file, written by one writer, a transaction a cell. Everything else is its export.

run    what was asked for and where it ran, as JSON by name
logs   a row a (dataset variant, seed): digest, and the truth as arrays
cells  a row a cell: the columns of cells.csv, and its arrays (numpy's .npz) for plots and exports
"""

import io
import json
import sqlite3
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..frontend.errors import InputError

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
    "growth_steps", "growth_landmarks", "j_prior", "j_odometry", "j_sightings", "j_loops",
    "n_eff_least", "ancestors_left", "refused_share",
)  # fmt: skip
"""The columns of metrics.csv after those that name the cell, in order."""

FILE = "results.sqlite"
VERSION = 1

_SCHEMA = f"""
CREATE TABLE run (name TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE logs (dataset TEXT, dataset_options TEXT, seed INTEGER, digest TEXT, truth_kind TEXT, arrays BLOB,
                   PRIMARY KEY (dataset, dataset_options, seed));
CREATE TABLE cells ({", ".join((*COLUMNS, *MORE))}, arrays BLOB, traceback TEXT,
                    PRIMARY KEY (dataset, dataset_options, backend, options, seed));
PRAGMA user_version = {VERSION};
"""


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
    """An open record. Reading is possible while another process writes."""

    def __init__(self, folder: Path, *, create: bool = False) -> None:
        self.folder = folder
        path = folder / FILE
        if not create and not path.is_file():
            raise InputError(f"{folder}: there is no {FILE} here; expected the folder of a run.")
        self._db = sqlite3.connect(path, isolation_level=None)
        try:
            self._open(path, create)
        except BaseException as error:
            self._db.close()
            if isinstance(error, sqlite3.DatabaseError):
                raise InputError(f"{path}: {error}; expected the record of a run.") from None
            raise

    def _open(self, path: Path, create: bool) -> None:
        """Make sure that the tables are there, and are ours."""
        version = self._db.execute("PRAGMA user_version").fetchone()[0]
        if version == 0 and create:
            self._db.execute("PRAGMA journal_mode = WAL")
            self._db.executescript(f"BEGIN; {_SCHEMA} COMMIT;")
        elif version != VERSION:
            raise InputError(f"{path}: found a record of format {version}, expected {VERSION}.")
        elif create:  # a run of an earlier version goes on with the columns that have come since
            for name in (name for name in (*COLUMNS, *MORE) if name not in self._columns()):
                self._db.execute(f"ALTER TABLE cells ADD COLUMN {name}")

    def _columns(self) -> set[str]:
        """The columns that the table of cells has."""
        return {row[1] for row in self._db.execute("PRAGMA table_info(cells)")}

    def close(self) -> None:
        """Close the file; what was written is in it."""
        self._db.close()

    def __enter__(self) -> "Store":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def put_run(self, name: str, value: Any) -> None:
        """Keep something about the run as a whole."""
        self._write("INSERT OR REPLACE INTO run VALUES (?, ?)", (name, json.dumps(value)))

    def run(self) -> dict[str, Any]:
        """Everything that is kept about the run as a whole."""
        return {name: json.loads(value) for name, value in self._db.execute("SELECT name, value FROM run")}

    def put_log(self, dataset: str, options: str, seed: int, digest: str, kind: str, arrays: Mapping[str, Any]) -> None:
        """Keep a log's digest and truth."""
        values = (dataset, options, seed, digest, kind, _packed(arrays))
        self._write("INSERT OR REPLACE INTO logs VALUES (?, ?, ?, ?, ?, ?)", values)

    def digest(self, dataset: str, options: str, seed: int) -> str | None:
        """The digest a log had when it was first prepared for this run."""
        query = "SELECT digest FROM logs WHERE dataset = ? AND dataset_options = ? AND seed = ?"
        found = self._db.execute(query, (dataset, options, seed)).fetchone()
        return None if found is None else found[0]

    def truth(self, dataset: str, options: str, seed: int) -> dict[str, Any]:
        """A log's arrays: `t`, `poses`, and where the landmarks are known `ids` and `xy`; empty with no truth."""
        query = "SELECT arrays FROM logs WHERE dataset = ? AND dataset_options = ? AND seed = ?"
        found = self._db.execute(query, (dataset, options, seed)).fetchone()
        return {} if found is None else _unpacked(found[0])

    def put_cell(self, row: Mapping[str, Any], arrays: Mapping[str, Any], traceback: str) -> None:
        """Keep a cell, in one transaction."""
        names = (*COLUMNS, *MORE, "arrays", "traceback")
        values = (*(row.get(name) for name in names[:-2]), _packed(arrays), traceback)
        marks = ", ".join("?" * len(names))
        self._write(f"INSERT OR REPLACE INTO cells ({', '.join(names)}) VALUES ({marks})", values)

    def cells(self) -> Iterator[Row]:
        """Every cell, in the order of the plan's names: by dataset, backend and seed."""
        order = "dataset, dataset_options, backend, options, seed"
        there = self._columns()
        names = [name for name in (*COLUMNS, *MORE) if name in there]
        none = dict.fromkeys((*COLUMNS, *MORE))
        query = f"SELECT {', '.join(names)}, traceback FROM cells ORDER BY {order}"
        for *values, traceback in self._db.execute(query):
            yield Row(none | dict(zip(names, values, strict=True)), traceback)

    def arrays(self, row: Row, names: Collection[str] | None = None) -> dict[str, Any]:
        """A cell's arrays by name; of `names`, where given, those that it has."""
        where = " AND ".join(f"{name} = ?" for name in ("dataset", "dataset_options", "backend", "options", "seed"))
        return _unpacked(self._db.execute(f"SELECT arrays FROM cells WHERE {where}", row.key).fetchone()[0], names)

    def _write(self, statement: str, values: Sequence[Any]) -> None:
        """One transaction; InputError where the file can no longer be written to, with all before it safe."""
        try:
            self._db.execute(statement, values)
        except sqlite3.Error as error:
            raise InputError(f"{self.folder / FILE}: cannot be written to: {error}.") from None


def _packed(arrays: Mapping[str, Any]) -> bytes:
    file = io.BytesIO()
    np.savez_compressed(file, allow_pickle=False, **arrays)
    return file.getvalue()


def _unpacked(blob: bytes, names: Collection[str] | None = None) -> dict[str, Any]:
    with np.load(io.BytesIO(blob), allow_pickle=False) as members:
        return {name: members[name] for name in members.files if names is None or name in names}
