"""Runs cells in processes of this machine: each does many, is watched meanwhile, and is replaced when it goes wrong.

A process's earlier jobs must not show in a result. So an error in one that has done other jobs, and every death, is
tried once more by a new process before it is believed. Where cells run alone, to be timed, each backend has a process
of its own: threads or patches that a plug-in leaves behind cannot reach the others.
"""

import os
import shutil
import tempfile
import time
from collections.abc import Generator, Iterator, Sequence
from dataclasses import replace
from multiprocessing.connection import wait
from multiprocessing.util import Finalize
from pathlib import Path

from ..measure.cell import Result
from .batch import Batch, Finished
from .batch_queue import BatchQueue
from .pool_worker import PoolWorker

MOST_JOBS = 500
"""That a process does before it is replaced: what leaks does not add up, and a new one costs no more than a few jobs.
"""

MOST_WAIT_S = 3600.0
"""Between two looks at the clock: the system refuses to wait for weeks at once."""

AHEAD = 2
"""Batches in a worker's hands, so that it never waits for whoever takes the results in."""


MOST_CREWS = 8
"""Backends whose processes are kept when cells run alone: each holds its libraries and its last few logs."""

REHEARSAL_S = 30.0
"""Limit of the time in which a backend loads or compiles its code before cells run alone; its cells do the rest."""

Crew = list[PoolWorker]


class Local:
    """A pool of `workers` processes, forked from one server. One thread at a time may use it; others have their own."""

    name = "local"

    def __init__(self, workers: int) -> None:
        self.slots = workers
        self._crews: dict[str, Crew] = {}  # by backend where cells run alone, else under ""
        self._calls = 0
        self._finish: Finalize | None = None

    def run(self, batches: Sequence[Batch], *, alone: bool) -> Generator[Finished]:
        """Each job as it ends; `alone`, as always with one slot: nothing else runs meanwhile, the caller included.

        Where there are no jobs, only logs to be made, every core is used.
        """
        if self._finish is None:
            self._folder = Path(tempfile.mkdtemp(prefix="slamduel-"))
            self._finish = Finalize(self, _finish, (self._crews, self._folder), exitpriority=1)  # at exit at the latest
        self._calls += 1
        if not any(batch.jobs for batch in batches):
            yield from self._work(BatchQueue(batches), self._crew(""), max(self.slots, os.cpu_count() or 1), AHEAD)
        elif alone or self.slots == 1:
            _end(self._crew(""))
            self._rehearse(batches)
            for batch in _single(batches):
                crew = self._crew(batch.jobs[0][1].backend)
                for finished in self._work(BatchQueue([batch]), crew, 1, 1):
                    yield finished._replace(alone=True)
        else:
            yield from self._work(BatchQueue(batches), self._crew(""), self.slots, AHEAD)

    def _rehearse(self, batches: Sequence[Batch]) -> None:
        """Let several backends load or compile their code, each in the process of its own, on every core.

        Nothing is timed meanwhile, and nothing of it is a result: whatever goes wrong will do so again in a cell.
        """
        first = {job[1].backend: replace(batch, jobs=(job,)) for batch in batches[::-1] for job in batch.jobs[::-1]}
        waiting = [(name, batch) for name, batch in first.items() if not self._crews.get(name)][-MOST_CREWS:]
        waiting = waiting if len(first) > 1 else []
        busy: dict[PoolWorker, Crew] = {}
        try:
            while waiting or busy:
                while waiting and len(busy) < (os.cpu_count() or 1):
                    name, batch = waiting.pop()
                    crew = self._crew(name)
                    crew.append(PoolWorker(self._folder))
                    limit = min(batch.timeout_s, REHEARSAL_S)
                    crew[-1].give(self._calls, replace(batch, timeout_s=limit, rehearsal=True, keep=False))
                    busy[crew[-1]] = crew
                for worker in _ready(list(busy)):
                    finished = _last_word(worker)
                    if finished is not None:
                        crew = busy.pop(worker)
                        if finished != "done":
                            _dismiss(worker, crew)
        finally:
            for worker, crew in busy.items():
                _dismiss(worker, crew)

    def _crew(self, name: str) -> Crew:
        """The processes under that name; the name used longest ago loses its own where there are too many."""
        self._crews[name] = self._crews.pop(name, [])
        while len(self._crews) > MOST_CREWS:
            _end(self._crews.pop(next(iter(self._crews))))
        return self._crews[name]

    def _work(self, queue: BatchQueue, crew: Crew, most: int, ahead: int) -> Generator[Finished]:
        """Each job of the queue as it ends, done by at most so many processes."""
        _end(crew, keep=most)
        try:
            while True:
                self._hand_out(queue, crew, most, ahead)
                busy = [worker for worker in crew if worker.batches]
                if not busy:
                    return
                for worker in _ready(busy):
                    yield from self._heard(worker, queue, crew)
        finally:
            for worker in list(crew):
                if worker.batches:
                    _dismiss(worker, crew)

    def close(self) -> None:
        """End every worker."""
        if self._finish is not None:
            self._finish()
            self._finish = None

    def _hand_out(self, queue: BatchQueue, crew: Crew, most: int, ahead: int) -> None:
        """Give every worker something to do, and where there is plenty something for when it has done that."""
        for worker in [worker for worker in crew if not worker.batches]:
            if worker.done >= MOST_JOBS or (queue.doubts and not worker.fresh):
                _dismiss(worker, crew)
        while len(crew) < most and len(queue) > sum(not worker.batches for worker in crew):
            crew.append(PoolWorker(self._folder))
        for depth in range(ahead):
            for worker in crew:
                plenty = not depth or len(queue) > len(crew)
                if worker.batches <= depth and worker.done < MOST_JOBS and plenty:
                    others = {log for other in crew if other is not worker for log in other.logs}
                    batch = queue.take(reversed(worker.logs), others, fresh=worker.fresh)
                    if batch is not None:
                        worker.give(self._calls, batch)

    def _heard(self, worker: PoolWorker, queue: BatchQueue, crew: Crew) -> Iterator[Finished]:
        """The worker's next result, or the result of its death or its silence."""
        if not worker.process.pipe.poll():
            if time.monotonic() >= worker.deadline:
                limit = worker.doing().timeout_s
                late = Result("timeout", f"was not finished after {limit:g} s of wall time and was stopped")
                ended = list(worker.failed(late))
                _give_up(worker, queue, crew, worker.rest())
                yield from ended
            return
        try:
            finished = worker.hear()
        except (EOFError, OSError):
            ended = list(worker.failed(Result("error", worker.process.death())))
            tried_again = queue.try_again(worker.doing())
            _give_up(worker, queue, crew, worker.rest())
            yield from [] if tried_again else ended
            return
        if finished is None:
            return
        if finished.result.status == "error" and finished.log is not None:
            used = worker.done > 1
            _give_up(worker, queue, crew, worker.left())
            if used and queue.try_again(replace(finished.batch, jobs=finished.batch.jobs[:1])):
                return
        yield finished


