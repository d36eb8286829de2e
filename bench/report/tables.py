"""Makes the report's tables: a small one of the main results, detailed ones, and one of every cell."""

from collections.abc import Callable, Mapping, Sequence
from math import isnan

from ..drawing.table import Entry, Table, TableRow
from ..measure.repeats import COMPARED, FEWEST_ROUNDS
from ..record.schema import Row, label
from ..verdict.consistency import belief_word
from ..verdict.cost_words import ends_of, slope
from ..verdict.costs import cost, rounds
from ..verdict.ranking import PATHS, RELATIONS, ordered, ranking, standing
from ..verdict.statistics import FEWEST
from ..verdict.summary import Line, Typical, representative, typical, units_of
from ..words.columns import DEADLINES_MS, about
from ..words.names import called
from ..words.numerals import number

SLOPES = ("slope_mapping", "slope_steps")
WHOSE = "implementation"  # the column of words before those of numbers wherever costs are compared

MAIN = (
    WHOSE, "ate_m", "final_ate_m", "relation_m", "relation_deg", "final_relation_m", "final_relation_deg", "nees",
    "map_rmse_m", "final_map_rmse_m", "step_us_p50", "step_us_p99", "cpu_s",
)  # fmt: skip
ONLINE = (
    "relation_sd_m", "relation_max_m", "relation_sd_deg", "relation_max_deg",
    "bound_m", "over_bound", "ate_origin_m", "bound_origin_m", "ate_median_m", "heading_rad", "rpe_m", "rpe_10m_m",
    "rpe_100m_m", "rpe_1s_m", "rpe_10s_m",
    "rpe_rad", "nees_inside", "nis", "landmark_nees", "landmark_nees_inside", "landmarks", "landmarks_missed",
    "landmarks_spurious",
)  # fmt: skip
FINAL = (
    "final_relation_sd_m", "final_relation_max_m", "final_relation_sd_deg", "final_relation_max_deg",
    "final_bound_m", "final_over_bound", "final_ate_origin_m", "final_bound_origin_m", "final_ate_median_m",
    "final_heading_rad", "final_rpe_m", "final_rpe_10m_m",
    "final_rpe_100m_m", "final_rpe_1s_m", "final_rpe_10s_m", "final_rpe_rad", "final_nees", "final_nees_inside",
    "final_landmark_nees", "final_landmark_nees_inside", "final_landmarks_missed", "final_landmarks_spurious",
)  # fmt: skip
OVER = tuple(f"over_{ms}ms" for ms in DEADLINES_MS)
COST = (
    WHOSE, "step_us_mean", "step_us_p50", "step_us_p95", "step_us_p99", "step_us_max", *OVER, "belief_us_mean",
    "setup_s", "finish_s", "cpu_s", "peak_mb",
)  # fmt: skip
MEANWHILE = ("repeats", "work_us", "waited_share", "switches", "others_share", "stolen_share", "load", "clock_mhz")
GROWTH = (
    WHOSE, *(f"step_us_fifth{k}" for k in range(1, 6)), "last_over_first", "last_over_whole", "slope_mapping",
    "slope_steps", "growth_steps", "growth_landmarks", "real_time", "late_share",
)  # fmt: skip
ASSOCIATION = (
    "pair_precision", "pair_recall", "wrong_share", "dropped_share", "landmarks_merged", "landmarks_double",
    "landmarks_clutter", "final_pair_precision", "final_pair_recall", "final_wrong_share", "associate_us_p50",
    "associate_us_p99", "nodes_max", "moved_out", "moved_found", "moved_false", "misread_share",
)  # fmt: skip
FIT = ("j_prior", "j_odometry", "j_sightings", "j_loops", "j_final", "j_online")
LOOPS = ("loops_rejected", "loop_precision", "loop_recall")
INNER = ("n_eff_least", "ancestors_left", "refused_share")
PAPER = ("ate_m", "final_ate_m", "nees", "cpu_s")
PAPER_RELATIONS = ("relation_m", "relation_deg", "final_relation_m", "final_relation_deg", "cpu_s")
PAPER_MAPS = ("ate_m", "final_ate_m", "map_rmse_m", "final_map_rmse_m", "cpu_s")
CELLS = (
    "ate_m", "final_ate_m", "relation_m", "relation_deg", "final_relation_m", "final_relation_deg",
    "ate_origin_m", "heading_rad", "rpe_m", "nees", "nees_inside", "map_rmse_m", "cost_j",
    "step_us_p50", "step_us_p99", "cpu_s", "peak_mb",
)  # fmt: skip

WITH_ENDS = {*PATHS.values(), *RELATIONS.values(), "nees", "map_rmse_m", "final_map_rmse_m"}  # with an interval

FROM_REFERENCE = {
    "ate_m": "online path from reference",
    "final_ate_m": "final path from reference",
    "heading_rad": "heading from reference",
    "map_rmse_m": "map from reference",
    "final_map_rmse_m": "final map from reference",
}
"""headings where distances are not errors"""


