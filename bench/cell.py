"""One cell of a run, in the process of its own in which it lives: dataset variant x backend variant x seed -> a row.

Limits are set, the backend is driven through the log, and only then is the truth read and the outcome judged.
"""

import hashlib
import resource
import sys
import traceback
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..backends import registry as backends
from ..backends.api import Diverged, TruthWanted
from ..datasets import archive
from ..frontend import compiled
from ..frontend.errors import SlamduelError
from ..frontend.factors import UNKNOWN, Log, Truth
from .drive import drive
from .score import score
from .summary import TOLD

MEGABYTE = 1 << 20


@dataclass(frozen=True)
class Task:
    """All that a worker needs to know of its cell."""

    backend: str  # the variant's label
    name: str
    options: Any
    seed: int
    log: Path  # the prepared log's archive
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


def generator(seed: int, backend: str, repeat: int = 0) -> np.random.Generator:
    """A backend's own randomness: drawn from (seed, backend variant, repeat), the same in every process."""
    word = int.from_bytes(hashlib.sha256(backend.encode()).digest()[:8], "big")
    return np.random.default_rng(np.random.SeedSequence([seed, word, repeat]))


def run(task: Task) -> Result:
    """The cell's result; every way in which a backend can end short of killing the process is a status here."""
    row: dict[str, Any] = {}
    _limit_memory(task.memory_mb)
    before_mb, made = _peak_mb(), compiled.made()
    try:
        log = archive.load_log(task.log)
        row |= _about(log)
        builder = backends.find(task.name)
        if len(log.loop_to) and not builder.loops:
            return Result("skipped", "the log has loop closures (RelativePoses), which this backend does not take", row)
        if builder.associates:
            row["ignored"] = 0
        outcome = drive(builder, task.options, log, lambda: generator(task.seed, task.backend), _oracle(task))
    except Diverged as error:
        return Result("diverged", str(error), row)
    except TruthWanted as error:
        unknown = "nobody knows the truth of this log, so --oracle has none to tell; " if task.oracle else ""
        return Result("skipped", unknown + str(error), row)
    except SlamduelError as error:
        return Result("error", str(error), row)
    except MemoryError:
        return Result("error", f"needed more than the memory limit of {task.memory_mb} MB", row)
    except BaseException as error:  # a backend may raise anything at all, SystemExit included
        return Result("error", _where(error), row, traceback=traceback.format_exc())
    if compiled.made() == made:
        row["peak_mb"] = max(_peak_mb() - before_mb, 0.0)
    judged = score(log, outcome, archive.load(task.log).truth)
    said = [TOLD] * outcome.told + [judged.remark] * bool(judged.remark)
    return Result("done", "; ".join(said), row | judged.row, judged.arrays)


def _oracle(task: Task) -> Truth | None:
    """What the backend is told, where the run says so: a batch optimum is no truth."""
    truth = archive.load(task.log).truth if task.oracle else None
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


def _peak_mb() -> float:
    """The most memory this process has held, MB."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / MEGABYTE if sys.platform == "darwin" else peak / 1024


def _limit_memory(megabytes: int) -> None:
    """Let the process grow by no more than this: address space, the one limit that the kernel keeps."""
    if sys.platform != "linux":  # elsewhere the kernel takes the limit and does not keep it
        return
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + megabytes * MEGABYTE
    _, most = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (limit if most == resource.RLIM_INFINITY else min(limit, most), most))
