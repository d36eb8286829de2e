"""The console that commands print on, its progress bar, and text written so that rich takes it as it is."""

import contextlib
import os
import re
import threading
from collections.abc import Callable, Generator
from functools import partial
from typing import Any, Self

from rich.cells import cell_len
from rich.console import Console
from rich.markup import escape

from ...core.kernels.compiled import compiling

WIDE = 160  # columns of a file or pipe: enough for every table
LEAST = 40  # columns of a terminal below which tables lose some of theirs, and names
FULL = 80  # columns on which they are then printed, and wrap


def screen_console(*, quiet: bool, aside: bool = False) -> Console:
    """The console to print on, WIDE where it is no terminal; standard error if `aside`."""
    console = wide_enough(Console(quiet=quiet, stderr=aside, emoji=False))
    if not watched(console):
        console.width = max(console.width, FULL if 0 < _columns(console) < LEAST else WIDE)
    return console


def watched(console: Console) -> bool:
    """True for a terminal that can be overwritten: no pipe with forced colours, no dumb nor very narrow terminal."""
    overwritten = console.is_terminal and console.file.isatty() and not console.is_dumb_terminal
    return overwritten and (_columns(console) or console.width) >= LEAST


def wide_enough(console: Console) -> Console:
    """The console, FULL where the terminal, or the variable COLUMNS, is narrower than any table."""
    if console.width < LEAST:
        console.width = columns if (columns := _columns(console)) >= LEAST else FULL
    return console


def _columns(console: Console) -> int:
    """Columns of the terminal itself, which COLUMNS need not be; 0 for no terminal."""
    try:
        return os.get_terminal_size(console.file.fileno()).columns
    except (OSError, ValueError):
        return 0


PATIENCE_S = 1.0  # s of silence before a user is told what is being done


COMPILING = "compiling inner loops, once: their machine code is kept on disk"


@contextlib.contextmanager
def announced(sentence: str, say: Callable[[str], None]) -> Generator[None]:
    """Says what is being done if that takes longer than PATIENCE_S, and if inner loops are compiled meanwhile."""
    with watching(partial(say, sentence), say):
        yield


@contextlib.contextmanager
def watching(show: Callable[[], None], say: Callable[[str], None]) -> Generator[None]:
    """Calls `show` after PATIENCE_S, and from there on says once if inner loops are compiled."""
    over = threading.Event()
    late = threading.Thread(target=_watch, args=(show, say, over), daemon=True)
    late.start()
    try:
        yield
    finally:
        over.set()
        late.join()  # so that nothing is said afterwards


def _watch(show: Callable[[], None], say: Callable[[str], None], over: threading.Event) -> None:
    if over.wait(PATIENCE_S):
        return
    show()
    while not compiling():
        if over.wait(PATIENCE_S):
            return
    say(COMPILING)


class ProgressBar:
    """A bar with a count, the time left and a note; a context manager. Hidden where quiet, or on no terminal."""

    def __init__(self, console: Console, task: str, total: int | None = None, *, of_bytes: bool = False) -> None:
        from rich import progress

        counts = progress.MofNCompleteColumn(), progress.TimeRemainingColumn(compact=True)
        self.hidden = console.quiet or not watched(console)
        self._bars = progress.Progress(
            progress.TextColumn("{task.description}", markup=False),
            progress.BarColumn(24),
            *((progress.DownloadColumn(), progress.TransferSpeedColumn()) if of_bytes else counts),
            progress.TextColumn("{task.fields[note]}"),
            console=console,
            transient=True,
            disable=self.hidden,
            refresh_per_second=2,
        )
        self._task = self._bars.add_task(task, total=total, note="")

    def __enter__(self) -> Self:
        self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bars.stop()

    def restart(self, task: str, total: int | None) -> None:
        """Begins another task."""
        self._bars.reset(self._task, total=total, description=task, note="")

    def advance(self) -> None:
        """Counts one more."""
        self.update(advance=1)

    def update(self, **fields: Any) -> None:
        """Changes fields of the bar: advance or completed, total, description, note."""
        self._bars.update(self._task, **fields)


def tell(console: Console, *sentences: str) -> None:
    """Prints sentences as they are, each on a line of its own however long it is."""
    for sentence in sentences:
        console.print(sentence, highlight=False, markup=False, soft_wrap=True)


def plain(text: str) -> str:
    """Escapes what rich would read as markup."""
    return escape(text)


def wrapped(label: str, width: int) -> str:
    """Breaks a label into lines of at most `width` columns where it can: after commas and brackets, never in a word."""
    done: list[str] = [""]
    for piece in re.findall(r"[^\[,/:]*[\[,/:]|[^\[,/:]+", label):
        if done[-1] and cell_len(done[-1] + piece) > width:
            done.append(" ")
        done[-1] += piece
    return "\n".join(done)
