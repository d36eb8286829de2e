"""Batches on their way through a Dask cluster, until every job of each has ended once, whatever becomes of workers."""

import pickle
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from queue import Empty, SimpleQueue
from typing import Any

from ...frontend.errors import InputError
from ..measure.cell import Result
from ..record.fingerprint import PACKAGE
from .batch import Batch, Finished
from .dask_cluster import GO_ON, RESOURCE, Cluster
from .dask_requirements import told
from .dask_task import Answer
from .dask_workers import DEATHS, Attempt, Crew, Hand

CENSUS_S = 1
"""Between two looks at who is there."""

FETCH_S = 30
"""For a result to come from the worker that has it."""

REMARK_S = 10
"""Without a worker, after which a user is told."""


class Run:
    """Batches on their way through the cluster."""

    def __init__(
        self,
        cluster: Cluster,
        crew: Crew,
        batches: Sequence[Batch],
        alone: bool,
        patience_s: float,
        say: Callable[[str], None],
    ) -> None:
        self.cluster, self.crew, self.alone, self.patience_s, self.say = cluster, crew, alone, patience_s, say
        self.waiting = deque(Attempt(batch) for batch in batches)
        self.landed: SimpleQueue[tuple[Attempt, Any]] = SimpleQueue()
        self.digests: dict[Any, tuple[str, str]] = {}  # of logs and truths, by what they are made of
        self.looked = self.worked = time.monotonic()
        self.remarked = False

    def finished(self, order: Callable[[Batch], bytes]) -> Iterator[Finished]:
        """Every job of every batch as it ends, once."""
        due = 0.0
        while self.waiting or any(hand.attempts for hand in self.crew.hands.values()):
            if time.monotonic() >= due:
                yield from self._census()
                due = time.monotonic() + CENSUS_S
            self._hand_out(order)
            with suppress(Empty):
                yield from self._taken(*self.landed.get(timeout=max(0.01, due - time.monotonic())))
                while True:
                    yield from self._taken(*self.landed.get_nowait())

    def let_go(self) -> None:
        """Take back what is still in anybody's hands."""
        for hand in self.crew.hands.values():
            self._withdrawn(hand)

    def _census(self) -> Iterator[Finished]:
        """Look who is there, and take back what the others had."""
        workers = self.cluster.workers()
        if workers is None:
            return
        gone, silent = self.crew.update(workers)
        for hand in gone:
            yield from self._lost(hand, f"worker {hand.seen.address} on {hand.seen.host} died")
        for hand in silent:
            self.say(f"Worker {hand.seen.address} on {hand.seen.host} has fallen silent: others do what it had.")
            self.waiting.extendleft(self._withdrawn(hand))
        now = time.monotonic()
        for hand in self.crew.hands.values():
            late = [attempt for attempt in hand.attempts if attempt.overdue(now)]
            if late:
                self._dismiss(hand, "has not ended a batch long after the limits of its cells")
                yield from self._lost(hand, f"worker {hand.seen.address} on {hand.seen.host} hung")
        if self.alone:
            self.crew.check_resources()
        self._wait_for_workers(now)

    def _wait_for_workers(self, now: float) -> None:
        """Say so where nobody can be used; InputError where that is for good, or has been for too long."""
        hands = list(self.crew.hands.values())
        if any(hand.attempts for hand in hands) or self.crew.usable(alone=self.alone):
            self.worked, self.remarked = now, False
            return
        where = f"--scheduler {self.cluster.address}"
        unfit = [hand for hand in hands if hand.unfit]
        if hands and len(unfit) == len(hands):
            why = "; ".join(f"{hand.seen.address} {hand.unfit}" for hand in unfit[:DEATHS])
            raise InputError(f"{where}: none of its {len(unfit)} workers can be used: {why}. {GO_ON}.")
        if self.alone and any(hand.usable for hand in hands) and not any(hand.seen.timed for hand in hands):
            raise InputError(
                f"{where}: no worker has the resource {RESOURCE}, without which no cell is timed; start one on each "
                f"machine that does nothing else: dask worker {self.cluster.address} --nthreads 1 "
                f'--resources "{RESOURCE}=1". {GO_ON}.'
            )
        if now - self.worked > self.patience_s:
            raise InputError(f"{where}: no worker to run on for {self.patience_s:.0f} s; expected one. {GO_ON}.")
        if not self.remarked and now - self.worked > REMARK_S:
            self.remarked = True
            self.say(
                f"No worker to run on; waiting up to {self.patience_s:.0f} s for one: "
                f"dask worker {self.cluster.address}"
            )

    def _hand_out(self, order: Callable[[Batch], bytes]) -> None:
        """Something for every free thread first, then one ahead for each worker while there is plenty."""
        hands = self.crew.usable(alone=self.alone)
        slots = {hand: 1 if self.alone else hand.seen.threads for hand in hands}
        for ahead in range(1 if self.alone else 2):
            if ahead and len(self.waiting) <= sum(slots.values()):
                return
            for hand in hands:
                while self.waiting and len(hand.attempts) < slots[hand] + ahead:
                    attempt = self._next(hand, hands)
                    if attempt is None:
                        break
                    attempt.began = None
                    attempt.future = self.cluster.submit(
                        pickle.loads,
                        order(attempt.batch),
                        hand.seen.address,
                        timed=self.alone,
                        done=lambda future, attempt=attempt: self.landed.put((attempt, future)),
                    )
                    if attempt.future is None:  # the next census tells why
                        self.waiting.appendleft(attempt)
                        return
                    hand.attempts.append(attempt)
                hand.begin(slots[hand], time.monotonic())

    def _next(self, hand: Hand, hands: Sequence[Hand]) -> Attempt | None:
        """The first that waits and is not better tried elsewhere, where that is possible."""
        for place, attempt in enumerate(self.waiting):
            if not attempt.avoids(hand.seen.address) or all(attempt.avoids(other.seen.address) for other in hands):
                del self.waiting[place]
                return attempt
        return None

    def _taken(self, attempt: Attempt, future: Any) -> Iterator[Finished]:
        """What came of an attempt; of one that has been given to another by now, nothing."""
        if attempt.future is not future:
            return
        hand = next(hand for hand in self.crew.hands.values() if attempt in hand.attempts)
        hand.attempts.remove(attempt)
        attempt.future = None
        hand.begin(1 if self.alone else hand.seen.threads, time.monotonic())
        try:
            answer = pickle.loads(future.result(timeout=FETCH_S))
        except Exception as error:
            yield from self._failed(attempt, hand, error)
        else:
            hand.failures = 0
            yield from self._answered(attempt, hand, answer)
        finally:
            future.release()

    def _answered(self, attempt: Attempt, hand: Hand, answer: Answer) -> Iterator[Finished]:
        """The jobs of a batch, where the worker had what it needs."""
        lacks = [found for found in answer if isinstance(found, str)]
        ended = [found for found in answer if isinstance(found, Finished)]
        facts = ended[0].log if ended else None
        if lacks:
            self._dismiss(hand, told(lacks))
        elif len(ended) < max(1, len(attempt.batch.jobs)):
            yield from self._mishap(attempt, hand, f"worker {hand.seen.address} gave up half-way")
            return
        elif facts is None and self._is_made_elsewhere(attempt, hand, ended[0].result.reason):
            self.waiting.appendleft(attempt)
            return
        elif facts is not None and self.digests.setdefault(attempt.batch.log, facts.digests) != facts.digests:
            self._dismiss(hand, f"makes another log of {attempt.batch.dataset} than other workers do")
        else:
            for address, reason in attempt.unmade.items() if facts is not None else ():
                if address in self.crew.hands:
                    self._dismiss(self.crew.hands[address], f"lacks what others have: {reason}")
            yield from ended
            return
        self.waiting.appendleft(attempt)
        self.waiting.extendleft(self._withdrawn(hand))

    def _is_made_elsewhere(self, attempt: Attempt, hand: Hand, reason: str) -> bool:
        """Whether a log that one worker cannot make may be made by one that has not tried, a few being enough."""
        attempt.unmade[hand.seen.address] = reason
        others = self.crew.usable(alone=self.alone)
        return len(attempt.unmade) < DEATHS and any(other.seen.address not in attempt.unmade for other in others)

    def _failed(self, attempt: Attempt, hand: Hand, error: Exception) -> Iterator[Finished]:
        """A task that ended with an exception: of the connection, of the worker, or of nobody knows whom."""
        from distributed import CancelledError, KilledWorker

        words = f"{type(error).__name__}: {error}"
        if isinstance(error, CancelledError | TimeoutError):
            self.waiting.appendleft(attempt)
        elif isinstance(error, KilledWorker):
            yield from self._mishap(attempt, hand, f"worker {hand.seen.address} on {hand.seen.host} died")
        elif isinstance(error, ImportError | AttributeError | InputError):
            self._dismiss(hand, f"cannot run {PACKAGE}: {words}")
            self.waiting.appendleft(attempt)
            self.waiting.extendleft(self._withdrawn(hand))
        else:
            hand.failures += 1
            if hand.failures >= DEATHS:
                self._dismiss(hand, f"has failed {hand.failures} times on end: {words}")
            yield from self._mishap(attempt, hand, f"worker {hand.seen.address} on {hand.seen.host} failed: {words}")

    def _lost(self, hand: Hand, how: str) -> Iterator[Finished]:
        """Whatever a worker had begun may be what it died of; what had to wait there is not."""
        for attempt in self._withdrawn(hand):
            if attempt.began is None:
                self.waiting.appendleft(attempt)
            else:
                yield from self._mishap(attempt, hand, how)

    def _mishap(self, attempt: Attempt, hand: Hand, how: str) -> Iterator[Finished]:
        """Try again elsewhere; a batch goes wrong twice before it is taken apart, a cell three times."""
        attempt.mishaps.append((hand.seen.address, how))
        batch, times = attempt.batch, len(attempt.mishaps)
        if times > 1 and len(batch.jobs) > 1:
            self.waiting.extendleft(Attempt(replace(batch, jobs=(job,))) for job in batch.jobs)
        elif times < DEATHS:
            self.waiting.appendleft(attempt)
        else:
            reason = f"{times} Dask workers failed while it ran, the last one so: {how}"
            for index in [index for index, _ in batch.jobs] or [None]:
                yield Finished(batch, index, None, Result("error", reason), 0.0, False, hand.seen.host)

    def _dismiss(self, hand: Hand, why: str) -> None:
        """Ask a worker no more."""
        if hand.unfit:
            return
        hand.unfit = why
        self.say(f"Worker {hand.seen.address} on {hand.seen.host} is not used: {why}.")

    @staticmethod
    def _withdrawn(hand: Hand) -> list[Attempt]:
        """What a worker had in hand; if it brings any of it yet, nobody looks."""
        attempts, hand.attempts = hand.attempts, []
        for attempt in attempts:
            attempt.future.release()
            attempt.future = None
        return attempts
