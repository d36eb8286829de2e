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

COLUMNS = (
    "dataset", "dataset_options", "backend", "options", "seed", "status", "reason", "digest", "truth_kind",
    "steps", "sightings", "ignored", "landmarks", "ate_m", "ate_origin_m", "heading_rad", "rpe_m", "map_rmse_m",
    "nees", "nees_inside", "nis", "final_ate_m", "final_ate_origin_m", "final_map_rmse_m", "cost_j",
    "step_us_mean", "step_us_p50", "step_us_p95", "step_us_p99", "step_us_max", "belief_us_mean",
    "finish_s", "setup_s", "cpu_s", "peak_mb", "timing_alone",
)  # fmt: skip
"""The columns of cells.csv, in order."""

KEY = COLUMNS[:5]
"""Those that name a cell."""

WORDS = COLUMNS[:9]
"""Those that say which cell it is and how it ended; what follows them was measured."""

TEXTS = tuple(name for name in WORDS if name != "seed")
"""Those that hold no number."""

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
