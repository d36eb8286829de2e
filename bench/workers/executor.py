"""The executor protocol, and an executor that runs cells one after another in this process."""

from collections.abc import Generator, Sequence
from typing import Protocol

from .batch import Batch, Finished, Logs, work


class Executor(Protocol):
    """Runs batches; every job of every batch ends once, even if a worker dies."""

    name: str

    @property
    def slots(self) -> int:
        """Returns how many jobs it runs at once, as far as known: for estimates and the size of batches."""
        ...

    @property
    def times(self) -> bool:
        """True if it can run cells one at a time on each machine, so that their times are comparable."""
        ...

    def run(self, batches: Sequence[Batch], *, alone: bool) -> Generator[Finished]:
        """Yields each job as it ends, in any order; `alone`: one at a time on each machine.

        InputError where it cannot run at all: no scheduler at that address, other code on a worker. A caller that stops
        listening ends what is running.
        """
        ...

    def close(self) -> None:
        """Ends its workers."""


class Here:
    """Runs cells in this process, for debuggers and profilers: without timeouts, unprotected from backends."""

    name = "here"
    slots = 1
    times = True

    def run(self, batches: Sequence[Batch], *, alone: bool) -> Generator[Finished]:  # noqa: ARG002 - it always is
        """Yields each job as it ends."""
        logs = Logs()
        for batch in batches:
            for finished in work(batch, logs):
                yield finished._replace(alone=True)

    def close(self) -> None:
        """Does nothing."""
