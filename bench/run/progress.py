"""Shows a run's progress: tables that fill up and the time left; without a terminal, a line per cell."""

import contextlib
import threading
import time
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from statistics import fmean
from typing import Any

from rich import box
from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from ..plan.plan import Cell
from ..plan.work import PlannedCell
from ..record.schema import COLUMNS, MORE, Row
from ..verdict.ranking import ERRORS, path_errors
from ..verdict.summary import Line, lines
from ..words.console import announced, plain, watched
from ..words.names import called
from ..words.numerals import counted
from ..words.stages import clock, time_left
from .terminal import STATUS_STYLE, tables

Kind = tuple[str, str]  # a cell's dataset and backend, by their labels


MORE_LATE = 0.25  # s still to go for each s that a cell is late


class Pace:
    """Estimates the time left from the wall time of the cells so far, by dataset and backend."""

    def __init__(self, kinds: Iterable[Kind], workers: int) -> None:
        self._left = list(kinds)
        self._workers = workers
        self._taken: dict[Kind, list[float]] = {}

    def took(self, kind: Kind, seconds: float) -> None:
        """Counts a cell of that kind."""
        self._left.remove(kind)
        self._taken.setdefault(kind, []).append(seconds)

    def left(self, since: float = 0.0) -> float | None:
        """The s to the last cell's end, `since` s after the latest cell's; None before any.

        At least those of the longest cell. While a cell takes longer than expected, the time of the others stays, and a
        share of the delay is added: what takes long mostly goes on to.
        """
        if not self._taken:
            return None
        known = {kind: fmean(seconds) for kind, seconds in self._taken.items()}
        guessed = {kind: _guess(known, kind) for kind in set(self._left)}
        awaited = [guessed[kind] for kind in self._left]
        if not awaited:
            return 0.0
        left = max(sum(awaited) / self._workers, *awaited)
        running = sum(awaited) / len(awaited) / min(self._workers, len(awaited))  # from one cell's end to the next
        return left - min(since, running) + MORE_LATE * max(0.0, since - running)


def _guess(known: Mapping[Kind, float], kind: Kind) -> float:
    """Guesses a kind's time: its own mean, else from ratios, at last the mean of all.

    As this backend is to another one on another dataset, so it is on this one; without two such, the mean of those that
    share its dataset or its backend.
    """
    if kind in known:
        return known[kind]
    dataset, backend = kind
    told = [
        known[dataset, other] * known[place, backend] / seconds
        for (place, other), seconds in known.items()
        if seconds > 0 and (dataset, other) in known and (place, backend) in known
    ]
    alike = [seconds for other, seconds in known.items() if dataset == other[0] or backend == other[1]]
    return fmean(told or alike or known.values())


AGAIN_S = 30.0  # s between two lines that report the time left
SELDOM_S = 600.0  # s between them at most, where one cell takes that long
RUNNING = "running cells"  # the stage
REFRESHED = 1.0  # redraws per second: each takes some milliseconds of a core from what is measured
ONLINE = ("ate_m", "relation_m")
BAR = 24  # columns of the bar, where there is room


