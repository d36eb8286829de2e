"""Cells in processes of this machine: each does many, is watched meanwhile, and is replaced when it goes wrong.

What a process has done before must not show in a result. So an error in one that has done other jobs, and every death,
is tried once more by a new process before it is believed: the first may be the fault of a job before, or of somebody
who killed the process.
"""

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


class Local:
    """A pool of `workers` processes, forked from one server. One thread at a time may use it; others have their own."""

    name = "local"

    def __init__(self, workers: int) -> None:
        self.slots = workers
        self._workers: list[PoolWorker] = []
        self._calls = 0
        self._finish: Finalize | None = None

    def run(self, batches: Sequence[Batch], *, alone: bool) -> Generator[Finished]:
        """Each job as it ends; `alone`: while one is at work nothing else is, whoever takes the results in included."""
        if self._finish is None:
            self._folder = Path(tempfile.mkdtemp(prefix="slamduel-"))
            self._finish = Finalize(
                self, _finish, (self._workers, self._folder), exitpriority=1
            )  # at exit at the latest
        self._calls += 1
        most, ahead = (1, 1) if alone else (self.slots, AHEAD)
        while len(self._workers) > most:
            self._workers.pop().process.kill()
        queue = BatchQueue(_single(batches) if alone else batches)
        try:
            while True:
                self._hand_out(queue, most, ahead)
                busy = [worker for worker in self._workers if worker.batches]
                if not busy:
                    return
                for worker in _ready(busy):
                    for finished in self._heard(worker, queue):
                        yield finished._replace(alone=alone)
        finally:
            for worker in list(self._workers):
                if worker.batches:
                    self._end(worker)

    def close(self) -> None:
        """End every worker."""
        if self._finish is not None:
            self._finish()
            self._finish = None

    def _hand_out(self, queue: BatchQueue, most: int, ahead: int) -> None:
        """Give every worker something to do, and where there is plenty something for when it has done that."""
        for worker in [worker for worker in self._workers if not worker.batches]:
            if worker.done >= MOST_JOBS or (queue.doubts and not worker.fresh):
                self._end(worker)
        while len(self._workers) < most and len(queue) > sum(not worker.batches for worker in self._workers):
            self._workers.append(PoolWorker(self._folder))
        for depth in range(ahead):
            for worker in self._workers:
                plenty = not depth or len(queue) > len(self._workers)
                if worker.batches <= depth and worker.done < MOST_JOBS and plenty:
                    others = {log for other in self._workers if other is not worker for log in other.logs}
                    batch = queue.take(reversed(worker.logs), others, fresh=worker.fresh)
                    if batch is not None:
                        worker.give(self._calls, batch)

    def _heard(self, worker: PoolWorker, queue: BatchQueue) -> Iterator[Finished]:
        """What a worker has to say, or what its end or its silence means."""
        if not worker.process.pipe.poll():
            if time.monotonic() >= worker.deadline:
                limit = worker.doing().timeout_s
                late = Result("timeout", f"was not finished after {limit:g} s of wall time and was stopped")
                ended = list(worker.failed(late))
                self._give_up(worker, queue, worker.rest())
                yield from ended
            return
        try:
            finished = worker.hear()
        except (EOFError, OSError):
            ended = list(worker.failed(Result("error", worker.process.death())))
            tried_again = queue.try_again(worker.doing())
            self._give_up(worker, queue, worker.rest())
            yield from [] if tried_again else ended
            return
        if finished is None:
            return
        if finished.result.status == "error" and finished.log is not None:
            used = worker.done > 1
            self._give_up(worker, queue, worker.left())
            if used and queue.try_again(replace(finished.batch, jobs=finished.batch.jobs[:1])):
                return
        yield finished

    def _give_up(self, worker: PoolWorker, queue: BatchQueue, rest: Sequence[Batch]) -> None:
        """End the worker and let others do the rest."""
        queue.put_back(reversed(rest))
        self._end(worker)

    def _end(self, worker: PoolWorker) -> None:
        self._workers.remove(worker)
        worker.process.kill()


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


def _finish(workers: list[PoolWorker], folder: Path) -> None:
    """End all; without it, who ends without `close` would wait for them for ever."""
    while workers:
        workers.pop().process.kill()
    shutil.rmtree(folder, ignore_errors=True)
