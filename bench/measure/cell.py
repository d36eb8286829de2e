"""Runs one cell, dataset variant x backend variant x seed, in a worker: the result is a row and arrays.

Limits are set, the backend is driven through the log, and only then is the truth read and the outcome judged.
"""

import hashlib
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ...backends import registry as backends
from ...backends.api import Diverged, TruthWanted
from ...frontend import compiled
from ...frontend.errors import SlamduelError
from ...frontend.factors import UNKNOWN, Log, Truth
from .drive import drive, warm_up
from .memory import Peak, limited
from .score import score

TOLD = "was told the truth: linearised there"
"""The remark on a cell whose backend made use of the truth."""


@dataclass(frozen=True)
class Job:
    """One backend on a log: all that a worker needs to know beside the log."""

    backend: str  # the variant's label
    name: str
    options: Any
    seed: int
    memory_mb: int
    oracle: bool = False  # tell the backend the truth, if it wants to know


@dataclass(frozen=True)
class Result:
    """How a cell ended: its row's values by column, what a report draws by name, and the traceback of an error."""

    status: str  # done | diverged | timeout | error | skipped
    reason: str
    row: dict[str, Any] = field(default_factory=dict[str, Any])
    arrays: dict[str, Any] = field(default_factory=dict[str, Any])
    traceback: str = ""


def generator(seed: int, backend: str) -> np.random.Generator:
    """A backend's own randomness: drawn from (seed, backend variant), the same in every process."""
    word = int.from_bytes(hashlib.sha256(backend.encode()).digest()[:8], "big")
    return np.random.default_rng(np.random.SeedSequence([seed, word, 0]))


def run_on(job: Job, read_log: Callable[[], Log], read_truth: Callable[[], Truth | None]) -> Result:
    """The result of the job; every way in which a backend can end short of killing the process is a status here."""
    with limited(job.memory_mb):
        return _run(job, read_log, read_truth)


def rehearse(job: Job, log: Log) -> Result:
    """Let the job's backend load or compile its code, on the first steps of the log; nothing of it is a result."""
    try:
        with limited(job.memory_mb):
            warm_up(backends.find(job.name), job.options, log, lambda: generator(job.seed, job.backend))
    except BaseException as error:  # a backend may raise anything at all; its cell will say so
        return Result("error", _where(error))
    return Result("done", "")


def _run(job: Job, read_log: Callable[[], Log], read_truth: Callable[[], Truth | None]) -> Result:
    row: dict[str, Any] = {}
    peak, made = Peak(), compiled.made()
    try:
        log = read_log()
        row |= _about(log)
        builder = backends.find(job.name)
        if len(log.loop_to) and not builder.loops:
            return Result("skipped", "the log has loop closures (RelativePoses), which this backend does not take", row)
        if builder.associates:
            row["ignored"] = 0
        outcome = drive(builder, job.options, log, lambda: generator(job.seed, job.backend), _oracle(job, read_truth))
    except Diverged as error:
        return Result("diverged", str(error), row)
    except TruthWanted as error:
        unknown = "nobody knows the truth of this log, so --oracle has none to tell; " if job.oracle else ""
        return Result("skipped", unknown + str(error), row)
    except SlamduelError as error:
        return Result("error", str(error), row)
    except MemoryError:
        return Result("error", f"needed more than the memory limit of {job.memory_mb} MB", row)
    except BaseException as error:  # a backend may raise anything at all, SystemExit included
        return Result("error", _where(error), row, traceback=traceback.format_exc())
    held = peak.mb()
    if held is not None and compiled.made() == made:
        row["peak_mb"] = held
    judged = score(log, outcome, read_truth())
    said = [TOLD] * outcome.told + [judged.remark] * bool(judged.remark)
    row |= {"told": int(outcome.told)} | judged.row
    return Result("done", "; ".join(said), row, judged.arrays)


def _oracle(job: Job, read_truth: Callable[[], Truth | None]) -> Truth | None:
    """What the backend is told, where the run says so: a batch optimum is no truth."""
    truth = read_truth() if job.oracle else None
    return truth if truth is not None and truth.kind == "truth" else None


def _about(log: Log) -> dict[str, Any]:
    """The columns that are known of a log before anybody has run on it."""
    return {
        "digest": log.digest,
        "steps": len(log),
        "sightings": len(log.ids),
        "ignored": int((log.ids == UNKNOWN).sum()),
    }


def _where(error: BaseException) -> str:
    """An exception as one line: its type, what it says, and the line of code it came from."""
    last = traceback.extract_tb(error.__traceback__)[-1]
    said = " ".join(str(error).split())
    return f"{type(error).__name__}: {said} ({Path(last.filename).name}:{last.lineno})"
