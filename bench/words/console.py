"""The console to print on, and text as it takes it."""

import re

from rich.cells import cell_len
from rich.console import Console

WIDE = 160
"""Columns that are enough for everything: those of a file or pipe, which nobody sees the end of."""


def screen_console(*, quiet: bool, aside: bool = False) -> Console:
    """The console to print on; where nobody watches, in a file or pipe, it is wide enough for everything.

    `aside` is standard error: standard output then belongs to what a program reads.
    """
    console = Console(quiet=quiet, stderr=aside)
    return console if watched(console) else Console(quiet=quiet, stderr=aside, width=max(console.width, WIDE))


def watched(console: Console) -> bool:
    """Whether it is a terminal that can be written over: no pipe whose colours are forced, and no dumb one."""
    return console.is_terminal and console.file.isatty() and not console.is_dumb_terminal


def plain(text: str) -> str:
    """Text whose brackets are no markup."""
    return text.replace("[", "\\[")


def wrapped(label: str, width: int) -> str:
    """A label in lines of at most `width` columns, if it can be broken: after commas and brackets, never in a word."""
    done: list[str] = [""]
    for piece in re.findall(r"[^\[,/:]*[\[,/:]|[^\[,/:]+", label):
        if done[-1] and cell_len(done[-1] + piece) > width:
            done.append(" ")
        done[-1] += piece
    return "\n".join(done)
