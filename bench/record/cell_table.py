"""The cells of a record as columns: parameters, status, and the requested measures."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .plan import status_of
from .schema import ABOUT, MEASURED, SKIPPED

COLUMN_KINDS = {"status": "TEXT", "reason": "TEXT"} | MEASURED | ABOUT  # columns of a result in a table


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


def joined(plan: Sequence[Any], names: Sequence[str], results: Sequence[Any], measures: Sequence[str]) -> CellTable:
    """The cells of a plan with their results.

    A row of `plan` has the text of the parameters, seed, key of the result, trouble and cluster; a row of `results` its
    key and the columns of these `names`. A parameter precedes its namesake among them. ValueError, TypeError or
    AttributeError for content that cannot be decoded.
    """
    keys, *columns = _columns(results, 1 + len(names))
    texts, seeds, wanted, troubles, clusters = _columns(plan, 5)
    known = dict(zip(keys, range(len(keys)), strict=True))
    at = np.array([known.get(key, -1) for key in wanted], int)  # -1: the None at the end of every column
    table = _parameters(texts, seeds)
    for name, values in zip(names, columns, strict=True):
        table.setdefault(name, (words if COLUMN_KINDS[name] == "TEXT" else numbers)([*values, None])[at])
    for name in measures:  # an earlier version's record lacks some
        table.setdefault(name, numbers([None] * len(at)))
    table["cluster"] = words(clusters)
    trouble, missing = words(troubles), at < 0
    table["status"][missing] = [status_of(said) for said in trouble[missing]]
    table["reason"][missing] = [said and said.removeprefix(SKIPPED) for said in trouble[missing]]
    return CellTable(table)


def _columns(rows: Sequence[Any], count: int) -> list[Sequence[Any]]:
    return list(zip(*rows, strict=True)) or [()] * count


def _parameters(texts: Sequence[str], seeds: Sequence[int]) -> dict[str, NDArray[Any]]:
    """The cells' parameters as columns, the seed third."""
    known: dict[str, dict[str, Any]] = {text: json.loads(text) for text in dict.fromkeys(texts)}
    names = dict.fromkeys(["dataset", "backend", "seed", *(name for found in known.values() for name in found)])
    columns: dict[str, NDArray[Any]] = {}
    for name in names:
        values = {text: found.get(name) for text, found in known.items()}
        columns[name] = words(seeds if name == "seed" else [values[text] for text in texts])
    return columns
