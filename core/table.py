"""Reads text files of numbers, one row per line: in one pass if valid, line by line to name faults.

Every reader here is the strict form of a scan, which reports all faults and not only the first.
"""

import gzip
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple, SupportsIndex

import numpy as np
from numpy.typing import NDArray

from .csv_values import header_names, no_number, number, other_count, other_header, shortened, shown
from .errors import InputError
from .files import check_regular
from .lines import Lines
from .scan import Scan, strict
from .se2 import Array, Ints

MOST = 2**53  # the largest integer up to which all are exact as doubles

LARGEST = 1e9
"""m, rad or their squares: beyond any robot, and its square is still far from overflow."""

HUGE = 1e30
"""Beyond any measure in any unit, and its eighth power is still far from overflow."""

CHUNK = 100_000  # lines parsed at once, and again one by one if any of them is invalid


class Table(NamedTuple):
    """The rows of a file and their line numbers."""

    path: Path
    columns: tuple[str, ...]
    rows: Array  # (r, columns)
    lines: Ints  # (r,) counted from 1
    broken: Ints = np.zeros(0, np.int64)  # rows with a fault

    def column(self, name: str) -> Array:
        """(r,) the column of that name."""
        return self.rows[:, self.columns.index(name)]

    def whole(self, name: str) -> Ints:
        """(r,) the column of that name as integers; InputError for other numbers."""
        return strict(self.scan_whole(name)).column(name).astype(np.int64)

    def fault(self, row: SupportsIndex, message: str) -> InputError:
        """The error `message` about `row`."""
        return InputError(f"{self.path}, line {self.lines[row]}: {message}.")

    def finite(self) -> "Table":
        """Returns itself; InputError for a number that is not finite."""
        return strict(self.scan_finite())

    def bounded(self, least: float, most: float, *names: str) -> "Table":
        """Returns itself; InputError for a number in those columns outside `least` to `most`."""
        for name in names:
            column = self.column(name)
            for row in np.flatnonzero(~((column >= least) & (column <= most))):
                raise self.fault(row, f"{name} is {column[row]!s}, expected {least:g} to {most:g}")
        return self

    def refuse(self, bad: NDArray[np.bool_], message: Callable[[int], str]) -> Scan["Table"]:
        """Breaks the rows where `bad` (r,) is true, yields a fault for each that was not broken; returns itself."""
        rows = np.flatnonzero(bad)
        if not len(rows):
            return self
        for row in np.setdiff1d(rows, self.broken):
            yield self.fault(row, message(int(row)))
        return self._replace(broken=np.union1d(self.broken, rows))

    def scan_whole(self, *names: str) -> Scan["Table"]:
        """Yields a fault for each non-integer in those columns; returns itself."""
        broken, message = self.broken, "{} is {!s}, expected a whole number up to " + str(MOST)
        for name in names:
            column = self.column(name)
            odd = ~((np.abs(column) <= MOST) & (column == np.rint(column)))
            refused = yield from self.refuse(odd, lambda row, it=column, of=name: message.format(of, it[row]))
            if refused is not self:
                broken = np.union1d(broken, refused.broken)
        return self if broken is self.broken else self._replace(broken=broken)

    def scan_finite(self) -> Scan["Table"]:
        """Yields a fault for each number that is not finite, or beyond HUGE; returns itself."""
        bad = ~(np.abs(self.rows) <= HUGE)
        bad[self.broken] = False
        for row, column in np.argwhere(bad):
            found = self.rows[row, column]
            size = f", not beyond {HUGE:g}" if np.isfinite(found) else ""
            yield self.fault(row, f"{self.columns[column]} is {found!s}, expected a finite number{size}")
        return self._replace(broken=np.union1d(self.broken, np.flatnonzero(bad.any(axis=1))))

    def sound(self) -> "Table":
        """The rows without faults."""
        return self.take(np.delete(np.arange(len(self.rows)), self.broken)) if len(self.broken) else self

    def take(self, rows: Ints) -> "Table":
        """The given rows, in that order."""
        return Table(self.path, self.columns, self.rows[rows], self.lines[rows])

    def without_repeats(self, remarks: list[str]) -> "Table":
        """The table without rows that repeat the one before, its time too, which one of the `remarks` then says."""
        return self.take(np.flatnonzero(first_of_repeats(self.path, self.rows, self.lines, remarks)))

    def lines_of(self, rows: Ints | slice = slice(None)) -> Lines:
        """The lines that rows are from, one each."""
        return Lines(str(self.path), self.lines[rows], self.lines[rows])


