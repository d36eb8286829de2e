"""The report's tables as text: a verdict and a cost table a dataset, and one of every cell."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from .definitions import COLUMNS, WORKED_OUT, Column
from .export import label
from .numerals import number, span
from .store import Row
from .summary import Line, Spread
from .verdict import belief_word, ranked

ACCURACY = (
    "ate_m", "final_ate_m", "heading_rad", "nees", "nees_inside", "map_rmse_m", "final_map_rmse_m",
    "landmarks",
)  # fmt: skip
FIT = ("j_prior", "j_odometry", "j_sightings", "j_loops", "j_final", "j_online")
INNER = ("n_eff_least", "ancestors_left", "refused_share")
COSTS = ("step_us_p50", "step_us_p95", "step_us_p99", "step_us_max", "finish_s", "cpu_s", "peak_mb")
CELLS = (
    "ate_m", "final_ate_m", "ate_origin_m", "heading_rad", "rpe_m", "nees", "nees_inside", "map_rmse_m", "cost_j",
    "step_us_p50", "step_us_p99", "cpu_s", "peak_mb",
)  # fmt: skip

WITH_RANGE = {"ate_m", "final_ate_m", "nees", "map_rmse_m", "final_map_rmse_m"}
TIMES = {"step_us_p50", "step_us_p95", "step_us_p99", "step_us_max", "finish_s", "cpu_s", "real_time"}
SECONDS = {"finish_s", "cpu_s"}
COUNTS = {"landmarks", "ancestors_left"}
PERCENT = {"nees_inside", "real_time", "refused_share"}

SHORTEST_S = 0.001
"""s; a filter's finish does nothing, and what that nothing takes is no figure."""

FROM_REFERENCE = {
    "ate_m": "online path from reference",
    "final_ate_m": "final path from reference",
    "heading_rad": "heading from reference",
    "map_rmse_m": "map from reference",
    "final_map_rmse_m": "final map from reference",
}
"""Headings where distances are not errors."""


class Entry(NamedTuple):
    """One entry of a table."""

    text: str
    word: str = ""  # what it comes to
    note: str = ""  # smaller, after it
    best: bool = False


class TableRow(NamedTuple):
    """A backend's entries, one a heading."""

    backend: str
    entries: Sequence[Entry]
    status: str = "done"
    place: Sequence[str] = ()  # path of the cell's folder


class Table(NamedTuple):
    """Ready to be set; a column in which nobody has a value is left out."""

    headings: Sequence[Column]
    rows: Sequence[TableRow]


def accuracy_table(lines: Sequence[Line]) -> Table:
    """How good: medians, ranges where there are several seeds, and the best path marked where there is a truth."""
    best = {
        name: order[0]
        for name in ("ate_m", "final_ate_m")
        if lines[0].truth_kind == "truth" and len(order := ranked(lines, name)) > 1
    }

    def entry(line: Line, name: str) -> Entry:
        if name not in line.values:
            return Entry("")
        value = line.values[name]
        word = belief_word(line) if name == "nees" else ""
        note = span(value) if name in WITH_RANGE else ""
        return Entry(_text(name, value), word, note, best.get(name) is line)

    return _table(lines, ACCURACY, entry, _from_reference(lines))


def _from_reference(lines: Sequence[Line]) -> Mapping[str, str]:
    """Headings that are other ones where distances are not errors."""
    if lines[0].truth_kind != "reference":
        return {}
    kept = {"map_rmse_m", "final_map_rmse_m"} if lines[0].surveyed else set[str]()
    return {name: heading for name, heading in FROM_REFERENCE.items() if name not in kept}


def cost_table(lines: Sequence[Line], lengths: Mapping[int, float | None]) -> Table:
    """What it costs: medians; a time is marked * where other cells ran beside any of the line's."""

    def entry(line: Line, name: str) -> Entry:
        value = _real_time(line, lengths) if name == "real_time" else line.values.get(name)
        if value is None:
            return Entry("")
        return Entry(_text(name, value) + "*" * (name in TIMES and not line.alone))

    return _table(lines, (*COSTS[:4], "real_time", *COSTS[4:]), entry, {})


