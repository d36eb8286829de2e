"""Processes: one for each task, forked from a server that has the heavy imports, watched, and killed when overdue.

A worker has one thread, a session of its own, and its output in a file. What it returns comes back through a pipe; if
it dies instead, how it died comes back.
"""

import contextlib
import ctypes
import multiprocessing
import os
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing import forkserver, resource_tracker
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any, NamedTuple

from ..frontend.errors import InputError

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
PRELOAD = ["slamduel.bench.preload"]
PR_SET_PDEATHSIG = 1
"""From <sys/prctl.h>."""

LAST_WORDS = 300
"""Characters of a killed worker's output that are quoted."""


class Ended(NamedTuple):
    """How a task's process ended."""

    task: int  # its place in the list
    value: Any  # what its function returned, where it did
    death: str  # "" where it returned, "timeout", or how the process died
    alone: bool  # no other task ran at any moment while it did
    seconds: float  # of wall time, from its start


@dataclass
class _Worker:
    task: int
    process: Any
    pipe: Connection
    output: Path
    began: float
    deadline: float
    alone: bool


def execute(
    function: Callable[[Any], Any], tasks: Sequence[Any], *, workers: int, timeout_s: float = float("inf")
) -> Iterator[Ended]:
    """Run `function(task)` for every task in a process of its own, at most `workers` at once; each end as it comes.

    `function` and what it takes and returns must pickle. Raises InputError where a task did. If the caller stops
    listening, every running process is killed.
    """
    for name in THREADS:  # before the server starts: libraries read these when they are loaded
        os.environ[name] = "1"
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(PRELOAD)
    _start_server()
    waiting = list(enumerate(tasks))[::-1]
    running: list[_Worker] = []
    with tempfile.TemporaryDirectory(prefix="slamduel-") as folder:
        try:
            while waiting or running:
                while waiting and len(running) < workers:
                    running.append(_started(context, function, *waiting.pop(), Path(folder), timeout_s))
                    if len(running) > 1:
                        for worker in running:
                            worker.alone = False
                patience = max(0.0, min(worker.deadline for worker in running) - time.monotonic())
                ready = wait(
                    [channel for worker in running for channel in (worker.pipe, worker.process.sentinel)],
                    None if patience == float("inf") else patience,
                )
                for worker in list(running):
                    overdue = time.monotonic() >= worker.deadline
                    if worker.pipe in ready or worker.process.sentinel in ready or overdue:
                        running.remove(worker)
                        yield _ended(worker, overdue)
        finally:
            for worker in running:
                _kill(worker)


def _start_server() -> None:
    """Start the fork server, if it is not there, deaf to Ctrl-C from its first moment on, as its children then are.

    The server ignores it only once it has imported everything; a terminal interrupts it too, but to end it is ours.
    """
    resource_tracker.ensure_running()  # which would lift the block when the server has it started
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        with _nameless_main():
            forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _started(
    context: Any, function: Callable[[Any], Any], index: int, task: Any, folder: Path, timeout_s: float
) -> _Worker:
    ours, theirs = context.Pipe(duplex=False)
    descriptor, name = tempfile.mkstemp(dir=folder)
    os.close(descriptor)
    process = context.Process(target=_work, args=(theirs, function, task, name), daemon=False)
    with _nameless_main():
        process.start()
    theirs.close()
    now = time.monotonic()
    return _Worker(index, process, ours, Path(name), now, now + timeout_s, alone=True)


@contextlib.contextmanager
def _nameless_main() -> Generator[None]:
    """Without a main module that a child could import: a script that calls us would call us again in every child."""
    main = sys.modules["__main__"].__dict__
    kept = {name: main.pop(name) for name in ("__file__", "__spec__") if name in main}
    main["__spec__"] = None
    try:
        yield
    finally:
        main.update(kept)


def _work(pipe: Connection, function: Callable[[Any], Any], task: Any, output: str) -> None:
    """The life of a worker process."""
    os.setsid()
    try:
        descriptor = os.open(output, os.O_WRONLY | os.O_APPEND)
    except FileNotFoundError:  # whoever asked was interrupted before this process was there
        os._exit(0)
    for stream in (1, 2):
        os.dup2(descriptor, stream)
    _die_with_the_server(pipe)
    try:
        answer = (function(task), None)
    except InputError as error:
        answer = (None, str(error))
    pipe.send(answer)
    pipe.close()
    sys.stdout.flush()
    os._exit(0)  # whatever a backend left behind, threads or exit handlers, has no say any more


def _die_with_the_server(pipe: Connection) -> None:
    """Be killed when the fork server ends, and let it end when the runner does: no worker outlives its run.

    The server lives while anybody holds the write end of a pipe to it, and hands one to each of its children; so every
    inherited descriptor but ours is closed. A limit on CPU time instead would make Linux count the process clock in
    ticks of 4 ms.
    """
    ours = pipe.fileno()
    os.closerange(3, ours)
    os.closerange(ours + 1, max(256, ours + 1))
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


def _ended(worker: _Worker, overdue: bool) -> Ended:
    value, wrong, death = None, None, ""
    try:
        if worker.pipe.poll():
            value, wrong = worker.pipe.recv()
        elif overdue:
            death = "timeout"
        else:
            death = _death(worker)
    except (EOFError, OSError):
        death = _death(worker)
    _kill(worker)
    if wrong is not None:
        raise InputError(wrong)
    return Ended(worker.task, value, death, worker.alone, time.monotonic() - worker.began)


def _death(worker: _Worker) -> str:
    """How a process that sent nothing came to its end, and its last words."""
    worker.process.join(timeout=5)
    code = worker.process.exitcode
    how = f"ended with exit status {code}" if code is None or code >= 0 else f"was killed by {_signal(-code)}"
    words = " ".join(worker.output.read_text(errors="replace").split())[-LAST_WORDS:]
    return f"the process {how}" + (f"; its last words: {words}" if words else "")


def _signal(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


def _kill(worker: _Worker) -> None:
    """End a process and all that it started, and wait for it."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(worker.process.pid, signal.SIGKILL)
    worker.process.kill()
    worker.process.join()
    worker.pipe.close()
    worker.process.close()
