"""Starts, watches and kills one process, forked from a server that has the heavy imports.

A worker has one thread, a process group of its own, and its output in a file. It ends when the server does, and the
server ends with the process that started it: no worker outlives its run, however that was killed.
"""

import contextlib
import ctypes
import multiprocessing
import os
import signal
import sys
import tempfile
import threading
from collections.abc import Callable, Generator
from multiprocessing import forkserver, resource_tracker
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS", "NUMBA_NUM_THREADS")
PRELOAD = ["slamduel.bench.workers.preload"]
PR_SET_PDEATHSIG = 1  # from <sys/prctl.h>
LAST_WORDS = 300  # characters of a dead worker's output that are quoted
_ONE_AT_A_TIME = threading.RLock()  # while starting or ending a process: the standard library's list is not thread-safe


class Worker:
    """A process that runs `function(pipe, *arguments)`, and the other end of that pipe."""

    def __init__(self, function: Callable[..., None], arguments: tuple[Any, ...], folder: Path) -> None:
        """Starts it; both must pickle. Its output goes to a file in `folder`."""
        descriptor, name = tempfile.mkstemp(dir=folder)
        os.close(descriptor)
        self.output = Path(name)
        with _ONE_AT_A_TIME:
            multiprocessing.current_process().daemon = False  # where another pool runs us, children are forbidden
            _start_server()
            context = multiprocessing.get_context("forkserver")
            self.pipe, theirs = context.Pipe()
            self._process = context.Process(target=_live, args=(theirs, name, function, arguments), daemon=False)
            with _nameless_main():
                self._process.start()
            theirs.close()
            self.sentinel = self._process.sentinel

    @property
    def channels(self) -> tuple[Any, Any]:
        """The handles to wait for: its messages, and its end."""
        return self.pipe, self.sentinel

    def death(self) -> str:
        """Describes how a silent process ended, with its last output."""
        with _ONE_AT_A_TIME:
            self._process.join(timeout=5)
            code = self._process.exitcode
        how = f"ended with exit status {code}" if code is None or code >= 0 else f"was killed by {_signal(-code)}"
        words = " ".join(self.output.read_text(errors="replace").split())[-LAST_WORDS:]
        return f"the process {how}" + (f"; its last words: {words}" if words else "")

    def kill(self) -> None:
        """Kills the process and all that it started, and waits for it."""
        with _ONE_AT_A_TIME:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid or 0, signal.SIGKILL)
            self._process.kill()
            self._process.join()
            self.pipe.close()
            self._process.close()
        with contextlib.suppress(OSError):
            self.output.unlink()


def _start_server() -> None:
    """Starts the fork server, if there is none, with Ctrl-C ignored from the start, as in its children.

    The server ignores it by itself only after its imports; a terminal interrupts it too, but ending it is our task.
    """
    for name in THREADS:  # libraries read these when they are loaded
        os.environ[name] = "1"
    multiprocessing.get_context("forkserver").set_forkserver_preload(PRELOAD)
    resource_tracker.ensure_running()  # which would lift the block when the server has it started
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        with _nameless_main():
            forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def _nameless_main() -> Generator[None]:
    """Hides the main module, which every child would otherwise import and so run again."""
    main = sys.modules["__main__"].__dict__
    kept = {name: main.pop(name) for name in ("__file__", "__spec__") if name in main}
    main["__spec__"] = None
    try:
        yield
    finally:
        main.update(kept)


def _live(pipe: Connection, output: str, function: Callable[..., None], arguments: tuple[Any, ...]) -> None:
    os.setsid()
    try:
        descriptor = os.open(output, os.O_WRONLY | os.O_APPEND)
    except FileNotFoundError:  # the parent was interrupted before this process started
        os._exit(0)
    for stream in (1, 2):
        os.dup2(descriptor, stream)
    _die_with_the_server(pipe)
    function(pipe, *arguments)
    pipe.close()
    sys.stdout.flush()
    os._exit(0)  # skips threads and exit handlers that a backend left behind


def _die_with_the_server(pipe: Connection) -> None:
    """Makes the process die with the fork server, and the server with the runner.

    The server lives while anybody holds the write end of a pipe to it, and hands one to each of its children; so every
    inherited descriptor but ours is closed. A limit on CPU time instead would make Linux count the process clock in
    ticks of 4 ms.
    """
    ours = pipe.fileno()
    os.closerange(3, ours)
    os.closerange(ours + 1, max(256, ours + 1))
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


def _signal(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