def accuracy_table(lines: Sequence[Line]) -> Table:
    """Makes the small table: accuracy, consistency, cost. The best are marked where that is tested."""
    known = representative(lines)
    kept = {"map_rmse_m", "final_map_rmse_m"} if known.surveyed else set[str]()
    reference = known.truth_kind == "reference"
    headings = {name: text for name, text in FROM_REFERENCE.items() if reference and name not in kept}
    tested = WITH_ENDS - {"nees"} if known.truth_kind in ("truth", "relations") else kept
    best = {name: _best(lines, name) for name in tested}

    def entry(line: Line, name: str) -> Entry:
        word = belief_word(line) if name == "nees" else ""
        if name not in line.values:
            return _words(line, name)._replace(word=word)
        found = typical(line, name)
        note = _ends(found, units_of(lines).n) if name in WITH_ENDS else ""
        return Entry(
            shown(name, found.value, alone=line.alone), word, note, line.backend in best.get(name, ()), found.value
        )

    names = MAIN if known.truth_kind else ("landmarks", *MAIN)
    table = laid(ordered(lines), names, entry, "", headings)
    bold = any(e.best for row in table.rows for e in row.entries)
    return table._replace(
        caption=f"{_basis(lines)}{'; bold: none is significantly more accurate' * bold}{_marks(lines)}"
    )


def paper_table(main: Table) -> Table:
    """Makes the small table for a column of a paper; counts of cells only where some are not done."""
    names = [column.name for column in main.headings]
    wanted = PAPER_RELATIONS if set(RELATIONS.values()) & {*names} else PAPER if "nees" in names else PAPER_MAPS
    kept = [k for k, name in enumerate(names) if name in wanted]
    kept = [0] * any(row.status != "done" for row in main.rows) + kept
    rows = [row._replace(entries=[row.entries[k] for k in kept]) for row in main.rows]
    return Table([main.headings[k] for k in kept], rows, main.caption)


def details_tables(lines: Sequence[Line]) -> list[Table]:
    """Makes tables of what the small one leaves out, of online and final path and map; medians."""
    return [
        laid(having, names, _median, f"{what} in detail: {_basis(lines, ends=False)}")
        for what, names in (
            ("Data association", ASSOCIATION),
            ("Online path and map", ONLINE),
            ("Path and map smoothed at the end", FINAL),
            ("Rejected loop closures", LOOPS),
        )
        if (having := _having(lines, names))
    ]


def cost_table(lines: Sequence[Line]) -> Table:
    """Makes the table of costs of a step and of the log: medians; * where other cells ran at the same time.

    Where no step of any backend is above a deadline, longer ones are left out.
    """
    above = [any(line.values[name].high > 0 for line in lines if name in line.values) for name in OVER]
    empty = set(OVER[above.index(False) + 1 :]) if False in above else set[str]()
    n = max(map(rounds, lines), default=1)
    which = "times" if all(rounds(line) == n for line in lines) else "times with an interval"
    repeated = f"; {which} are medians of {n} rounds, intervals those of the machine as it was" * (n >= FEWEST_ROUNDS)

    def entry(line: Line, name: str) -> Entry:
        found = cost(line, name) if name in COMPARED else None
        ends = "" if found is None or isnan(found.low) else f"{number(found.low)}\N{EN DASH}{number(found.high)}"
        return _median(line, name)._replace(note=ends)

    caption = f"Cost of a step and of the whole log: {_basis(lines, ends=False)}{repeated}{_marks(lines)}"
    return laid(ordered(lines), [name for name in COST if name not in empty], entry, caption)


def meanwhile_table(lines: Sequence[Line]) -> Table:
    """Makes the table of what the machine did while each backend was timed: medians; nothing without it."""
    having = [line for line in ordered(lines) if "work_us" in line.values]
    return laid(having, MEANWHILE, _median, "The machine while a backend was timed, medians over cells and rounds")


def growth_table(lines: Sequence[Line]) -> Table:
    """Makes the table of costs along the log: growth, and real time; slopes with intervals, powers with errors."""

    def entry(line: Line, name: str) -> Entry:
        error, found = line.values.get(f"{name}_se"), slope(line, name) if name in SLOPES else None
        note = "" if error is None else f"\N{PLUS-MINUS SIGN}{error.median:.2f}"
        return _median(line, name)._replace(note=note if found is None else ends_of(found))

    caption = f"How the cost of a step grows along the log: {_basis(lines, ends=False)}{_marks(lines)}"
    return laid(ordered(lines), GROWTH, entry, caption)


def fit_table(lines: Sequence[Line]) -> Table:
    """Makes the table of J by its terms: medians, and the least of all marked."""
    totals = {line.backend: line.values[name].median for line in lines for name in FIT[-2:] if name in line.values}
    least = min(totals, key=lambda name: totals[name]) if len(totals) > 1 else ""

    def entry(line: Line, name: str) -> Entry:
        return _median(line, name)._replace(best=name in FIT[-2:] and name in line.values and line.backend == least)

    having = [line for line in ordered(lines) if line.backend in totals]
    return laid(
        having,
        FIT,
        entry,
        f"J, the misfit to all factors, by its parts: {_basis(lines, ends=False)}, the least in bold",
    )


