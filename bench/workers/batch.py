"""Batches of cells on one log, run one after another in one process, and their results."""

import platform
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...core.errors import Absent, InputError, SlamduelError
from ...core.factors import Dataset, Log, Map, Start
from ...core.truth.errors import counted
from ...datasets import archive
from ...datasets import registry as datasets
from ...datasets.truth import digest
from ..bound.bound import Bound, bound
from ..contradiction.remark import remarked
from ..measure import cell
from ..measure.cell import Job, Result
from ..plan.reference import made_with_reference
from ..record.beside_arrays import beside_arrays
from ..record.sketch import sketch

HOST = platform.node()

LOGS_KEPT = 3  # logs that a process keeps: cells that share a log come nearly one after another
LARGE_MB = 100.0  # a log of more is loaded again for each batch: each backend has a process, and all would keep it


class KeptLog(NamedTuple):
    """A log that was made before, with its truth or reference, and its archive's content."""

    path: Path  # of an archive
    digests: tuple[str, str]  # of the log and of its truth
    content: bytes = b""  # of the file, on the way to a machine that may not have it
    mistaken: bool | None = None  # of its facts; None: not known here, so that whoever loads it finds out


@dataclass(frozen=True)
class Batch:
    """A log and the jobs that run on it, each with its cell's place in the plan; without jobs the log is looked at."""

    dataset: str
    options: Any
    seed: int  # of the log: 0 where it draws no random numbers
    jobs: tuple[tuple[int, Job], ...]
    timeout_s: float  # a job, or the making of the log
    keep: bool  # the arrays of the result and of the truth come back, too
    kept: KeptLog | None = None  # the log is loaded instead of made
    whole: bool = False  # the log itself comes back, too
    map: Map | None = None  # goes into the log's prior
    start: Start = "known"  # likewise
    round: int = 1  # of the repeats: each has processes of its own
    rehearsal: bool = False  # the jobs' backends load or compile their code, and nothing is measured

    @property
    def log(self) -> tuple[str, Any, int, tuple[str, str] | None]:
        """Returns what its log is made of, with the digests of a kept one: batches with equal values share the log."""
        return self.dataset, self.options, self.seed, None if self.kept is None else self.kept.digests


class LogFacts(NamedTuple):
    """The facts of a log that the record keeps."""

    digest: str
    truth_digest: str  # of what the cells are scored by; "" where there is none
    truth_kind: str
    truth: dict[str, Any]  # where it is kept: t, poses, ids, xy, landmark and step of each sighting, what lies beside
    archive: bytes = b""  # the log and its truth: where they are to come back whole
    sketch: Any = None  # of such a log, as JSON has it
    remarks: tuple[str, ...] = ()  # what is legal in it yet odd
    mistaken: bool = False  # what looks like errors of its measurements is a mistake

    @property
    def digests(self) -> tuple[str, str]:
        """The digests of the log and of its truth."""
        return self.digest, self.truth_digest


class Finished(NamedTuple):
    """The end of a job, or of a batch that looked at its log."""

    batch: Batch
    index: int | None  # of the job's cell; None: the log was looked at  # pyright: ignore[reportIncompatibleMethodOverride]
    log: LogFacts | None  # None: it could not be made, `result` says why
    result: Result
    seconds: float  # of wall time
    alone: bool  # nothing else of the study ran on the machine at any moment while it did
    host: str


class Logs:
    """The last few logs that a process has made or loaded, shared by batches."""

    def __init__(self) -> None:
        self._kept: dict[tuple[Any, bool], tuple[Dataset, LogFacts]] = {}  # the one that was asked for last is last
        self._bounds: dict[tuple[str, str], Bound | None] = {}  # by digests, likewise

    def forget_files(self) -> None:
        """Forgets logs made from files, which may have changed."""
        for name in [name for name in self._kept if name[0][3] is None and not datasets.find(name[0][0]).seeded]:
            del self._kept[name]

    def forget_large(self) -> None:
        """Forgets logs of more than LARGE_MB."""
        for name in [name for name, (dataset, _) in self._kept.items() if _megabytes(dataset.log) > LARGE_MB]:
            del self._kept[name]

    def get(self, batch: Batch) -> tuple[Dataset, LogFacts]:
        """The batch's log and its facts; SlamduelError where it cannot be made or loaded."""
        name = batch.log, batch.round > 1
        found = self._kept.pop(name, None)
        if found is None:
            options = batch.dataset, batch.options, batch.seed, batch.map, batch.start
            dataset = _loaded(batch.kept) if batch.kept else made_with_reference(*options)
            found = dataset, _facts(batch, dataset)
        self._kept[name] = found
        while len(self._kept) > LOGS_KEPT:
            del self._kept[next(iter(self._kept))]
        return found

    def bound(self, dataset: Dataset, facts: LogFacts) -> Bound | None:
        """The least errors that the log allows: computed once."""
        if facts.digests not in self._bounds:
            self._bounds[facts.digests] = bound(*dataset)
        while len(self._bounds) > LOGS_KEPT:
            del self._bounds[next(iter(self._bounds))]
        return self._bounds[facts.digests]


