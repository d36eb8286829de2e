"""What a run looks like in the terminal: progress while it goes on, a table when it is over."""

from collections.abc import Sequence
from typing import Any

from rich import box
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from .numerals import counted
from .plan import Cell
from .summary import Line, Spread, logs, remarks, short

WIDE = 104
"""Columns from which on ranges are shown."""

LOST = 1e6
"""m, or NEES, from which on a figure is shown by its order."""

STATUS_STYLE = {"done": "green", "skipped": "yellow"}


def screen_console(*, quiet: bool) -> Console:
    """The console to print on; where nobody watches, in a file or pipe, it is wide enough for everything."""
    console = Console(quiet=quiet)
    return console if console.is_terminal else Console(quiet=quiet, width=max(console.width, WIDE))


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
            self._console.print(f"{counted(before, 'cell')} in the record already, {cells} to be run")
        self._progress.update(self._task, description="running cells", total=cells, completed=0)

    def finished(self, cell: Cell, status: str, reason: str, row: dict[str, Any]) -> None:
        """One has ended; what did not go well is said at once."""
        self._progress.advance(self._task)
        if self._quiet:
            return
        said = f": {remarks(reason)}" if remarks(reason) else ""
        error = row.get("ate_m", row.get("final_ate_m"))
        figure = "" if error is None else f" · ATE {error:.3f} m"
        style = STATUS_STYLE.get(status, "red")
        self._console.print(
            f"[{style}]{status}[/] [dim]{plain(short(str(cell)))}[/]{figure}{plain(said)}", highlight=False
        )


def tables(lines: Sequence[Line], width: int) -> list[Table]:
    """The run at a glance, a table a dataset: medians over seeds, and the range of the errors where there is room."""
    return [
        _table(dataset, [line for line in lines if line.dataset == dataset], with_range=width >= WIDE)
        for dataset in dict.fromkeys(line.dataset for line in lines)
    ]


def _table(dataset: str, lines: Sequence[Line], *, with_range: bool) -> Table:
    title = f"[bold]{plain(short(dataset))}[/], {counted(logs(lines), 'log')}"
    if lines[0].truth_kind == "reference":
        title += f"; truth unknown: errors{' of paths' * lines[0].surveyed} are distances from {lines[0].reference}"
    shown = Table(title=title, title_style="", title_justify="left", box=box.SIMPLE_HEAD, collapse_padding=True)
    shown.add_column("backend", overflow="fold")
    surveyed = lines[0].surveyed
    for heading in ("done", "ATE, m", "final, m", *["map, m"] * surveyed, "NEES", "in 95 %", "step, µs", "p99"):
        shown.add_column(heading, justify="right", no_wrap=True)
    for line in lines:
        v = line.values
        shown.add_row(
            plain(line.backend) + " \N{DAGGER}" * line.told,
            f"{line.done}/{len(line.rows)}",
            _metres(v.get("ate_m"), with_range),
            _metres(v.get("final_ate_m"), with_range),
            *[_metres(v.get("final_map_rmse_m", v.get("map_rmse_m")), with_range)] * surveyed,
            "" if "nees" not in v else f"{v['nees'].median:{'.2f' if v['nees'].median < LOST else '.1e'}}",
            "" if "nees_inside" not in v else f"{100 * v['nees_inside'].median:.0f} %",
            "" if "step_us_p50" not in v else _whole(v["step_us_p50"].median),
            "" if "step_us_p99" not in v else _whole(v["step_us_p99"].median) + ("" if line.alone else "*"),
        )
    notes = ["* timed while other cells ran beside it"] * (not all(line.alone for line in lines))
    notes += ["\N{DAGGER} was told the truth (--oracle)"] * any(line.told for line in lines)
    if notes:
        shown.caption, shown.caption_justify = "\n".join(notes), "left"
    return shown


def _whole(value: float) -> str:
    return "<1" if value < 0.5 else f"{value:.0f}"


def _metres(value: Spread | None, with_range: bool) -> str:
    """To a millimetre, or to a thousandth where that is coarser; what is lost altogether by its order alone."""
    if value is None:
        return ""
    if value.high < 0.0005:
        return "<0.001"
    form = ".3f" if value.median < 10 else ".2f" if value.median < 100 else ".1f" if value.high < LOST else ".1e"
    if value.n == 1 or not with_range:
        return f"{value.median:{form}}"
    return f"{value.median:{form}} ({value.low:{form}}-{value.high:{form}})"


def plain(text: str) -> str:
    """Text whose brackets are no markup."""
    return text.replace("[", "\\[")
