"""The report's tables, and what of them goes into a paper."""

import re
from typing import Any

import pytest

from slamduel.bench.drawing.latex import escaped, latex
from slamduel.bench.drawing.table import Entry, Table, TableRow
from slamduel.bench.record.schema import COLUMNS, MORE, Row
from slamduel.bench.report.pair_tables import pairs_table
from slamduel.bench.report.tables import (
    accuracy_table,
    cells_table,
    cost_table,
    details_tables,
    fit_table,
    growth_table,
    inner_table,
    paper_table,
)
from slamduel.bench.verdict.summary import Line, lines
from slamduel.bench.verdict.verdict import verdict
from slamduel.bench.words.column import ERROR_M, TEXT, Column

LOGS = [0.1 * 1.1**k for k in range(20)]


def of(*backends: dict[str, Any]) -> list[Line]:
    """A line a backend; values are of all its cells, or a list of one each."""
    rows: list[Row] = []
    for about in backends:
        n = max(len(value) for value in about.values() if isinstance(value, list))
        for k in range(n):
            row: dict[str, Any] = dict.fromkeys((*COLUMNS, *MORE))
            row |= {"dataset": "room", "dataset_options": "", "options": "", "truth_kind": "truth", "seed": k}
            row |= {"status": "done", "reason": "", "timing_alone": 1, "digest": f"d{k}"}
            row |= {name: value[k] if isinstance(value, list) else value for name, value in about.items()}
            if row["status"] != "done":
                row |= dict.fromkeys(("ate_m", "final_ate_m", "nees", "cpu_s"))
            rows.append(Row(row, ""))
    return lines(rows)


def at(table: Table, backend: str, heading: str) -> Entry:
    """One entry."""
    k = [column.heading for column in table.headings].index(heading)
    return next(row for row in table.rows if row.backend == backend).entries[k]


def twice(errors: list[float], times: float) -> list[float]:
    return [times * error for error in errors]


def test_medians_have_intervals_where_there_are_logs_enough_and_ranges_where_not() -> None:
    entry = at(found := accuracy_table(of({"backend": "a", "ate_m": LOGS})), "a", "ATE online")
    assert found.caption == "medians over 20 logs and 95 % intervals"
    low, high = map(float, entry.note.split("\N{EN DASH}"))
    assert LOGS[4] < low < LOGS[9] < (entry.value or 0) < LOGS[10] < high < LOGS[15]
    few = accuracy_table(of({"backend": "a", "ate_m": [0.1, 0.2, 0.4]}))
    assert "range" in few.caption
    assert at(few, "a", "ATE online") == Entry("0.200", "", "0.100\N{EN DASH}0.400", value=0.2)
    assert at(accuracy_table(of({"backend": "a", "ate_m": [0.1]})), "a", "ATE online").note == ""


def test_a_failure_is_in_the_median_and_in_the_interval() -> None:
    status = ["diverged"] * 7 + ["done"] * 13
    found = accuracy_table(of({"backend": "a", "ate_m": LOGS, "nees": [1.0] * 20, "status": status}))
    entry = at(found, "a", "ATE online")
    assert entry.value == pytest.approx((LOGS[16] + LOGS[17]) / 2)
    assert entry.note.endswith("\N{INFINITY}")
    assert at(found, "a", "NEES / 3").note == ""  # a belief has no worst
    assert "a failure counts as \N{INFINITY}" in found.caption
    assert at(found, "a", "done").text == "13/20"


def test_bold_are_those_that_none_beats_for_sure_and_nobody_where_nothing_is_tested() -> None:
    near = {"backend": "b", "ate_m": [e * (1.1 if k % 2 else 0.9) for k, e in enumerate(LOGS)]}
    found = accuracy_table(of({"backend": "c", "ate_m": twice(LOGS, 3)}, near, {"backend": "a", "ate_m": LOGS}))
    assert {row.backend for row in found.rows if any(entry.best for entry in row.entries)} == {"a", "b"}
    assert "bold" in found.caption
    for kind, n in (("truth", 5), ("reference", 20)):
        parts = [{"backend": name, "ate_m": twice(LOGS[:n], x), "truth_kind": kind} for name, x in (("a", 1), ("b", 3))]
        shown = accuracy_table(of(*parts))
        assert not any(entry.best for row in shown.rows for entry in row.entries)
        assert "bold" not in shown.caption