def work(batch: Batch, logs: Logs, made: Callable[[LogFacts], None] = lambda _: None) -> Iterator[Finished]:
    """Runs the batch here, one job after another; `made` is called as soon as its log is there."""
    began = time.perf_counter()
    try:
        dataset, facts = logs.get(batch)
    except Absent as error:
        yield from unmade(batch, Result("skipped", str(error)), time.perf_counter() - began)
        return
    except SlamduelError as error:
        seconds = time.perf_counter() - began
        yield from unmade(batch, Result("error", f"the log could not be made: {error}"), seconds)
        return
    if not batch.keep:
        facts = facts._replace(truth={})
    if batch.whole:
        facts = facts._replace(archive=archive.packed(dataset), sketch=sketch(dataset.log).words())
    made(facts)
    if not batch.jobs:
        yield Finished(batch, None, facts, Result("done", ""), time.perf_counter() - began, False, HOST)
    for index, job in batch.jobs:
        began = time.perf_counter()
        if batch.rehearsal:
            result = cell.rehearse(job, dataset.log)
        else:
            result = cell.run_on(
                job,
                lambda: dataset.log,
                lambda: dataset.truth,
                mistaken=facts.mistaken,
                bound=lambda: logs.bound(dataset, facts),
            )
        if not batch.keep:
            result = replace(result, arrays={})
        yield Finished(batch, index, facts, result, time.perf_counter() - began, False, HOST)


def _megabytes(log: Log) -> float:
    """The size of a log's main columns."""
    columns = log.t, log.delta, log.delta_cov, log.ids, log.z, log.z_cov, log.loop_to, log.loop_delta, log.loop_cov
    return sum(column.nbytes for column in columns) / 1e6


def unmade(batch: Batch, result: Result, seconds: float) -> Iterator[Finished]:
    """Ends all jobs of a batch whose log could not be made, with that result."""
    for index in [index for index, _ in batch.jobs] or [None]:
        yield Finished(batch, index, None, result, seconds, False, HOST)


def _facts(batch: Batch, dataset: Dataset) -> LogFacts:
    """The facts of a batch's log, as far as they are needed: a repeat is not scored, those of a kept log are known."""
    if batch.round > 1:
        return digested(dataset)
    if batch.kept is None or batch.kept.mistaken is None:
        return facts_of(dataset)
    return digested(dataset)._replace(mistaken=batch.kept.mistaken)


def _loaded(kept: KeptLog) -> Dataset:
    dataset = archive.load(kept.path)
    found = digested(dataset).digests
    if found != kept.digests:
        log, expected = found[0][:12], kept.digests[0][:12]
        raise InputError(f"{kept.path}: holds another log or truth: the log's digest is {log}, expected {expected}.")
    return dataset


def digested(dataset: Dataset) -> LogFacts:
    """The digests and the kind of truth of a log, and nothing that takes long."""
    log, truth = dataset
    return LogFacts(log.digest, "", "", {}) if truth is None else LogFacts(log.digest, digest(truth), truth.kind, {})


def facts_of(dataset: Dataset) -> LogFacts:
    """The facts of a log with its truth or reference."""
    log, truth = dataset
    odd, arrays = remarked(dataset, thorough=False), beside_arrays(log)
    found = digested(dataset)._replace(truth=arrays, remarks=tuple(odd.all), mistaken=odd.mistaken)
    if truth is None:
        return found
    arrays |= {} if truth.relations is not None else {"t": truth.t, "poses": truth.poses}
    if truth.map is not None:
        ids = log.ids if truth.assigned is None else truth.assigned
        if log.partial is not None:
            alone = log.partial.ids if truth.assigned_partial is None else truth.assigned_partial
            ids = np.concatenate((ids, alone))
        arrays |= {"ids": truth.map.ids, "xy": truth.map.xy, "times": counted(ids, truth.map.ids)}
        arrays |= {} if truth.moving is None else {"moving": truth.moving}
    if truth.assigned is not None:
        steps = np.repeat(np.arange(len(log)), np.diff(log.sighting_first))
        arrays |= {"sighted": truth.assigned, "sighted_at": steps}
    return found