def inner_table(lines: Sequence[Line]) -> Table:
    """Makes the table of particles and gates."""
    return laid(_having(lines, INNER), INNER, _median, f"Particles and gates: {_basis(lines, ends=False)}")


def cells_table(rows: Sequence[Row], folders: Mapping[str, str]) -> Table:
    """Makes the table of every cell; one that is not done has a status and no numbers."""
    names = [name for name in CELLS if any(row.columns[name] is not None for row in rows)]
    datasets = called([label(row.columns["dataset"], row.columns["dataset_options"]) for row in rows])
    found: list[TableRow] = []
    for row in rows:
        c = row.columns
        dataset, backend = label(c["dataset"], c["dataset_options"]), label(c["backend"], c["options"])
        entries = [
            Entry(datasets[dataset]),
            Entry(str(c["seed"]), value=c["seed"]),
            Entry(c["status"]),
            *(
                Entry("" if c[name] is None else shown(name, c[name], alone=c["timing_alone"]), value=c[name])
                for name in names
            ),
        ]
        place = (folders[dataset], str(c["seed"]), folders[backend]) if c["status"] == "done" else ()
        found.append(TableRow(backend, entries, c["status"], place))
    return Table([about(name) for name in ("dataset", "seed", "status", *names)], found, "Every cell by itself")


def laid(
    lines: Sequence[Line],
    names: Sequence[str],
    entry: Callable[[Line, str], Entry],
    caption: str,
    headings: Mapping[str, str] | None = None,
) -> Table:
    """Makes a table, one row per line and one column per name with any entry; `headings` replace the usual ones."""
    other = headings or {}
    columns = [[entry(line, name) for line in lines] for name in names]
    kept = [
        (name, column) for name, column in zip(names, columns, strict=True) if any(e.text or e.word for e in column)
    ]
    kept = kept if any(name != WHOSE for name, _ in kept) else []
    top = [about(name)._replace(heading=other.get(name, about(name).heading)) for name, _ in kept]
    return Table([about("done"), *top], [_row(line, [c[k] for _, c in kept]) for k, line in enumerate(lines)], caption)


def _row(line: Line, entries: Sequence[Entry]) -> TableRow:
    done = Entry(f"{line.done}/{len(line.rows)}", "given the ground truth" if line.told else "", value=line.done)
    return TableRow(line.backend, [done, *entries], "done" if line.done == len(line.rows) else "some failed")


def _best(lines: Sequence[Line], name: str) -> list[str]:
    """Lists those that are not significantly beaten; [] where nothing is tested or none is beaten."""
    found = ranking(lines, name)
    if found is None or found.units.n < FEWEST:
        return []
    beaten = {c.second for c in found.comparisons if c.first == found.lines[0].backend and standing(c) == "better"}
    return [line.backend for line in found.lines if line.backend not in beaten] if beaten else []


def _having(lines: Sequence[Line], names: Sequence[str]) -> list[Line]:
    return [line for line in ordered(lines) if any(name in line.values for name in names)]


def _words(line: Line, name: str) -> Entry:
    return Entry(line.implementation if name == WHOSE else "")


def _median(line: Line, name: str) -> Entry:
    word = belief_word(line, name) if name == "final_nees" else ""
    if name not in line.values:
        return _words(line, name)._replace(word=word)
    found = typical(line, name)
    return Entry(shown(name, found.value, alone=line.alone), word, value=found.value)


def shown(name: str, value: float, *, alone: bool) -> str:
    """Writes a column's value; a time is marked where other cells ran at the same time."""
    kind = about(name).kind
    return kind.shown(value) + "*" * (kind.is_time and not alone)


def _ends(found: Typical, of: int) -> str:
    """Writes the interval, or the range; the caption says which, if most logs are there."""
    word = "range " if of >= FEWEST and not found.interval else ""
    return "" if found.low == found.high else f"{word}{number(found.low)}\N{EN DASH}{number(found.high)}"


def _basis(lines: Sequence[Line], *, ends: bool = True) -> str:
    of = units_of(lines)
    if of.logs == 1:
        runs = max(len(line.rows) for line in lines)
        if runs == 1:
            return "one run on one log"
        return f"one log; of the {runs} runs of a backend that draws at random, medians{' and ranges' * ends}"
    if not ends:
        return f"medians over {of}"
    what = "95 % intervals" if of.n >= FEWEST else "their range, as there are too few for intervals"
    return f"medians over {of} and {what}"


def _marks(lines: Sequence[Line]) -> str:
    failed = "; a failure counts as ∞" * any(line.failed and line.done for line in lines)
    return failed + "; * timed while other cells ran beside it" * (not all(line.alone for line in lines))