def test_every_table_of_a_dataset_has_the_same_order() -> None:
    more = {"step_us_p50": 1.0, "j_online": 2.0, "refused_share": 0.1, "rpe_m": 0.1}
    found = of(
        *({"backend": name, "ate_m": twice(LOGS, x), **more} for name, x in (("dead-reckoning", 9), ("z", 1), ("b", 2)))
    )
    made = [make(found) for make in (accuracy_table, cost_table, growth_table, fit_table, inner_table)]
    tables = [*made, *details_tables(found)]
    assert len(tables) == 6
    assert {tuple(row.backend for row in table.rows) for table in tables} == {("z", "b", "dead-reckoning")}


def test_distances_from_a_reference_are_not_called_errors() -> None:
    found = accuracy_table(of({"backend": "a", "ate_m": [0.1], "map_rmse_m": [0.2], "truth_kind": "reference"}))
    assert [column.heading for column in found.headings][1:] == ["online path from reference", "map from reference"]


def test_times_that_others_ran_beside_are_marked_and_sorted_without_the_mark() -> None:
    found = of(
        {"backend": "a", "step_us_p50": [10.0] * 6, "timing_alone": 0}, {"backend": "b", "step_us_p50": [2.0] * 6}
    )
    assert at(cost_table(found), "a", "step p50") == Entry("10.0*", value=10.0)
    assert at(cost_table(found), "b", "step p50") == Entry("2.00", value=2.0)
    assert "* timed while other cells ran beside it" in cost_table(found).caption


def test_shares_counts_and_what_takes_no_time() -> None:
    found = of(
        {"backend": "a", "real_time": [0.1, 0.3], "finish_s": 1e-6, "landmarks_missed": 3, "growth_steps": 1e-17}
    )
    assert at(growth_table(found), "a", "of real time").text == "20.0 %"
    assert at(cost_table(found), "a", "finish").text == "<0.001"
    assert at(growth_table(found), "a", "growth with steps").text == "0.00"
    assert at(details_tables(found)[0], "a", "missed").text == "3"


def test_deadlines_beyond_one_that_every_step_keeps_are_left_out() -> None:
    busy = {"over_1ms": [0.25], "over_10ms": [0.0], "over_100ms": [0.0]}
    found = cost_table(of({"backend": "a", **busy}, {"backend": "b", **busy, "over_1ms": [0.0]}))
    assert [column.heading for column in found.headings][1:] == ["above 1 ms", "above 10 ms"]
    assert at(found, "a", "above 1 ms").text == "25.0 %"
    assert at(found, "b", "above 10 ms").text == "0 %"
    every = cost_table(of({"backend": "a", "over_1ms": [0.3], "over_10ms": [0.2], "over_100ms": [0.1]}))
    assert len(every.headings) == 4
    assert len(cost_table(of({"backend": "a", "cpu_s": [1.0]})).headings) == 2  # a run of an earlier version


def test_a_slope_has_its_interval_beside_it() -> None:
    slopes = {"slope_steps": [0.7], "slope_steps_low": [0.6], "slope_steps_high": [0.8]}
    entry = at(growth_table(of({"backend": "a", **slopes})), "a", "slope with steps")
    assert (entry.text, entry.note) == ("0.70", "0.60 to 0.80")


def test_the_least_misfit_is_marked() -> None:
    found = fit_table(of({"backend": "a", "j_final": [5.0]}, {"backend": "b", "j_online": [9.0]}))
    assert [row.backend for row in found.rows if any(entry.best for entry in row.entries)] == ["a"]


def test_a_backend_that_was_told_the_truth_says_so() -> None:
    found = accuracy_table(of({"backend": "a", "ate_m": LOGS}, {"backend": "b", "ate_m": twice(LOGS, 0.1), "told": 1}))
    assert at(found, "b", "done").word == "given the ground truth"
    assert not at(found, "b", "ATE online").best


def test_whose_program_a_backend_is_stands_beside_its_costs_where_the_run_says_it() -> None:
    found = of({"backend": "ekf", "ate_m": LOGS, "cpu_s": 1.0}, {"backend": "isam2", "ate_m": LOGS, "cpu_s": 9.0})
    for table in (accuracy_table(found), cost_table(found)):
        assert "implementation" not in [column.heading for column in table.headings]
    kinds = {"ekf": "compiled here", "isam2": "GTSAM's wheel"}
    told = [line._replace(implementation=kinds[line.backend]) for line in found]
    for table in (accuracy_table(told), cost_table(told)):
        assert [at(table, name, "implementation").text for name in kinds] == list(kinds.values())
    assert "implementation" not in [column.heading for column in paper_table(accuracy_table(told)).headings]
    assert growth_table(told).headings == growth_table(found).headings  # of which nothing is known here