def first_of_repeats(
    path: Path, rows: Array, lines: Ints | Sequence[int], remarks: list[str] | None
) -> NDArray[np.bool_]:
    """(n,) which rows (n, columns) do not repeat the one before; adds one remark for the others. Blanks are alike.

    `lines` (n,) are those of the file.
    """
    same = ((rows[1:] == rows[:-1]) | (np.isnan(rows[1:]) & np.isnan(rows[:-1]))).all(axis=1)
    kept = np.append(True, ~same)[: len(rows)]
    again = np.flatnonzero(~kept)
    if len(again) and remarks is not None:
        more = f", and so do {len(again) - 1:,} more rows" * (len(again) > 1)
        left_out = "they are" if len(again) > 1 else "it is"
        remarks.append(
            f"{path}, line {lines[again[0]]}: repeats line {lines[again[0] - 1]}, its time, too{more}: {left_out} left "
            "out"
        )
    return kept


def read_csv(path: Path, columns: Sequence[str], *, blanks: bool = False) -> Table:
    """Reads the table in `path`, whose first line names `columns`.

    InputError names the file, the line and the column of what cannot be read; NaN and infinity can. With `blanks`,
    cells after the first of a row may be blank, which reads as NaN, and NaN cannot be read.
    """
    return strict(scan_csv(path, columns, blanks=blanks))


def scan_csv(
    path: Path,
    columns: Sequence[str],
    optional: Sequence[str] = (),
    blank_after: int | None = None,
    *,
    blanks: bool = False,
) -> Scan[Table]:
    """Scans as `read_csv` reads; rows with unreadable cells are broken, and all NaN.

    The header may continue with `optional`, all of them or none. With `blank_after`, the first row fills that many
    cells and leaves the others blank, which reads as NaN. `blanks` are as in `read_csv`.

    InputError for a file that is missing, not text or has another header.
    """
    lines = text(path).split("\n")
    many = optional and lines[0].count(",") >= len(columns)
    columns = (*columns, *optional) if many else tuple(columns)
    _check_header(path, lines[0], columns)
    parts = list[Table]()
    if blank_after is not None and len(lines) > 1 and lines[1]:
        row = yield from _scan_first(path, lines[1].split(","), columns, blank_after)
        parts = [_table(path, columns, [row], [2])]
    return (yield from _scan_rows(path, lines, 1 + len(parts), columns, ",", parts, blanks=blanks))


def read_spaced(path: Path, columns: Sequence[str]) -> Table:
    """Reads blank-separated `columns` of `path`, no header, # begins a comment; InputError as from `read_csv`."""
    return strict(scan_spaced(path, columns))


def scan_spaced(path: Path, columns: Sequence[str]) -> Scan[Table]:
    """Scans as `read_spaced` reads; broken rows as in `scan_csv`. Commas may stand in place of blanks."""
    lines = text(path).split("\n")
    first = next((k for k, line in enumerate(lines) if line.strip() and not line.lstrip().startswith("#")), len(lines))
    cells = lines[first].split(",") if first < len(lines) else []
    if len(cells) > 1 and all(len(cell.split()) <= 1 for cell in cells):  # else a decimal comma
        lines = [line if line.lstrip().startswith("#") else line.replace(",", " ") for line in lines]
    return (yield from _scan_rows(path, lines, first, tuple(columns), None, []))


def text(path: Path) -> str:
    """The content of `path` with \n line ends, unpacked if it is a .gz.

    InputError if it is missing, no regular file, damaged, empty or not UTF-8.
    """
    check_regular(path)
    try:
        content = path.read_bytes()
        if path.suffix == ".gz":
            content = gzip.decompress(content)
    except FileNotFoundError:
        found = "is a link to nothing, expected a file" if path.is_symlink() else "there is no such file"
        raise InputError(f"{path}: {found}.") from None
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise InputError(f"{path}: cannot be unpacked ({error}).") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}).") from error
    if not content or content.isspace():
        raise InputError(f"{path}: the file is empty.")
    if content.startswith((b"\xff\xfe", b"\xfe\xff")) or b"\0" in content[:2]:
        raise InputError(f"{path}: found UTF-16, expected UTF-8 text.")
    try:
        return content.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InputError(f"{path}, line {line}: byte {content[error.start]:#04x} is not UTF-8 text.") from error


