"""Shows a study's progress: a bar on a terminal, elsewhere a line every AGAIN_S; failures at once."""

import time
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Self

from rich.console import Console

from ..plan.work import PlannedCell
from ..record.schema import FAILED, Row
from ..words.console import ProgressBar, plain
from ..words.numerals import counted

AGAIN_S = 30.0  # s between two lines where there is no terminal
NAMED = 5  # failures of one backend and status that are printed; the report has all


class StudyScreen:
    """The watcher of a study; a context manager around it."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._failed: dict[tuple[str, str], int] = {}
        self._done, self._total, self._told = 0, 0, time.monotonic()
        self._bar = ProgressBar(console, "starting")

    def __enter__(self) -> Self:
        self._bar.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.__exit__()

    def say(self, sentence: str) -> None:
        """Prints a remark for the user."""
        self._console.print(plain(sentence), highlight=False, soft_wrap=True)

    def looking(self, logs: int) -> None:
        """Announces that so many logs are made first."""
        if logs:
            self._begin(f"looking at {counted(logs, 'log')}", logs)

    def looked(self, name: str) -> None:
        """Counts a log that has been made, or cannot be."""
        del name
        self._advance("log", "")

    def running(self, cells: Sequence[PlannedCell], done: int, slots: int, recorded: Iterable[Row]) -> None:
        """Announces the cells to be run."""
        del recorded
        if done:
            self._console.print(
                f"{counted(done, 'cell')} have a result already, {len(cells)} to be run", highlight=False
            )
        self._begin(f"running, {slots} at once", len(cells))

    def finished(self, cell: PlannedCell, row: Mapping[str, Any], seconds: float) -> None:
        """Counts a cell, and prints its failure unless there were NAMED of that kind."""
        del seconds
        if row["status"] in FAILED:
            kind = cell.cell.backend.label, row["status"]
            self._failed[kind] = self._failed.get(kind, 0) + 1
            more = "; further ones of this kind are not printed" if self._failed[kind] == NAMED else ""
            if self._failed[kind] <= NAMED:
                self.say(f"{row['status']}: {cell.cell}: {row['reason']}{more}")
        failed = sum(self._failed.values())
        self._advance("cell", f"{failed} failed" if failed else "")

    def repeating(self, cells: Sequence[PlannedCell], number: int, of: int) -> None:
        """Does nothing: a study has no repeats."""

    def repeated(self, cell: PlannedCell, row: Mapping[str, Any], seconds: float) -> None:
        """Does nothing."""

    def _begin(self, task: str, total: int) -> None:
        self._done, self._total = 0, total
        self._bar.restart(task, total)

    def _advance(self, what: str, note: str) -> None:
        self._done += 1
        self._bar.update(advance=1, note=note)
        if self._bar.hidden and time.monotonic() - self._told > AGAIN_S:
            self._told = time.monotonic()
            self._console.print(f"{self._done} of {counted(self._total, what)} done", highlight=False)
