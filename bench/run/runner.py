"""Runs a plan into its folder: its cells through the engine, then the folder's files from the record."""

import contextlib
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ...core.errors import InputError
from ..engine.engine import Watcher
from ..engine.engine import run as run_cells
from ..engine.log_files import FOLDER as LOGS
from ..engine.request import RunRequest
from ..plan.plan import Plan
from ..plan.work import work_of
from ..record.database import Empty
from ..record.files import export
from ..record.lock import LOCK
from ..record.schema import FILE
from ..record.store import Store
from ..workers.executor import Executor

__all__ = ["LOGS", "any_ended", "killed_plan", "recorded_plan", "run"]


def run(
    plan: Plan,
    folder: Path,
    executor: Executor,
    command: Sequence[str],
    watcher: Watcher,
    *,
    retry: bool = False,
    strict: bool = False,
) -> None:
    """Runs the plan's missing cells, then writes the folder's files. InputError leaves nothing new behind."""

    def about(known: Mapping[str, Any]) -> Mapping[str, Any]:
        _refuse_a_study(folder, known)
        facts: dict[str, Any] = {
            "kind": "run",
            "plan": plan.words(),
            "command": shlex.join(command),
            "map": None if plan.map is None else plan.map.words(),
        }
        kept: dict[str, Any] = {**facts, **known}  # a continued run keeps its first facts, but for added repeats
        kept["plan"] = {**kept["plan"], "repeats": plan.repeats}
        return kept

    run_cells(work_of(plan), folder, executor, RunRequest(retry=retry, strict=strict), about, watcher)
    with Store(folder) as store:
        export(store)


def recorded_plan(folder: Path) -> Plan | None:
    """Reads the plan of the run in `folder`; None where it holds none, InputError where it holds something else."""
    if (folder / FILE).is_file():
        with contextlib.suppress(Empty), Store(folder) as store:
            known = store.about()
            _refuse_a_study(folder, known)
            if store.planned():
                return Plan.from_words(known.get("plan"))
        return None
    if folder.exists() and (not folder.is_dir() or any(item.name not in (LOCK, LOGS) for item in folder.iterdir())):
        found = f"a run's files without their record, {FILE}" if (folder / "run.json").is_file() else "no run"
        raise InputError(f"--out {folder}: found {found}; expected a new or empty folder, or a run's.")
    return None


def killed_plan(folder: Path) -> Plan | None:
    """Reads the plan of a run that was killed before all of its logs were made; None where `folder` holds no such."""
    if (folder / FILE).is_file():
        with contextlib.suppress(Empty), Store(folder) as store:
            known = store.about()
            if known.get("kind") == "run" and not store.planned():
                return Plan.from_words(known.get("plan"))
    return None


def any_ended(folder: Path) -> bool:
    """True if a cell of the run in `folder` has ended; InputError where its record cannot be read."""
    with Store(folder) as store:
        return next(store.cells(), None) is not None


def _refuse_a_study(folder: Path, known: Mapping[str, Any]) -> None:
    if known.get("kind", "run") != "run":
        raise InputError(f"--out {folder}: holds the study {known.get('name')}; expected a new folder, or a run's.")