class Screen:
    """The watcher of a run; a context manager around it."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._stage, self._done, self._total = "starting", 0, 0
        self._began = self._latest = time.monotonic()
        self._told = 0.0  # when the time left was last shown
        self._pace = Pace((), 1)
        self._rows: list[Row] = []
        self._planned: Counter[tuple[str, str]] = Counter()
        self._names: dict[str, str] = {}
        self._announced = contextlib.ExitStack()
        self._told_of: set[tuple[str, str, str]] = set()
        self._told_of_logs: set[tuple[tuple[str, int], str]] = set()
        self._shown: Sequence[RenderableType] = ()
        self._ended = threading.Event()
        self._live = Live(
            get_renderable=self._renderable, console=console, transient=True, refresh_per_second=REFRESHED
        )

    def __enter__(self) -> "Screen":
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._announced.close()
        self._live.stop()

    def looking(self, logs: int) -> None:
        """Announces the making of so many logs; the screen starts."""
        if watched(self._console) and not self._console.quiet:
            self._live.start()
        if logs:
            self._stage, self._done, self._total = "preparing logs", 0, logs
        if logs and not self._live.is_started:
            self._announced.enter_context(announced(f"preparing {counted(logs, 'log')}", self.say))

    def looked(self, name: str) -> None:
        """Counts a log."""
        del name
        self._done += 1

    def say(self, sentence: str) -> None:
        """Prints a remark for the user."""
        self._console.print(plain(sentence), highlight=False, soft_wrap=True)

    def running(self, cells: Sequence[PlannedCell], done: int, slots: int, recorded: Iterable[Row]) -> None:
        """Announces the cells to be run; `recorded` have a result already."""
        if done:
            self._console.print(
                f"{counted(done, 'cell')} in the record already, {len(cells)} to be run", highlight=False
            )
        self._announced.close()
        todo = {cell.cell.key for cell in cells}
        self._rows = [row for row in recorded if row.key not in todo]
        self._planned = Counter(_kind(c.cell) for c in cells)
        self._planned.update((line.dataset, line.backend) for line in lines(self._rows) for _ in line.rows)
        self._names = called(list(dict.fromkeys(dataset for dataset, _ in self._planned)))
        self._pace = Pace((_kind(c.cell) for c in cells), slots)
        self._stage, self._done, self._total = RUNNING, 0, len(cells)
        self._latest = self._told = time.monotonic()
        if not self._live.is_started and not self._console.quiet:
            threading.Thread(target=self._tell_again, daemon=True).start()
        self._draw()

    def finished(self, cell: PlannedCell, row: Mapping[str, Any], seconds: float) -> None:
        """Counts a cell; prints it, on a terminal only if it is not done, each message once."""
        self._rows.append(Row({name: row.get(name) for name in (*COLUMNS, *MORE)}, ""))
        self._done += 1
        self._latest = time.monotonic()
        self._pace.took(_kind(cell.cell), seconds)
        said = row["reason"]
        news = cell.cell.backend.label, row["status"], said
        if not self._live.is_started or (row["status"] != "done" and news not in self._told_of):
            self._told_of.add(news)
            self._say(cell.cell, row, self._once(cell.cell, said) if row["status"] == "done" else said)
        self._draw()

    def repeating(self, cells: Sequence[PlannedCell], number: int, of: int) -> None:
        """Announces a round; without a terminal, a line."""
        self._stage, self._done, self._total = f"round {number} of {of}", 0, len(cells)
        if not self._live.is_started:
            self.say(f"round {number} of {of}: {counted(len(cells), 'cell')} timed again")
        self._draw()

    def repeated(self, cell: PlannedCell, row: Mapping[str, Any], seconds: float) -> None:
        """Counts a cell of a round; prints it if it did not end well."""
        del seconds
        self._done += 1
        if row["status"] != "done":
            self.say(f"{self._stage}: {row['status']} {cell.cell}: {row['reason']}")

    def reporting(self) -> None:
        """Announces the report."""
        self._stage, self._done, self._total = "writing the report", 0, 0

    def _tell_again(self) -> None:
        """Says where a run without a terminal is, if nothing was said for AGAIN_S, then twice that, and so on."""
        patience = AGAIN_S
        while not self._ended.wait(patience):
            if self._stage != RUNNING or self._done == self._total:
                return
            now, left = time.monotonic(), self._left()
            if now - max(self._latest, self._told) < patience / 2:
                continue
            said = f"{self._done} of {self._total} done after {clock(now - self._began)}"
            self._told, patience = now, min(2 * patience, SELDOM_S)
            self.say(said + ("" if left is None else f"; {left}"))

    def _once(self, cell: Cell, said: str) -> str:
        """Leaves out of the words on a cell the remarks that another cell of its log has had."""
        log, fresh = (cell.dataset.label, cell.seed), list[str]()
        for one in said.split("; ") if said else ():
            if (log, one) not in self._told_of_logs:
                self._told_of_logs.add((log, one))
                fresh.append(one)
        return "; ".join(fresh)

    def _say(self, cell: Cell, row: Mapping[str, Any], said: str) -> None:
        kind = row.get("truth_kind") or ""
        found = [(end, row[name]) for end, name in path_errors(kind).items() if row.get(name) is not None]
        parts = [self._names[cell.dataset.label], cell.backend.label, cell.which]
        parts += [f"{'final ' * (end == 'final')}{ERRORS[kind]} {error:.3f} m" for end, error in found[:1]]
        text = plain(" \N{MIDDLE DOT} ".join(parts) + (f": {said}" if said else ""))
        status = f"[{STATUS_STYLE.get(row['status'], 'red')}]{row['status']}[/]"
        left = self._left()
        if self._live.is_started or left is None or self._latest - self._told < AGAIN_S:
            left = ""
        else:
            self._told = self._latest
        count = "" if self._live.is_started else f"{self._done} of {self._total} "
        self._console.print(
            f"{count}{status} {text}{left and f'; {left}'}", highlight=False, soft_wrap=not self._live.is_started
        )

    def _left(self) -> str | None:
        """The time left, in words; None before the first cell has ended, and at the end."""
        left = self._pace.left(time.monotonic() - self._latest)
        return None if left is None or self._done == self._total else time_left(left)

    def _draw(self) -> None:
        """Recomputes the tables; where they are too tall, one line per dataset, or none."""
        if not self._live.is_started:
            return
        found = {(line.dataset, line.backend): line for line in lines(self._rows)}
        every = [found.get(kind) or Line(*kind, "", [], {}, self._names[kind[0]]) for kind in sorted(self._planned)]
        for shown in (tables(every, self._console.width, self._planned), [self._compact(every)], []):
            self._shown = shown
            if len(self._console.render_lines(Group(*shown), pad=False)) < self._console.height - 2:
                return

    def _compact(self, every: Sequence[Line]) -> Table:
        shown = Table(box=box.SIMPLE_HEAD, collapse_padding=True)
        room = max(8, (self._console.width - 34) // 2)
        shown.add_column("dataset", no_wrap=True, overflow="ellipsis", max_width=room)
        for heading in ("ended", "lowest error, m"):
            shown.add_column(heading, justify="right", no_wrap=True, min_width=len(heading))
        shown.add_column("of", no_wrap=True, overflow="ellipsis", max_width=room)
        for dataset, name in self._names.items():
            mine = [line for line in every if line.dataset == dataset]
            of = sum(self._planned[dataset, line.backend] for line in mine)
            best = min(
                ((line.values[name].median, line.backend) for line in mine for name in ONLINE if name in line.values),
                default=None,
            )
            figures = ("", "") if best is None else (f"{best[0]:.3f}", plain(best[1]))
            shown.add_row(plain(name), f"{sum(len(line.rows) for line in mine)}/{of}", *figures)
        return shown

    def _renderable(self) -> RenderableType:
        parts = [self._stage]
        if self._total:
            parts.append(f"{self._done} of {self._total}")
        parts.append(clock(time.monotonic() - self._began))
        left = self._left() if self._stage == RUNNING else None
        text = Text(" \N{MIDDLE DOT} ".join([*parts, *([] if left is None else [left])]), no_wrap=True)
        bar = min(BAR, self._console.width - text.cell_len - 2)
        foot = Table.grid(padding=(0, 2))
        foot.add_row(*([ProgressBar(self._total, self._done, width=bar)] if self._total and bar > 4 else []), text)
        return Group(*self._shown, foot)


def _kind(cell: Cell) -> tuple[str, str]:
    return cell.dataset.label, cell.backend.label
