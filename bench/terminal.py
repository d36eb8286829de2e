"""What a run looks like in the terminal: progress while it goes on, a table when it is over."""

from collections.abc import Sequence
from typing import Any

from rich import box
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from .plan import Cell
from .summary import Line, Spread

STATUS_STYLE = {"done": "green", "skipped": "yellow"}


class Screen:
    """Progress on a terminal, a line a finished cell elsewhere; a context manager around a run."""

    def __init__(self, console: Console, *, quiet: bool) -> None:
        self._console, self._quiet = console, quiet
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
        self._progress = Progress(*columns, console=console, transient=True, disable=quiet or not console.is_terminal)
        self._task = self._progress.add_task("starting", total=None)

    def __enter__(self) -> "Screen":
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def preparing(self, logs: int) -> None:
        """That many logs are to be made."""
        self._progress.update(self._task, description="preparing logs", total=logs, completed=0)

    def prepared(self, name: str) -> None:
        """One is ready."""
        del name
        self._progress.advance(self._task)

    def running(self, cells: int, before: int) -> None:
        """That many cells are to be run; `before` more are in the record already."""
        if before and not self._quiet:
            self._console.print(f"{before} cells are in the record already, {cells} are to be run")
        self._progress.update(self._task, description="running cells", total=cells, completed=0)

    def finished(self, cell: Cell, status: str, reason: str, row: dict[str, Any]) -> None:
        """One has ended; what did not go well is said at once."""
        self._progress.advance(self._task)
        if self._quiet:
            return
        said = f": {reason}" if reason else ""
        error = row.get("ate_m", row.get("final_ate_m"))
        figure = "" if error is None else f" · ATE {error:.3g} m"
        style = STATUS_STYLE.get(status, "red")
        self._console.print(f"[{style}]{status}[/] [dim]{plain(str(cell))}[/]{figure}{plain(said)}", highlight=False)


def tables(lines: Sequence[Line]) -> list[Table]:
    """The run at a glance, a table a dataset: medians over seeds, with the range where there are several."""
    return [
        _table(dataset, [line for line in lines if line.dataset == dataset])
        for dataset in dict.fromkeys(line.dataset for line in lines)
    ]


def _table(dataset: str, lines: Sequence[Line]) -> Table:
    origin = plain(dataset)
    if lines[0].truth_kind == "reference":
        origin += ": nobody knows the truth; errors are distances from the batch optimum"
    shown = Table(title=origin, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    shown.add_column("backend", no_wrap=True)
    headings = ("done", "ATE m", "final ATE m", "NEES", "in 95 %", "step µs p50", "p99")
    for heading in headings:
        shown.add_column(heading, justify="right", no_wrap=True)
    for line in lines:
        v = line.values
        shown.add_row(
            plain(line.backend),
            f"{line.done}/{len(line.rows)}",
            _range(v.get("ate_m")),
            _range(v.get("final_ate_m")),
            _one(v.get("nees")),
            "" if "nees_inside" not in v else f"{100 * v['nees_inside'].median:.0f} %",
            _one(v.get("step_us_p50")),
            _one(v.get("step_us_p99")) + ("" if line.alone else "*"),
        )
    if not all(line.alone for line in lines):
        shown.caption = "* timed while other cells ran beside it"
    return shown


def _range(value: Spread | None) -> str:
    if value is None:
        return ""
    if value.n == 1:
        return _figure(value.median)
    return f"{_figure(value.median)} ({_figure(value.low)}-{_figure(value.high)})"


def _one(value: Spread | None) -> str:
    return "" if value is None else _figure(value.median)


def _figure(value: float) -> str:
    """Three digits that count, without an exponent."""
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"


def plain(text: str) -> str:
    """Text whose brackets are no markup."""
    return text.replace("[", "\\[")
