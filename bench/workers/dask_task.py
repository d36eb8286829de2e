"""What a Dask worker does with a batch: see that it has what the batch needs, and run it in a process of its own.

A task reaches a worker as bytes that do the work when they are unpickled: so neither the scheduler nor the Dask of a
worker has to import this package to pass them on, and a worker that does not have it says so as the task's error.
"""

import contextlib
import multiprocessing
import pickle
import tempfile
import threading
from collections.abc import Callable, Generator, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...frontend.errors import InputError
from .batch import Batch, Finished
from .dask_cluster import GO_ON
from .dask_requirements import Inventory, differences
from .local_executor import Local

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
    """The task: `pickle.loads` of it does the batch and returns an answer, pickled, too.

    A log that is kept goes with it, since the worker may not have the file. InputError where it cannot be read.
    """
    if batch.kept is not None:
        batch = replace(batch, kept=batch.kept._replace(content=_read(batch.kept.path)))
    return pickle.dumps(_Order(carry_out, batch, wanted, alone))


def carry_out(batch: Batch, wanted: Inventory, alone: bool) -> bytes:
    """The pickled answer of this worker.

    What it takes stays the same from version to version, so that a worker of another one can say so.
    """
    answer: Answer = differences(wanted)
    if not answer:
        with _with_log_here(batch) as batch:
            answer = [finished._replace(alone=alone) for finished in _ended(batch, alone=alone)]
    return pickle.dumps(answer)


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; expected the study's copy of a log. {GO_ON}.") from None


@contextlib.contextmanager
def _with_log_here(batch: Batch) -> Generator[Batch]:
    """The batch, with the log that came with it in a file of this machine."""
    if batch.kept is None:
        yield batch
        return
    with tempfile.NamedTemporaryFile(prefix="slamduel-", suffix=".npz") as here:
        here.write(batch.kept.content)
        here.flush()
        yield replace(batch, kept=batch.kept._replace(path=Path(here.name), content=b""))


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
