"""Summarises a study's progress: its cells by status, and the failures with reasons and parameters."""

import re
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..record.cell_table import CellTable
from ..record.schema import FAILED
from .curves import worded
from .side import parameters

ENDS = ("done", *FAILED, "skipped", "waiting")  # statuses in the order in which they are listed
NAMED = 4  # values of a parameter that are listed


class FailureGroup(NamedTuple):
    """Cells that ended in the same way, for the same reason but for its numbers."""

    status: str
    reason: str  # that of the first
    n: int
    where: Sequence[tuple[str, str]]  # (parameter, its values): what distinguishes them from the other cells

    @property
    def failed(self) -> bool:
        """True where it is a failure."""
        return self.status in FAILED


class Progress(NamedTuple):
    """The progress of all cells of a study."""

    counts: dict[str, int]  # by status, those that there are
    told: Sequence[FailureGroup]  # every reason, failures first, the most frequent first

    @property
    def cells(self) -> int:
        """Counts all cells."""
        return sum(self.counts.values())

    @property
    def waiting(self) -> int:
        """Counts the cells without a result."""
        return self.counts.get("waiting", 0)

    @property
    def failed(self) -> int:
        """Counts the failed cells."""
        return sum(self.counts.get(status, 0) for status in FAILED)


def standing(table: CellTable) -> Progress:
    """Summarises the table."""
    statuses, reasons = table.columns["status"], table.columns["reason"]
    counts = Counter(statuses.tolist())
    alike: dict[tuple[str, str], list[int]] = {}
    worth = np.logical_or.reduce([reasons.astype(bool), *(statuses == status for status in FAILED)])
    for row in np.flatnonzero(worth).tolist():
        alike.setdefault((statuses[row], re.sub(r"\d[\d.,]*(e[+-]?\d+)?", "#", reasons[row] or "")), []).append(row)
    told = [
        FailureGroup(status, reasons[rows[0]] or "no reason given", len(rows), _where(table, rows))
        for (status, _), rows in alike.items()
    ]
    told.sort(key=lambda one: (not one.failed, one.status == "done", -one.n))
    return Progress({status: counts[status] for status in ENDS if counts[status]}, told)


def _where(table: CellTable, rows: Sequence[int]) -> list[tuple[str, str]]:
    """The parameters of which these cells have only some of the study's values."""
    found: list[tuple[str, str]] = []
    for name in parameters(table):
        values = table.columns[name]
        having = [value for value in dict.fromkeys(values[list(rows)].tolist()) if value is not None]
        if having and len(having) < len(set(values.tolist())):
            said = [worded(value) for value in having[:NAMED]]
            more = len(having) - len(said)
            found.append((name, ", ".join(said) + (f" and {more:,} more" if more else "")))
    return found
