"""Cells on a Dask cluster, whose workers may die, come late, or be somebody else's.

Dask chooses the worker of a batch, and gives what a dead worker had to another. Each worker is first asked whether it
has what the batches were planned with (dask_requirements.py); one that differs is named and given nothing.
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

from ...frontend.errors import InputError
from ..measure.cell import Result
from ..record.fingerprint import PACKAGE
from .batch import Batch, Finished, unmade
from .dask_cluster import GO_ON, RESOURCE, Cluster
from .dask_requirements import inventory
from .dask_task import check, order

CENSUS_S = 1
"""Between two looks at who is there."""

REMARK_S = 10
"""Without a worker, after which a user is told."""

MISHAPS = 3
"""Of a batch before its jobs are tried one by one, of such a job before it has failed. The deaths of workers are
counted by Dask: after its `distributed.scheduler.allowed-failures`, that is as many at once."""


def to_stderr(sentence: str) -> None:
    """Where a user reads what is no error yet."""
    print(sentence, file=sys.stderr)


class Dask:
    """An executor on the scheduler at an address (tcp://host:port) or in a scheduler file.

    `patience_s`: without any worker, before that is an error; `say` is told in sentences who is waited for and who is
    not used.
    """

    name = "dask"

    def __init__(self, scheduler: str, *, patience_s: float = 300, say: Callable[[str], None] = to_stderr) -> None:
        self.scheduler = scheduler
        self.patience_s = patience_s
        self.say = say
        self.unfit: dict[str, str] = {}  # worker's address -> why it is not used

    @cached_property
    def cluster(self) -> Cluster:
        """The connection, made when it is first asked for. InputError where there is no scheduler."""
        return Cluster(self.scheduler)

    @property
    def slots(self) -> int:
        """Threads of the workers that there are now, at least one. InputError where there is no scheduler."""
        workers = self.cluster.workers().items()
        return max(1, sum(worker["nthreads"] for address, worker in workers if address not in self.unfit))

    def run(self, batches: Sequence[Batch], *, alone: bool) -> Generator[Finished]:
        """Each job as it ends; InputError where there is no scheduler, or no worker that can be used, for too long."""
        yield from _Run(self, batches, alone).finished()

    def close(self) -> None:
        """Leave the cluster; its workers are whoever's they were."""
        if "cluster" in self.__dict__:
            self.cluster.close()
            del self.cluster


@dataclass(eq=False)
class _Attempt:
    """A batch that is to be done."""

    batch: Batch
    suspect: bool = False  # it runs while nothing else does, so that nothing else can be to blame
    workers: list[str] | None = None  # that may run it, where that is not any
    mishaps: int = 0


class _Run:
    """Batches on their way through the cluster, until every job of each has ended once."""

    def __init__(self, executor: Dask, batches: Sequence[Batch], alone: bool) -> None:
        from distributed import CancelledError, KilledWorker, as_completed

        self.gone = CancelledError, KilledWorker
        self.executor, self.cluster, self.alone = executor, executor.cluster, alone
        self.wanted = inventory(batches)
        self.waiting = deque(_Attempt(batch) for batch in batches)  # suspects last
        self.attempts: dict[Any, _Attempt] = {}  # by the futures of their tasks
        self.checks: dict[Any, str] = {}  # addresses of workers, by the futures of what they were asked
        self.landed = as_completed(loop=self.cluster.client.loop, with_results=True, raise_errors=False)
        self.workers: dict[str, Any] = {}
        self.fit = set[str]()
        self.due, self.worked, self.remarked = 0.0, time.monotonic(), False

    def finished(self) -> Iterator[Finished]:
        """Every job as it ends; a worker that is at one when nobody listens any more stops after it."""
        try:
            while self.waiting or self.attempts:
                if time.monotonic() >= self.due:
                    yield from self._census()
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
            with contextlib.suppress(Exception):  # where the scheduler is gone, so are its tasks
                self.cluster.client.cancel([*self.attempts, *self.checks])

    def _census(self) -> Iterator[Finished]:
        """Look who is there, check who is new, and take back what nobody is left to run."""
        self.workers, unfit = self.cluster.workers(), self.executor.unfit.keys()
        self.due = time.monotonic() + CENSUS_S
        self.fit &= self.workers.keys()
        for address in self.workers.keys() - self.fit - unfit - set(self.checks.values()):
            self.checks[self._submit(check(self.wanted), [address])] = address
        for future, attempt in list(self.attempts.items()):
            if attempt.workers is not None and self.workers.keys().isdisjoint(attempt.workers):
                del self.attempts[future]
                future.release()
                yield from self._failed(attempt, f"{', '.join(attempt.workers)} died")
        self._complain()

    def _usable(self) -> dict[str, int]:
        """How many batches each worker runs at once that has been found fit."""
        fit = {address: self.workers[address] for address in self.fit}
        if self.alone:
            return {address: 1 for address, worker in fit.items() if _is_timed(worker)}
        return {address: worker["nthreads"] for address, worker in fit.items()}

    def _complain(self) -> None:
        """Say so where no worker can be used; InputError where that is for good, or has been for too long."""
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
            wrong = f"no worker to run on for {patience_s:.0f} s; expected one"
        elif now - self.worked > REMARK_S and not self.remarked:
            self.remarked = True
            wait = f"No worker to run on; waiting up to {patience_s:.0f} s for one"
            self.executor.say(f"{wait}: dask worker {self.cluster.address}")
        if wrong:
            raise InputError(f"--scheduler {self.cluster.address}: {wrong}. {GO_ON}.")

    def _hand_out(self) -> None:
        """Give Dask a batch for every thread and one ahead for each worker; a suspect only when nothing else runs."""
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
        except Exception:  # whichever way a connection fails
            raise self.cluster.lost() from None
        self.landed.add(future)
        return future

    def _checked(self, address: str, found: Any) -> None:
        """Take in how a worker differs; where it did not say, it is asked again if it is still there."""
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
        """What came of an attempt: the jobs of its batch, or an exception."""
        cancelled, killed = self.gone
        if isinstance(found, cancelled):  # with a connection that was lost and is there again
            self.waiting.appendleft(attempt)
        elif isinstance(found, killed):
            yield from self._failed(attempt, f"{found.last_worker.address} died", MISHAPS)
        elif isinstance(found, Exception):
            self.due = 0.0  # a worker that has just come and cannot run anything may be behind it
            yield from self._failed(attempt, f"{type(found).__name__}: {found}")
        else:
            yield from pickle.loads(found)

    def _failed(self, attempt: _Attempt, how: str, mishaps: int = 1) -> Iterator[Finished]:
        """Try again what went wrong; at last job by job, and the job that still goes wrong has failed."""
        attempt.mishaps += mishaps
        batch = attempt.batch
        if attempt.mishaps < MISHAPS:
            self.waiting.appendleft(attempt)
        elif not attempt.suspect:
            parts = [replace(batch, jobs=(job,)) for job in batch.jobs] or [batch]
            self.waiting.extend(_Attempt(part, suspect=True) for part in parts)
        else:
            reason = f"Dask workers died or failed each time that it ran, the last one so: {how}"
            yield from unmade(batch, Result("error", reason), 0.0)


def _is_timed(worker: dict[str, Any]) -> bool:
    return worker["resources"].get(RESOURCE, 0) >= 1
