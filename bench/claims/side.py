"""One side of a claim: the cells it selects, and their values of its measure on every log."""

from collections.abc import Hashable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.se2 import Array, Ints
from ..record.cell_table import CellTable
from ..record.schema import FAILED
from ..verdict.ranking import ROUNDING
from ..verdict.units import INDEPENDENT, Units, units
from ..words.columns import about
from ..words.numerals import listed

Rows = NDArray[np.intp]
Bools = NDArray[np.bool_]

NO_PARAMETERS = frozenset(
    ("status", "reason", "digest", "cluster", "host", "executor")
)  # columns of words, not parameters
SHOWN = 6  # values that a sentence has room for


class Untestable(Exception):
    """A claim that no result could answer, or that these cannot; its text is the reason."""


class Side(NamedTuple):
    """The values of one side's cells on k logs, for m values of the parameter that a claim goes along, or for one."""

    measure: str
    along: list[Any]  # (m,) rising; [None] where a claim goes along nothing, or no cell has what it goes along
    logs: Ints  # (k,) numbers, the same on both sides of a claim
    units: tuple[Hashable, ...]  # (k,) of these logs: the same where they are of one cluster of several
    values: Array  # (k, m) infinite where an error's cell failed, NaN where a cell failed of what is no error
    present: Bools  # (k, m) where there is a value, or a cell has failed
    cells: int
    waiting: int
    failed: int
    skipped: int
    undefined: int  # done, without a value
    beside: int  # with others running on their machine meanwhile
    within: float  # standard error of the value on a single log, NaN where it has none
    why: str  # the reason of the skipped ones, where all have the same

    @property
    def unknown(self) -> int:
        """Counts the cells that failed and might have had any value."""
        return 0 if about(self.measure).kind.is_error else self.failed

    def complete(self) -> "Side":
        """Keeps the logs that have all that any log has, and the values of `along` that some log has."""
        some = self.present.any(axis=0)
        whole = self.present[:, some].all(axis=1)
        along = [self.along[place] for place in np.flatnonzero(some)]
        kept = np.ix_(whole, some)
        units = tuple(self.units[place] for place in np.flatnonzero(whole))
        return self._replace(
            along=along, logs=self.logs[whole], units=units, values=self.values[kept], present=self.present[kept]
        )


class Pairs(NamedTuple):
    """The values of two sides on the logs that both ran on."""

    along: list[Any]  # (m,)
    first: Array  # (k, m)
    second: Array
    units: tuple[Hashable, ...]  # (k,)
    lost: int  # other logs of either side


def pairs(first: Side, second: Side) -> Pairs:
    """Pairs two sides by logs and values; one without `along` is constant. Untestable for negative values."""
    one, other = first.complete(), second.complete()
    along = one.along if other.along == [None] else other.along
    if None not in (*one.along, *other.along):
        along = [x for x in one.along if x in other.along]
    logs, rows, others = np.intersect1d(one.logs, other.logs, return_indices=True)
    lost = len(np.union1d(first.logs, second.logs)) - len(logs)
    a, b = (_columns(side, along)[place] for side, place in ((one, rows), (other, others)))
    for side, values in ((one, a), (other, b)):
        if (values < 0).any():
            raise Untestable(
                f"{side.measure} has negative values, such as {np.nanmin(values):.3g}, which have no ratio"
            )
    return Pairs(along, a, b, tuple(one.units[row] for row in rows), lost)


def _columns(side: Side, along: list[Any]) -> Array:
    if side.along == along:
        return side.values
    return side.values[:, [0] * len(along) if side.along == [None] else [side.along.index(x) for x in along]]


def standard_error(measure: str) -> str:
    """Names the column with the standard error of the measure, a mean over a log; "" without one."""
    name = measure.replace("relation_", "relation_se_")
    return name if measure.removeprefix("final_") in ("relation_m", "relation_deg") else ""


def parameters(table: CellTable) -> list[str]:
    """Lists the names of its cells' parameters."""
    return [name for name, column in table.columns.items() if column.dtype == object and name not in NO_PARAMETERS]


def selected(table: CellTable, own: Mapping[str, Any], where: Mapping[str, Any]) -> Rows:
    """Selects rows by a side's own values, and those of `where` that its cells have; Untestable without any."""
    names = parameters(table)
    wanted = {name: value for name, value in own.items() if name != "measure"}
    for name in (*wanted, *where):
        if name not in names:
            raise Untestable(f"the study has no parameter {name}, but {listed(names)}")
    rows = table.rows(wanted)
    for name, value in where.items():
        column = table.columns[name][rows]
        mine = column == value
        if not mine.any() and all(other is None for other in column.tolist()):
            continue
        rows = rows[mine]
    if not len(rows):
        both = ", ".join(f"{name} = {value}" for name, value in (wanted | dict(where)).items())
        raise Untestable(f"no cell of the study has {both}")
    return rows


