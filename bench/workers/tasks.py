"""Runs tasks in processes of their own, with a timeout.

What a task returns comes back through a pipe; if its process dies instead, how it died comes back.
"""

import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any, NamedTuple

from ...core.errors import InputError
from .process import Worker


class Ended(NamedTuple):
    """The end of a task's process."""

    task: int  # its place in the list
    value: Any  # what its function returned, where it did
    death: str  # "" where it returned, "timeout", or how the process died
    alone: bool  # no other task ran at any moment while it did
    seconds: float  # of wall time, from its start


@dataclass
class _Running:
    task: int
    worker: Worker
    began: float
    deadline: float
    alone: bool


def execute(
    function: Callable[[Any], Any], tasks: Sequence[Any], *, workers: int, timeout_s: float = float("inf")
) -> Iterator[Ended]:
    """Runs `function(task)` for every task in a process of its own, at most `workers` at once; yields each end.

    `function` and what it takes and returns must pickle. InputError where a task raised it. If the caller stops
    listening, every running process is killed.
    """
    waiting = list(enumerate(tasks))[::-1]
    running: list[_Running] = []
    with tempfile.TemporaryDirectory(prefix="slamduel-") as folder:
        try:
            while waiting or running:
                while waiting and len(running) < workers:
                    running.append(_started(function, *waiting.pop(), Path(folder), timeout_s))
                    if len(running) > 1:
                        for one in running:
                            one.alone = False
                patience = max(0.0, min(one.deadline for one in running) - time.monotonic())
                ready = wait(
                    [channel for one in running for channel in one.worker.channels],
                    None if patience == float("inf") else patience,
                )
                for one in list(running):
                    overdue = time.monotonic() >= one.deadline
                    if overdue or any(channel in ready for channel in one.worker.channels):
                        running.remove(one)
                        yield _ended(one, overdue)
        finally:
            for one in running:
                one.worker.kill()


def _started(function: Callable[[Any], Any], index: int, task: Any, folder: Path, timeout_s: float) -> _Running:
    worker = Worker(_work, (function, task), folder)
    now = time.monotonic()
    return _Running(index, worker, now, now + timeout_s, alone=True)


def _work(pipe: Connection, function: Callable[[Any], Any], task: Any) -> None:
    try:
        answer = (function(task), None)
    except InputError as error:
        answer = (None, str(error))
    pipe.send(answer)


def _ended(one: _Running, overdue: bool) -> Ended:
    value, wrong, death = None, None, ""
    try:
        if one.worker.pipe.poll():
            value, wrong = one.worker.pipe.recv()
        elif overdue:
            death = "timeout"
        else:
            death = one.worker.death()
    except (EOFError, OSError):
        death = one.worker.death()
    one.worker.kill()
    if wrong is not None:
        raise InputError(wrong)
    return Ended(one.task, value, death, one.alone, time.monotonic() - one.began)
