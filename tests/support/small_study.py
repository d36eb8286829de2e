"""A study's store written by hand, with known results of each cell."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import create_autospec

from slamduel.bench.engine.engine import Watcher
from slamduel.bench.record.schema import label
from slamduel.bench.record.store import Store

ENVIRONMENT = {"processor": "abacus & sons", "memory_gb": None, "packages": {"slamduel": "0.1.0", "evo": None}}


class Outcome(NamedTuple):
    """One cell of the study."""

    parameters: Mapping[str, Any]  # dataset, backend, seed and swept options
    status: str  # "waiting" without a result
    columns: Mapping[str, Any] = {}


def silent() -> Watcher:
    """A silent watcher of a study."""
    return create_autospec(Watcher, instance=True)


def small_study(folder: Path, name: str, text: str, outcomes: Iterable[Outcome], size: str = "quick") -> Path:
    """The folder, with the study of this text and these cells in its store."""
    folder.mkdir(parents=True, exist_ok=True)
    cells = list(outcomes)
    with Store(folder, writing=True) as store:
        command = ["bench", "ablate", f"{name}.toml"]
        folders = {label(*map(str, _key(cell)[at : at + 2])): "a-folder" for cell in cells for at in (0, 2)}
        words: dict[str, Any] = {"kind": "study", "name": name, "size": size, "text": text, "command": command}
        words |= {"executor": "local", "workers": 2, "folders": folders, "options": {}, "timing_policy": "alone"}
        words |= {"environment": ENVIRONMENT, "started": 1.8e9}
        store.put_about(words)
        store.put_plan(
            [(*_key(cell), cell.parameters, f"log {k}", f"key {k}", None, None) for k, cell in enumerate(cells)]
        )
        for k, cell in enumerate(cells):
            if cell.status != "waiting":
                named = dict(zip(("dataset", "dataset_options", "backend", "options", "seed"), _key(cell), strict=True))
                log = f"log {[(n, v) for n, v in cell.parameters.items() if n != 'backend']}"
                row = {
                    "status": cell.status,
                    "reason": "",
                    "digest": log,
                    "seconds": 0.5,
                    "timing_alone": 1,
                    "steps": 9,
                }
                store.put_result(f"key {k}", row | named | dict(cell.columns), {})
    return folder


def _key(cell: Outcome) -> tuple[str, str, str, str, int]:
    return cell.parameters["dataset"], "", cell.parameters["backend"], "", cell.parameters["seed"]
