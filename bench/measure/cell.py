"""Runs one cell, dataset variant x backend variant x seed, in a worker: the result is a row and arrays.

The backend is driven through the log under its limits; only then is the ground truth read and the outcome scored.
"""

import hashlib
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...backends import registry as backends
from ...backends.api import Builder, Diverged, TruthWanted, Unsuited
from ...backends.given import Given, given, refused
from ...core.errors import SlamduelError
from ...core.factors import UNKNOWN, Log, Truth
from ...core.kernels import compiled
from ...core.partial import NO_IDS
from ..bound.bound import Bound
from ..process.memory import Peak, limited
from ..process.threads import one_thread
from .cpu_time import repeated_cost
from .drive import Outcome, drive, path_digest, timed_again, warm_up
from .score import Score, score

TOLD = "was given the ground truth: linearised there"  # the remark on a cell whose backend made use of it


@dataclass(frozen=True)
class Job:
    """One backend on a log: all that a worker needs beside the log itself."""

    backend: str  # the variant's label
    name: str
    options: Any
    seed: int
    memory_mb: int
    oracle: bool = False  # give the backend the ground truth, if it asks for it
    missing: str = ""  # why the backend cannot be imported, where that is known: it is not tried again
    again: bool = False  # a repeat: timed, and nothing scored


@dataclass(frozen=True)
class Result:
    """The result of a cell: its row by column, arrays by name, and the traceback of an error."""

    status: str  # done | diverged | timeout | error | skipped
    reason: str
    row: dict[str, Any] = field(default_factory=dict[str, Any])
    arrays: dict[str, Any] = field(default_factory=dict[str, Any])
    traceback: str = ""
    path: str = ""  # digest of the paths and the final map, where it is done: the same in every repeat


def generator(seed: int, backend: str) -> np.random.Generator:
    """Makes a backend's random generator from (seed, backend variant), the same in every process."""
    word = int.from_bytes(hashlib.sha256(backend.encode()).digest()[:8], "big")
    return np.random.default_rng(np.random.SeedSequence([seed, word, 0]))


def run_on(
    job: Job,
    read_log: Callable[[], Log],
    read_truth: Callable[[], Truth | None],
    *,
    mistaken: bool = False,
    bound: Callable[[], Bound | None] = lambda: None,
) -> Result:
    """Runs the job; every way in which a backend can end, short of killing the process, becomes a status.

    Of a log that is `mistaken`, what its measurements are off from the truth by is not taken for noise. `bound` gives
    the least errors that the log allows.
    """
    with one_thread(), limited(job.memory_mb):
        return _run(job, read_log, read_truth, bound, mistaken=mistaken)


def rehearse(job: Job, log: Log) -> Result:
    """Has the backend load or compile its code on the first steps of the log; nothing of it is a result."""
    if job.missing:
        return Result("error", job.missing)
    try:
        with limited(job.memory_mb):
            warm_up(backends.find(job.name), job.options, log, lambda: generator(job.seed, job.backend))
    except BaseException as error:  # a backend may raise anything at all; its cell will say so
        return Result("error", located(error))
    return Result("done", "")


