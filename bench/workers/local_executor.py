"""Runs cells in worker processes of this machine, which are watched, reused and replaced.

A process's earlier jobs must not affect a result: an error in a used process, and every death, is retried once in a new
one. Cells that run alone, for timing, have processes per backend: threads or patches that a plug-in leaves behind
cannot reach the others.
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

MOST_JOBS = 500  # before a process is replaced: leaks do not add up, and a new one costs no more than a few jobs
MOST_WAIT_S = 3600.0  # s between two looks at the clock: the system refuses to wait for weeks at once
AHEAD = 2  # batches handed to a worker, so that it never waits for its results to be read

MOST_POOLS = 8  # backends whose processes are kept when cells run alone: each holds its libraries and its last few logs
REHEARSAL_S = 30.0  # a backend's to load or compile its code before cells run alone; its first cell does the rest

Workers = list[PoolWorker]


class Local:
    """A pool of `workers` processes, forked from one server. Not for several threads at once."""

    name = "local"
    times = True

    def __init__(self, workers: int) -> None:
        self.slots = workers
        self._pools: dict[str, Workers] = {}  # by backend where cells run alone, else under ""
        self._calls = 0
        self._finish: Finalize | None = None

    def run(self, batches: Sequence[Batch], *, alone: bool) -> Generator[Finished]:
        """Yields the result of each job as it ends; with `alone`, jobs run one at a time.

        Batches without jobs only make their logs, on every core.
        """
        if self._finish is None:
            self._folder = Path(tempfile.mkdtemp(prefix="slamduel-"))
            self._finish = Finalize(self, _finish, (self._pools, self._folder), exitpriority=1)  # at exit at the latest
        self._calls += 1
        if any(batch.round > 1 for batch in batches):  # a process's memory affects its times: a round has its own
            for workers in self._pools.values():
                _end(workers)
        if not any(batch.jobs for batch in batches):
            yield from self._work(BatchQueue(batches), self._pool(""), max(self.slots, os.cpu_count() or 1), AHEAD)
        elif alone or self.slots == 1:
            _end(self._pool(""))
            self._rehearse(batches)
            for batch in _single(batches):
                workers = self._pool(batch.jobs[0][1].backend)
                for finished in self._work(BatchQueue([batch]), workers, 1, 1):
                    yield finished._replace(alone=True)
        else:
            yield from self._work(BatchQueue(batches), self._pool(""), self.slots, AHEAD)

    def _rehearse(self, batches: Sequence[Batch]) -> None:
        """Let several backends load or compile their code, each in the process of its own, on every core.

        Nothing is timed meanwhile, and nothing of it is a result: whatever goes wrong will do so again in a cell.
        """
        first = {job[1].backend: replace(batch, jobs=(job,)) for batch in batches[::-1] for job in batch.jobs[::-1]}
        waiting = [(name, batch) for name, batch in first.items() if not self._pools.get(name)][-MOST_POOLS:]
        waiting = waiting if len(first) > 1 else []
        busy: dict[PoolWorker, Workers] = {}
        try:
            while waiting or busy:
                while waiting and len(busy) < (os.cpu_count() or 1):
                    name, batch = waiting.pop()
                    workers = self._pool(name)
                    workers.append(PoolWorker(self._folder))
                    limit = min(batch.timeout_s, REHEARSAL_S)
                    workers[-1].give(self._calls, replace(batch, timeout_s=limit, rehearsal=True, keep=False))
                    busy[workers[-1]] = workers
                for worker in _ready(list(busy)):
                    finished = _last_word(worker)
                    if finished is not None:
                        workers = busy.pop(worker)
                        if finished != "done":
                            _dismiss(worker, workers)
        finally:
            for worker, workers in busy.items():
                _dismiss(worker, workers)

    def _pool(self, name: str) -> Workers:
        """The processes under that name; the name used longest ago loses its own where there are too many."""
        self._pools[name] = self._pools.pop(name, [])
        while len(self._pools) > MOST_POOLS:
            _end(self._pools.pop(next(iter(self._pools))))
        return self._pools[name]

    def _work(self, queue: BatchQueue, workers: Workers, most: int, ahead: int) -> Generator[Finished]:
        """Yields each job of the queue as it ends, done by at most so many processes."""
        _end(workers, keep=most)
        try:
            while True:
                self._hand_out(queue, workers, most, ahead)
                busy = [worker for worker in workers if worker.batches]
                if not busy:
                    return
                for worker in _ready(busy):
                    yield from self._heard(worker, queue, workers)
        finally:
            for worker in list(workers):
                if worker.batches:
                    _dismiss(worker, workers)

    def close(self) -> None:
        """Ends every worker."""
        if self._finish is not None:
            self._finish()
            self._finish = None

    def _hand_out(self, queue: BatchQueue, workers: Workers, most: int, ahead: int) -> None:
        """Gives every worker a batch, and the next one in advance where there is plenty."""
        for worker in [worker for worker in workers if not worker.batches]:
            if worker.done >= MOST_JOBS or (queue.doubts and not worker.fresh):
                _dismiss(worker, workers)
        while len(workers) < most and len(queue) > sum(not worker.batches for worker in workers):
            workers.append(PoolWorker(self._folder))
        for depth in range(ahead):
            for worker in workers:
                plenty = not depth or len(queue) > len(workers)
                if worker.batches <= depth and worker.done < MOST_JOBS and plenty:
                    others = {log for other in workers if other is not worker for log in other.logs}
                    batch = queue.take(reversed(worker.logs), others, fresh=worker.fresh)
                    if batch is not None:
                        worker.give(self._calls, batch)

    def _heard(self, worker: PoolWorker, queue: BatchQueue, workers: Workers) -> Iterator[Finished]:
        """Yields the worker's next result, or that of its death or timeout."""
        if not worker.process.pipe.poll():
            if time.monotonic() >= worker.deadline:
                limit = worker.doing().timeout_s
                late = Result("timeout", f"was not finished after {limit:g} s of wall time and was stopped")
                ended = list(worker.failed(late))
                _give_up(worker, queue, workers, worker.rest())
                yield from ended
            return
        try:
            finished = worker.hear()
        except (EOFError, OSError):
            ended = list(worker.failed(Result("error", worker.process.death())))
            tried_again = queue.try_again(worker.doing())
            _give_up(worker, queue, workers, worker.rest())
            yield from [] if tried_again else ended
            return
        if finished is None:
            return
        if finished.result.status == "error" and finished.log is not None:
            used = worker.done > 1
            _give_up(worker, queue, workers, worker.left())
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


