"""A table of the report: headings, a row a backend, what each entry says and what it is sorted by."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from .definitions import COLUMNS, WORKED_OUT, Column
from .numerals import number
from .summary import Line

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


def laid(
    lines: Sequence[Line],
    names: Sequence[str],
    entry: Callable[[Line, str], Entry],
    caption: str,
    headings: Mapping[str, str] | None = None,
) -> Table:
    """A row a line, a column a name in which any has an entry; `headings` replace those of the definitions."""
    other = headings or {}
    columns = [[entry(line, name) for line in lines] for name in names]
    kept = [(name, column) for name, column in zip(names, columns, strict=True) if any(e.text for e in column)]
    about = COLUMNS | WORKED_OUT
    top = [about[name]._replace(heading=other.get(name, about[name].heading)) for name, _ in kept]
    return Table(
        [WORKED_OUT["done"], *top], [_row(line, [c[k] for _, c in kept]) for k, line in enumerate(lines)], caption
    )


def _row(line: Line, entries: Sequence[Entry]) -> TableRow:
    done = Entry(f"{line.done}/{len(line.rows)}", "told the truth" if line.told else "", value=line.done)
    return TableRow(line.backend, [done, *entries], "done" if line.done == len(line.rows) else "some failed")


def shown(name: str, value: Any) -> str:
    """A column's value as its table has it."""
    if name in PERCENT:
        return f"{number(100 * value)} %"
    if name in SECONDS and value < SHORTEST_S:
        return f"<{SHORTEST_S:g}"
    if name in EXPONENTS:
        return f"{value + 0.0:.2f}"
    return f"{value:,.0f}" if name in COUNTS else number(value)