def _run(
    job: Job,
    read_log: Callable[[], Log],
    read_truth: Callable[[], Truth | None],
    bound: Callable[[], Bound | None],
    *,
    mistaken: bool,
) -> Result:
    row: dict[str, Any] = {}
    peak, made, oracle = Peak(), compiled.made(), None
    draw = partial(generator, job.seed, job.backend)
    try:
        log = read_log()
        unknown = int((log.ids == UNKNOWN).sum())
        row |= {"digest": log.digest, "steps": len(log), "sightings": log.sighted, "ignored": unknown}
        if job.missing:
            return Result("error", job.missing, row)
        builder = backends.find(job.name)
        if why := _unfit(job, builder, log):
            return Result("skipped", why, row)
        if builder.associating(job.options):
            row["ignored"] = 0
        used = given(builder, log, job.options)
        truth = read_truth() if job.oracle else None
        oracle = truth if truth is not None and truth.kind == "truth" else None  # a batch optimum is no ground truth
        if job.again:
            timed = timed_again(builder, job.options, used.log, draw, oracle)
            return Result("done", "", repeated_cost(timed), path=path_digest(timed))
        outcome = drive(builder, job.options, used.log, draw, oracle)
    except Diverged as error:
        return Result("diverged", str(error), row)
    except TruthWanted as error:
        blind = job.oracle and oracle is None
        return Result("skipped", "--oracle: this log has no ground truth" if blind else str(error), row)
    except Unsuited as error:
        return Result("skipped", str(error), row)
    except SlamduelError as error:
        return Result("error", str(error), row)
    except MemoryError:
        return Result("error", f"needed more than the memory limit of {job.memory_mb} MB", row)
    except BaseException as error:  # a backend may raise anything at all, SystemExit included
        return Result("error", located(error), row, traceback=traceback.format_exc())
    held = peak.mb()
    if held is not None and compiled.made() == made:
        row["peak_mb"] = held
    used = used._replace(loops=used.loops + outcome.left_out)
    minimised = used.log if builder.minimising(job.options) else None
    takes = {"sightings": builder.sightings, "loops": builder.loops}
    judged = score(log, outcome, read_truth(), **takes, minimised=minimised, mistaken=mistaken, least=bound())
    return _scored(judged, outcome, used, row)


def _unfit(job: Job, builder: Builder, log: Log) -> str:
    """Says why a backend and a log with loop closures, or with or without ids, do not go together; "" if they do."""
    if why := refused(builder, log):
        return why
    associates, whole = builder.associating(job.options), len(log.ids)
    nothing = log.unknown == log.sighted > 0 and builder.sightings
    if not whole:  # positions or loops are used without them
        nothing = nothing and log.fixes is None and not len(log.loop_to)
    if builder.sightings and log.starts_nothing:
        return NO_IDS
    if nothing and not associates:
        if not builder.can_associate:
            return f"no sighting of the log has an id: {job.backend} takes no hidden ids; ekf[association=jcbb] does"
        fit = f"{job.name}[association=jcbb]"
        return f"no sighting of the log has an id, and {job.backend} does no data association; {fit} does"
    if associates and not log.unknown and whole and builder.can_associate:
        return "every sighting of the log has an id; DATASET[ids=hidden] hides those of a simulated or published log"
    return ""


def _left_out(used: Given) -> Iterator[str]:
    kinds = (
        (used.loops, "loop closure", "loop closures"),
        (used.partial, "partial sighting", "partial sightings"),
        (used.fixes, "fix", "fixes"),
    )
    for count, one, many in kinds:
        if count:
            yield f"1 {one} is left out" if count == 1 else f"{count} {many} are left out"
    if used.turns:
        yield f"{used.turns} turns by the gyro are in the odometry, their bias {used.bias}"
    if used.wheel_scale:
        yield "the wheels' scale, which is not known, is not estimated"


def _scored(judged: Score, outcome: Outcome, used: Given, row: dict[str, Any]) -> Result:
    """Makes a result of a score; the closures that the backend had kept no pose for are among those not `used`."""
    if judged.failed:
        return Result("diverged", judged.failed, row)
    said = [TOLD] * outcome.told
    said += [*_left_out(used)]
    said += [] if outcome.solution is None else [outcome.solution.remark] * bool(outcome.solution.remark)
    said += [judged.remark] * bool(judged.remark)
    if outcome.solution is not None and (bias := outcome.solution.gyro_bias) is not None:
        mean, sd = np.degrees(bias)
        said.append(f"the gyro's bias is {mean:.4g} degrees/s at the end, with a standard deviation of {sd:.2g}")
    row |= {"told": int(outcome.told)} | judged.row
    return Result("done", "; ".join(said), row, judged.arrays, path=path_digest(outcome))


def located(error: BaseException) -> str:
    """Describes an exception in a line: type, message, and the line of code that raised it."""
    last = traceback.extract_tb(error.__traceback__)[-1]
    said = " ".join(str(error).split())
    return f"{type(error).__name__}: {said} ({Path(last.filename).name}:{last.lineno})"
