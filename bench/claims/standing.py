"""How far a study is: its cells by status, and what failed, for what reasons and where."""

import re
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..measure.status import FAILED
from ..record.cell_table import CellTable
from .curves import worded
from .side import parameters

ENDS = ("done", *FAILED, "skipped", "waiting")
"""Statuses in the order in which they are told."""

NAMED = 4
"""Values of a parameter that are told one by one."""


class FailureGroup(NamedTuple):
    """Cells that ended in the same way, for the same reason but for its numbers."""

    status: str
    reason: str  # that of the first
    n: int
    where: Sequence[tuple[str, str]]  # (parameter, its values): what tells them from the other cells

    @property
    def failed(self) -> bool:
        """Whether it counts as the worst there is."""
        return self.status in FAILED


class Standing(NamedTuple):
    """Of all cells of the study as it stands."""

    counts: dict[str, int]  # by status, those that there are
    told: Sequence[FailureGroup]  # every reason, failures first, the most frequent first

    @property
    def cells(self) -> int:
        """How many there are."""
        return sum(self.counts.values())

    @property
    def waiting(self) -> int:
        """How many have no result yet."""
        return self.counts.get("waiting", 0)

    @property
    def failed(self) -> int:
        """How many count as the worst there is."""
        return sum(self.counts.get(status, 0) for status in FAILED)


def standing(table: CellTable) -> Standing:
    """How far the study is."""
    statuses, reasons = table.columns["status"], table.columns["reason"]
    counts = Counter(statuses.tolist())
    alike: dict[tuple[str, str], list[int]] = {}
    worth = np.logical_or.reduce([reasons.astype(bool), *(statuses == status for status in FAILED)])
    for row in np.flatnonzero(worth).tolist():
        alike.setdefault((statuses[row], _without_numbers(reasons[row] or "")), []).append(row)
    told = [
        FailureGroup(status, reasons[rows[0]] or "no reason given", len(rows), _where(table, rows))
        for (status, _), rows in alike.items()
    ]
    told.sort(key=lambda one: (not one.failed, one.status == "done", -one.n))
    return Standing({status: counts[status] for status in ENDS if counts[status]}, told)


def _without_numbers(reason: str) -> str:
    return re.sub(r"\d[\d.,]*(e[+-]?\d+)?", "#", reason)


def _where(table: CellTable, rows: Sequence[int]) -> list[tuple[str, str]]:
    """The parameters of which these cells have not every value that the study has."""
    found: list[tuple[str, str]] = []
    for name in parameters(table):
        values = table.columns[name]
        having = [value for value in dict.fromkeys(values[list(rows)].tolist()) if value is not None]
        if having and len(having) < len(set(values.tolist())):
            said = [worded(value) for value in having[:NAMED]]
            more = len(having) - len(said)
            found.append((name, ", ".join(said) + (f" and {more:,} more" if more else "")))
    return found
