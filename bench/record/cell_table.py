"""The cells of a record as columns: parameters, status, and the requested measures."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray


class CellTable:
    """Rows in the order of the plan.

    `columns[name]` is an array (n,): of objects for parameters, status and other words, of float64 with NaN for
    measures. A cell that has not run has the status "waiting".
    """

    def __init__(self, columns: Mapping[str, NDArray[Any]]) -> None:
        self.columns = columns

    def __len__(self) -> int:
        return len(self.columns["status"])

    def rows(self, where: Mapping[str, Any]) -> NDArray[np.intp]:
        """The indices of the rows whose parameters have these values."""
        chosen = np.ones(len(self), bool)
        for name, value in where.items():
            chosen &= self.columns[name] == value
        return np.flatnonzero(chosen)

    def values(self, name: str, rows: NDArray[np.intp]) -> list[Any]:
        """The distinct values of a parameter in these rows, in the order of the plan."""
        return list(dict.fromkeys(self.columns[name][rows].tolist()))


def words(values: Sequence[Any]) -> NDArray[Any]:
    """Makes a column of objects."""
    return np.fromiter(values, object, len(values))


def numbers(values: Sequence[Any]) -> NDArray[np.float64]:
    """Makes a column of float64, NaN for None."""
    return np.array(values, float)
