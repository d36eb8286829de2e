"""Compares the costs of backends over the rounds of a run's repeats; claims no more than these bear.

Two costs are compared on the same log in the same round, where the machine was in about the same state, by the
logarithm of their ratio. Its mean over logs and rounds has an interval (`measure/repeats.py`) that holds for the
machine as it was. Load changes the ratio of two backends, too, as they depend differently on caches and memory: one is
called cheaper only where the whole interval is beyond MARGIN.
"""

from collections.abc import Iterable, Sequence
from itertools import combinations
from math import isnan
from typing import Any, NamedTuple

import numpy as np

from ...core.se2 import Array
from ..measure.repeats import FEWEST_ROUNDS, student, two_way
from ..record.schema import Row
from ..words.columns import TIMED
from .statistics import exponential
from .summary import Line

MARGIN = 1.5
"""Factor by which load may shift the ratio of two backends' costs. Measured for ten pairs of the demo's five backends,
mean of six rounds: one or two other processes that compute, or that copy memory, beside them on two cores shifted the
ratio of median steps by 1.42 at most, that of the whole log's time by 1.35, and so did, by 1.33, a second time without
them."""

ONCE = 2.0
"""Factor beyond which costs without enough rounds count as different for a recommendation, and for nothing else."""


class Cost(NamedTuple):
    """A backend's cost: geometric mean over logs and rounds, with its 95 % interval for the machine as it was."""

    value: float
    low: float  # NaN with fewer than FEWEST_ROUNDS
    high: float
    logs: int
    rounds: int


class CostRatio(NamedTuple):
    """Two backends' costs on the same logs in the same rounds."""

    first: str
    second: str
    ratio: float  # the second's over the first's, geometric mean
    low: float  # 95 % interval; NaN with fewer than FEWEST_ROUNDS
    high: float
    logs: int
    rounds: int

    @property
    def standing(self) -> str:
        """Classifies the first: "cheaper", "dearer", "alike" within MARGIN, "open", or "few" without an interval."""
        if isnan(self.low):
            return "few"
        if self.low > MARGIN or self.high < 1 / MARGIN:
            return "cheaper" if self.low > MARGIN else "dearer"
        return "alike" if self.low >= 1 / MARGIN and self.high <= MARGIN else "open"

    def reverse(self) -> "CostRatio":
        """The comparison of the second with the first."""
        return self._replace(
            first=self.second, second=self.first, ratio=1 / self.ratio, low=1 / self.high, high=1 / self.low
        )


def rounds(line: Line) -> int:
    """The number of rounds that any cell of the line was timed in, those beside other cells left out."""
    return max((1, *(len(_times(row, "cpu_s")) for row in line.rows)))


def cost(line: Line, column: str) -> Cost | None:
    """Estimates a backend's cost; None where it was not timed alone, or took no time."""
    found = _grids([line], column)
    if found is None:
        return None
    (values,) = found
    mean = two_way(values)
    few = values.shape[1] < FEWEST_ROUNDS
    ends = (np.nan, np.nan) if few else (exponential(mean.low), exponential(mean.high))
    return Cost(exponential(mean.value), *ends, *values.shape)


def costs_by_round(line: Line, column: str) -> Array:
    """A backend's cost in every round (rounds,): geometric mean over the logs; none where there is none."""
    found = _grids([line], column)
    return np.zeros(0) if found is None else np.exp(found[0].mean(axis=0))


def compare_costs(first: Line, second: Line, column: str) -> CostRatio | None:
    """Compares two backends' costs; None where they were not timed alone on a log of both, or took no time."""
    found = _grids([first, second], column)
    if found is None:
        return None
    mine, theirs = found
    mean = two_way(theirs - mine)
    few = mine.shape[1] < FEWEST_ROUNDS
    ends = (np.nan, np.nan) if few else (exponential(mean.low), exponential(mean.high))
    return CostRatio(first.backend, second.backend, exponential(mean.value), *ends, *mine.shape)


