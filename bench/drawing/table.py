"""Tables of a report: headings, one row per backend, and the sort key of each entry."""

from collections.abc import Sequence
from typing import NamedTuple

from ..words.column import Column


class Entry(NamedTuple):
    """An entry of a table."""

    text: str
    word: str = ""  # its judgement, such as consistent
    note: str = ""  # smaller, after it
    best: bool = False
    value: float | None = None  # what it is sorted by; None where it is no number


class TableRow(NamedTuple):
    """The entries of a backend, or of a landmark, one per heading."""

    backend: str
    entries: Sequence[Entry]
    status: str = "done"
    place: Sequence[str] = ()  # path of the cell's folder


class Table(NamedTuple):
    """A table; columns without any value are left out."""

    headings: Sequence[Column]
    rows: Sequence[TableRow]
    caption: str = ""  # what its numbers are; no full stop
    of: str = "backend"  # heading of the rows