def _last_word(worker: PoolWorker) -> str | None:
    """The status of the worker's only job, "dead" and "late" among them; None while it goes on."""
    if not worker.process.pipe.poll():
        return "late" if time.monotonic() >= worker.deadline else None
    try:
        finished = worker.hear()
    except (EOFError, OSError):
        return "dead"
    return None if finished is None else finished.result.status


def _give_up(worker: PoolWorker, queue: BatchQueue, crew: Crew, rest: Sequence[Batch]) -> None:
    """End the worker and let others do the rest."""
    queue.put_back(reversed(rest))
    _dismiss(worker, crew)


def _dismiss(worker: PoolWorker, crew: Crew) -> None:
    crew.remove(worker)
    worker.process.kill()


def _end(crew: Crew, keep: int = 0) -> None:
    while len(crew) > keep:
        crew.pop().process.kill()


def _single(batches: Sequence[Batch]) -> Iterator[Batch]:
    """Each job a batch of its own: it is handed out once the one before has been taken in."""
    for batch in batches:
        if not batch.jobs:
            yield batch
        for job in batch.jobs:
            yield replace(batch, jobs=(job,))


def _ready(busy: Sequence[PoolWorker]) -> list[PoolWorker]:
    """Wait until one of them has something to say, is dead, or overdue; those."""
    patience = max(0.0, min(MOST_WAIT_S, *(worker.deadline - time.monotonic() for worker in busy)))
    ready = wait([channel for worker in busy for channel in worker.process.channels], patience)
    now = time.monotonic()
    return [w for w in busy if now >= w.deadline or any(channel in ready for channel in w.process.channels)]


def _finish(crews: dict[str, Crew], folder: Path) -> None:
    """End all; without it, who ends without `close` would wait for them for ever."""
    for crew in crews.values():
        _end(crew)
    shutil.rmtree(folder, ignore_errors=True)
