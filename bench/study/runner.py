"""A study from its cells to its store: logs looked at where that is needed, cells run that have no result yet."""

import contextlib
import random
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from ...frontend.errors import InputError
from ..measure.cell import Job
from ..measure.status import FAILED
from ..record.lock import claimed
from ..record.machine import environment
from ..record.study_store import Known, StudyStore
from ..workers.batch import Batch, Finished, KeptLog, unmade
from ..workers.executor import Executor
from .key import log_key, log_seed, made_once, result_key
from .logs import StudyLogs
from .study import Study, StudyCell

MOST_JOBS = 20
"""Of a batch: no more is lost with a machine."""

ROUNDS = 4
"""Batches for each slot, at least, so that the end of a study is shared evenly."""


class Watcher(Protocol):
    """Whoever is told how a study goes along."""

    def looking(self, logs: int) -> None:
        """That many logs are looked at first: to know which results are still theirs, or to keep them."""
        ...

    def looked(self) -> None:
        """One has been, or cannot be made."""
        ...

    def say(self, sentence: str) -> None:
        """Something that a user should know."""
        ...

    def running(self, cells: int, done: int, slots: int) -> None:
        """So many cells are to be run, and so many have a result already."""
        ...

    def finished(self, cell: StudyCell, status: str, reason: str, seconds: float) -> None:
        """One has ended."""
        ...


class Wanted(NamedTuple):
    """What is asked of a study now."""

    chosen: Callable[[StudyCell], bool]  # --only
    limit: int | None  # cells at most
    retry: bool  # failed ones, too


class Tally(NamedTuple):
    """How far a study is."""

    cells: int
    done: int  # that have ended, in whatever way
    failed: int  # of those; with cells whose log could not be made


def run(
    study: Study, folder: Path, executor: Executor, wanted: Wanted, command: Sequence[str], watcher: Watcher
) -> Tally:
    """Run the study's cells into the store in `folder`, or those that it has no result of."""
    with claimed(folder), StudyStore(folder, writing=True) as store:
        return _Run(study, store, executor, watcher).run(wanted, command)


