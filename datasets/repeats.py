"""Rows of a sensor's table that repeat the row before, its time too: they are left out, with a remark."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..core.se2 import Array, Ints
from ..core.table import Table


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


def without_repeats(table: Table, remarks: list[str] | None) -> Table:
    """The table without rows that repeat the one before."""
    return table.take(np.flatnonzero(first_of_repeats(table.path, table.rows, table.lines, remarks)))
