"""A table of the report: headings, one row per backend, what each entry says and what it is sorted by."""

from collections.abc import Sequence
from typing import NamedTuple

from ..words.column import Column


class Entry(NamedTuple):
    """One entry of a table."""

    text: str
    word: str = ""  # what it comes to
    note: str = ""  # smaller, after it
    best: bool = False
    value: float | None = None  # what it is sorted by; None where it is no number


class TableRow(NamedTuple):
    """A backend's entries, one a heading."""

    backend: str
    entries: Sequence[Entry]
    status: str = "done"
    place: Sequence[str] = ()  # path of the cell's folder


class Table(NamedTuple):
    """Ready to be set; a column in which nobody has a value is left out."""

    headings: Sequence[Column]
    rows: Sequence[TableRow]
    caption: str = ""  # what its numbers are; no full stop
