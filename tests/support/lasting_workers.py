"""Worker processes that outlive a run and serve the next: to load a backend takes a new one longer than a small run."""

import os
import sys

from slamduel.bench.workers.local_executor import Local


class Lasting(Local):
    """A pool that ends with the tests, and not with its run."""

    def close(self) -> None:
        """Leaves the workers to the next run."""


def _place() -> tuple[str, ...]:
    """What a worker has from the process that starts it: its folder, and where it looks for modules."""
    return os.getcwd(), *sys.path


HERE = _place()

_lasting: dict[int, Lasting] = {}
"""By the number of workers."""


def local(workers: int) -> Local:
    """The pool of so many workers that lasts; one for a single run where a worker of it would be elsewhere."""
    return _lasting.setdefault(workers, Lasting(workers)) if _place() == HERE else Local(workers)


def end() -> None:
    """Ends all workers; the next run begins others."""
    for pool in _lasting.values():
        Local.close(pool)
