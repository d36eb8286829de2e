"""Where a study's cells run: in this process, in processes of this machine, or on a Dask cluster."""

from collections.abc import Generator, Sequence
from typing import Protocol

from .batch import Batch, Finished, Logs, work


class Executor(Protocol):
    """Runs batches; whatever becomes of a worker, every job of every batch ends once."""

    name: str

    @property
    def slots(self) -> int:
        """How many jobs it runs at once, as far as is known: for estimates and the size of batches."""
        ...

    def run(self, batches: Sequence[Batch], *, alone: bool) -> Generator[Finished]:
        """Each job as it ends, in any order; `alone`: one at a time on each machine.

        InputError where it cannot be done at all: no scheduler at that address, other code on a worker. A caller that
        stops listening ends what is running.
        """
        ...

    def close(self) -> None:
        """End its workers."""
        ...


class Here:
    """No limit on a cell's time is kept, and what a backend does to the process it does to the study."""

    name = "here"
    slots = 1

    def run(self, batches: Sequence[Batch], *, alone: bool) -> Generator[Finished]:  # noqa: ARG002 - it always is
        """Each job as it ends."""
        logs = Logs()
        for batch in batches:
            for finished in work(batch, logs):
                yield finished._replace(alone=True)

    def close(self) -> None:
        """Nothing is left to end."""
