"""Reads text files of tagged rows, `EDGE_SE2 0 1 0.9 ...`: one table per kind of row.

Blank lines and lines that begin with # are skipped. A row with an unknown tag is an error, not a comment: it may be a
constraint that changes the graph.
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ...core.csv_values import no_number, number, shortened
from ...core.errors import InputError
from ...core.se2 import Array
from ...core.table import LARGEST, Table, text
from .symbols import has_symbols, without_symbols

LIST = ("id",)  # the columns of rows with a variable number of ids: each becomes a row of its own
_IN_SPACE = re.compile(r"SE3|XYZ|^(VERTEX|EDGE)3\b", re.IGNORECASE)  # tags of poses and points in three dimensions

LENGTHS = ("x", "y", "dx", "dy", "range")  # columns in m, limited to LARGEST


def read_tagged(
    path: Path, kinds: Mapping[str, str], columns: Mapping[str, Sequence[str]], refused: Sequence[str] = ()
) -> dict[str, Table]:
    """Reads the rows of `path`, one table per kind, in the order of the file; tables may be empty.

    `kinds` maps tags to kinds of row, `columns` names the numbers that follow. Tags in `refused` are known but reported
    as unsupported. InputError names the file, the line and the column of what is invalid.
    """
    rest: dict[str, list[str]] = {kind: [] for kind in columns}
    lines: dict[str, list[int]] = {kind: [] for kind in columns}
    for line, content in enumerate(text(path).split("\n"), start=1):
        tag, *numbers = content.split(None, 1) or ["#"]
        if tag.startswith("#"):
            continue
        kind = kinds.get(tag)
        if kind is None:
            raise _unknown(path, line, tag, kinds, refused)
        found = numbers[0] if numbers else ""
        if columns[kind] == LIST:
            rest[kind] += found.split() or [""]
            lines[kind] += [line] * (len(rest[kind]) - len(lines[kind]))
        else:
            rest[kind].append(found)
            lines[kind].append(line)
    tables = _tables(path, lines, rest, columns)
    if has_symbols(tables):
        tables = _tables(path, lines, without_symbols(path, rest, lines, columns), columns)
    return tables


def _tables(
    path: Path, lines: Mapping[str, list[int]], rest: Mapping[str, list[str]], columns: Mapping[str, Sequence[str]]
) -> dict[str, Table]:
    """The rows of each kind as numbers."""
    return {
        kind: Table(path, tuple(names), _numbers(path, lines[kind], rest[kind], names), np.array(lines[kind], np.int64))
        .finite()
        .bounded(-LARGEST, LARGEST, *(name for name in names if name in LENGTHS))
        for kind, names in columns.items()
    }


def tags(path: Path) -> set[str]:
    """The first word of every row of `path`."""
    words = {line.split(None, 1)[0] for line in text(path).split("\n") if line.strip()}
    return {word for word in words if not word.startswith("#")}


def _numbers(path: Path, lines: Sequence[int], rows: Sequence[str], columns: Sequence[str]) -> Array:
    """(r, columns); parsed at once if all are valid, otherwise line by line to name the fault."""
    if not rows:
        return np.zeros((0, len(columns)))
    if all(rows):
        try:
            found = np.loadtxt(rows, comments=None, ndmin=2)
        except ValueError:
            pass
        else:
            if found.shape == (len(rows), len(columns)):
                return found
    return np.array([_row(path, *row, columns) for row in zip(lines, rows, strict=True)])


def _row(path: Path, line: int, row: str, columns: Sequence[str]) -> list[float]:
    cells = row.split()
    if len(cells) != len(columns):
        wanted = f"{len(columns)} ({' '.join(columns)})"
        raise InputError(f"{path}, line {line}: found {len(cells)} numbers after the tag, expected {wanted}.")
    found: list[float] = []
    for name, cell in zip(columns, cells, strict=True):
        if (value := number(cell)) is None:
            raise InputError(f"{path}, line {line}: {name} {no_number(cell)}.")
        found.append(value)
    return found


def _unknown(path: Path, line: int, tag: str, kinds: Mapping[str, str], refused: Sequence[str]) -> InputError:
    known = ", ".join(kinds)
    if _IN_SPACE.search(tag):
        return InputError(
            f"{path}, line {line}: rows {tag} are of a graph in space, 3D, expected planar ones: {known}."
        )
    if tag in refused:
        return InputError(f"{path}, line {line}: rows {tag} are not supported, expected only {known}.")
    return InputError(f"{path}, line {line}: found the tag {shortened(tag)}, expected one of {known}.")
