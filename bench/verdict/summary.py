"""A run's cells drawn together over their seeds: what the table in the terminal and the report show."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..measure.status import FAILED
from ..record.schema import Row, label
from ..words.columns import about
from ..words.names import called
from .statistics import FEWEST, estimate


class Spread(NamedTuple):
    """A value over the seeds that have one."""

    median: float
    low: float
    high: float
    n: int


class Line(NamedTuple):
    """One backend variant on one dataset variant, over all seeds."""

    dataset: str  # label
    backend: str  # label
    truth_kind: str
    rows: list[Row]  # by seed
    values: Mapping[str, Spread]  # by column of cells.csv; a column without any value is absent
    name: str  # what people call the dataset, among those of the run
    implementation: str = ""  # whose program the backend is; "" where the run does not say

    @property
    def done(self) -> int:
        """How many of its cells are done."""
        return sum(row.columns["status"] == "done" for row in self.rows)

    def by_log(self, column: str) -> dict[str, float]:
        """The column's value on every log, by digest: what several runs on one log have is averaged first.

        An error is infinite where a cell of the log has failed; a log without a value is absent.
        """
        found: dict[str, list[float]] = {}
        for log, value in self.runs(column):
            found.setdefault(log, []).append(value)
        return {log: sum(values) / len(values) for log, values in found.items()}

    def runs(self, column: str) -> list[tuple[str, float]]:
        """(digest, value) of every cell that is done and has one; of an error, of every failed cell too: infinite."""
        found: list[tuple[str, float]] = []
        for c in (row.columns for row in self.rows):
            if c["status"] == "done" and c[column] is not None:
                found.append((c["digest"], c[column]))
            elif c["status"] in FAILED and about(column).kind.is_error:
                found.append((c["digest"], float("inf")))
        return found

    @property
    def failed(self) -> int:
        """How many of its cells ended in one of the ways that count as the worst there is."""
        return sum(row.columns["status"] in FAILED for row in self.rows)

    @property
    def alone(self) -> bool:
        """Whether every cell ran alone, so that its times stand for themselves."""
        return all(row.columns["timing_alone"] for row in self.rows)

    @property
    def told(self) -> bool:
        """Whether it was told the truth, and so does not compete."""
        return any(row.columns["told"] for row in self.rows)

    @property
    def surveyed(self) -> bool:
        """Whether its map is measured from true places, though nobody knows where the robot was."""
        return any(row.columns["surveyed"] for row in self.rows)

    @property
    def reference(self) -> str:
        """What its path is measured from where nobody knows the true one."""
        return next((said for row in self.rows if (said := row.columns["reference"])), "the batch optimum")


def representative(lines: Sequence[Line]) -> Line:
    """One of a dataset's lines whose cells say what is known of it: the first that is done, if any is."""
    return next((line for line in lines if line.done), lines[0])


def logs(lines: Sequence[Line]) -> int:
    """How many different logs the lines of one dataset ran on: a dataset that draws nothing has one for all seeds."""
    return len({row.columns["digest"] for line in lines for row in line.rows})


def lines(rows: Iterable[Row], implementations: Mapping[str, str] | None = None) -> list[Line]:
    """A line a (dataset, backend) of a run, in the order in which the record has them.

    `implementations` are what the run's record says of its backends, by label.
    """
    made_by = implementations or {}
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        c = row.columns
        key = label(c["dataset"], c["dataset_options"]), label(c["backend"], c["options"])
        groups.setdefault(key, []).append(row)
    names = called([dataset for dataset, _ in groups])
    return [
        Line(
            dataset,
            backend,
            members[0].columns["truth_kind"],
            members,
            _spreads(members),
            names[dataset],
            made_by.get(backend, ""),
        )
        for (dataset, backend), members in groups.items()
    ]


def _spreads(rows: list[Row]) -> dict[str, Spread]:
    done = [row.columns for row in rows if row.columns["status"] == "done"]
    spreads: dict[str, Spread] = {}
    for name in [name for name in rows[0].columns if about(name).kind.is_measured]:
        values: list[Any] = [columns[name] for columns in done if columns[name] is not None]
        if values:
            spreads[name] = spread(values)
    return spreads


def spread(values: Sequence[Any]) -> Spread:
    """Of the values of a column, one or more."""
    ranked = sorted(values)
    middle = (ranked[(len(ranked) - 1) // 2] + ranked[len(ranked) // 2]) / 2
    return Spread(float(middle), ranked[0], ranked[-1], len(ranked))


class Typical(NamedTuple):
    """Of a column, over logs."""

    value: float  # the median; infinite where half of the cells have failed
    low: float
    high: float
    n: int  # logs
    interval: bool  # whether low and high are the ends of a 95 % interval, or of the range that was measured


def typical(line: Line, column: str) -> Typical:
    """Of a column in which the line has a value. On a single log, the median and range of the runs on it."""
    by_log = line.by_log(column)
    values = list(by_log.values()) if len(by_log) > 1 else [value for _, value in line.runs(column)]
    if len(by_log) >= FEWEST:
        return Typical(*estimate(values), interval=True)
    return Typical(float(np.median(values)), min(values), max(values), len(by_log), interval=False)
