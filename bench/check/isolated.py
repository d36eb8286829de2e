"""Runs checks in a process of their own, so that a backend that hangs, crashes or exits fails one check only.

The process sends each outcome as soon as it is known. One that is overdue is killed, and a new process runs the rest.
"""

import os
import pickle
import tempfile
from collections.abc import Iterator, Sequence
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

from ...backends import registry as backends
from ..workers.process import Worker
from .candidate import Candidate
from .suite import Check, Outcome, chosen, examine


def examined(backend: str, options: Any, checks: Sequence[Check], limit_s: float) -> Iterator[Outcome]:
    """Yields the outcome of each of `checks` on the named backend as it ends; no check takes longer than `limit_s`."""
    done = 0
    with tempfile.TemporaryDirectory(prefix="slamduel-") as folder:
        while done < len(checks):
            left = checks[done:]
            worker = Worker(run, (backend, options, tuple(check.name for check in left)), Path(folder))
            try:
                for outcome in _outcomes(worker, left, limit_s):
                    yield outcome
                    done += 1
            finally:
                worker.kill()


def _outcomes(worker: Worker, checks: Sequence[Check], limit_s: float) -> Iterator[Outcome]:
    """Yields the outcomes that the process sends, and a failure in place of the first that it does not send."""
    limit, found = None, ""  # imports do not count
    for check in (None, *checks):
        if not wait(worker.channels, limit):
            found = f"it did not come back within {limit_s:g} s"
        try:
            said = None if found or not worker.pipe.poll() else worker.pipe.recv()
        except (EOFError, OSError, pickle.UnpicklingError):
            said = None
        if said is None:
            failed = check or checks[0]
            yield Outcome(failed.name, failed.title, "failed", found or worker.death())
            return
        if check is not None:
            yield said
        limit = limit_s


def run(pipe: Connection, backend: str, options: Any, names: Sequence[str]) -> None:
    """Runs the checks in the process; sends its number when it is ready, and then each outcome."""
    candidate, process = Candidate(backends.find(backend), options), os.getpid()
    pipe.send(process)
    for check in chosen(names):
        outcome = examine(check, candidate)
        if os.getpid() != process:  # a copy that the backend has forked
            os._exit(0)
        pipe.send(outcome)
