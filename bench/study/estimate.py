"""Estimates how long a study will take, from recorded results, else from a few cells timed now."""

import contextlib
import random
import time
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from ..engine.batches import batch_of
from ..engine.key import log_key, made_once, result_key
from ..engine.log_files import LogFiles
from ..engine.request import RunRequest
from ..measure.cell import Result
from ..plan.work import PlannedCell
from ..record.schema import FAILED
from ..record.store import Known, Store
from ..words.numerals import counted, lasting
from ..workers.batch import KeptLog
from ..workers.executor import Executor
from .study import Study

BUDGET_S = 20.0  # s of wall time for cells that are timed now
WARM_S = 1.0  # s; a faster cell is timed once more, as loading code ruled the first time
Pair = tuple[str, str, str, str]  # dataset and its options, backend and its options


class Share(NamedTuple):
    """The study's cells of one backend on one dataset, both as its file names them."""

    dataset: str
    backend: str
    cells: int
    done: int
    todo: int  # now
    seconds: float  # of its cells to be done, one after another, as far as known
    unknown: int  # of them, those without any timing


@dataclass(frozen=True)
class StudyEstimate:
    """The estimate for what is to be run now, without the making of logs."""

    shares: Sequence[Share]
    slots: int
    alone: int  # cells that are to run alone on their machine
    wall_s: float
    timed_now: int  # cells that were run for this
    undone: Mapping[str, int] = field(default_factory=dict[str, int])  # those not done, by reason

    @property
    def cells(self) -> int:
        """Counts the cells of the study."""
        return sum(share.cells for share in self.shares)

    @property
    def todo(self) -> int:
        """Counts the cells to be run now."""
        return sum(share.todo for share in self.shares)

    def sentences(self) -> list[str]:
        """States in sentences how many cells, how long, and what is not known."""
        done = sum(share.done for share in self.shares)
        alone = f", {self.alone:,} of them alone on their machine, as they are timed" if self.alone else ""
        said = [f"{self.cells:,} cells, {done:,} done, {self.todo:,} to be run now{alone}."]
        if not self.todo:
            return said
        unknown = [share for share in self.shares if share.unknown]
        if sum(share.unknown for share in unknown) < self.todo:
            known = f"by {counted(self.timed_now, 'cell')} timed now" if self.timed_now else "by cells done before"
            slots = f", {self.slots} at a time" if self.alone < self.todo else ""
            how_long = f"About {lasting(self.wall_s)}" if self.wall_s >= 1 else "Less than 1 s"
            said.append(f"{how_long}{slots}, {known}; making the logs takes additional time.")
        said += [
            f"Not known: how long {share.unknown:,} of {share.dataset} with {share.backend} will take."
            for share in unknown
        ]
        said += [f"{counted(n, 'cell')} timed now did not end well: {reason}" for reason, n in self.undone.items()]
        again = "There was no time to try more; a second --dry-run tries more, as compiled code is kept."
        return said + [again] * bool(unknown)

    def table(self) -> list[tuple[str, ...]]:
        """A head and one row per share: dataset, backend, cells, done, to do, and their time in sequence."""
        rows: list[tuple[str, ...]] = [("dataset", "backend", "cells", "done", "to do", "one after another")]
        for share in self.shares:
            took = "" if share.unknown == share.todo else lasting(share.seconds) + " and more" * (share.unknown > 0)
            rows.append((share.dataset, share.backend, *map(str, (share.cells, share.done, share.todo)), took))
        return rows


def estimate(
    study: Study, store: Store | None, executor: Executor, request: RunRequest, budget_s: float = BUDGET_S
) -> StudyEstimate:
    """Estimates how long the requested cells of the study will take on the executor's slots.

    A cell takes as long as the record's of the same variants did on average, else as those of the same names, else as
    some that the executor is given now, at random and one at a time, until `budget_s` is over. Only the cache of logs
    that are costly to make is written to.
    """
    done = _done(study, store, request)
    todo = [cell for cell, is_done in zip(study.cells, done, strict=True) if not is_done and request.chosen(cell)]
    random.Random(0).shuffle(todo)
    todo = todo[: request.limit]
    seconds = {} if store is None else store.seconds()
    names = {_names(pair) for pair in seconds}
    new = [cell for cell in todo if _names(_pair(cell)) not in names]
    now, undone = _timed_now(study, store, new, executor, budget_s)
    took = _Averages(seconds | now)
    each = [took.of(_pair(cell)) for cell in todo]
    side = [s or 0.0 for cell, s in zip(todo, each, strict=True) if not cell.timed]
    alone = [s or 0.0 for cell, s in zip(todo, each, strict=True) if cell.timed]
    wall = max([sum(side) / executor.slots, *side]) + sum(alone)
    return StudyEstimate(_shares(study, done, todo, each), executor.slots, len(alone), wall, len(now), undone)


