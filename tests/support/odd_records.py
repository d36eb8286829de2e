"""Records of runs whose numbers are extreme, missing, infinite or all the same, drawn from a seed."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from slamduel.bench.record.schema import KEY
from slamduel.bench.words.columns import CELLS, METRICS
from small_record import Record

EXTREME = (0.0, 5e-324, 1e-300, 1e-9, 1.0, 1.0, 3.0, 1e9, 1e300, 1.7e308, float("inf"))
KINDS = ("truth", "truth", "reference", "")
MEASURED = [column for column in (*CELLS, *METRICS) if column.kind.is_measured]
COUNTS = ("steps", "sightings", "ignored", "landmarks", "timing_alone", "told", "surveyed")  # whole, as a run counts
ARRAYS = ("nees", "nis", "n_eff", "ancestors", "cov", "map_xy", "final_map_xy", "map_cov", "final_map_cov", "step_ns")


def odd_record(folder: Path, seed: int) -> Record:
    """A run of up to four backends on one or two datasets and up to eight seeds."""
    rng = np.random.default_rng(seed)
    made = Record(folder, seed)
    backends = ("dead-reckoning", "ekf", "isam2", "own:x")[: rng.integers(1, 5)]
    for dataset in ("room", "park")[: rng.integers(1, 3)]:
        kind = str(rng.choice(KINDS))
        steps = int(rng.choice((1, 2, 12)))
        for backend in backends:
            usual = {name: _value(rng) for name in _some(rng)}  # of all cells of the backend
            for k in range(int(rng.choice((1, 2, 7)))):
                if rng.random() < 0.1:
                    made.failed(dataset, kind, backend, str(rng.choice(("error", "diverged", "skipped"))), "so", seed=k)
                    made.log(dataset, kind, k, steps=steps)
                    continue
                own = {name: _value(rng) for name in _some(rng)} if rng.random() < 0.5 else {}
                paths = (("online",), ("final",), ("online", "final"))[rng.integers(3)]
                row = made.cell(dataset, kind, backend, seed=k, steps=steps, paths=paths)
                made.put(row | usual | own, _spoilt_arrays(rng, made.store.archive(_key(row)), steps))
    return made


def _key(row: Mapping[str, Any]) -> str:
    return f"result {tuple(row[name] for name in KEY)}"


def _spoilt_arrays(rng: np.random.Generator, arrays: dict[str, Any], steps: int) -> dict[str, Any]:
    arrays |= {name: np.ones(steps) for name in ("nis", "n_eff", "ancestors", "wall_ns", "belief_ns")}
    arrays |= {"nis_dof": np.full(steps, 2), "refused": np.zeros(steps, np.int64)}
    return {name: _spoilt(rng, a) if name in ARRAYS and rng.random() < 0.5 else a for name, a in arrays.items()}


def _some(rng: np.random.Generator) -> list[str]:
    names = [column.name for column in MEASURED if column.name not in COUNTS]
    return [name for name in names if rng.random() < rng.choice((0.05, 0.5))]


def _value(rng: np.random.Generator) -> Any:
    return None if rng.random() < 0.2 else float(rng.choice(EXTREME))


def _spoilt(rng: np.random.Generator, values: Any) -> Any:
    if values.dtype.kind in "iu":
        return np.zeros_like(values) if rng.random() < 0.5 else np.full_like(values, 10**15)
    numbers = EXTREME if values.ndim == 1 else (0.0, 1e-310, -1e300, 1e308)  # maps and covariances are finite
    odd = rng.choice(numbers, values.shape)
    return np.where(rng.random(values.shape) < rng.choice((0.1, 1.0)), odd, values)