def all_pairs(lines: Sequence[Line], column: str) -> list[CostRatio]:
    """Compares every pair that can be."""
    found = (compare_costs(first, second, column) for first, second in combinations(lines, 2))
    return [one for one in found if one is not None]


def is_dearer(line: Line, other: Line, column: str) -> bool:
    """True if the first costs more: beyond MARGIN by the rounds, or measured once by a factor of ONCE."""
    found = compare_costs(other, line, column)
    if found is not None and found.standing != "few":
        return found.standing == "cheaper"
    one, two = (each.values[column].median if column in each.values else np.inf for each in (line, other))
    return one > ONCE * two


def _grids(lines: Sequence[Line], column: str) -> list[Array] | None:
    """Returns logarithms of costs (units, rounds) of each line, over what all of them have.

    A round counts once it has ended for every cell, alone on its machine, and a log where every cell on it has a time
    in all of them; the logs of a unit are averaged, as are the runs of a random backend on one log.
    """
    cells = [[row for row in line.rows if row.columns["status"] == "done"] for line in lines]
    if not all(cells):
        return None
    times = [[_times(row, column) for row in rows] for rows in cells]
    ended = sorted(set[int].intersection(*(set(one) for found in times for one in found)))
    by_log: list[dict[str, list[Sequence[float | None]]]] = [{} for _ in lines]
    for found, rows, each in zip(by_log, cells, times, strict=True):
        for row, one in zip(rows, each, strict=True):
            found.setdefault(row.columns["digest"], []).append([one[number] for number in ended])
    whole = [
        {digest: np.log(np.array(runs, float)).mean(axis=0) for digest, runs in found.items() if _known(runs)}
        for found in by_log
    ]
    shared = [digest for digest in whole[0] if all(digest in other for other in whole)]
    if not shared or not ended:
        return None
    units: dict[Any, list[str]] = {}
    for digest in shared:
        units.setdefault(lines[0].units.unit(digest), []).append(digest)
    return [np.array([np.mean([found[one] for one in unit], axis=0) for unit in units.values()]) for found in whole]


def _times(row: Row, column: str) -> dict[int, float | None]:
    """A cell's cost in every round that it ran alone, None where that failed; of a record without rounds, the one."""
    if not row.rounds:
        return {1: row.columns[column]} if row.columns["timing_alone"] else {}
    counted = [one for one in row.rounds if one["timing_alone"] or one["status"] != "done"]
    return {one["round"]: one[column] if one["status"] == "done" else None for one in counted}


def _known(runs: Iterable[Iterable[float | None]]) -> bool:
    return all(value is not None and value > 0 for run in runs for value in run)


class BetweenRuns(NamedTuple):
    """The cost of one backend in two runs on the same logs, whose rounds are not of the same time."""

    ratio: float  # the new one's over the old one's, geometric mean
    low: float  # 95 % interval: Student's over the rounds of either, with Welch's degrees of freedom
    high: float
    rounds: tuple[int, int]


def between_runs(cells: Sequence[tuple[Row, Row]], column: str) -> BetweenRuns | None:
    """Compares a cost of old and new cells of the same logs; None unless both have FEWEST_ROUNDS of every one."""
    if column not in TIMED:
        return None
    means: list[Array] = []
    for rows in zip(*cells, strict=True):
        found = [_times(row, column) for row in rows]
        ended = sorted(set[int].intersection(*(set(times) for times in found)))
        whole = [[times[number] for number in ended] for times in found]
        if not _known(whole) or len(whole[0]) < FEWEST_ROUNDS:
            return None
        means.append(np.log(np.array(whole, float)).mean(axis=0))
    if len(means) != 2:
        return None
    old, new = means
    parts = [float(one.var(ddof=1)) / len(one) for one in (old, new)]
    free = [part**2 / (len(one) - 1) for part, one in zip(parts, (old, new), strict=True)]
    dof = sum(parts) ** 2 / sum(free) if sum(free) else 1.0
    middle, reach = float(new.mean() - old.mean()), student(dof) * sum(parts) ** 0.5
    return BetweenRuns(
        exponential(middle), exponential(middle - reach), exponential(middle + reach), (len(old), len(new))
    )
