"""Reads CSV files of other programs: columns by name, in any order, others ignored."""

from collections.abc import Callable, Iterable, Sequence
from itertools import chain
from pathlib import Path

import numpy as np

from ...core.csv_values import digits_lost, header_names, no_number, number, other_count, other_header, shown
from ...core.errors import InputError
from ...core.se2 import Array, Ints
from ...core.table import CHUNK, HUGE, Table, text

NAMED = 5
"""Lines with a fault that an error names."""

Fault = tuple[int, str]
"""A row, and what is wrong with it."""


def read_columns(
    path: Path,
    *choices: Sequence[str],
    remarks: list[str] | None = None,
    faults: Callable[[Table], Iterable[Fault]] | None = None,
) -> Table:
    """Reads the table in `path`, of the first of `choices` whose columns the header has; all numbers are finite.

    A remark is added where the header has another of the choices, too. InputError names the file, the line and the
    column of what cannot be read, and lists the choices; of numbers that are not finite, and of the `faults` that the
    caller finds in a table which may have such, it names the first lines in order.
    """
    lines: list[str] = text(path).split("\n")
    header = [name.strip('"') for name in header_names(lines[0])]
    chosen, *others = [columns for columns in choices if set(columns) <= set(header)] or [None]
    if chosen is None:
        hint = next(filter(None, (other_header(lines[0], columns) for columns in choices)), None)
        wanted = ", or ".join(",".join(columns) for columns in choices)
        raise InputError(
            f"{path}, line 1: {hint or f'found the columns {shown(header)}, expected {wanted} among them'}."
        )
    for name in chosen:
        if header.count(name) > 1:
            raise InputError(f"{path}, line 1: column {name!r} occurs {header.count(name)} times, expected once.")
    if remarks is not None:
        used = f"as well as {','.join(chosen)}, which is used"
        remarks += [f"{path}: has {','.join(other)} {used}" for other in others if other]
    places = [header.index(name) for name in chosen]
    numbers = np.array([number for number, line in enumerate(lines[1:], start=2) if line.strip()], np.int64)
    if not len(numbers):
        raise InputError(f"{path}: found no rows, expected at least one below the header.")
    rows = _rows(path, lines, numbers, header, places)
    table = Table(path, tuple(chosen), rows, numbers)
    _refuse(table, [] if faults is None else faults(table))
    return table


def in_order(table: Table, *, strictly: bool) -> Table:
    """Returns the table; InputError for a time that is earlier than the one before or, with `strictly`, equal."""
    t = table.column("t")
    late = np.diff(t) <= 0 if strictly else np.diff(t) < 0
    for row in np.flatnonzero(late) + 1:
        # A row that is late in order itself, or the row before it, without which the next ones are.
        if row + 1 < len(t) and t[row + 1] < t[row - 1] and (row < 2 or t[row - 2] <= t[row]):
            after = f"the next, line {table.lines[row]}, has {t[row]!s}, and later ones are before it, too"
            raise table.fault(row - 1, f"t is {t[row - 1]!s}, but {after}: expected times in order")
        wanted = "later than" if strictly else "no earlier than"
        raise table.fault(row, f"t is {t[row]!s}, expected {wanted} {t[row - 1]!s}{digits_lost(t.tolist())}")
    return table


def repeated_motions(table: Table) -> list[str]:
    """Remarks on motions that are as the row before, their time too: at most one sentence, with the first lines.

    None where other rows of equal times differ, as those of a coarse clock do.
    """
    twin = np.diff(table.column("t")) == 0
    same = (np.diff(table.rows, axis=0) == 0).all(axis=1)
    rows = np.flatnonzero(same) + 1
    if not len(rows) or (twin & ~same).any():
        return []
    line, before = table.lines[rows[0]], table.lines[rows[0] - 1]
    more = f", and so do {len(rows) - 1:,} more rows" * (len(rows) > 1)
    return [f"{table.path}, line {line}: repeats line {before}, so its motion counts twice{more}; expected once"]


def _refuse(table: Table, faults: Iterable[Fault]) -> None:
    """Raises InputError for numbers that are not finite, or beyond HUGE, and for `faults` of other rows."""
    bad = ~(np.abs(table.rows) <= HUGE)
    if bad.any():
        infinite = ((int(row), _not_finite(table, int(row), int(column))) for row, column in np.argwhere(bad))
        faults = chain(infinite, (fault for fault in faults if not bad[fault[0]].any()))
    found = dict[int, str]()
    for row, words in faults:
        found.setdefault(row, words)
    if found:
        first, *others = sorted(found)
        said = [f"line {table.lines[row]}: {found[row]}" for row in others[: NAMED - 1]]
        said += [f"and {len(others) + 1 - NAMED:,} more lines"] * (len(others) >= NAMED)
        raise table.fault(first, "; ".join([found[first], *said]))


def _not_finite(table: Table, row: int, column: int) -> str:
    found = table.rows[row, column]
    size = f", not beyond {HUGE:g}" if np.isfinite(found) else ""
    return f"{table.columns[column]} is {found!s}, expected a finite number{size}"


def _rows(path: Path, lines: list[str], numbers: Ints, header: Sequence[str], places: Sequence[int]) -> Array:
    """(r, columns) the cells at `places` of the lines with these numbers: at once, or one by one to find a fault."""
    parts = list[Array]()
    for first in range(0, len(numbers), CHUNK):
        some = numbers[first : first + CHUNK].tolist()
        content = [lines[line - 1] for line in some]
        found = _parsed(content, len(header), places)
        parts.append(_one_by_one(path, content, some, header, places) if found is None else found)
    return np.concatenate(parts)


def _parsed(lines: list[str], count: int, places: Sequence[int]) -> Array | None:
    """Parses all lines, of `count` cells each, at once; None if one is invalid."""
    if any(line.count(",") != count - 1 for line in lines):
        return None
    try:
        return np.loadtxt(lines, delimiter=",", comments=None, usecols=places, ndmin=2)
    except ValueError:
        return None


def _one_by_one(
    path: Path, lines: list[str], numbers: Sequence[int], header: Sequence[str], places: Sequence[int]
) -> Array:
    rows = list[list[float]]()
    for line, content in zip(numbers, lines, strict=True):
        cells = content.split(",")
        if len(cells) != len(header):
            raise InputError(f"{path}, line {line}: {other_count(cells, header, ',')}.")
        row = list[float]()
        for place in places:
            cell = cells[place].strip().strip('"')
            if (found := number(cell)) is None:
                raise InputError(f"{path}, line {line}: {header[place]} {no_number(cell)}.")
            row.append(found)
        rows.append(row)
    return np.array(rows)
