"""A table of the report: headings, a row a backend, what each entry says and what it is sorted by."""

from collections.abc import Sequence
from typing import Any, NamedTuple

from ..words.columns import Column
from ..words.numerals import number

SECONDS = {"finish_s", "cpu_s", "setup_s"}
COUNTS = {
    "landmarks", "ancestors_left", "landmarks_missed", "landmarks_spurious", "final_landmarks_missed",
    "final_landmarks_spurious",
}  # fmt: skip
PERCENT = {
    "nees_inside", "final_nees_inside", "landmark_nees_inside", "final_landmark_nees_inside", "real_time",
    "refused_share",
}  # fmt: skip

EXPONENTS = {"growth_steps", "growth_landmarks"}

SHORTEST_S = 0.001
"""s; a filter's finish does nothing, and what that nothing takes is no figure."""


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


def shown(name: str, value: Any) -> str:
    """A column's value as its table has it."""
    if name in PERCENT:
        return f"{number(100 * value)} %"
    if name in SECONDS and value < SHORTEST_S:
        return f"<{SHORTEST_S:g}"
    if name in EXPONENTS:
        return f"{value + 0.0:.2f}"
    return f"{value:,.0f}" if name in COUNTS else number(value)
