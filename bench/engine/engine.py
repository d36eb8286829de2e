"""Runs cells into a record: makes the logs it needs, then runs the cells without a result, round by round.

In each further round cells that are done are timed again: log by log, all backends one after another in a shuffled
order. A machine that becomes slower meanwhile does so for all of them, and what a round has for two backends on one log
was measured at about the same time.
"""

import contextlib
import random
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from ...core.errors import Absent, InputError
from ...datasets.remarks import refuse
from ..measure.cell import Result
from ..measure.repeats import over_rounds
from ..plan.work import PlannedCell, Work
from ..record.database import Unwritable
from ..record.lock import claimed
from ..record.schema import FAILED, FILE, KEY, ROUND, Row
from ..record.store import Known, Store
from ..words.columns import TIMED
from ..words.names import called
from ..words.reason import reason, traceback
from ..workers.batch import Batch, Finished, unmade
from ..workers.executor import Executor
from .batches import batch_of
from .facts import facts
from .key import result_key
from .log_files import FOLDER as LOGS
from .logs import KnownLogs
from .repeats import lacking, last_round
from .request import RunRequest

MOST_JOBS = 20  # jobs of a batch: no more is lost with a machine
SHARES = 4  # batches for each slot, at least, so that the end of a study is shared evenly


class Watcher(Protocol):
    """Follows a run or a study."""

    def looking(self, logs: int) -> None:
        """Announces that so many logs are made first, to check results or to keep the logs."""

    def looked(self, name: str) -> None:
        """Counts a log that has been made, or cannot be."""

    def say(self, sentence: str) -> None:
        """Passes a remark to the user."""

    def running(self, cells: Sequence[PlannedCell], done: int, slots: int, recorded: Iterable[Row]) -> None:
        """Announces the cells to be run; `done` have a result already, which are `recorded`."""

    def finished(self, cell: PlannedCell, row: Mapping[str, Any], seconds: float) -> None:
        """Reports a cell that ended after so much wall time, with its values by column, status and reason at least."""

    def repeating(self, cells: Sequence[PlannedCell], number: int, of: int) -> None:
        """Announces the cells to be timed again in that round."""

    def repeated(self, cell: PlannedCell, row: Mapping[str, Any], seconds: float) -> None:
        """Reports such a cell that ended, with its values by column of a round."""


class Tally(NamedTuple):
    """The counts of the work's cells."""

    cells: int
    done: int  # that have ended, in whatever way
    failed: int  # of those; with cells whose log could not be made


About = Callable[[Mapping[str, Any]], Mapping[str, Any]]  # known facts -> facts to keep, or InputError


def run(work: Work, folder: Path, executor: Executor, request: RunRequest, about: About, watcher: Watcher) -> Tally:
    """Runs the cells of `work` that the record in `folder` has no result of.

    InputError where the folder cannot be used or written to, or where a log that is needed cannot be made. A record
    without planned cells is removed again.
    """
    with claimed(folder):
        try:
            with Store(folder, writing=True) as store:
                return _Engine(work, store, executor, watcher).run(request, about)
        except BaseException as error:
            left = _discard_unless_begun(folder)
            if isinstance(error, Unwritable):
                raise Unwritable(f"{error} {left}".rstrip()) from None
            raise


