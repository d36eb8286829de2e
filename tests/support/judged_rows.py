"""Rows of backends whose errors are known, for the verdict to judge."""

from typing import Any

import numpy as np

from slamduel.bench.record.schema import COLUMNS, MORE, ROUND, Row

SEED = 4
LOGS = np.exp(np.random.default_rng(SEED).normal(-3, 0.4, 40))
"""How hard each log is: errors are this times a backend's own."""


def told(backend: str, kind: str = "truth", *, one_log: bool = False, **columns: Any) -> list[Row]:
    """Cells of a backend, one a value of the columns; a cell is done unless its status says otherwise."""
    n = max(map(len, columns.values()))
    about: dict[str, Any] = dict.fromkeys((*COLUMNS, *MORE))
    about |= {"dataset": "room", "dataset_options": "", "backend": backend, "options": "", "truth_kind": kind}
    about |= {"status": "done", "reason": "", "timing_alone": 1}
    rows = [about | {"seed": k, "digest": "d" if one_log else f"d{k}"} for k in range(n)]
    for name, values in columns.items():
        for row, value in zip(rows, values, strict=True):
            row[name] = value
    return [Row(row, "") for row in rows]


def timed(cells: list[Row], *rounds: float, noise: float = 0.02, path: str = "same", **more: Any) -> list[Row]:
    """The cells with a time in every round: theirs, times a factor of the round and chance; `path`: what they found."""
    found: list[Row] = []
    rng = np.random.default_rng([SEED, *cells[0].columns["backend"].encode()])
    for row in cells:
        times: list[dict[str, Any]] = []
        for number, factor in enumerate(rounds, 1):
            one: dict[str, Any] = dict.fromkeys(ROUND) | {"round": number, "status": "done", "path": path, **more}
            of = {name: row.columns[name] for name in ("step_us_p50", "cpu_s") if row.columns[name] is not None}
            one |= {name: value * factor * np.exp(rng.normal(0, noise)) for name, value in of.items()}
            times.append(one | {"timing_alone": 1})
        found.append(row._replace(rounds=times))
    return found


def rows(backend: str, times: float, n: int = 20, *, sd: float = 0.05, step: float = 10.0, **more: Any) -> list[Row]:
    """Cells whose error is that many times what the log's is, give or take."""
    rng = np.random.default_rng([SEED, *backend.encode()])
    made: dict[str, Any] = {
        "ate_m": (LOGS[:n] * times * np.exp(rng.normal(0, sd, n))).tolist(),
        "step_us_p50": [step] * n,
    }
    made |= {"cpu_s": [step] * n}
    for name, value in more.items():
        made[name] = value if isinstance(value, list) else [value] * n
    return told(backend, **made)
