"""Runs checks in a process of their own, so that a backend that hangs, crashes or exits fails one check only.

The process writes a diary of checks started and their outcomes. A watchdog thread, which compiled code cannot block,
ends it when a check is overdue; the rest then runs in a new one.
"""

import faulthandler
import pickle
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...backends import registry as backends
from ..workers.tasks import execute
from .candidate import Candidate
from .suite import Check, Outcome, chosen, examine


@dataclass(frozen=True)
class CheckTask:
    """The checks for one process."""

    backend: str  # its name
    options: Any
    checks: tuple[str, ...]  # names
    diary: Path  # gets, in turn, the time (s) at which a check starts, and its Outcome
    limit_s: float


def examined(backend: str, options: Any, checks: Sequence[Check], limit_s: float) -> Iterator[Outcome]:
    """Yields the outcomes of `checks` on the named backend, in order; no check takes longer than `limit_s`."""
    left = list(checks)
    with tempfile.TemporaryDirectory(prefix="slamduel-") as folder:
        while left:
            diary = Path(folder) / str(len(left))
            diary.touch()
            names = tuple(check.name for check in left)
            (ended,) = execute(run, [CheckTask(backend, options, names, diary, limit_s)], workers=1)
            outcomes, begun = _read(diary)
            yield from outcomes
            left = left[len(outcomes) :]
            if left:
                overdue = begun is not None and time.time() - begun >= limit_s
                found = f"it did not come back within {limit_s:g} s" if overdue else ended.death
                yield Outcome(left[0].name, left[0].title, "failed", found)
                del left[0]


def run(task: CheckTask) -> None:
    """Runs the checks in the process."""
    candidate = Candidate(backends.find(task.backend), task.options)
    with task.diary.open("ab") as diary:
        for check in chosen(task.checks):
            pickle.dump(time.time(), diary)
            diary.flush()
            faulthandler.dump_traceback_later(task.limit_s, exit=True)
            outcome = examine(check, candidate)
            faulthandler.cancel_dump_traceback_later()
            pickle.dump(outcome, diary)
            diary.flush()


def _read(diary: Path) -> tuple[list[Outcome], float | None]:
    """Reads the outcomes in a diary, and the start of the check that has none, if there is one."""
    entries: list[Any] = []
    with diary.open("rb") as file:
        while True:
            try:
                entries.append(pickle.load(file))
            except EOFError:
                break
    return entries[1::2], entries[-1] if len(entries) % 2 else None
