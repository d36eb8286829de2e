"""Runs cells on a Dask cluster, whose workers may die, join late, or have other code.

Dask assigns batches to workers and reassigns those of a dead one. Each worker is first compared with what the batches
need (dask_requirements.py); one that differs is reported and not used.
"""

import contextlib
import pickle
import sys
import time
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from ...core.errors import InputError
from ..measure.cell import Result
from ..record.fingerprint import PACKAGE
from .batch import Batch, Finished, unmade
from .dask_cluster import GO_ON, RESOURCE, Cluster
from .dask_requirements import inventory
from .dask_task import check, order

POLL_S = 1  # between two looks at the list of workers
REMARK_S = 10  # without a worker before the user is told so

MOST_FAILURES = 3
"""Failures of a batch before its jobs run one by one, and of such a job before it ends as an error. Dask counts deaths
of workers itself: when it gives up, after `distributed.scheduler.allowed-failures`, that counts as this many."""


def to_stderr(sentence: str) -> None:
    """Prints a remark for the user."""
    print(sentence, file=sys.stderr)


class Dask:
    """An executor on the scheduler at an address (tcp://host:port) or in a scheduler file.

    `patience_s`: s without any worker before that is an error; `say` is called with remarks, such as on workers that
    are not used.
    """

    name = "dask"

    def __init__(self, scheduler: str, *, patience_s: float = 300, say: Callable[[str], None] = to_stderr) -> None:
        self.scheduler = scheduler
        self.patience_s = patience_s
        self.say = say
        self.unfit: dict[str, str] = {}  # worker's address -> why it is not used

    @cached_property
    def cluster(self) -> Cluster:
        """Connects at the first use; InputError without a scheduler."""
        return Cluster(self.scheduler)

    @property
    def slots(self) -> int:
        """Counts the threads of the current workers, at least one; InputError without a scheduler."""
        workers = self.cluster.workers().items()
        return max(1, sum(worker["nthreads"] for address, worker in workers if address not in self.unfit))

    @property
    def times(self) -> bool:
        """True where machines have a worker for timed cells, and none has two."""
        workers = self.cluster.workers().items()
        timed = [one["host"] for address, one in workers if address not in self.unfit and _is_timed(one)]
        return 0 < len(timed) == len(set(timed))

    def run(self, batches: Sequence[Batch], *, alone: bool) -> Generator[Finished]:
        """Yields each job as it ends; InputError without a scheduler, or without a usable worker for too long."""
        yield from _Run(self, batches, alone).finished()

    def close(self) -> None:
        """Disconnects; the workers keep running."""
        if "cluster" in self.__dict__:
            self.cluster.close()
            del self.cluster


@dataclass(eq=False)
class _Attempt:
    """A batch to run."""

    batch: Batch
    suspect: bool = False  # runs while nothing else does, so that a failure is its own
    workers: list[str] | None = None  # that may run it; None: any
    failures: int = 0