@dataclass
class _Engine:
    work: Work
    store: Store
    executor: Executor
    watcher: Watcher

    def run(self, request: RunRequest, about: About) -> Tally:
        work, store = self.work, self.store
        known = store.about() if store.planned() else {}  # else of one that was killed before anything was planned
        store.put_about(facts(work, self.executor) | dict(about(known)))
        self.logs = KnownLogs(store, work)
        self.log_keys = [self.logs.key(cell) for cell in work.cells]
        self.statuses = store.statuses(arrays=work.keep)
        self._strict = request.strict
        self._look(cell for cell in work.cells if self.logs.is_doubtful(cell))
        for name, found in store.remarks().items() if request.strict else ():
            refuse(name, found)
        todo = self._todo(request)
        while absent := [cell for cell in self._lacking(todo) if not self.logs.is_at_hand(cell)]:
            self._look(absent)
            todo = self._todo(request)  # a log that has changed adds cells
        self.watcher.running([work.cells[k] for k in todo], self._ended(), self.executor.slots, store.cells())
        for place in todo:
            self._keep_unmade(place)
        able = [place for place in todo if self.log_keys[place] not in self.logs.lost]
        for timed in (False, True):
            places = [place for place in able if work.cells[place].timed == timed]
            for finished in self._executed(self._batches(places), alone=timed):
                self._keep(finished)
        last = last_round(work, self.executor)
        for number in range(2, last + 1):
            self._repeat(number, last, request)
        store.put_about({"finished": time.time()})
        statuses = [self._status(place) for place in range(len(self.keys))]
        failed = sum(status in FAILED for status in statuses)
        return Tally(len(statuses), self._ended(), failed)

    def _repeat(self, number: int, last: int, request: RunRequest) -> None:
        """Times the cells that lack that round, one at a time."""
        todo = lacking(self.work, self.keys, self.statuses, self.store.rounds(), number, request)
        if todo:
            self.watcher.repeating([self.work.cells[place] for place in todo], number, last)
        for finished in self._executed(self._batches(todo, number), alone=True):
            self._keep_round(finished, number)

    def _keep_round(self, finished: Finished, number: int) -> None:
        assert finished.index is not None
        place, finished = finished.index, finished._replace(result=_told(finished.result))
        cell, key = self.work.cells[place], self.keys[place]
        assert key is not None
        row = {"round": number, **_round(finished)}
        before = [one for one in self.store.rounds(key).get(key, []) if one["round"] != number]
        self.store.put_round(key, row, over_rounds([*before, {**dict.fromkeys(ROUND), **row}], TIMED))
        self.watcher.repeated(cell, row, finished.seconds)

    def _lacking(self, todo: Sequence[int]) -> list[PlannedCell]:
        return list(self.work.cells) if self.work.logs_first else [self.work.cells[place] for place in todo]

    def _status(self, place: int) -> str | None:
        """The cell's status, also where its log could not be made; None where it has not ended."""
        key = self.keys[place]
        if key is None:
            return self.logs.unmade.get(self.log_keys[place])
        return self.statuses.get(key)

    def _ended(self) -> int:
        return sum(self._status(place) is not None for place in range(len(self.keys)))

    def _executed(self, batches: Sequence[Batch], *, alone: bool) -> Iterator[Finished]:
        """Yields each job of the batches as it ends; an exception here ends those that are running."""
        if batches:
            with contextlib.closing(self.executor.run(batches, alone=alone)) as ended:
                yield from ended

    def _look(self, cells: Iterable[PlannedCell]) -> None:
        """Makes the logs of these cells, each once, for their digests or to be kept; plans all cells by them."""
        looks = ((batch_of(self.work, cell, {}, whole=self.logs.are_kept(cell)), cell) for cell in cells)
        looked_at = {batch.log: (batch, cell) for batch, cell in looks}
        names = called([cell.cell.dataset.label for cell in self.work.cells])
        self.watcher.looking(len(looked_at))
        for finished in self._executed([batch for batch, _ in looked_at.values()], alone=False):
            cell = looked_at[finished.batch.log][1]
            if finished.log is None and self.work.logs_first:
                refusal = Absent if finished.result.status == "skipped" else InputError
                raise refusal(finished.result.reason.removeprefix("the log could not be made: "))
            if self._strict and finished.log is not None:
                refuse(names[cell.cell.dataset.label], finished.log.remarks)
            if told := self.logs.looked(cell, finished):
                self.watcher.say(told)
            self.watcher.looked(f"{names[cell.cell.dataset.label]} \N{MIDDLE DOT} {cell.cell.which}")
        self.logs.refuse_unlike()
        self.keys = [self._key(place) for place in range(len(self.work.cells))]
        rows = zip(self.work.cells, self.log_keys, self.keys, strict=True)
        self.store.put_plan([_planned(cell, log, key) for cell, log, key in rows])

    def _key(self, place: int) -> str | None:
        """The key of the cell's result, where its log is known."""
        cell, log = self.work.cells[place], self.logs.known.get(self.log_keys[place])
        return None if log is None else result_key(cell.cell, log, timed=cell.timed, oracle=self.work.oracle)

    def _todo(self, request: RunRequest) -> list[int]:
        """The places of the cells to be run, in a fixed shuffled order; one of those with the same key."""
        places: dict[Any, int] = {}
        for place, (cell, key) in enumerate(zip(self.work.cells, self.keys, strict=True)):
            status = self._status(place)
            if request.chosen(cell) and (status is None or (request.retry and status in FAILED)):
                places.setdefault(key or place, place)
        todo = list(places.values())
        random.Random(0).shuffle(todo)
        return todo[: request.limit]

    def _batches(self, places: Sequence[int], number: int = 1) -> list[Batch]:
        """Makes batches of cells by log, of a round; in a repeat a log's cells stay together, on one machine."""
        most = len(places) if number > 1 else min(MOST_JOBS, max(1, len(places) // (SHARES * self.executor.slots)))
        by_log: dict[str, list[tuple[int, PlannedCell]]] = {}
        for place in places:
            by_log.setdefault(self.log_keys[place], []).append((place, self.work.cells[place]))
        return [
            batch_of(self.work, group[0][1], dict(group[first : first + most]), self.logs.kept.get(key), number=number)
            for key, group in by_log.items()
            for first in range(0, len(group), most)
        ]

    def _keep_unmade(self, place: int) -> None:
        cell, looked = self.work.cells[place], self.logs.lost.get(self.log_keys[place])
        if looked is not None:
            for finished in unmade(batch_of(self.work, cell, {place: cell}), looked.result, looked.seconds):
                self._keep(finished)

    def _keep(self, finished: Finished) -> None:
        assert finished.index is not None
        place, finished = finished.index, finished._replace(result=_told(finished.result))
        cell, result, of_log = self.work.cells[place], finished.result, self.log_keys[place]
        row: dict[str, Any] = {"status": result.status, "reason": result.reason}
        with self.store.together():
            if finished.log is not None:
                self.logs.know(cell, finished.log)
            key = self.keys[place] = self._key(place)
            if key is None:
                self.store.settle(place, None, result.reason, skipped=result.status == "skipped")
                self.logs.know_unmade(cell, result.status)
            else:
                row = self._row(cell, finished, self.logs.known[of_log])
                if self.store.put_result(key, row, result.arrays):
                    self.statuses[key] = result.status
                    if result.status == "done":
                        self.store.put_round(key, {"round": 1, **_round(finished)}, {})
                self.store.settle(place, key, None)
        self.watcher.finished(cell, row, finished.seconds)

    def _row(self, cell: PlannedCell, finished: Finished, log: Known) -> dict[str, Any]:
        result = finished.result
        of = cell.cell.log
        row = dict(zip(KEY, cell.cell.key, strict=True)) | {"log_name": of.name, "cluster": of.cluster}
        row |= {"status": result.status, "reason": result.reason}
        row |= {"digest": log.digest, "truth_kind": log.truth_kind, "timing_alone": int(finished.alone)}
        row |= {"seconds": finished.seconds, "host": finished.host, "executor": self.executor.name}
        return row | {"recorded": time.time(), "traceback": result.traceback} | result.row


def _round(finished: Finished) -> dict[str, Any]:
    """The columns of a round, but for its number."""
    result = finished.result
    ended = {"status": result.status, "reason": result.reason, "timing_alone": int(finished.alone)}
    return result.row | ended | {"path": result.path or None, "host": finished.host, "recorded": time.time()}


def _told(result: Result) -> Result:
    """The result with words that a record can take, whatever a backend has said."""
    return replace(result, reason=reason(result.reason), traceback=traceback(result.traceback))


def _planned(cell: PlannedCell, log: str, key: str | None) -> tuple[Any, ...]:
    """Writes the cell for the record's plan, with the keys of its log and result."""
    of = cell.cell.log
    return (*cell.cell.key, dict(cell.parameters), log, key, of.name, of.cluster)


def _discard_unless_begun(folder: Path) -> str:
    """Removes a record without planned cells; says what then is in the folder, "" where that cannot be read."""
    if not (folder / FILE).exists():
        return f"There is no {FILE}: nothing is kept."
    with contextlib.suppress(InputError):
        with Store(folder) as store:
            if store.planned():
                return "What was written before is safe."
        for path in (*folder.glob(f"{FILE}*"), *(folder / LOGS).glob("*.npz")):
            path.unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # not there, or not empty
            (folder / LOGS).rmdir()
        return "No cell had been run: nothing is kept."
    return ""
