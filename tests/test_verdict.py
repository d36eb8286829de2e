"""The report's words and numbers: what is clear is said, what is not is left open."""

from typing import Any

import numpy as np
import pytest

from slamduel.bench.axes import stretches
from slamduel.bench.numerals import counted, listed, number, plain, span
from slamduel.bench.store import COLUMNS, Row
from slamduel.bench.summary import Line, Spread, lines, short
from slamduel.bench.tables import accuracy_table, cost_table
from slamduel.bench.verdict import belief_word, headline


def told(backend: str, kind: str = "truth", **columns: list[Any]) -> list[Row]:
    """Cells of a backend, one a value of the columns; a cell is done unless its status says otherwise."""
    n = max(map(len, columns.values()))
    about: dict[str, Any] = dict.fromkeys(COLUMNS)
    about |= {"dataset": "room", "dataset_options": "", "backend": backend, "options": "", "truth_kind": kind}
    about |= {"status": "done", "reason": "", "timing_alone": 1}
    rows = [about | {"seed": k, "digest": f"d{k}"} for k in range(n)]
    for name, values in columns.items():
        for row, value in zip(rows, values, strict=True):
            row[name] = value
    return [Row(row, "") for row in rows]


def test_a_log_that_nobody_can_believe_is_said_to_be_one() -> None:
    rows = [*told("a", nees=[40.0, 30.0], nees_inside=[0.1, 0.1], ate_m=[1.0, 1.0])]
    rows += told("b", nees=[400.0, 300.0], nees_inside=[0.1, 0.1], ate_m=[1.0, 1.0])
    rows += told("dead-reckoning", nees=[1.0, 1.0], nees_inside=[0.9, 0.9], ate_m=[1.0, 1.0])
    assert any("None of them has a belief that fits this log" in sentence for sentence in headline(lines(rows)))
    rows += told("c", nees=[1.0, 1.0], nees_inside=[0.9, 0.9], ate_m=[1.0, 1.0])
    assert not any("None of them" in sentence for sentence in headline(lines(rows)))


def line(**columns: list[Any]) -> Line:
    (found,) = lines(told("ekf", "truth", **columns))
    return found


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0, "0"), (0.0213, "0.0213"), (0.5, "0.500"), (0.9999, "1.00"), (99.96, "100"), (12.34, "12.3"), (123.4, "123"),
        (1234567, "1,234,567"), (-4.5, "-4.50"), (2e-5, "0.0000200"), (2.08e7, "2.08\u00d710\u2077"),
        (1.2e-9, "1.20\u00d710\u207b\u2079"), (9999999, "1.00\u00d710\u2077"), (float("inf"), "\u221e"),
        (-float("inf"), "-\u221e"), (float("nan"), "not a number"),
    ],
)  # fmt: skip
def test_numbers_have_three_digits(value: float, text: str) -> None:
    assert number(value) == text


def test_marks_of_an_axis_have_no_zeros_at_the_end() -> None:
    assert [plain(v) for v in (0.01, 0.5, 20, 100, 1000, 1e8)] == ["0.01", "0.5", "20", "100", "1,000", number(1e8)]


def test_words_for_many_and_few() -> None:
    assert (counted(1, "seed"), counted(1200, "step")) == ("1 seed", "1,200 steps")
    assert [listed(list("abc")[:n]) for n in (1, 2, 3)] == ["a", "a and b", "a, b and c"]
    assert span(Spread(1, 1, 1, 1)) == ""
    assert span(Spread(2, 1, 3, 2)) == "1.00\u20133.00"


@pytest.mark.parametrize(
    ("nees", "inside", "word"),
    [
        ([1.0], [0.95], "consistent"),
        ([0.6, 1.9], [0.99, 0.86], "consistent"),
        ([1.0, 1.2], [0.95, 0.8], ""),
        ([3.0, 5.0], [0.6, 0.8], "overconfident"),
        ([3.0, 1.5], [0.6, 0.8], ""),
        ([3.0], [0.95], ""),
        ([0.1, 0.4], [1.0, 1.0], "cautious"),
        ([0.1, 0.6], [1.0, 1.0], ""),
    ],
)
def test_a_belief_has_a_word_only_where_every_seed_agrees(nees: list[float], inside: list[float], word: str) -> None:
    assert belief_word(line(nees=nees, nees_inside=inside)) == word


def test_without_nees_there_is_no_word() -> None:
    assert belief_word(line(ate_m=[1.0])) == ""