def test_every_cell_can_be_sorted() -> None:
    found = of({"backend": "a", "ate_m": LOGS[:3]})
    table = cells_table(found[0].rows, {"room": "room", "a": "a"})
    assert [row.entries[1].value for row in table.rows] == [0, 1, 2]
    assert [row.entries[-1].value for row in table.rows] == LOGS[:3]
    assert table.rows[2].place == ("room", "2", "a")


def test_every_pair_is_in_the_table_of_pairs() -> None:
    found = of(*({"backend": name, "ate_m": twice(LOGS, x)} for name, x in (("a", 1), ("b", 2), ("dead-reckoning", 9))))
    table = pairs_table(verdict(found))
    pairs = [(row.backend, row.entries[0].text) for row in table.rows]
    assert pairs == [("a", "b"), ("a", "dead-reckoning"), ("b", "dead-reckoning")]
    first = table.rows[0].entries
    assert [entry.text for entry in first[1:4]] == ["ATE online", "2.00", "closer"]
    assert first[2].value == pytest.approx(2)
    assert (first[5].value, first[6].text) == (1.0, "20 of 20")
    few = pairs_table(verdict(of({"backend": "a", "ate_m": [0.1]}, {"backend": "b", "ate_m": [0.2]})))
    shown = [entry.text for entry in few.rows[0].entries]
    assert shown == ["b", "ATE online", "2.00", "too few logs", "", "", "1 of 1"]


@pytest.mark.parametrize(
    ("text", "set_"),
    [
        ("a_b & 95 % #1 $", r"a\_b \& 95 \% \#1 \$"), ("{x}^2~", r"\{x\}\textasciicircum{}2\textasciitilde{}"),
        ("\\end{table}", r"\textbackslash{}end\{table\}"), ("1\u20132", "1--2"),
        ("2.08\u00d710\u207b\u2077", r"2.08$\times10^{-7}$"),
        ("\u221e \u00b5s", r"$\infty$ $\mu$s"), ("two\nlines", "two lines"),
    ],
)  # fmt: skip
def test_latex_sets_text_as_it_is(text: str, set_: str) -> None:
    assert escaped(text) == set_


def test_a_table_for_a_paper() -> None:
    heading = Column("ate_m", "ATE online", ERROR_M, ""), Column("word", "word", TEXT, "")
    rows = [
        TableRow("fast_slam[particles=10]", [Entry("0.1", note="0.05\N{EN DASH}0.2", best=True, value=0.1), Entry("")]),
        TableRow("ekf", [Entry("0.2", value=0.2), Entry("cautious", "so")]),
    ]
    text = latex(Table(heading, rows, ""), "A caption, 100 %", "tab:a b")
    assert text.splitlines() == [
        r"\begin{table}",
        r"\centering\footnotesize\setlength{\tabcolsep}{2pt}",
        r"\caption{A caption, 100 \%}",
        r"\label{tab:a-b}",
        r"\begin{tabular}{@{}lrl@{}}",
        r"\toprule",
        r"backend & \shortstack[r]{ATE \\ \scriptsize online \\ \scriptsize (m)} & word \\",
        r"\midrule",
        r"fast\_slam[particles=10] & \shortstack[r]{\textbf{0.1} \\ \scriptsize 0.05--0.2} & -- \\",
        r"ekf & 0.2 & \shortstack[r]{cautious \\ \scriptsize so} \\",
        r"\bottomrule",
        r"\end{tabular}",
        r"\end{table}",
    ]


def test_what_is_wide_spans_both_columns_and_the_papers_table_does_not() -> None:
    more = {"nees": 1.0, "heading_rad": 0.1, "step_us_p50": 12.0, "step_us_p99": 90.0, "cpu_s": 1.0, "map_rmse_m": 0.1}
    found = of(
        {"backend": "isam2", "ate_m": LOGS, "final_ate_m": LOGS, **more},
        {"backend": "dead-reckoning", "ate_m": twice(LOGS, 3), **more},
    )
    assert latex(accuracy_table(found), "", "").startswith(r"\begin{table*}")
    narrow = latex(paper_table(accuracy_table(found)), "", "")
    assert narrow.startswith("\\begin{table}\n")
    widths = {line.count(" & ") for line in narrow.splitlines() if line.endswith(r" \\")}
    assert widths == {4}
    assert re.search(r"begin\{tabular\}\{@\{\}lr{4}@\{\}\}", narrow)
