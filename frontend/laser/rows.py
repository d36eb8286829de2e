"""Rows of numbers in one array that grows: a list of small arrays takes several times the memory."""

import numpy as np

from ...core.se2 import Array

FIRST = 256  # rows that there is room for at first; then always for twice as many


class Rows:
    """Rows of `width` numbers."""

    def __init__(self, width: int) -> None:
        self._all, self._count = np.empty((FIRST, width)), 0

    def __len__(self) -> int:
        return self._count

    @property
    def array(self) -> Array:
        """(n, width) the rows; a view, valid until the next one is appended."""
        return self._all[: self._count]

    def append(self, row: Array) -> None:
        """Appends a copy of `row` (width,)."""
        if self._count == len(self._all):
            self._all = np.concatenate((self._all, np.empty_like(self._all)))
        self._all[self._count] = row
        self._count += 1