def numbered(table: CellTable, sides: Sequence[Rows], along: str) -> Ints:
    """Numbers the log of each of the table's rows, (n,); -1 for those of no side.

    A log is identified by its seed; of a dataset without randomness all seeds are one log, by its digest. Datasets may
    be several where each is a single log, known once it has run, and then count as logs. Untestable where a side is not
    one configuration.
    """
    rows = np.unique(np.concatenate(sides))
    seeds = table.columns["seed"][rows].tolist()
    digests: list[str | None] = [None] * len(rows)
    if "digest" in table.columns:
        digests = table.columns["digest"][rows].tolist()
    first: dict[str | None, int] = {}  # the first seed of a log
    for digest, seed in zip(digests, seeds, strict=True):
        if digest is not None:
            first[digest] = min(seed, first.get(digest, seed))
    seeds = [first.get(digest, seed) for digest, seed in zip(digests, seeds, strict=True)]
    keys: list[Hashable] = [*seeds]
    if any(_several(table, side, along) for side in sides):
        datasets = table.columns["dataset"][rows].tolist()
        keys = list(zip(datasets, seeds, strict=True))
        ran = {key for key, digest in zip(keys, digests, strict=True) if digest is not None}
        if len(ran) > len(set(datasets)):
            raise Untestable(_ambiguous("dataset", list(dict.fromkeys(datasets))))
    known: dict[Hashable, int] = {}
    numbers = np.full(len(table), -1)
    numbers[rows] = [known.setdefault(key, len(known)) for key in keys]
    return numbers


def units_of(table: CellTable, logs: Ints) -> Units:
    """Finds the units of the logs that `numbered` numbers, (n,), from the clusters that they are stated to be of."""
    clusters = table.columns.get("cluster")
    rows = np.flatnonzero(logs >= 0)
    stated = [None] * len(rows) if clusters is None else clusters[rows].tolist()
    return units(dict(zip(logs[rows].tolist(), stated, strict=True)))


def _several(table: CellTable, rows: Rows, along: str) -> bool:
    """True if a side has several datasets; Untestable where it has several values of another parameter."""
    several = False
    for name in parameters(table):
        if name in ("seed", along):
            continue
        values = table.values(name, rows)
        if len(values) > 1 and name == "dataset":
            several = True
        elif len(values) > 1:
            raise Untestable(_ambiguous(name, values))
    return several


def _ambiguous(name: str, values: Sequence[Any]) -> str:
    shown = [str(value) for value in values[:SHOWN]] + ["others"] * (len(values) > SHOWN)
    return f"a side has cells with {name} = {listed(shown)}; expected one value, by a side's own {name}, where or each"


def side(table: CellTable, measure: str, rows: Rows, logs: Ints, along: str, of: Units = INDEPENDENT) -> Side:
    """Collects the rows' values of the measure; `logs` (n,) as from `numbered`, `of` their units.

    Several cells on one log, of a random backend, are averaged. Untestable unless `along` is a number above 0 in all of
    them, or in none.
    """
    status = table.columns["status"][rows]
    value = table.columns[measure][rows].astype(float)
    failed = np.zeros(len(rows), bool)
    for name in FAILED:
        failed |= status == name
    if about(measure).kind.is_error:
        value = np.maximum(value, ROUNDING)
        value[failed] = np.inf
    else:
        value[failed] = np.nan
    done = status == "done"
    present = failed | (done & ~np.isnan(value))
    xs, column = _along(table.columns[along][rows].tolist(), along) if along else ([None], np.zeros(len(rows), int))
    own, line = np.unique(logs[rows], return_inverse=True)
    shape = len(own), len(xs)
    place = np.ravel_multi_index((line, column), shape)[present]
    count = np.bincount(place, minlength=len(own) * len(xs))
    total = np.bincount(place, value[present], minlength=len(own) * len(xs))
    with np.errstate(invalid="ignore"):
        mean = total / count
    beside, spread = table.columns.get("timing_alone"), table.columns.get(standard_error(measure))
    within = float(spread[rows][done].mean()) if spread is not None and mean.size == 1 and done.any() else np.nan
    skipped = status == "skipped"
    reasons = set(table.columns["reason"][rows][skipped].tolist()) if skipped.any() else set[str]()
    return Side(
        measure, xs, own, tuple(map(of.unit, own.tolist())), mean.reshape(shape), (count > 0).reshape(shape),
        len(rows), int((status == "waiting").sum()),
        int(failed.sum()), int(skipped.sum()), int((done & ~present).sum()),
        0 if beside is None else int((beside[rows] == 0).sum()),
        within, reasons.pop() if len(reasons) == 1 else "",
    )  # fmt: skip


def _along(values: list[Any], name: str) -> tuple[list[Any], Rows]:
    """The values of a parameter, rising, and each row's index; [None] where no row has the parameter."""
    known = set(values)
    if known == {None}:
        return [None], np.zeros(len(values), int)
    wrong = [x for x in known if isinstance(x, bool) or not isinstance(x, int | float) or x <= 0]
    if wrong:
        raise Untestable(f"{name} = {wrong[0]} among its cells; expected numbers above 0")
    xs = sorted(known)
    at = {x: k for k, x in enumerate(xs)}
    return xs, np.array([at[x] for x in values])
