"""Makes tasks for Dask workers: a check of the worker, and a batch that it runs in a process of its own.

A task is sent as bytes that do the work when unpickled, so the scheduler need not import this package, and on a worker
without it the task fails with that error.
"""

import pickle
import tempfile
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...core.errors import InputError
from .batch import Batch, Finished
from .dask_cluster import GO_ON
from .dask_requirements import Inventory, differences
from .local_executor import Local

_thread = threading.local()


class Order:
    """A call that is made when this is unpickled."""

    def __init__(self, call: Callable[..., Any], *arguments: Any) -> None:
        self.call, self.arguments = call, arguments

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        return self.call, self.arguments


def check(wanted: Inventory) -> bytes:
    """Makes the task that returns a worker's differences from the inventory, "" without any."""
    return pickle.dumps(Order(differences, wanted))


def order(batch: Batch, wanted: Inventory, *, alone: bool) -> bytes:
    """Makes the task that runs the batch and returns its ended jobs, pickled.

    A kept log is sent along, as the worker may not have the file; InputError where it cannot be read.
    """
    if batch.kept is not None:
        path = batch.kept.path
        try:
            batch = replace(batch, kept=batch.kept._replace(content=path.read_bytes()))
        except OSError as error:
            raise InputError(f"{path}: {error.strerror}; expected the study's copy of a log. {GO_ON}.") from None
    return pickle.dumps(Order(carry_out, batch, wanted, alone))


def carry_out(batch: Batch, wanted: Inventory, alone: bool) -> bytes:
    """Runs the batch on this worker; RuntimeError where the worker differs from the inventory."""
    if lacks := differences(wanted):
        raise RuntimeError(lacks)
    with tempfile.NamedTemporaryFile(prefix="slamduel-", suffix=".npz") as here:  # for a log that was sent along
        if batch.kept is not None:
            here.write(batch.kept.content)
            here.flush()
            batch = replace(batch, kept=batch.kept._replace(path=Path(here.name), content=b""))
        return pickle.dumps([finished._replace(alone=alone) for finished in _ended(batch, alone=alone)])


def _ended(batch: Batch, *, alone: bool) -> Iterator[Finished]:
    """Yields the jobs as they end; InterruptedError once the task is cancelled."""
    from distributed import get_worker

    worker = get_worker()
    task = worker.state.tasks[worker.get_current_task()]
    if not hasattr(_thread, "pool"):
        _thread.pool = Local(1)  # a process for each of the worker's threads, kept from one batch to the next
    for finished in _thread.pool.run([batch], alone=alone):
        yield finished
        if task.state != "executing":
            raise InterruptedError("the task is cancelled")