class _Averages:
    """Mean seconds of a cell, by its variants or by their names."""

    def __init__(self, seconds: Mapping[Pair, tuple[float, int]]) -> None:
        self._by_pair = {pair: mean for pair, (mean, _) in seconds.items()}
        total: dict[tuple[str, str], tuple[float, int]] = {}
        for pair, (mean, count) in seconds.items():
            s, n = total.get(_names(pair), (0.0, 0))
            total[_names(pair)] = s + mean * count, n + count
        self._by_names = {names: s / n for names, (s, n) in total.items()}

    def of(self, pair: Pair) -> float | None:
        """The mean; None where nothing is known."""
        return self._by_pair.get(pair, self._by_names.get(_names(pair)))


def _pair(cell: PlannedCell) -> Pair:
    return cell.cell.key[:4]


def _names(pair: Pair) -> tuple[str, str]:
    return pair[0], pair[2]


def _done(study: Study, store: Store | None, request: RunRequest) -> list[bool]:
    """Returns for each cell True if it has ended and is not to be run again."""
    if store is None:
        return [False] * len(study.cells)
    logs, statuses = store.logs(), store.statuses() | store.logs_unmade()
    known: dict[tuple[int, int], str | Known] = {}  # by dataset and seed: several cells share a log
    done: list[bool] = []
    for cell in study.cells:
        of = cell.cell.log
        place = id(cell.cell.dataset), cell.cell.seed if cell.cell.dataset.numbered else 0
        if place not in known:
            made_of = log_key(of)
            known[place] = logs.get(made_of, made_of)
        log = known[place]
        key = log if isinstance(log, str) else result_key(cell.cell, log, timed=cell.timed, oracle=study.oracle)
        done.append(key in statuses and not (request.retry and request.chosen(cell) and statuses[key] in FAILED))
    return done


def _timed_now(
    study: Study, store: Store | None, cells: Sequence[PlannedCell], executor: Executor, budget_s: float
) -> tuple[dict[Pair, tuple[float, int]], Counter[str]]:
    """Times one cell per pair, of as many pairs as there is time for; also counts reasons of those not done.

    The cells come in random order, so the mean of those timed is unbiased; first one of every dataset and backend,
    whatever their options.
    """
    end, found, undone = time.monotonic() + budget_s, dict[Pair, tuple[float, int]](), Counter[str]()
    for cell in _first_of_each(cells):
        kept = None if store is None else _kept(store, cell)
        left = end - time.monotonic()
        if left <= 0:
            break
        for _ in range(2):
            took, result = _took(study, cell, kept, executor, min(left, study.timeout_s))
            if result.status == "timeout" and took < study.timeout_s:  # stopped for lack of time
                break
            found[_pair(cell)] = took, 1
            if result.status not in ("done", "timeout"):
                undone[f"{result.status}, {result.reason}"] += 1
                break
            left = end - time.monotonic()
            if took > WARM_S or left <= 0:
                break
    return found, undone


def _first_of_each(cells: Iterable[PlannedCell]) -> list[PlannedCell]:
    """Returns one cell per pair, in rounds with one pair of every two names."""
    by_names: dict[tuple[str, str], dict[Pair, PlannedCell]] = {}
    for cell in cells:
        by_names.setdefault(_names(_pair(cell)), {}).setdefault(_pair(cell), cell)
    ranked = [(rank, cell) for group in by_names.values() for rank, cell in enumerate(group.values())]
    return [cell for _, cell in sorted(ranked, key=lambda one: one[0])]


def _kept(store: Store, cell: PlannedCell) -> KeptLog | None:
    """The cell's log, where the study has a copy of it."""
    of = cell.cell.log
    log = store.logs().get(log_key(of)) if made_once(of) else None
    entry = log and LogFiles(store.folder).entry(of.dataset.name, log)
    return entry if entry and entry.path.is_file() else None


def _took(
    study: Study, cell: PlannedCell, kept: KeptLog | None, executor: Executor, timeout_s: float
) -> tuple[float, Result]:
    """Times a cell; returns its seconds, and its end."""
    mine = replace(batch_of(study, cell, {0: cell}, kept), timeout_s=timeout_s, keep=False)
    with contextlib.closing(executor.run([mine], alone=True)) as ended:
        finished = next(iter(ended))
    return finished.seconds, finished.result


def _shares(
    study: Study, done: Sequence[bool], todo: Sequence[PlannedCell], each: Sequence[float | None]
) -> list[Share]:
    rows: dict[tuple[str, str], list[float]] = {}
    for cell, is_done in zip(study.cells, done, strict=True):
        row = rows.setdefault((cell.parameters["dataset"], cell.parameters["backend"]), [0, 0, 0, 0.0, 0])
        row[0] += 1
        row[1] += is_done
    for cell, seconds in zip(todo, each, strict=True):
        row = rows[cell.parameters["dataset"], cell.parameters["backend"]]
        row[2] += 1
        row[3] += seconds or 0.0
        row[4] += seconds is None
    return [
        Share(*names, int(cells), int(ended), int(left), seconds, int(unknown))
        for names, (cells, ended, left, seconds, unknown) in rows.items()
    ]
