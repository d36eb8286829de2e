"""Text files of numbers, a row a line: read in one go while they are good, and line by line to name what is not."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, SupportsIndex

import numpy as np

from .errors import InputError
from .se2 import Array, Ints

MOST = 2**53
"""The largest whole number up to which every one has a double of its own."""


class Table(NamedTuple):
    """The rows of a file, and where they stood."""

    path: Path
    columns: tuple[str, ...]
    rows: Array  # (r, columns)
    lines: Ints  # (r,) counted from 1

    def column(self, name: str) -> Array:
        """(r,) the column of that name."""
        return self.rows[:, self.columns.index(name)]

    def whole(self, name: str) -> Ints:
        """(r,) the column of that name as integers; InputError for a number that is none."""
        column = self.column(name)
        odd = np.flatnonzero(~((np.abs(column) <= MOST) & (column == np.rint(column))))
        if len(odd):
            raise self.fault(odd[0], f"{name} is {column[odd[0]]!s}, expected a whole number up to {MOST}")
        return column.astype(np.int64)

    def fault(self, row: SupportsIndex, message: str) -> InputError:
        """The error that says `message` of `row`."""
        return InputError(f"{self.path}, line {self.lines[row]}: {message}.")

    def finite(self) -> "Table":
        """Itself; InputError for a number that is not finite."""
        for row, column in np.argwhere(~np.isfinite(self.rows)):
            raise self.fault(row, f"{self.columns[column]} is {self.rows[row, column]!s}, expected a finite number")
        return self


def read_csv(path: Path, columns: Sequence[str], optional: Sequence[str] = (), blank_after: int | None = None) -> Table:
    """The table in `path`, whose first line names `columns`, and then all of `optional` or none.

    With `blank_after`, the first row fills that many cells and leaves the others blank, which reads as NaN.
    InputError names the file, the line and the column of what cannot be read; NaN and infinity can.
    """
    lines = text(path).split("\n")
    header = [cell.strip() for cell in lines[0].split(",")]
    columns = (*columns, *optional) if optional and len(header) > len(columns) else tuple(columns)
    _check_header(path, header, columns)
    head = list[list[float]]()
    if blank_after is not None and len(lines) > 1 and lines[1]:
        cells = lines[1].split(",")
        _check_width(path, 2, cells, columns)
        filled = [_number(path, 2, *pair) for pair in zip(columns[:blank_after], cells, strict=False)]
        for name, cell in zip(columns[blank_after:], cells[blank_after:], strict=True):
            if cell.strip():
                raise InputError(f"{path}, line 2: {name} is {cell!r}, expected nothing in the first row.")
        head = [filled + [np.nan] * (len(columns) - blank_after)]
    rows, numbers = _rows(path, lines, 1 + len(head), columns, ",")
    if head:
        rows, numbers = np.concatenate((np.array(head), rows)), np.concatenate(([2], numbers))
    return Table(path, columns, rows, numbers)


def read_spaced(path: Path, columns: Sequence[str]) -> Table:
    """The table in `path`, of `columns` between blanks, without a header; lines that begin with # are comments.

    InputError as from `read_csv`.
    """
    lines = text(path).split("\n")
    first = next((k for k, line in enumerate(lines) if line.strip() and not line.lstrip().startswith("#")), len(lines))
    rows, numbers = _rows(path, lines, first, columns, None)
    return Table(path, tuple(columns), rows, numbers)


def text(path: Path) -> str:
    """What `path` holds, its lines ended by one newline each; InputError where it is not there, empty or no UTF-8."""
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file.") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}).") from error
    if not content.strip():
        raise InputError(f"{path}: the file is empty.")
    try:
        return content.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InputError(f"{path}, line {line}: byte {content[error.start]:#04x} is not UTF-8 text.") from error


def upper(cov: Array) -> Array:
    """The upper triangles (k (k + 1) / 2, m), row by row, of `cov` (m, k, k); the mean of both where halves differ."""
    i, j = np.triu_indices(cov.shape[-1])
    return ((cov[:, i, j] + cov[:, j, i]) / 2).T


def symmetric(triangles: Array) -> Array:
    """Symmetric matrices (m, k, k) from their upper triangles (m, k (k + 1) / 2), row by row."""
    k = {3: 2, 6: 3}[triangles.shape[1]]
    index = np.zeros((k, k), np.int64)
    index[np.triu_indices(k)] = np.arange(triangles.shape[1])
    return triangles[:, np.maximum(index, index.T)]


def _rows(
    path: Path, lines: Sequence[str], first: int, columns: Sequence[str], delimiter: str | None
) -> tuple[Array, Ints]:
    """The rows from lines[first] on, (r, columns), and the number of each one's line, (r,)."""
    last = len(lines)
    while last > first and not lines[last - 1].strip():
        last -= 1
    if last == first:
        return np.zeros((0, len(columns))), np.zeros(0, np.int64)
    try:
        rows = np.loadtxt(lines[first:last], delimiter=delimiter, comments=None, ndmin=2)
    except ValueError:
        rows = None
    if rows is not None and rows.shape == (last - first, len(columns)):
        return rows, np.arange(first + 1, last + 1)

    numbers, found = list[int](), list[list[float]]()
    for number, line in enumerate(lines[first:last], start=first + 1):
        if not line.strip() or (delimiter is None and line.lstrip().startswith("#")):
            continue
        cells = line.split(delimiter)
        _check_width(path, number, cells, columns)
        found.append([_number(path, number, *pair) for pair in zip(columns, cells, strict=True)])
        numbers.append(number)
    return np.array(found), np.array(numbers)


def _check_header(path: Path, found: Sequence[str], columns: Sequence[str]) -> None:
    if list(found) == list(columns):
        return
    expected = f"expected the columns {','.join(columns)}"
    missing = [name for name in columns if name not in found]
    extra = [name for name in found if name not in columns]
    if missing and extra:
        raise InputError(f"{path}, line 1: column {extra[0]!r} where {missing[0]!r} is missing, {expected}.")
    if missing:
        raise InputError(f"{path}, line 1: column {missing[0]!r} is missing, {expected}.")
    if extra:
        raise InputError(f"{path}, line 1: column {extra[0]!r} is one too many, {expected}.")
    raise InputError(f"{path}, line 1: found the columns {','.join(found)}, {expected}, in this order.")


def _check_width(path: Path, number: int, cells: Sequence[str], columns: Sequence[str]) -> None:
    if len(cells) != len(columns):
        wanted = f"{len(columns)} ({','.join(columns)})"
        raise InputError(f"{path}, line {number}: found {len(cells)} columns, expected {wanted}.")


def _number(path: Path, number: int, column: str, cell: str) -> float:
    try:
        if "_" not in cell and cell.isascii():  # float() reads 1_000, and digits of every script
            return float(cell)
    except ValueError:
        pass
    found = f"{column} is {cell.strip()!r}" if cell.strip() else f"{column} is blank"
    raise InputError(f"{path}, line {number}: {found}, expected a number.")