def fit_table(lines: Sequence[Line]) -> Table:
    """J and what it is made of: medians, and the least of all marked."""
    totals = [(line.values[name].median, line) for line in lines for name in FIT[-2:] if name in line.values]
    least = min(totals, key=lambda total: total[0])[1] if len(totals) > 1 else None

    def entry(line: Line, name: str) -> Entry:
        if name not in line.values:
            return Entry("")
        return Entry(_text(name, line.values[name]), best=name in FIT[-2:] and line is least)

    return _table([line for _, line in totals], FIT, entry, {})


def inner_table(lines: Sequence[Line]) -> Table:
    """What goes on inside the estimators that tell: those of particles, and those that gate."""
    telling = [line for line in lines if any(name in line.values for name in INNER)]

    def entry(line: Line, name: str) -> Entry:
        return Entry(_text(name, line.values[name])) if name in line.values else Entry("")

    return _table(telling, INNER, entry, {})


def cells_table(rows: Sequence[Row], folders: Mapping[str, str]) -> Table:
    """Every cell by itself; what is not done has a status and no numbers."""
    names = [name for name in CELLS if any(row.columns[name] is not None for row in rows)]
    found: list[TableRow] = []
    for row in rows:
        c = row.columns
        dataset, backend = label(c["dataset"], c["dataset_options"]), label(c["backend"], c["options"])
        marks = ["*" * (name in TIMES and not c["timing_alone"]) for name in names]
        entries = [
            Entry(dataset),
            Entry(str(c["seed"])),
            Entry(c["status"]),
            *(Entry("" if c[name] is None else _one(name, c[name]) + m) for name, m in zip(names, marks, strict=True)),
        ]
        place = (folders[dataset], str(c["seed"]), folders[backend]) if c["status"] == "done" else ()
        found.append(TableRow(backend, entries, c["status"], place))
    return Table([COLUMNS[name] for name in ("dataset", "seed", "status", *names)], found)


def _table(
    lines: Sequence[Line], names: Sequence[str], entry: Callable[[Line, str], Entry], headings: Mapping[str, str]
) -> Table:
    columns = [[entry(line, name) for line in lines] for name in names]
    kept = [(name, column) for name, column in zip(names, columns, strict=True) if any(e.text for e in column)]
    about = COLUMNS | WORKED_OUT
    return Table(
        [
            WORKED_OUT["done"],
            *(about[name]._replace(heading=headings.get(name, about[name].heading)) for name, _ in kept),
        ],
        [
            TableRow(
                line.backend,
                [
                    Entry(f"{line.done}/{len(line.rows)}", "told the truth" if line.told else ""),
                    *(column[k] for _, column in kept),
                ],
                "done" if line.done == len(line.rows) else "some failed",
            )
            for k, line in enumerate(lines)
        ],
    )


def _real_time(line: Line, lengths: Mapping[int, float | None]) -> Spread | None:
    """Share of the log's time that its steps take; None where no seed has both."""
    shares: list[float] = []
    for row in line.rows:
        c, length = row.columns, lengths.get(row.columns["seed"])
        if c["status"] == "done" and c["step_us_mean"] is not None and length:
            shares.append(1e-6 * c["step_us_mean"] * c["steps"] / length)
    if not shares:
        return None
    shares.sort()
    middle = (shares[(len(shares) - 1) // 2] + shares[len(shares) // 2]) / 2
    return Spread(middle, shares[0], shares[-1], len(shares))


def _text(name: str, value: Spread) -> str:
    return _one(name, value.median)


def _one(name: str, value: Any) -> str:
    if name in PERCENT:
        return f"{number(100 * value)} %"
    if name in SECONDS and value < SHORTEST_S:
        return f"<{SHORTEST_S:g}"
    return f"{value:,.0f}" if name in COUNTS else number(value)