def _give_up(worker: PoolWorker, queue: BatchQueue, workers: Workers, rest: Sequence[Batch]) -> None:
    """End the worker and let others do the rest."""
    queue.put_back(reversed(rest))
    _dismiss(worker, workers)


def _dismiss(worker: PoolWorker, workers: Workers) -> None:
    workers.remove(worker)
    worker.process.kill()


def _end(workers: Workers, keep: int = 0) -> None:
    while len(workers) > keep:
        workers.pop().process.kill()


def _single(batches: Sequence[Batch]) -> Iterator[Batch]:
    """Makes each job a batch of its own, handed out once the one before has ended."""
    for batch in batches:
        if not batch.jobs:
            yield batch
        for job in batch.jobs:
            yield replace(batch, jobs=(job,))


def _ready(busy: Sequence[PoolWorker]) -> list[PoolWorker]:
    """Waits until workers have something to read, are dead or overdue; returns these."""
    patience = max(0.0, min(MOST_WAIT_S, *(worker.deadline - time.monotonic() for worker in busy)))
    ready = wait([channel for worker in busy for channel in worker.process.channels], patience)
    now = time.monotonic()
    return [w for w in busy if now >= w.deadline or any(channel in ready for channel in w.process.channels)]


def _finish(pools: dict[str, Workers], folder: Path) -> None:
    """Ends all at exit, which would otherwise wait for them for ever."""
    for workers in pools.values():
        _end(workers)
    shutil.rmtree(folder, ignore_errors=True)