def test_the_best_path_is_named_and_the_others_measured_by_it() -> None:
    rows = told("a", ate_m=[0.5, 0.7, 0.6]) + told("b", ate_m=[0.1, 0.2, 0.3]) + told("c", ate_m=[3.0, 2.0, 1.0])
    assert headline(lines(rows))[0] == (
        "room, 3 logs: b's online path has the lowest error (median ATE 0.200 m, 0.100 to 0.300 over 3 seeds); "
        "a 3.00 times that; c 10.0 times that."
    )


def test_paths_whose_ranges_overlap_are_named_together_with_the_cheapest() -> None:
    rows = told("a", ate_m=[0.2, 0.4], cpu_s=[1.0, 1.0]) + told("b", ate_m=[0.1, 0.3], cpu_s=[2.0, 2.0])
    assert headline(lines(rows + told("c", ate_m=[2.0, 2.0])))[0] == (
        "room, 2 logs: b and a have the lowest errors of the online path, and their ranges overlap (median ATE 0.200 "
        "and 0.300 m, 2 seeds); the cheapest of them is a; c 10.0 times that."
    )


def test_a_belief_without_a_word_is_not_passed_over() -> None:
    rows = told("a", ate_m=[0.1], nees=[9.0], nees_inside=[0.1]) + told(
        "b", ate_m=[0.3], nees=[2.5], nees_inside=[0.93]
    )
    assert "By NEES, a is overconfident; b is not clearly either." in headline(lines(rows))


def test_a_backend_that_fails_on_some_seeds_does_not_win_on_the_others() -> None:
    rows = told("a", ate_m=[0.2, 0.4]) + told("b", ate_m=[0.1, None], status=["done", "diverged"])
    found = lines(rows)
    said = headline(found)
    assert (
        "a's online path has median ATE 0.300 m, 0.200 to 0.400 over 2 seeds; not ranked: b (1 of 2 done)." in said[0]
    )
    assert "1 diverged of 4" in said[-1]
    assert not any(entry.best for row in accuracy_table(found).rows for entry in row.entries)


def test_one_seed_is_said_to_be_one() -> None:
    assert "ATE 0.500 m in one seed" in headline(lines(told("a", ate_m=[0.5]) + told("b", ate_m=[0.6])))[0]


def test_the_lowest_is_marked_where_there_is_a_truth_alone() -> None:
    for kind, marked in (("truth", ["b"]), ("reference", [])):
        found = lines(told("a", kind, ate_m=[0.2]) + told("b", kind, ate_m=[0.1]))
        assert [row.backend for row in accuracy_table(found).rows if any(e.best for e in row.entries)] == marked


def test_costs_are_ranked_without_dead_reckoning() -> None:
    rows = told("a", cpu_s=[2.0], timing_alone=[0]) + told("b", cpu_s=[1.0]) + told("dead-reckoning", cpu_s=[0.1])
    said = " ".join(headline(lines(rows)))
    assert "b 1.00 s and a* 2.00 s (*: while other cells ran beside it)" in said
    assert "0.100 s" not in said


def test_share_of_real_time() -> None:
    found = lines(told("a", step_us_mean=[1e4, 3e4], steps=[100, 100]))
    (row,) = cost_table(found, {0: 10.0, 1: 10.0}).rows
    assert [entry.text for entry in row.entries][-1] == "20.0 %"  # 1 s and 3 s of 10 s
    (row,) = cost_table(found, {0: 10.0, 1: None}).rows
    assert [entry.text for entry in row.entries][-1] == "10.0 %"
    assert len(cost_table(found, {0: None}).headings) == 1


def test_stretches_are_means_and_gaps_stay_gaps() -> None:
    rng = np.random.default_rng(1)
    t = np.sort(np.concatenate((rng.uniform(0, 4, 500), rng.uniform(6, 10, 500), (0.0, 10.0))))
    values = rng.normal(size=len(t))
    values[7] = np.nan
    middle, means = stretches(t, values, 10)
    assert middle == pytest.approx(np.arange(10) + 0.5)
    assert np.flatnonzero(np.isnan(means)).tolist() == [4, 5]
    for k in (0, 2, 9):
        inside = (t >= k) & ((t < k + 1) | (k == 9))
        assert means[k] == pytest.approx(np.nanmean(values[inside]), rel=1e-12)
    short, same = stretches(t[:5], values[:5], 10)
    assert short.tolist() == t[:5].tolist()
    assert same.tolist() == values[:5].tolist()


def test_a_path_in_a_label_is_cut_down_to_its_last_part() -> None:
    assert short("log[path=/a/b/c d]") == "log[path=…/c d]"
    assert short('mrclam[path="/a,x/[b]/c/",robot=3]') == "mrclam[path=…/c,robot=3]"
    assert short("log[path=c]") == "log[path=c]"
