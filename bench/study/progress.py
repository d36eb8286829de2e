"""A study while it goes on: a bar with the time left on a terminal, elsewhere a line now and then; failures at once."""

import time
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from ..measure.status import FAILED
from ..plan.work import PlannedCell
from ..record.schema import Row
from ..words.console import plain, watched
from ..words.numerals import counted

AGAIN_S = 30.0
"""s between two lines where nobody watches."""

NAMED = 5
"""Failures of one kind that are said each; the report has all."""


class StudyScreen:
    """The watcher of a study; a context manager around it."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._failed: dict[tuple[str, str], int] = {}
        self._done, self._total, self._told = 0, 0, time.monotonic()
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(24),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(elapsed_when_finished=False),
            TextColumn("{task.fields[failed]}", style="red"),
            console=console,
            transient=True,
            disable=not watched(console) or console.quiet,
            refresh_per_second=2,
        )
        self._task = self._progress.add_task("starting", total=None, failed="")

    def __enter__(self) -> Self:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def say(self, sentence: str) -> None:
        """Something that a user should know while it goes on."""
        self._console.print(plain(sentence), highlight=False, soft_wrap=True)

    def looking(self, logs: int) -> None:
        """That many logs are looked at first."""
        if logs:
            self._done, self._total = 0, logs
            self._progress.reset(self._task, total=logs, description=f"looking at {counted(logs, 'log')}", failed="")

    def looked(self, name: str) -> None:
        """One has been."""
        del name
        self._advance("log", "")

    def running(self, cells: Sequence[PlannedCell], done: int, slots: int, recorded: Iterable[Row]) -> None:
        """These cells are to be run."""
        del recorded
        self._done, self._total = 0, len(cells)
        if done:
            self._console.print(
                f"{counted(done, 'cell')} have a result already, {len(cells)} to be run", highlight=False
            )
        self._progress.reset(self._task, total=len(cells), description=f"running, {slots} at once", failed="")

    def finished(self, cell: PlannedCell, row: Mapping[str, Any], seconds: float) -> None:
        """One has ended."""
        del seconds
        if row["status"] in FAILED:
            self._say(cell, row["status"], row["reason"])
        failed = sum(self._failed.values())
        self._advance("cell", f"{failed} failed" if failed else "")

    def _advance(self, what: str, failed: str) -> None:
        self._done += 1
        self._progress.update(self._task, advance=1, failed=failed)
        if self._progress.disable and time.monotonic() - self._told > AGAIN_S:
            self._told = time.monotonic()
            self._console.print(f"{self._done} of {counted(self._total, what)} done", highlight=False)

    def _say(self, cell: PlannedCell, status: str, reason: str) -> None:
        kind = cell.cell.backend.label, status
        self._failed[kind] = self._failed.get(kind, 0) + 1
        if self._failed[kind] <= NAMED:
            more = "; more of the kind are not said one by one" if self._failed[kind] == NAMED else ""
            self._console.print(plain(f"{status}: {cell.cell}: {reason}{more}"), highlight=False, soft_wrap=True)
