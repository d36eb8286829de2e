"""Computes a study's figure: the median and its interval at every x, for every value of `by`."""

from collections.abc import Hashable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ...core.se2 import Array
from ..record.cell_table import CellTable
from ..record.schema import FAILED
from ..study.study import Figure
from ..verdict.statistics import FEWEST, estimate
from ..verdict.units import units
from ..words.columns import about
from ..words.names import called, tags

MANY = 400  # values beyond which an interval's exact ends are the normal ones, and slow to compute


class Place(NamedTuple):
    """The cells of one point of a figure."""

    x: Any
    by: Any
    value: float  # the median; NaN without any value, infinite where half of the cells have failed
    low: float  # the ends of its 95 % interval, of the range below FEWEST values
    high: float
    values: Array  # (n,) sorted; a cell that failed is infinite, where the measure is an error
    failed: int
    waiting: int

    @property
    def n(self) -> int:
        """Counts the cells that the median is over."""
        return len(self.values)

    @property
    def ended(self) -> int:
        """Counts the cells that have a value or have failed."""
        return int(np.isfinite(self.values).sum()) + self.failed


class Medians(NamedTuple):
    """A figure's numbers, in its order."""

    figure: Figure
    xs: Sequence[Any]  # rising where they are numbers, else as the study has them; None last
    bys: Sequence[Any]
    places: Mapping[tuple[Any, Any], Place]  # by (x, by); those that no cell belongs to are absent
    called: Mapping[Any, str]  # of each of `bys`, its name
    without: str  # the backends that have no value of x

    @property
    def numeric(self) -> bool:
        """True where x is a number, so that there are lines."""
        return self.figure.x != self.figure.by and _numbers(self.xs)

    @property
    def ordered(self) -> bool:
        """True where `by` is a number."""
        return _numbers(self.bys)

    def line(self, by: Any) -> list[Place]:
        """The places of one value of `by`, by x."""
        return [self.places[x, by] for x in self.xs if (x, by) in self.places]


def medians(figure: Figure, table: CellTable) -> Medians:
    """Computes the figure's numbers."""
    rows = table.rows(figure.where) if figure.where else slice(None)
    xs, at = _coded(table.columns[figure.x][rows])
    bys, line = _coded(table.columns[figure.by][rows])
    status = table.columns["status"][rows]
    values = table.columns[figure.y][rows].astype(float)
    failed, waiting = np.logical_or.reduce([status == one for one in FAILED]), status == "waiting"
    values[failed] = np.inf if about(figure.y).kind.is_error else np.nan
    group = at * len(bys) + line
    order = np.argsort(group, kind="stable")
    starts = np.flatnonzero(np.diff(group[order], prepend=-1))
    of = _units(table, rows)
    places: dict[tuple[Any, Any], Place] = {}
    for members in np.split(order, starts[1:]) if len(order) else ():
        x, by = xs[at[members[0]]], bys[line[members[0]]]
        having = values[members]
        there = ~np.isnan(having)
        known, own = np.sort(having[there]), _typical(having[there], [of[place] for place in members[there]])
        counts = int(failed[members].sum()), int(waiting[members].sum())
        places[x, by] = Place(x, by, *own, known, *counts)
    return Medians(
        figure, _sorted(xs), _sorted(bys), places, _called(figure, table, bys), _lacking(figure.x, figure, table)
    )


def _units(table: CellTable, rows: Any) -> list[Hashable]:
    """The unit of each of the rows' cells: the cluster of its log, else the cell by itself."""
    clusters = table.columns.get("cluster")
    stated = [] if clusters is None else clusters[rows].tolist()
    found = units(dict(enumerate(stated)))
    return [found.unit(place) for place in range(len(table.columns["status"][rows]))]


def _typical(values: Array, of: Sequence[Hashable]) -> tuple[float, float, float]:
    if not len(values):
        return np.nan, np.nan, np.nan
    if len(values) > MANY and len(set(of)) == len(of):
        return _of_many(np.sort(values))
    found = estimate(values.tolist(), of)
    if found.units >= FEWEST:
        return found.value, found.low, found.high
    return found.value, float(values.min()), float(values.max())


def _of_many(sorted_: Array) -> tuple[float, float, float]:
    """Computes it by the binomial's normal limit: the order statistics 1.96 sqrt(n) / 2 from the middle."""
    n = len(sorted_)
    off = 1.96 * np.sqrt(n) / 2
    middle, low, high = (float(sorted_[round(place)]) for place in ((n - 1) / 2, n / 2 - off - 1, n / 2 + off))
    return middle, low, high


def _coded(values: Any) -> tuple[list[Any], Any]:
    """Each value once, and (n,) its index."""
    found = values.tolist()
    codes = {value: code for code, value in enumerate(dict.fromkeys(found))}
    return list(codes), np.fromiter(map(codes.__getitem__, found), np.intp, len(found))


def _numbers(values: Sequence[Any]) -> bool:
    known = [value for value in values if value is not None]
    return len(known) > 0 and all(isinstance(value, int | float) and not isinstance(value, bool) for value in known)


def _sorted(values: list[Any]) -> list[Any]:
    known = [value for value in values if value is not None]
    return (sorted(known) if _numbers(known) else known) + [None] * (len(known) < len(values))


def _called(figure: Figure, table: CellTable, bys: Sequence[Any]) -> dict[Any, str]:
    """Names the values of `by`; cells without any by their backends."""
    found = names(figure.by, bys)
    if None in found:
        found[None] = _lacking(figure.by, figure, table)
    return found


def names(parameter: str, values: Iterable[Any]) -> dict[Any, str]:
    """Names a parameter's values: words are by themselves, datasets and backends as short as they stay distinct."""
    if parameter in ("dataset", "backend"):
        found = called([str(value) for value in values])
        tag = tags(found.values())
        return {label: tag[name].removesuffix("[]") for label, name in found.items()}
    words = parameter.rpartition(".")[2].replace("_", " ")
    return {value: worded(value) if isinstance(value, str) else f"{words} {worded(value)}" for value in values}


def _lacking(parameter: str, figure: Figure, table: CellTable) -> str:
    """Lists the backends that have no value of the parameter."""
    rows = table.rows(figure.where)
    backends = table.values("backend", rows[table.columns[parameter][rows] == None])  # noqa: E711 - of each element
    return ", ".join(names("backend", backends).values())


def worded(value: Any) -> str:
    """Writes a parameter's value for readers."""
    if value is None:
        return "\N{EN DASH}"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:,}" if isinstance(value, int) else f"{value:g}" if isinstance(value, float) else str(value)