class _Run:
    """Runs batches on the cluster until every job of each has ended once."""

    def __init__(self, executor: Dask, batches: Sequence[Batch], alone: bool) -> None:
        from distributed import CancelledError, KilledWorker, as_completed

        self.gone = CancelledError, KilledWorker
        self.executor, self.cluster, self.alone = executor, executor.cluster, alone
        self.wanted = inventory(batches)
        self.waiting = deque(_Attempt(batch) for batch in batches)  # suspects last
        self.attempts: dict[Any, _Attempt] = {}  # by the futures of their tasks
        self.checks: dict[Any, str] = {}  # addresses of workers, by the futures of their checks
        self.landed = as_completed(loop=self.cluster.client.loop, with_results=True, raise_errors=False)
        self.workers: dict[str, Any] = {}
        self.fit = set[str]()
        self.due, self.worked, self.remarked = 0.0, time.monotonic(), False

    def finished(self) -> Iterator[Finished]:
        """Yields every job as it ends; if the caller stops early, a worker ends its current job and stops."""
        try:
            while self.waiting or self.attempts:
                if time.monotonic() >= self.due:
                    yield from self._poll()
                self._hand_out()
                if not self.landed.has_ready():
                    time.sleep(0.01)
                for future, result in self.landed.next_batch(block=False):
                    found = result[1] if isinstance(result, tuple) else result  # of an exception, its type comes first
                    if future in self.checks:
                        self._checked(self.checks.pop(future), found)
                    elif future in self.attempts:  # and has not been taken back
                        yield from self._ended(self.attempts.pop(future), found)
        finally:
            with contextlib.suppress(Exception):  # a scheduler that is gone has no tasks
                self.cluster.client.cancel([*self.attempts, *self.checks])

    def _poll(self) -> Iterator[Finished]:
        """Lists the workers, checks new ones, and takes back batches whose workers are gone."""
        self.workers, unfit = self.cluster.workers(), self.executor.unfit.keys()
        self.due = time.monotonic() + POLL_S
        self.fit &= self.workers.keys()
        for address in self.workers.keys() - self.fit - unfit - set(self.checks.values()):
            self.checks[self._submit(check(self.wanted), [address])] = address
        for future, attempt in list(self.attempts.items()):
            if attempt.workers is not None and self.workers.keys().isdisjoint(attempt.workers):
                del self.attempts[future]
                future.release()
                yield from self._failed(attempt, f"{', '.join(attempt.workers)} died")
        self._check_usable()

    def _usable(self) -> dict[str, int]:
        """The number of batches at once of each worker that passed its check."""
        fit = {address: self.workers[address] for address in self.fit}
        if self.alone:
            return {address: 1 for address, worker in fit.items() if _is_timed(worker)}
        return {address: worker["nthreads"] for address, worker in fit.items()}

    def _check_usable(self) -> None:
        """Remarks that there is no usable worker; InputError if that is final or lasts too long."""
        unfit, patience_s, now = self.executor.unfit, self.executor.patience_s, time.monotonic()
        able = [worker for address, worker in self.workers.items() if address not in unfit]
        timed = Counter(worker["host"] for worker in self.workers.values() if _is_timed(worker))
        twice = [host for host, number in timed.items() if number > 1]
        wrong = ""
        if self.alone and twice:
            wrong = f"two workers of {twice[0]} have the resource {RESOURCE}; expected it at one worker of each machine"
        elif any(_is_timed(worker) or not self.alone for worker in able):
            self.worked, self.remarked = now, False
        elif self.workers and not able:
            why = "; ".join(f"{address} {unfit[address]}" for address in list(self.workers)[:3])
            wrong = f"none of its {len(self.workers)} workers can be used: {why}"
        elif self.workers and self.alone and not timed:
            wrong = (
                f"no worker has the resource {RESOURCE}, without which no cell is timed; start one on each machine "
                f'that does nothing else: dask worker {self.cluster.address} --nthreads 1 --resources "{RESOURCE}=1"'
            )
        elif now - self.worked > patience_s:
            wrong = f"no worker to run on for {patience_s:.0f} s, expected one"
        elif now - self.worked > REMARK_S and not self.remarked:
            self.remarked = True
            wait = f"No worker to run on; waiting up to {patience_s:.0f} s for one"
            self.executor.say(f"{wait}: dask worker {self.cluster.address}")
        if wrong:
            raise InputError(f"--scheduler {self.cluster.address}: {wrong}. {GO_ON}.")

    def _hand_out(self) -> None:
        """Submits a batch per thread and one ahead per worker; a suspect only when nothing else runs."""
        usable = self._usable()
        room = sum(usable.values()) + (0 if self.alone else len(usable))
        while self.waiting and len(self.attempts) < (min(1, room) if self.waiting[0].suspect else room):
            attempt = self.waiting.popleft()
            attempt.workers = None if self.workers.keys() <= self.fit else list(usable)
            task = order(attempt.batch, self.wanted, alone=self.alone)
            self.attempts[self._submit(task, attempt.workers, {RESOURCE: 1} if self.alone else None)] = attempt

    def _submit(self, task: bytes, workers: list[str] | None, resources: dict[str, float] | None = None) -> Any:
        limits = {"workers": workers, "resources": resources}
        try:
            future = self.cluster.client.submit(pickle.loads, task, pure=False, **limits)
        except Exception:  # however the connection fails
            raise self.cluster.lost() from None
        self.landed.add(future)
        return future

    def _checked(self, address: str, found: Any) -> None:
        """Reads the answer to a check; a worker that gave none is checked again if it is still there."""
        if isinstance(found, self.gone) or address not in self.workers:
            return
        if isinstance(found, Exception):
            found = f"cannot run {PACKAGE}: {type(found).__name__}: {found}"
        if found:
            self.executor.unfit[address] = found
            self.executor.say(f"Worker {address} on {self.workers[address]['host']} is not used: {found}.")
        else:
            self.fit.add(address)

    def _ended(self, attempt: _Attempt, found: Any) -> Iterator[Finished]:
        """Yields the jobs of a batch that ran; retries one that raised an exception."""
        cancelled, killed = self.gone
        if isinstance(found, cancelled):  # the connection was lost and is there again
            self.waiting.appendleft(attempt)
        elif isinstance(found, killed):
            yield from self._failed(attempt, f"{found.last_worker.address} died", MOST_FAILURES)
        elif isinstance(found, Exception):
            self.due = 0.0  # a new worker that cannot run anything may be the cause
            yield from self._failed(attempt, f"{type(found).__name__}: {found}")
        else:
            yield from pickle.loads(found)

    def _failed(self, attempt: _Attempt, how: str, failures: int = 1) -> Iterator[Finished]:
        """Retries a batch that failed, in the end job by job; a job that still fails ends as an error."""
        attempt.failures += failures
        batch = attempt.batch
        if attempt.failures < MOST_FAILURES:
            self.waiting.appendleft(attempt)
        elif not attempt.suspect:
            parts = [replace(batch, jobs=(job,)) for job in batch.jobs] or [batch]
            self.waiting.extend(_Attempt(part, suspect=True) for part in parts)
        else:
            reason = f"Dask workers died or failed each time it ran, at last: {how}"
            yield from unmade(batch, Result("error", reason), 0.0)


def _is_timed(worker: dict[str, Any]) -> bool:
    return worker["resources"].get(RESOURCE, 0) >= 1