@dataclass
class _Run:
    study: Study
    store: StudyStore
    executor: Executor
    watcher: Watcher

    def run(self, wanted: Wanted, command: Sequence[str]) -> Tally:
        study, store = self.study, self.store
        refuse_another(store, study)
        store.put_words(_words(study, command, self.executor))
        self.log_keys = [log_key(cell.cell) for cell in study.cells]
        self.logs = StudyLogs(store, arrays=study.keep)
        self.statuses = store.statuses(arrays=study.keep)
        self._look(cell for cell in study.cells if self.logs.is_doubtful(cell))
        todo = self._todo(wanted)
        while absent := [study.cells[place] for place in todo if not self.logs.is_at_hand(study.cells[place])]:
            self._look(absent)
            todo = self._todo(wanted)  # where a log is another than it was, more is to be run
        self.watcher.running(len(todo), self._ended(), self.executor.slots)
        for place in todo:
            self._keep_unmade(place)
        able = [place for place in todo if self.log_keys[place] not in self.logs.lost]
        for timed in (False, True):
            places = [place for place in able if study.cells[place].timed == timed]
            for finished in self._executed(self._batches(places), alone=timed):
                self._keep(finished)
        store.put_words({"finished": time.time()})
        statuses = [self._status(place) for place in range(len(self.keys))]
        failed = sum(status in FAILED for status in statuses)
        return Tally(len(statuses), self._ended(), failed)

    def _status(self, place: int) -> str | None:
        """How the cell ended, in an error where its log could not be made; None where it has not."""
        key = self.keys[place]
        if key is None:
            return "error" if self.log_keys[place] in self.logs.unmade else None
        return self.statuses.get(key)

    def _ended(self) -> int:
        return sum(self._status(place) is not None for place in range(len(self.keys)))

    def _executed(self, batches: Sequence[Batch], *, alone: bool) -> Iterator[Finished]:
        """Each job of the batches as it ends; whatever happens here ends those that are running."""
        if batches:
            with contextlib.closing(self.executor.run(batches, alone=alone)) as ended:
                yield from ended

    def _look(self, cells: Iterable[StudyCell]) -> None:
        """Have the logs of these cells made, each once, for their digests or to be kept; plan all cells by them."""
        looks = ((batch_of(self.study, cell, {}, whole=made_once(cell.cell)), cell) for cell in cells)
        looked_at = {batch.log: (batch, cell) for batch, cell in looks}
        self.watcher.looking(len(looked_at))
        for finished in self._executed([batch for batch, _ in looked_at.values()], alone=False):
            if told := self.logs.looked(looked_at[finished.batch.log][1], finished):
                self.watcher.say(told)
            self.watcher.looked()
        self.keys = [self._key(place) for place in range(len(self.study.cells))]
        self.store.put_plan([_plan_row(cell, key) for cell, key in zip(self.study.cells, self.keys, strict=True)])

    def _key(self, place: int) -> str | None:
        """That of the cell's result, where its log is known."""
        cell, log = self.study.cells[place], self.logs.known.get(self.log_keys[place])
        return None if log is None else result_key(cell.cell, log, timed=cell.timed, oracle=self.study.oracle)

    def _todo(self, wanted: Wanted) -> list[int]:
        """The places of the cells that are to be run now, in an order that is shuffled but always the same.

        Cells of one key have one result: it is got once.
        """
        places: dict[Any, int] = {}
        for place, (cell, key) in enumerate(zip(self.study.cells, self.keys, strict=True)):
            status = self._status(place)
            if wanted.chosen(cell) and (status is None or (wanted.retry and status in FAILED)):
                places.setdefault(key or place, place)
        todo = list(places.values())
        random.Random(0).shuffle(todo)
        return todo[: wanted.limit]

    def _batches(self, places: Sequence[int]) -> list[Batch]:
        """Cells of the same log together, as far as there are batches enough for everybody."""
        most = min(MOST_JOBS, max(1, len(places) // (ROUNDS * self.executor.slots)))
        by_log: dict[str, list[tuple[int, StudyCell]]] = {}
        for place in places:
            by_log.setdefault(self.log_keys[place], []).append((place, self.study.cells[place]))
        return [
            batch_of(self.study, group[0][1], dict(group[first : first + most]), self.logs.kept.get(key))
            for key, group in by_log.items()
            for first in range(0, len(group), most)
        ]

    def _keep_unmade(self, place: int) -> None:
        """What becomes of a cell whose log was looked at in vain, if it was."""
        cell, looked = self.study.cells[place], self.logs.lost.get(self.log_keys[place])
        if looked is not None:
            for finished in unmade(batch_of(self.study, cell, {place: cell}), looked.result, looked.seconds):
                self._keep(finished)

    def _keep(self, finished: Finished) -> None:
        """Put a result into the store as soon as it is there."""
        assert finished.index is not None
        cell, result, of_log = self.study.cells[finished.index], finished.result, self.log_keys[finished.index]
        with self.store.together():
            if finished.log is not None:
                self.logs.know(cell, finished.log)
            key = self.keys[finished.index] = self._key(finished.index)
            if key is None:
                self.store.settle(finished.index, None, result.reason)
                self.logs.know_unmade(cell)
            else:
                if self.store.put_result(key, self._row(cell, finished, self.logs.known[of_log]), result.arrays):
                    self.statuses[key] = result.status
                self.store.settle(finished.index, key, None)
        self.watcher.finished(cell, result.status, result.reason, finished.seconds)

    def _row(self, cell: StudyCell, finished: Finished, log: Known) -> dict[str, Any]:
        names = ("dataset", "dataset_options", "backend", "options", "seed")
        result = finished.result
        row = dict(zip(names, cell.cell.key, strict=True)) | {"status": result.status, "reason": result.reason}
        row |= {"digest": log.digest, "truth_kind": log.truth_kind, "timing_alone": int(finished.alone)}
        row |= {"seconds": finished.seconds, "host": finished.host, "executor": self.executor.name}
        return row | {"recorded": time.time(), "traceback": result.traceback} | result.row


def refuse_another(store: StudyStore, study: Study) -> None:
    """InputError where the folder holds another study than this one, of whatever text."""
    name = store.words().get("name", study.name)
    if name != study.name:
        raise InputError(f"--out {store.folder}: holds the study {name}, expected {study.name} or another folder.")


def batch_of(
    study: Study,
    cell: StudyCell,
    cells: Mapping[int, StudyCell],
    kept: KeptLog | None = None,
    *,
    whole: bool = False,
) -> Batch:
    """Cells of the study by their places, all on the log of `cell`; none to look at the log."""
    dataset = cell.cell.dataset
    jobs = tuple((place, _job(study, one)) for place, one in cells.items())
    return Batch(dataset.name, dataset.options, log_seed(cell.cell), jobs, study.timeout_s, study.keep, kept, whole)


def _job(study: Study, cell: StudyCell) -> Job:
    backend = cell.cell.backend
    return Job(backend.label, backend.name, backend.options, cell.cell.seed, study.memory_mb, study.oracle)


def _plan_row(cell: StudyCell, key: str | None) -> tuple[Any, ...]:
    return (*cell.cell.key, dict(cell.parameters), key)


def _words(study: Study, command: Sequence[str], executor: Executor) -> Mapping[str, Any]:
    return {
        "name": study.name,
        "size": study.size,
        "text": study.text,
        "command": list(command),
        "executor": executor.name,
        "environment": environment(),
        "started": time.time(),
    }
