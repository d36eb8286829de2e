"""CSV files of other people's programs: columns are found by their names, in any order, others are ignored."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..frontend.errors import InputError
from ..frontend.se2 import Array, Ints
from ..frontend.table import Table, text


def read_columns(path: Path, *choices: Sequence[str]) -> Table:
    """The table in `path`, of the first of `choices` whose columns the header has; all numbers are finite.

    InputError names the file, the line and the column of what cannot be read, and says what columns would do.
    """
    lines: list[str] = text(path).split("\n")
    header = [cell.strip().strip('"') for cell in lines[0].split(",")]
    chosen = next((columns for columns in choices if set(columns) <= set(header)), None)
    if chosen is None:
        wanted = ", or ".join(",".join(columns) for columns in choices)
        raise InputError(f"{path}, line 1: found the columns {','.join(header)}, expected {wanted} among them.")
    for name in chosen:
        if header.count(name) > 1:
            raise InputError(f"{path}, line 1: column {name!r} is there {header.count(name)} times, expected once.")
    places = [header.index(name) for name in chosen]
    numbers = np.array([number for number, line in enumerate(lines[1:], start=2) if line.strip()], np.int64)
    if not len(numbers):
        raise InputError(f"{path}: there is no row, expected at least one below the header.")
    rows = _rows(path, lines, numbers, header, places)
    return Table(path, tuple(chosen), rows, numbers).finite()


def _rows(path: Path, lines: list[str], numbers: Ints, header: Sequence[str], places: Sequence[int]) -> Array:
    """(r, columns) the cells at `places` of the lines with these numbers."""
    found = list[list[float]]()
    for number in numbers.tolist():
        cells = lines[number - 1].split(",")
        if len(cells) != len(header):
            raise InputError(f"{path}, line {number}: found {len(cells)} columns, expected {len(header)}.")
        found.append([_number(path, number, header[place], cells[place]) for place in places])
    return np.array(found)


def _number(path: Path, number: int, column: str, cell: str) -> float:
    cell = cell.strip().strip('"')
    try:
        if "_" not in cell and cell.isascii():  # float() reads 1_000, and digits of every script
            return float(cell)
    except ValueError:
        pass
    found = f"{column} is {cell!r}" if cell else f"{column} is blank"
    raise InputError(f"{path}, line {number}: {found}, expected a number.")