def _scan_rows(
    path: Path,
    lines: Sequence[str],
    first: int,
    columns: tuple[str, ...],
    delimiter: str | None,
    before: list[Table],
    *,
    blanks: bool = False,
) -> Scan[Table]:
    """The table of the rows `before` and of those from lines[first] on."""
    last = len(lines)
    while last > first and not lines[last - 1].strip():
        last -= 1
    parts = [*before]
    for begin in range(first, last, CHUNK):
        chunk = lines[begin : min(begin + CHUNK, last)]
        rows = _parsed(chunk, delimiter)
        if rows is not None and rows.shape == (len(chunk), len(columns)) and not (blanks and np.isnan(rows).any()):
            parts.append(Table(path, columns, rows, np.arange(begin + 1, begin + 1 + len(chunk))))
        else:
            parts.append((yield from _scan_lines(path, chunk, begin + 1, columns, delimiter, blanks=blanks)))
    if not parts:
        return _table(path, columns, [], [])
    starts = np.cumsum([0, *(len(part.rows) for part in parts[:-1])])
    return Table(
        path,
        columns,
        np.concatenate([part.rows for part in parts]),
        np.concatenate([part.lines for part in parts]),
        np.concatenate([part.broken + start for part, start in zip(parts, starts, strict=True)]),
    )


def _parsed(lines: Sequence[str], delimiter: str | None) -> Array | None:
    """Parses all lines at once; None if one is invalid."""
    if not any(line.strip() for line in lines):
        return None
    try:
        return np.loadtxt(lines, delimiter=delimiter, comments=None, ndmin=2)
    except ValueError:
        return None


def _scan_lines(
    path: Path,
    lines: Sequence[str],
    first: int,
    columns: tuple[str, ...],
    delimiter: str | None,
    *,
    blanks: bool,
) -> Scan[Table]:
    """Scans `lines`, the first numbered `first`, skipping blank lines and comments."""
    rows, numbers = list[list[float] | None](), list[int]()
    for line, content in enumerate(lines, start=first):
        if content.strip() and not (delimiter is None and content.lstrip().startswith("#")):
            cells = content.split(delimiter)
            rows.append((yield from _scan_cells(path, line, cells, columns, delimiter, blanks=blanks)))
            numbers.append(line)
    return _table(path, columns, rows, numbers)


def _table(path: Path, columns: tuple[str, ...], rows: Sequence[list[float] | None], numbers: Sequence[int]) -> Table:
    """The table of `rows`; those that are None are broken."""
    filled = [[np.nan] * len(columns) if row is None else row for row in rows]
    broken = np.array([k for k, row in enumerate(rows) if row is None], np.int64)
    return Table(path, columns, np.array(filled).reshape(-1, len(columns)), np.array(numbers, np.int64), broken)


def _scan_first(path: Path, cells: Sequence[str], columns: Sequence[str], filled: int) -> Scan[list[float] | None]:
    """The first row, line 2, of which only the first `filled` cells are not blank; None if it is broken."""
    if len(cells) != len(columns):
        return (yield from _scan_cells(path, 2, cells, columns, ","))
    row = yield from _scan_cells(path, 2, cells[:filled], columns[:filled], ",")
    for name, cell in zip(columns[filled:], cells[filled:], strict=True):
        if cell.strip():
            yield InputError(f"{path}, line 2: {name} is {shortened(cell)}, expected nothing in the first row.")
            row = None
    return None if row is None else row + [np.nan] * (len(columns) - filled)


def _scan_cells(
    path: Path,
    line: int,
    cells: Sequence[str],
    columns: Sequence[str],
    delimiter: str | None,
    *,
    blanks: bool = False,
) -> Scan[list[float] | None]:
    """A row of numbers; None if it is broken."""
    if len(cells) != len(columns):
        yield InputError(f"{path}, line {line}: {other_count(cells, columns, delimiter)}.")
        return None
    blank = [blanks and k > 0 and not cell.strip() for k, cell in enumerate(cells)]
    row = list[float]()
    for name, cell, left_out in zip(columns, cells, blank, strict=True):
        found = np.nan if left_out else number(cell)
        if found is None:
            yield InputError(f"{path}, line {line}: {name} {no_number(cell)}.")
        elif blanks and np.isnan(found) and not left_out:
            yield InputError(f"{path}, line {line}: {name} is {found!s}, expected a finite number.")
        else:
            row.append(found)
    return row if len(row) == len(cells) else None


def _check_header(path: Path, line: str, columns: Sequence[str]) -> None:
    found = header_names(line)
    if found == list(columns):
        return
    if (hint := other_header(line, columns)) is not None:
        raise InputError(f"{path}, line 1: {hint}.")
    expected = f"expected the columns {shown(columns)}"
    missing = [name for name in columns if name not in found]
    extra = [name for name in found if name not in columns]
    if missing and extra:
        raise InputError(f"{path}, line 1: column {shortened(extra[0])} in place of {missing[0]!r}, {expected}.")
    if missing:
        raise InputError(f"{path}, line 1: column {missing[0]!r} is missing, {expected}.")
    if extra:
        raise InputError(f"{path}, line 1: column {shortened(extra[0])} is one too many, {expected}.")
    raise InputError(f"{path}, line 1: found the columns {shown(found)}, {expected}, in this order.")
