"""A small record of a run, created without running anything, for tests of its readers; and edits of any record."""

import contextlib
import sqlite3
from collections.abc import Generator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from slamduel.bench.record.files import export
from slamduel.bench.record.schema import COLUMNS, FILE, KEY, label
from slamduel.bench.record.store import Known, Store
from slamduel.core.se2 import Array

STEPS, LANDMARKS = 60, 5

RUN: dict[str, Any] = {
    "command": "bench run --backend 'ekf,fastslam[particles=10]' --dataset room,park --out 'a <b>'",
    "environment": {
        "processor": "abacus & sons",
        "cores": 1,
        "memory_gb": 1.5,
        "system": "any",
        "python": "3.11",
        "packages": {"numpy": "2.0", "gtsam": None},
        "revision": None,
    },
    "kind": "run",
    "random": [],
    "implementations": {},
    "workers": 2,
    "timing_policy": "With a stop watch. GTSAM is a generic wheel.",
    "started": 1.7e9,
}


class Record:
    """A run's folder that is filled cell by cell."""

    def __init__(self, folder: Path, seed: int = 1) -> None:
        folder.mkdir()
        self.store = Store(folder, writing=True)
        self._rng = np.random.default_rng(seed)
        self._folders: dict[str, str] = {}
        self._plan: list[tuple[Any, ...]] = []
        self.store.put_about(RUN)
        self._name("", "")

    def put(self, row: dict[str, Any], arrays: dict[str, Any], traceback: str = "") -> None:
        """Stores a cell's row and arrays, under a key made of its name, replacing earlier ones."""
        named = tuple(row[name] for name in KEY)
        key, log = f"result {named}", f"log {(row['dataset'], row['dataset_options'], row['seed'])}"
        self._plan = [planned for planned in self._plan if planned[:5] != named]
        self._plan.append(
            (*named, {"dataset": named[0], "backend": named[2]}, log, key, row.get("log_name"), row.get("cluster"))
        )
        put(self.store, key, row | {"traceback": traceback}, arrays)
        self.store.put_plan(self._plan)

    def log(self, dataset: str, kind: str, seed: int = 0, *, steps: int = STEPS, landmarks: int = LANDMARKS) -> Array:
        """Stores a log's ground truth, a circle; "" for an unknown path. Returns the path either way."""
        t: Array = 0.1 * np.arange(float(steps))
        poses: Array = np.column_stack((3 * np.cos(t), 3 * np.sin(t), (t + np.pi / 2 + np.pi) % (2 * np.pi) - np.pi))
        arrays = {"t": t, "poses": poses}
        if landmarks:
            arrays |= {"ids": np.arange(landmarks), "xy": self._rng.normal(0, 3, (landmarks, 2))}
        known = Known(f"d{seed}" * 32, f"t{seed}" if kind else "", kind)
        self.store.put_log(f"log {(dataset, '', seed)}", (dataset, "", seed), known, arrays if kind else {})
        self._name(dataset, "")
        return poses

    def cell(
        self,
        dataset: str,
        kind: str,
        backend: str,
        options: str = "",
        seed: int = 0,
        *,
        off: float = 0.1,
        steps: int = STEPS,
        paths: Sequence[str] = ("online",),
        leave_out: Sequence[str] = (),
        alone: bool = True,
        **columns: Any,
    ) -> dict[str, Any]:
        """Stores a finished cell, `off` metres from the path of `log`; returns its row. `columns` replace defaults."""
        poses = self.log(dataset, kind, seed, steps=steps)
        known = self.store.archive(f"log {(dataset, '', seed)}")
        rng = self._rng
        arrays: dict[str, Any] = {
            "t": 0.1 * np.arange(steps),
            "cov": np.broadcast_to(np.diag((0.2, 0.1, 0.01)), (steps, 3, 3)).copy(),
            "step_ns": rng.integers(1_000, 90_000, steps),
        }
        row = dict.fromkeys(COLUMNS) | self._key(dataset, backend, options, seed)
        row |= {"status": "done", "reason": "", "digest": f"d{seed}" * 32, "truth_kind": kind}
        row |= {"steps": steps, "sightings": 7, "ignored": 0, "landmarks": LANDMARKS, "timing_alone": int(alone)}
        row |= {"cost_j": rng.uniform(10, 99), "cpu_s": rng.uniform(1, 9)}
        row |= {"finish_s": 0.0, "peak_mb": 12.0, "real_time": 0.01}
        row |= {f"step_us_{name}": rng.uniform(1, 900) for name in ("mean", "p50", "p95", "p99", "max")}
        for path in paths:
            prefix = "" if path == "online" else "final_"
            arrays[path] = poses + rng.normal(0, off, poses.shape)
            arrays |= {f"{prefix}map_ids": np.arange(LANDMARKS), f"{prefix}map_xy": rng.normal(0, 3, (LANDMARKS, 2))}
            arrays[f"{prefix}map_cov"] = np.broadcast_to(0.3 * np.eye(2), (LANDMARKS, 2, 2))
            if known:
                arrays |= {"at": np.arange(steps), f"{prefix}alignment": np.array((0.1, 0.2, 0.3))}
                arrays["aligned" if path == "online" else "final_aligned"] = arrays[path]
                row |= {f"{prefix}ate_m": off * rng.uniform(0.9, 1.1), f"{prefix}map_rmse_m": rng.uniform(0.1, 1)}
        if kind == "truth" and "online" in paths:
            arrays["nees"] = rng.chisquare(3, steps)
            row |= {"nees": 1.1, "nees_inside": 0.95, "heading_rad": rng.uniform(0.01, 0.1)}
        row |= columns
        if row["cost_j"] is not None:
            arrays["cost_terms"] = row["cost_j"] * np.array((0.1, 0.2, 0.7, 0.0))
            terms = dict(zip(("j_prior", "j_odometry", "j_sightings"), arrays["cost_terms"].tolist(), strict=False))
            row |= terms | {"j_final" if "final" in paths else "j_online": row["cost_j"]}
        self.put(row, {name: a for name, a in arrays.items() if name not in leave_out})
        return row

    def failed(
        self, dataset: str, kind: str, backend: str, status: str, reason: str, traceback: str = "", seed: int = 0
    ) -> None:
        """Stores a failed cell."""
        self.log(dataset, kind, seed)
        row = self._key(dataset, backend, "", seed)
        row |= {"status": status, "reason": reason, "digest": f"d{seed}" * 32, "truth_kind": kind, "timing_alone": 1}
        self.put(row, {}, traceback)

    def _key(self, dataset: str, backend: str, options: str, seed: int) -> dict[str, Any]:
        self._name(backend, options)
        return {"dataset": dataset, "dataset_options": "", "backend": backend, "options": options, "seed": seed}

    def _name(self, name: str, options: str) -> None:
        if name:
            self._folders.setdefault(label(name, options), f"folder-{len(self._folders)}")
        self.store.put_about({"folders": self._folders, "options": {one: {"particles": 10} for one in self._folders}})


def put(store: Store, key: str, row: Mapping[str, Any], arrays: Mapping[str, Any]) -> None:
    """Stores a result, replacing one under the same key."""
    with store.together() as db:
        db.execute("DELETE FROM results WHERE key = ?", (key,))
        store.put_result(key, row, arrays)


def edited(folder: Path, *statements: str, **values: Any) -> Path:
    """The run or study with its record changed behind everyone's back, `values` being those named in the SQL."""
    with contextlib.closing(sqlite3.connect(folder / FILE)) as db, db:
        for statement in statements:
            db.execute(statement, values)
    return folder


@contextlib.contextmanager
def record(folder: Path) -> Generator[sqlite3.Connection]:
    """A record that is changed, and its files with it."""
    with contextlib.closing(sqlite3.connect(folder / FILE)) as db, db:
        yield db
    for path in folder.rglob("*.tum"):
        path.unlink()
    with Store(folder) as store:
        export(store)
