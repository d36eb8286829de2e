"""Summarises a run's cells over their seeds, for the terminal and the report."""

from collections.abc import Hashable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from ..record.schema import FAILED, Row, label
from ..words.columns import about
from ..words.names import called
from .statistics import FEWEST, Estimate, estimate, median, median_over
from .units import INDEPENDENT, Units, units

OF_MAPS = ("map_rmse_m", "final_map_rmse_m")  # the errors that do not take a true path


class Spread(NamedTuple):
    """A column's values over the seeds that have one."""

    median: float
    low: float
    high: float
    n: int


class Line(NamedTuple):
    """One backend variant on one dataset variant, over all seeds."""

    dataset: str  # label
    backend: str  # label
    truth_kind: str  # of the log, or of all; "truth" where the true path is known of some alone, and places of all
    rows: list[Row]  # by seed
    values: Mapping[str, Spread]  # by column of cells.csv; a column without any value is absent
    name: str  # the dataset's display name
    implementation: str = ""  # whose program the backend is; "" where the run does not say
    units: Units = INDEPENDENT  # of the dataset's logs, by digest
    with_path: Units | None = None  # those whose true path is known, where it is of some logs alone

    @property
    def done(self) -> int:
        """Counts the cells that are done."""
        return sum(row.columns["status"] == "done" for row in self.rows)

    def by_log(self, column: str) -> dict[str, float]:
        """The mean value by log digest; infinite for an error of a failed cell, absent without a value."""
        found: dict[str, list[float]] = {}
        for log, value in self.runs(column):
            found.setdefault(log, []).append(value)
        return {log: sum(values) / len(values) for log, values in found.items()}

    def estimate(self, column: str) -> Estimate:
        """Estimates the median of a column over the logs."""
        by_log, of = self.by_log(column), self.over(column)
        return estimate([*by_log.values()], [of.unit(log) for log in by_log])

    def runs(self, column: str) -> list[tuple[str, float]]:
        """Lists (digest, value) of every done cell that has one; of an error, of every failed cell too: infinite."""
        found: list[tuple[str, float]] = []
        for c in (row.columns for row in _judged(self.rows, column, mixed=self.with_path is not None)):
            if c["status"] == "done" and c[column] is not None:
                found.append((c["digest"], c[column]))
            elif c["status"] in FAILED and about(column).kind.is_error:
                found.append((c["digest"], float("inf")))
        return found

    def over(self, column: str) -> Units:
        """The units of the logs that a column is judged on: all, or of errors of paths those with a true one."""
        return self.with_path if self.with_path is not None and _of_path(column) else self.units

    @property
    def failed(self) -> int:
        """Counts the failed cells."""
        return sum(row.columns["status"] in FAILED for row in self.rows)

    @property
    def alone(self) -> bool:
        """True where every cell ran alone, so that times are comparable."""
        return all(row.columns["timing_alone"] for row in self.rows)

    @property
    def told(self) -> bool:
        """True where it was given the ground truth, so that it is not ranked."""
        return any(row.columns["told"] for row in self.rows)

    @property
    def surveyed(self) -> bool:
        """True where its map is measured from true places, though the true path is unknown, if of some logs alone."""
        return self.with_path is not None or any(row.columns["surveyed"] for row in self.rows)

    @property
    def reference(self) -> str:
        """Describes what its path is measured from where the true one is unknown."""
        return next((said for row in self.rows if (said := row.columns["reference"])), "the batch optimum")


def representative(lines: Sequence[Line]) -> Line:
    """A line that shows what is known of its dataset: the first that is done, if any is."""
    return next((line for line in lines if line.done), lines[0])


def logs(lines: Sequence[Line]) -> int:
    """Counts the different logs of one dataset's lines: a dataset without randomness has one for all seeds."""
    return units_of(lines).logs


def units_of(lines: Sequence[Line]) -> Units:
    """The units of one dataset's logs; during a run some lines have none yet."""
    return max((line.units for line in lines), key=lambda found: found.logs)


def lines(rows: Iterable[Row], implementations: Mapping[str, str] | None = None) -> list[Line]:
    """Groups a run's rows into lines, one per (dataset, backend); `implementations` by backend label."""
    made_by = implementations or {}
    groups: dict[tuple[str, str], list[Row]] = {}
    clusters: dict[str, dict[Hashable, str | None]] = {}  # by dataset and log
    paths: dict[str, dict[Hashable, str | None]] = {}  # likewise, of logs whose true path is known
    kinds: dict[str, set[str]] = {}  # by dataset
    for row in rows:
        c = row.columns
        key = label(c["dataset"], c["dataset_options"]), label(c["backend"], c["options"])
        groups.setdefault(key, []).append(row)
        clusters.setdefault(key[0], {})[c["digest"]] = c["cluster"]
        kinds.setdefault(key[0], set()).add(c["truth_kind"])
        if c["truth_kind"] == "truth":
            paths.setdefault(key[0], {})[c["digest"]] = c["cluster"]
    of = {dataset: units(by_log) for dataset, by_log in clusters.items()}
    some = {dataset: units(paths[dataset]) for dataset, found in kinds.items() if found >= {"truth", "reference"}}
    names = called([dataset for dataset, _ in groups])
    return [
        Line(
            dataset,
            backend,
            "truth" if dataset in some else members[0].columns["truth_kind"],
            members,
            _spreads(members, mixed=dataset in some),
            names[dataset],
            made_by.get(backend, ""),
            of[dataset],
            some.get(dataset),
        )
        for (dataset, backend), members in groups.items()
    ]


def _of_path(column: str) -> bool:
    return about(column).kind.is_error and column not in OF_MAPS


def _judged(rows: list[Row], column: str, *, mixed: bool) -> list[Row]:
    """The rows that a column is judged by.

    Of a dataset that is `mixed`, with a true path for some logs alone, an error of paths is that of these: on the
    others it is a distance from a reference.
    """
    return [row for row in rows if row.columns["truth_kind"] == "truth"] if mixed and _of_path(column) else rows


def _spreads(rows: list[Row], *, mixed: bool) -> dict[str, Spread]:
    spreads: dict[str, Spread] = {}
    for name in [name for name in rows[0].columns if about(name).kind.is_measured]:
        done = [row.columns for row in _judged(rows, name, mixed=mixed) if row.columns["status"] == "done"]
        values: list[Any] = [columns[name] for columns in done if columns[name] is not None]
        if values:
            spreads[name] = spread(values)
    return spreads


def spread(values: Sequence[Any]) -> Spread:
    """Summarises the values of a column, one or more."""
    ranked = sorted(values)
    return Spread(median(ranked), ranked[0], ranked[-1], len(ranked))


class Typical(NamedTuple):
    """The typical value of a column over logs."""

    value: float  # the median; infinite where half of the cells have failed
    low: float
    high: float
    n: int  # logs
    interval: bool  # low and high are the ends of a 95 % interval, else of the range


def typical(line: Line, column: str) -> Typical:
    """Computes a column's typical value; on a single log, the median and range of the runs on it."""
    by_log = line.by_log(column)
    values = list(by_log.values()) if len(by_log) > 1 else [value for _, value in line.runs(column)]
    found = line.estimate(column)
    if found.units >= FEWEST:
        return Typical(*found[:4], interval=True)
    middle = median_over(by_log, line.units) if len(by_log) > 1 else median(values)
    return Typical(middle, min(values), max(values), len(by_log), interval=False)
