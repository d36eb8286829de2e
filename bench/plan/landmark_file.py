"""Reads a file of landmarks as a map to start from, such as a cell's map.csv or a log's landmarks.csv.

id,x,y                  each landmark's place, m
id,x,y,moving           the same; those that move, 1 in the last column, are left out
id,x,y,cxx,cxy,cyy      and each landmark's covariance, m²; blank throughout where unknown
"""

from pathlib import Path

import numpy as np

from ...core.errors import InputError
from ...core.factors import Map
from ...core.se2 import Array
from ...core.small_matrices import symmetric
from ...core.table import Table, text
from ..record.files import MAP as COLUMNS

MOVING = (*COLUMNS[:3], "moving")


def read_landmarks(path: Path) -> Map:
    """Reads the map in `path`; InputError names the file and the line of what cannot be used."""
    lines = text(path).rstrip("\n").split("\n")
    header = tuple(cell.strip() for cell in lines[0].split(","))
    if header not in (COLUMNS, COLUMNS[:3], MOVING):
        raise InputError(f"{path}, line 1: found {lines[0]!r}, expected id,x,y or {','.join(COLUMNS)}.")
    rows = [_cells(path, number, line, header) for number, line in enumerate(lines[1:], start=2)]
    table = Table(path, header, np.array(rows).reshape(-1, len(header)), np.arange(2, len(rows) + 2))
    if not rows:
        raise InputError(f"{path}: there is no landmark, expected at least one row.")
    Table(path, header[:3], table.rows[:, :3], table.lines).finite()
    ids = table.whole("id")
    first = np.unique(ids, return_index=True)[1]
    for row in np.flatnonzero(ids < 0):
        raise table.fault(row, f"id is {ids[row]}, expected 0 or more")
    for row in np.setdiff1d(np.arange(len(ids)), first):
        raise table.fault(row, f"id {ids[row]} is there a second time, expected it once")
    if header == MOVING:
        stays = table.finite().column("moving") == 0
        return Map(ids[stays], table.rows[stays, 1:3], None)
    triangles = table.rows[:, 3:]
    if not triangles.size or np.isnan(triangles).all():
        return Map(ids, table.rows[:, 1:3].copy(), None)
    table.finite()
    blocks = symmetric(triangles)
    for row in np.flatnonzero(~(np.linalg.eigvalsh(blocks)[:, 0] > 0)):
        raise table.fault(row, "the covariance cxx,cxy,cyy is not positive definite, expected one that is")
    return Map(ids, table.rows[:, 1:3].copy(), block_diagonal(blocks))


def _cells(path: Path, number: int, line: str, header: tuple[str, ...]) -> list[float]:
    """Reads a line's numbers, NaN for a blank cell of the covariance."""
    cells = [cell.strip() for cell in line.split(",")]
    if len(cells) != len(header):
        raise InputError(f"{path}, line {number}: found {len(cells)} columns, expected {len(header)}.")
    values: list[float] = []
    for name, cell in zip(header, cells, strict=True):
        try:
            if "_" in cell:  # which float would read over
                raise ValueError
            values.append(np.nan if not cell and name in COLUMNS[3:] else float(cell))
        except ValueError:
            raise InputError(f"{path}, line {number}: {name} is {cell!r}, expected a number.") from None
    return values


def block_diagonal(blocks: Array) -> Array:
    """The (2n, 2n) matrix with the (n, 2, 2) `blocks` on its diagonal."""
    n = len(blocks)
    whole = np.zeros((n, 2, n, 2))
    whole[np.arange(n), :, np.arange(n)] = blocks
    return whole.reshape(2 * n, 2 * n)
