"""Writes tables of numbers as lines of text, block by block: a table of a million rows is never text as a whole."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

BLOCK = 10_000  # rows that are text at once


def number_rows(columns: Sequence[NDArray[Any]], between: str = ",", before: str = "") -> Iterator[str]:
    """Yields the lines of `columns` (n,) each, many in a text: `before`, then the numbers with `between` them.

    Floats read back bit for bit; NaN, and what is masked, is blank.
    """
    for first in range(0, len(columns[0]), BLOCK):
        texts = [_texts(column[first : first + BLOCK]) for column in columns]
        yield "".join([f"{before}{row}\n" for row in map(between.join, zip(*texts, strict=True))])


def _texts(numbers: NDArray[Any]) -> Sequence[str]:
    masked = np.ma.getmaskarray(numbers)
    unknown = masked | np.isnan(numbers) if numbers.dtype.kind == "f" else masked
    if unknown.all():
        return [""] * len(numbers)
    texts = list(map(repr, np.ma.getdata(numbers).tolist()))
    for row in np.flatnonzero(unknown).tolist():
        texts[row] = ""
    return texts
