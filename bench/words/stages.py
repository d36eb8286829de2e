"""Shows which stage of a command is at work, and about how long it and the others take."""

import contextlib
import time
from collections.abc import Mapping
from typing import Self

from rich.console import Console
from rich.live import Live
from rich.text import Text

from ...core.kernels.compiled import compiling, made
from .console import PATIENCE_S, plain, watched, watching

AGAIN_S = 10.0  # s between two lines where there is no terminal


class Stages:
    """Shows the stages of what takes longer than PATIENCE_S; a context manager around them.

    On a terminal a line with the time so far and the time left, which vanishes at the end; elsewhere a line where a
    stage begins, at most every AGAIN_S.
    """

    def __init__(self, console: Console, shares: Mapping[str, float]) -> None:
        """`shares` are the stages in order, each with its share of the time, by any unit."""
        self._console, self._shares = console, dict(shares)
        self._stage, self._done = "", 0.0  # the share of what has ended
        self._began = self._here = time.monotonic()  # all of them, and this stage
        self._told = -AGAIN_S
        self._made = made()  # machine code that was compiled before
        self._live = Live(
            get_renderable=self._line, console=console, transient=True, refresh_per_second=2,
            redirect_stdout=False, redirect_stderr=False,
        )  # fmt: skip
        self._watch = contextlib.ExitStack()

    def __enter__(self) -> Self:
        self._watch.enter_context(watching(self._show, self._say))
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def stop(self) -> None:
        """Ends the line; stages may go on."""
        self._watch.close()
        self._live.stop()

    def begin(self, stage: str) -> None:
        """Begins one of the stages; those before it have ended, or are left out."""
        before = list(self._shares)[: list(self._shares).index(stage)]
        self._stage, self._done = stage, sum(self._shares[name] for name in before)
        self._here = time.monotonic()
        if self._here - self._began >= PATIENCE_S:
            self._tell()

    @property
    def words(self) -> str:
        """The stage, and the time left where that is known."""
        left = self._left()
        return self._stage if left is None else f"{self._stage}, {time_left(left)}"

    def _left(self) -> float | None:
        """The s left; None in the first stage, whose share tells nothing yet, and with time that compiling took."""
        if not self._done or compiling() or made() > self._made:
            return None
        pace = (self._here - self._began) / self._done
        mine = self._shares[self._stage]
        after = sum(self._shares.values()) - self._done - mine
        return pace * after + max(pace * mine - (time.monotonic() - self._here), 0.0)

    def _show(self) -> None:
        if self._console.quiet:
            return
        if watched(self._console):
            self._live.start()
        else:
            self._tell()

    def _tell(self) -> None:
        """Prints the stage where there is no terminal."""
        now = time.monotonic()
        if not self._stage or self._console.quiet or watched(self._console) or now - self._told < AGAIN_S:
            return
        self._told = now
        self._say(self.words)

    def _say(self, words: str) -> None:
        self._console.print(plain(words), highlight=False, soft_wrap=True)

    def _line(self) -> Text:
        return Text(f"{self.words} \N{MIDDLE DOT} {clock(time.monotonic() - self._began)}", no_wrap=True)


def time_left(seconds: float) -> str:
    """Writes the time left, no finer than it is known."""
    if seconds < 10:
        return "some seconds left"
    if seconds < 90:
        return f"about {10 * round(seconds / 10)} s left"
    return f"about {seconds / 60:.0f} min left" if seconds < 5400 else f"about {seconds / 3600:.1f} h left"


def clock(seconds: float) -> str:
    """Writes a duration as a clock does: 3:20 or 1:03:20."""
    minutes, seconds = divmod(int(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{seconds:02}" if hours else f"{minutes}:{seconds:02}"
