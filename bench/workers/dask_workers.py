"""Who works for a study on a Dask cluster, what each has in hand, and why one is no longer asked."""

import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from ...frontend.errors import InputError
from .batch import Batch
from .dask_cluster import RESOURCE, Seen

DEATHS = 3
"""Mishaps on as many workers before a cell is to blame; from the second on, each cell of a batch runs by itself."""

START_S = 120
"""What a worker may take beyond the limits of a batch's cells: imports, compilation, a queue in front of a disk."""


@dataclass(eq=False)
class Attempt:
    """A batch that is to be done, and what came of it so far."""

    batch: Batch
    mishaps: list[tuple[str, str]] = field(default_factory=list[tuple[str, str]])  # a worker's address, what happened
    unmade: dict[str, str] = field(default_factory=dict[str, str])  # worker's address -> why it has no such log
    future: Any = None
    began: float | None = None  # at the latest; None while it waits

    def overdue(self, now: float) -> bool:
        """Whether its own limits should have ended it."""
        return self.began is not None and now > self.began + (len(self.batch.jobs) + 1) * self.batch.timeout_s + START_S

    def avoids(self, address: str) -> bool:
        """Whether it is better tried elsewhere."""
        return address in self.unmade or any(address == there for there, _ in self.mishaps)


@dataclass(eq=False)
class Hand:
    """A Dask worker."""

    seen: Seen
    heard: float  # by this machine's clock
    attempts: list[Attempt] = field(default_factory=list[Attempt])  # as many as it has threads run, others wait
    unfit: str = ""  # why it is asked no more
    silent: bool = False
    failures: int = 0  # one after another

    @property
    def usable(self) -> bool:
        """Whether it can be given something now."""
        return not self.unfit and not self.silent and self.seen.running

    def begin(self, slots: int, now: float) -> None:
        """Start the clocks of those attempts that it has got round to."""
        for attempt in self.attempts[:slots]:
            attempt.began = attempt.began or now


class Crew:
    """The workers of a cluster, as they join, fall silent, speak again and leave."""

    def __init__(self, silence_s: float) -> None:
        self.silence_s = silence_s
        self.hands: dict[str, Hand] = {}
        self.cleared: set[str] = set()  # machines that were seen to do nothing before timed cells began there

    def update(self, workers: Iterable[Seen]) -> tuple[list[Hand], list[Hand]]:
        """Those that have gone, and those that have just fallen silent."""
        now, present = time.monotonic(), {seen.address: seen for seen in workers}
        gone = [self.hands.pop(address) for address in list(self.hands) if address not in present]
        fell: list[Hand] = []
        for address, seen in present.items():
            hand = self.hands.setdefault(address, Hand(seen, now))
            if seen.last_seen != hand.seen.last_seen:
                hand.heard, hand.silent = now, False
            elif now - hand.heard > self.silence_s and not hand.silent:
                hand.silent = True
                fell.append(hand)
            hand.seen = seen
        return gone, fell

    def usable(self, *, alone: bool) -> list[Hand]:
        """Workers that can be given something; `alone`: those with the resource, whose machines did nothing else."""
        hands = [hand for hand in self.hands.values() if hand.usable]
        if not alone:
            return hands
        for host in {hand.seen.host for hand in hands}:
            there = [hand for hand in self.hands.values() if hand.seen.host == host]
            if any(hand.silent for hand in there):
                self.cleared.discard(host)
            elif not any(hand.seen.executing for hand in there):
                self.cleared.add(host)
        return [hand for hand in hands if hand.seen.timed and hand.seen.host in self.cleared]

    def check_resources(self) -> None:
        """InputError where two workers of one machine have the resource for timed cells."""
        hosts: dict[str, str] = {}
        for hand in self.hands.values():
            other = hosts.setdefault(hand.seen.host, hand.seen.address) if hand.seen.timed else hand.seen.address
            if other != hand.seen.address:
                raise InputError(
                    f"--scheduler: workers {other} and {hand.seen.address} of one machine, {hand.seen.host}, both have "
                    f"the resource {RESOURCE}; expected it at one worker a machine: timed cells run one by one."
                )
