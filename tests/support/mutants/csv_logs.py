"""Mutated CSV logs: of tables that are changed, and of files that are damaged."""

import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import slamduel
from fuzzing import damaged
from slamduel.core.se2 import Array

from .drive import TABLES, Tables, drive
from .ending import Ended, in_any_order, judged, sound
from .tables import MUTATIONS

REUSED = 20  # mutations of one drive


def texts(tables: Tables) -> dict[str, str]:
    """The CSV files of the tables."""
    return {name: "\n".join([TABLES[name], *(_row(name, row) for row in rows)]) + "\n" for name, rows in tables.items()}


def _row(name: str, row: Array) -> str:
    return ",".join(str(int(x)) if name == "detections" and k == 1 else f"{x:.9g}" for k, x in enumerate(row))


def written(folder: Path, files: dict[str, str | bytes]) -> str:
    """Writes CSV files; returns the dataset's name with its options."""
    for name, content in files.items():
        path = folder / f"{name}.csv"
        path.write_bytes(content.encode() if isinstance(content, str) else content)
    return f"csv[{','.join(f'{name}={folder / name}.csv' for name in files)}]"


def tried(cases: int, seed: int = 0) -> Iterator[Ended]:
    """Mutates that many logs, every kind in turn; each sixth is a damaged file instead."""
    kinds = in_any_order(MUTATIONS, seed)
    with tempfile.TemporaryDirectory(prefix="slamduel-") as scratch:
        folder = Path(scratch)
        clean, right = Tables(), dict[str, Any]()
        for case in range(cases):
            rng = np.random.default_rng([seed, case])
            if case % REUSED == 0:
                clean = drive(rng)
                right = sound(slamduel.load(written(folder, dict(texts(clean)))))
            if case % 6 == 5:
                files: dict[str, str | bytes] = dict(texts(clean))
                victim = list(files)[case // 6 % len(files)]
                (files[victim],) = list(damaged(texts(clean)[victim].encode(), case // 6 % 6 + 1, case))[-1:]
                yield judged(f"csv {victim}: damaged", partial(slamduel.load, written(folder, files)), right)
                continue
            kind = kinds[(case - case // 6) % len(kinds)]
            mutated = {name: rows.copy() for name, rows in clean.items()}
            MUTATIONS[kind](mutated, rng)
            yield judged(f"csv {kind}", partial(slamduel.load, written(folder, dict(texts(mutated)))), right)
