"""A run from plan to folder: logs prepared, cells run that are not yet in the record, files exported."""

import os
import shlex
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from ...backends import registry as backends
from ...frontend.errors import InputError
from ...frontend.factors import Truth
from ...frontend.sketch import Sketch
from ..measure import cell as cells
from ..plan import prepare
from ..plan.plan import Cell, Plan
from ..plan.spec import DatasetVariant
from ..record.files import export
from ..record.lock import LOCK, claimed
from ..record.machine import environment
from ..record.schema import FILE, Row
from ..record.writer import Recorder
from ..workers.tasks import Ended, execute

LOGS = "logs"
"""The folder, in a run's, of logs that were handed over in Python."""

TIMING_POLICY = (
    "Process CPU time of each step(), the clock's own cost subtracted, garbage collection off, one thread, after a "
    "warm-up on a backend of its own. Beliefs, map and finish are timed apart, in a second pass whose path is the same "
    "to the last bit. timing_alone = 0 marks cells that ran side by side with others. GTSAM is the published generic "
    "wheel; so are numpy and its BLAS."
)


class Watcher(Protocol):
    """Whoever is told how a run goes along."""

    def preparing(self, logs: int) -> None:
        """That many logs are to be made."""
        ...

    def prepared(self, name: str) -> None:
        """One is ready."""
        ...

    def running(self, cells: Sequence[Cell], before: Sequence[Row], workers: int) -> None:
        """These cells are to be run, so many at once; `before` are in the record already."""
        ...

    def finished(self, cell: Cell, row: dict[str, Any], seconds: float) -> None:
        """One has ended, after so much wall time; what it has of cells.csv."""
        ...

    def reporting(self) -> None:
        """All have; what is left to do is the report."""
        ...


def run(plan: Plan, folder: Path, workers: int, command: list[str], watcher: Watcher) -> None:
    """Run the plan's cells into `folder`, or those that its record still lacks; then write the folder's files.

    InputError where a log cannot be had or the folder not be used; nothing is left behind then that was not there.
    """
    with claimed(folder), tempfile.TemporaryDirectory(prefix="slamduel-") as scratch:
        logs = _prepare(plan, Path(scratch), watcher)
        with Recorder(folder) as store:
            _describe(store, plan, command, workers)
            for c in plan.cells():
                _record_log(store, c, logs[c.dataset.label, c.seed])
            _record_truths(store, logs)
            sketches = {f"{name}, seed {seed}": log.sketch.words() for (name, seed), log in logs.items()}
            store.put_run("sketches", store.run().get("sketches", {}) | sketches)
            _run_cells(store, plan, logs, workers, watcher)
            store.put_run("finished", time.time())
            export(store)


def recorded_plan(folder: Path) -> Plan | None:
    """The plan of the run in `folder`; None where it holds none. InputError where it holds something else."""
    if (folder / FILE).is_file():
        with Recorder(folder) as store:  # a run killed at its very start may have left no tables yet
            words = store.run().get("plan")
        return None if words is None else Plan.from_words(words)
    if folder.exists() and (not folder.is_dir() or any(item.name not in (LOCK, LOGS) for item in folder.iterdir())):
        found = f"a run's files without their record, {FILE}" if (folder / "run.json").is_file() else "no run"
        raise InputError(f"--out {folder}: found {found}; expected a new or empty folder, or a run's.")
    return None


class _Ready(NamedTuple):
    """A prepared log."""

    archive: Path
    digest: str
    truth: Truth | None
    told: str | None  # the digest of the dataset's own truth
    sketch: Sketch


_Logs = dict[tuple[str, int], _Ready]
"""By the dataset's label and the cell's seed."""


def _prepare(plan: Plan, scratch: Path, watcher: Watcher) -> _Logs:
    """Every log that the cells need, in its archive: one for all seeds where the dataset draws no random numbers.

    Nothing is timed yet, so every core is used.
    """
    keys = {(c.dataset.label, c.seed): _log_seed(c) for c in plan.cells()}
    by_label = {dataset.label: dataset for dataset in plan.datasets}
    wanted = sorted({(name, drawn) for (name, _), drawn in keys.items()})
    tasks = [_preparation(plan, by_label[name], seed, scratch / f"{k}.npz") for k, (name, seed) in enumerate(wanted)]
    watcher.preparing(len(tasks))
    ready: dict[tuple[str, int], _Ready] = {}
    for ended in execute(prepare.run, tasks, workers=os.cpu_count() or 1):
        name, seed = wanted[ended.task]
        if ended.death:
            raise InputError(f"dataset {name}, seed {seed}: could not be made; {ended.death}.")
        ready[name, seed] = _Ready(tasks[ended.task].archive, *ended.value)
        watcher.prepared(f"{name} · seed {seed}")
    return {(name, seed): ready[name, drawn] for (name, seed), drawn in keys.items()}


