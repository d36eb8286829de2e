"""Cells one after another in this very process: for a debugger, and to see where the time goes."""

from collections.abc import Generator, Sequence

from .batch import Batch, Finished, Logs, work


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
