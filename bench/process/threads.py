"""Holds the linear algebra of this process to one thread while a cell is measured.

A worker process starts with one thread. A process of the user's has one for each core: on a busy machine its calls wait
for one another longer than they compute, CPU time that no backend is to blame for, and sums are added in another order.
"""

import contextlib
from collections.abc import Generator

from threadpoolctl import threadpool_limits


@contextlib.contextmanager
def one_thread() -> Generator[None]:
    """Limits each BLAS, and OpenMP, that the process has loaded by now; afterwards they have what they had before."""
    with threadpool_limits(limits=1):
        yield
