"""A pool's worker process, which runs batch after batch, and its side in the parent."""

import contextlib
import gc
import os
import sys
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple

from ..measure.cell import Result
from .batch import HOST, LOGS_KEPT, Batch, Finished, LogFacts, Logs, unmade, work
from .process import Worker


class Reply(NamedTuple):
    """The result of a job, or of looking at a log."""

    job: int | None  # its cell
    result: Result
    seconds: float


def serve(pipe: Connection) -> None:
    """Runs in the process: reads batches from the pipe; sends each log's facts, then a reply for each job.

    Between batches it holds no large log.
    """
    logs, latest, cold = Logs(), 0, True
    while True:
        try:
            call, batch = pipe.recv()
        except EOFError:
            return
        if call != latest:
            logs.forget_files()
            latest = call
        for finished in work(batch, logs, pipe.send):
            with contextlib.suppress(OSError, ValueError):  # a cell's output is dropped
                sys.stdout.flush()
                os.ftruncate(1, 0)
            pipe.send(Reply(finished.index, finished.result, finished.seconds))
            if cold:  # the first job's imports stay: no collection needed
                gc.freeze()
                cold = False
        finished = None  # which has the log's archive and the result's arrays
        logs.forget_large()


@dataclass
class _InHand:
    batch: Batch  # without the jobs that have ended
    facts: LogFacts | None = None  # None: its log is being made


class PoolWorker:
    """A process of a pool; the first of its batches is being run, the next ones wait in the pipe."""

    def __init__(self, folder: Path) -> None:
        self.process = Worker(serve, (), folder)
        self.done = 0  # jobs
        self.deadline = float("inf")  # of what it is doing, by time.monotonic()
        self.logs: deque[Any] = deque(maxlen=LOGS_KEPT)  # those that it keeps, as far as is known here
        self._in_hand: deque[_InHand] = deque()
        self._began = 0.0

    @property
    def batches(self) -> int:
        """Counts the batches it was given."""
        return len(self._in_hand)

    @property
    def fresh(self) -> bool:
        """True where it has not been given anything yet."""
        return not self.done and not self._in_hand

    def give(self, call: int, batch: Batch) -> None:
        """Sends a batch of that call of the pool."""
        self._in_hand.append(_InHand(batch))
        if batch.log not in self.logs:
            self.logs.append(batch.log)
        if len(self._in_hand) == 1:
            self._restart_clock()
        with contextlib.suppress(OSError):  # it is dead, which is about to be noticed
            self.process.pipe.send((call, batch))

    def hear(self) -> Finished | None:
        """Reads its next message: a job's end, or None for a log that was made. EOFError or OSError if dead."""
        said = self.process.pipe.recv()
        now = self._in_hand[0]
        if isinstance(said, LogFacts):
            now.facts = said
            self._restart_clock()
            return None
        index, result, seconds = said
        finished = Finished(now.batch, index, now.facts, result, seconds, False, HOST)
        now.batch = replace(now.batch, jobs=now.batch.jobs[1:])
        self.done += 1
        if not now.batch.jobs:
            self._in_hand.popleft()
        self._restart_clock()
        return finished

    def doing(self) -> Batch:
        """Returns what it is running: a job, or the making of a log with all its jobs."""
        now = self._in_hand[0]
        return now.batch if now.facts is None else replace(now.batch, jobs=now.batch.jobs[:1])

    def failed(self, result: Result) -> Iterator[Finished]:
        """Ends what it is running with that result."""
        at, facts, seconds = self.doing(), self._in_hand[0].facts, time.monotonic() - self._began
        if facts is None:
            yield from unmade(at, replace(result, reason=f"the log could not be made: {result.reason}"), seconds)
        else:
            yield Finished(at, at.jobs[0][0] if at.jobs else None, facts, result, seconds, False, HOST)

    def rest(self) -> list[Batch]:
        """The batches after that."""
        if not self._in_hand:
            return []
        now, *later = self._in_hand
        jobs = () if now.facts is None else now.batch.jobs[1:]
        return [replace(now.batch, jobs=jobs)] * bool(jobs) + [one.batch for one in later]

    def left(self) -> list[Batch]:
        """All batches it was given."""
        return [one.batch for one in self._in_hand]

    def _restart_clock(self) -> None:
        self._began = time.monotonic()
        self.deadline = self._began + self._in_hand[0].batch.timeout_s if self._in_hand else float("inf")
