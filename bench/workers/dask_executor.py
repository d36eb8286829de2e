"""Cells on a Dask cluster, whose workers may die, hang, come late, or be somebody else's.

A batch goes to one worker that is chosen here, so it is known at any moment who has what in hand, and for how long:
what a worker does not bring back within the limits of the batch's cells is given to another, and what it brings later
is not looked at. A worker holds one batch more than it has threads. Every batch comes with the inventory that it was
planned with (dask_inventory.py), and a worker that does not have the same is named and asked no more.
"""

import sys
from collections.abc import Callable, Generator, Sequence
from functools import cached_property

from .batch import Batch, Finished
from .dask_cluster import Cluster
from .dask_requirements import inventory
from .dask_run import Run
from .dask_task import order
from .dask_workers import Crew


def to_stderr(sentence: str) -> None:
    """Where a user reads what is no error yet."""
    print(sentence, file=sys.stderr)


class Dask:
    """An executor on the scheduler at an address (tcp://host:port) or in a scheduler file.

    `patience_s`: without any worker, before that is an error; `silence_s`: without a heartbeat, before a worker's
    batches are given to others; `say` is told in sentences who is waited for and who is not used.
    """

    name = "dask"

    def __init__(
        self,
        scheduler: str,
        *,
        patience_s: float = 300,
        silence_s: float = 20,
        say: Callable[[str], None] = to_stderr,
    ) -> None:
        self.scheduler = scheduler
        self.patience_s = patience_s
        self.say = say
        self._crew = Crew(silence_s)

    @cached_property
    def cluster(self) -> Cluster:
        """The connection, made when it is first asked for. InputError where there is no scheduler."""
        return Cluster(self.scheduler)

    @property
    def slots(self) -> int:
        """Threads of the workers that there are now, at least one. InputError where there is no scheduler."""
        self._crew.update(self.cluster.workers() or [])
        return max(1, sum(hand.seen.threads for hand in self._crew.usable(alone=False)))

    def run(self, batches: Sequence[Batch], *, alone: bool) -> Generator[Finished]:
        """Each job as it ends; InputError where there is no scheduler, or no worker that can be used, for too long."""
        self._crew.cleared.clear()
        wanted = inventory(batches)
        run = Run(self.cluster, self._crew, batches, alone, self.patience_s, self.say)
        try:
            yield from run.finished(lambda batch: order(batch, wanted, alone=alone))
        finally:
            run.let_go()

    def close(self) -> None:
        """Leave the cluster; its workers are whoever's they were."""
        if "cluster" in self.__dict__:
            self.cluster.close()
            del self.cluster
