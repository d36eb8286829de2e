"""Queues batches for workers: those on one log go to the same worker, where that costs nothing."""

from collections import deque
from collections.abc import Collection, Iterable
from typing import Any

from .batch import Batch


class BatchQueue:
    """Batches in order, grouped by log, and those to be retried in a new process."""

    def __init__(self, batches: Iterable[Batch]) -> None:
        self._by_log: dict[Any, deque[Batch]] = {}
        self._again: deque[Batch] = deque()
        self._tried: set[tuple[Any, int | None]] = set()
        self._waiting = 0
        for batch in batches:
            self._by_log.setdefault(batch.log, deque()).append(batch)
            self._waiting += 1

    def __len__(self) -> int:
        return self._waiting + len(self._again)

    @property
    def doubts(self) -> bool:
        """True where something is to be retried."""
        return bool(self._again)

    def take(self, known: Iterable[Any], elsewhere: Collection[Any], *, fresh: bool) -> Batch | None:
        """Takes the next batch for a worker that has the logs `known`, not `elsewhere`; a retry if it is `fresh`."""
        if fresh and self._again:
            return self._again.popleft()
        if not self._by_log:
            return None
        at_hand = next((log for log in known if log in self._by_log), None)
        nobodys = next((log for log in self._by_log if log not in elsewhere), None)
        log = at_hand or nobodys or next(iter(self._by_log))
        batches = self._by_log[log]
        batch = batches.popleft()
        self._waiting -= 1
        if not batches:
            del self._by_log[log]
        return batch

    def put_back(self, batches: Iterable[Batch]) -> None:
        """Puts back what a worker did not start on."""
        for batch in batches:
            self._by_log.setdefault(batch.log, deque()).appendleft(batch)
            self._waiting += 1

    def try_again(self, batch: Batch) -> bool:
        """Queues a retry; False where the batch's first job has had one."""
        index = batch.jobs[0][0] if batch.jobs else None
        if (batch.log, index) in self._tried:
            return False
        self._tried.add((batch.log, index))
        self._again.append(batch)
        return True