def _preparation(plan: Plan, dataset: DatasetVariant, seed: int, archive: Path) -> prepare.Task:
    given = None if plan.map is None else plan.map.of(dataset, seed)
    return prepare.Task(dataset.name, dataset.options, seed, archive, given)


def _log_seed(cell: Cell) -> int:
    """The seed that the cell's log is made with."""
    return cell.seed if cell.dataset.source.seeded else 0


def _describe(store: Recorder, plan: Plan, command: list[str], workers: int) -> None:
    """Keep what the run is; of one that goes on, what it was started as."""
    known = store.run()
    variants = [*plan.datasets, *plan.backends]
    about = {
        "plan": plan.words(),
        "cells": len(plan.cells()),
        "command": shlex.join(command),
        "options": {variant.label: vars(variant.options) for variant in variants},
        "folders": {variant.label: variant.slug for variant in variants},
        "implementations": {
            v.label: backends.implementation(v.name, v.options) for v in plan.backends if v.builder is not None
        },
        "random": [v.label for v in plan.backends if v.builder is not None and v.builder.random],
        "environment": environment(),
        "map": None if plan.map is None else plan.map.words(),
        "workers": workers,
        "timing_policy": TIMING_POLICY,
        "started": time.time(),
    }
    for name, value in about.items():
        if name not in known:
            store.put_run(name, value)


def _record_log(store: Recorder, cell: Cell, log: _Ready) -> None:
    name, options, seed = cell.dataset.name, cell.dataset.given, cell.seed
    before = store.digest(name, options, seed)
    if before == log.digest:
        return
    if before is not None:
        raise InputError(
            f"--out {store.folder}: {cell.dataset.label}, seed {seed}, has changed since this run was begun: its "
            f"digest is {log.digest[:12]}, expected {before[:12]}; run into another folder."
        )
    arrays: dict[str, Any] = {}
    if log.truth is not None:
        arrays = {"t": log.truth.t, "poses": log.truth.poses}
        if log.truth.map is not None:
            arrays |= {"ids": log.truth.map.ids, "xy": log.truth.map.xy}
    store.put_log(name, options, seed, log.digest, log.truth.kind if log.truth else "", arrays)


def _record_truths(store: Recorder, logs: _Logs) -> None:
    """Keep the digests of the datasets' own truths; InputError where one is no longer what the cells were scored by."""
    known: dict[str, str | None] = store.run().get("truths", {})  # a run of an earlier version has none
    told = {f"{name}, seed {seed}": log.told for (name, seed), log in logs.items()}
    for log, now in told.items():
        if (before := known.get(log, now)) != now:
            found, expected = ("no truth" if digest is None else digest[:12] for digest in (now, before))
            raise InputError(
                f"--out {store.folder}: the truth of {log}, has changed since this run was begun: its digest is "
                f"{found}, expected {expected}; run into another folder."
            )
    store.put_run("truths", known | told)


def _run_cells(store: Recorder, plan: Plan, logs: _Logs, workers: int, watcher: Watcher) -> None:
    """Run what the record lacks; a row is in it as soon as its cell has ended."""
    before = list(store.cells())
    done = {row.key for row in before}
    todo = [c for c in plan.cells() if c.key not in done]
    watcher.running(todo, before, workers)
    able = [c for c in todo if c.backend.builder is not None]
    for c in todo:
        if c.backend.builder is None:
            row = _keep(store, c, logs, cells.Result("error", c.backend.missing), True)
            watcher.finished(c, row, 0.0)
    tasks = [task(plan, c, logs[c.dataset.label, c.seed].archive) for c in able]
    for ended in execute(cells.run, tasks, workers=workers, timeout_s=plan.timeout_s):
        result = ended.value or _dead(ended, plan.timeout_s)
        row = _keep(store, able[ended.task], logs, result, ended.alone)
        watcher.finished(able[ended.task], row, ended.seconds)


def task(plan: Plan, cell: Cell, archive: Path) -> cells.Task:
    """What a worker is told of a cell whose log is in `archive`."""
    backend = cell.backend
    return cells.Task(backend.label, backend.name, backend.options, cell.seed, plan.memory_mb, plan.oracle, log=archive)


def _dead(ended: Ended, timeout_s: float) -> cells.Result:
    """The result of a cell whose process returned none."""
    if ended.death == "timeout":
        return cells.Result("timeout", f"was not finished after {timeout_s:g} s of wall time and was stopped")
    return cells.Result("error", ended.death)


def _keep(store: Recorder, cell: Cell, logs: _Logs, result: cells.Result, alone: bool) -> dict[str, Any]:
    """Put the cell into the record; its row."""
    names = ("dataset", "dataset_options", "backend", "options", "seed")
    log = logs[cell.dataset.label, cell.seed]
    row = dict(zip(names, cell.key, strict=True)) | {"status": result.status, "reason": result.reason}
    row |= {"digest": log.digest, "truth_kind": log.truth.kind if log.truth else "", "timing_alone": int(alone)}
    row |= result.row
    store.put_cell(row, result.arrays, result.traceback)
    return row
