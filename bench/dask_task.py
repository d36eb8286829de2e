"""What a Dask worker does with a batch: see that it has what the batch needs, and run it in a process of its own.

A task reaches a worker as bytes that do the work when they are unpickled: so neither the scheduler nor the Dask of a
worker has to import this package to pass them on, and a worker that does not have it says so as the task's error.
"""

import multiprocessing
import pickle
import threading
from collections.abc import Callable, Iterator
from typing import Any

from .batch import Batch, Finished
from .dask_inventory import Inventory, differences
from .executor_local import Local

Answer = list[Finished] | list[str]
"""The batch's jobs as they ended, or how this worker differs from what the batch needs."""

_thread = threading.local()


class _Order:
    """A call that is made where this is unpickled."""

    def __init__(self, call: Callable[..., Any], *arguments: Any) -> None:
        self.call, self.arguments = call, arguments

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        return self.call, self.arguments


def order(batch: Batch, wanted: Inventory, *, alone: bool) -> bytes:
    """The task: `pickle.loads` of it does the batch and returns an answer, pickled, too."""
    return pickle.dumps(_Order(carry_out, batch, wanted, alone))


def carry_out(batch: Batch, wanted: Inventory, alone: bool) -> bytes:
    """The pickled answer of this worker."""
    lacks = differences(wanted)
    answer: Answer = lacks or [finished._replace(alone=alone) for finished in _ended(batch, alone=alone)]
    return pickle.dumps(answer)


def _ended(batch: Batch, *, alone: bool) -> Iterator[Finished]:
    """The jobs as they end, until nobody wants the task any more."""
    wanted = _still_wanted()
    for finished in _pool().run([batch], alone=alone):
        yield finished
        if not wanted():
            return


def _pool() -> Local:
    """A process for each of the worker's threads, kept from one batch to the next."""
    if not hasattr(_thread, "pool"):
        multiprocessing.current_process().daemon = False  # a nanny's child is one, and could not have children
        _thread.pool = Local(1)
    return _thread.pool


def _still_wanted() -> Callable[[], bool]:
    """Whether the task that this thread runs has not been cancelled meanwhile."""
    from distributed import get_worker

    worker = get_worker()
    key = worker.get_current_task()

    def asked() -> bool:
        task = worker.state.tasks.get(key)
        return task is not None and task.state == "executing"

    return asked
