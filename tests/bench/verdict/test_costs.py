"""Costs: nothing is claimed of times that were measured once, nor of what load alone may do."""

import re
from math import isnan
from typing import Any

import numpy as np
import pytest

from judged_rows import LOGS, rows, timed, told
from slamduel.bench.measure.growth import slope_from
from slamduel.bench.measure.repeats import FEWEST_ROUNDS, over_rounds, two_way
from slamduel.bench.record.schema import Row
from slamduel.bench.verdict.cost_simulation import COSTS, Case
from slamduel.bench.verdict.cost_words import basis, compared, grown, meanwhile, repeat_troubles
from slamduel.bench.verdict.costs import MARGIN, CostRatio, between_runs, compare_costs, cost, is_dearer
from slamduel.bench.verdict.summary import Line, lines
from slamduel.bench.verdict.verdict import verdict
from slamduel.bench.words.columns import TIMED
from slamduel.bench.words.numerals import raised

LOADED = (1.0, 1.8, 3.0, 0.9, 1.4)  # what the machine makes of every time, by round


def of(*parts: list[Row]) -> list[Line]:
    return lines([row for part in parts for row in part])


def held(first: list[Row], second: list[Row], column: str) -> CostRatio | None:
    one, other = of(first, second)
    return compare_costs(one, other, column)


def pair(ratio: float, *rounds: float, n: int = 8, noise: float = 0.02) -> tuple[Line, Line]:
    one, other = of(
        timed(rows("a", 1, n, step=10), *rounds, noise=noise),
        timed(rows("b", 1, n, step=10 * ratio), *rounds, noise=noise),
    )
    return one, other


def test_a_machine_that_is_slower_in_some_rounds_does_not_widen_a_ratio() -> None:
    found, alone = compare_costs(*pair(20, *LOADED), "step_us_p50"), cost(pair(20, *LOADED)[0], "step_us_p50")
    assert 19 < found.low < 20 < found.high < 21
    assert (found.logs, found.rounds) == (8, 5)
    assert alone.high / alone.low > 2
    assert compared(found, "b").endswith("times cheaper than b")
    assert compared(found.reverse(), "a").endswith("times as costly as a")


def test_what_load_may_do_is_not_called_cheaper() -> None:
    found = compare_costs(*pair(1.3, *LOADED), "step_us_p50")
    assert found.low > 1.2
    assert found.standing == "alike"
    assert compared(found, "b") == "about as costly as b"


def test_costs_that_the_rounds_do_not_tell_apart_are_said_to_be_so_with_the_interval() -> None:
    found = compare_costs(*pair(1.6, *LOADED, noise=0.4), "step_us_p50")
    assert 1 < found.low < MARGIN < found.high
    assert re.fullmatch(
        r"measured .* times cheaper than b, too near to the 1.5 times that load .*", compared(found, "b")
    )
    assert re.match(r"measured .* times as costly as a, too near", compared(found.reverse(), "a"))
    either = found._replace(low=0.6, high=1.8)
    assert compared(either, "b") == "not told apart in cost from b (between 1.7 times as costly and 1.8 times cheaper)"


@pytest.mark.parametrize("count", range(1, FEWEST_ROUNDS))
def test_too_few_rounds_bear_nothing(count: int) -> None:
    found = compare_costs(*pair(20, *LOADED[:count]), "step_us_p50")
    assert isnan(found.low)
    assert compared(found, "b") == ""
    said = " ".join(verdict(list(pair(20, *LOADED[:count]))).sentences)
    assert "cheaper only beyond" not in said
    assert ("none is called cheaper" if count == 1 else "too few for intervals") in said


def test_a_round_counts_once_every_cell_has_ended_and_a_log_where_all_are_done() -> None:
    a, b = timed(rows("a", 1, 8), *LOADED), timed(rows("b", 1, 8, step=50), *LOADED)
    b[3] = b[3]._replace(rounds=b[3].rounds[:4])
    failed = [*b[5].rounds]
    failed[2] = dict.fromkeys(failed[2]) | {"round": 3, "status": "timeout", "timing_alone": 1}
    b[5] = b[5]._replace(rounds=failed)
    found = held(a, b, "step_us_p50")
    assert (found.logs, found.rounds) == (7, 4)


def test_times_beside_other_cells_are_not_compared() -> None:
    once = held(rows("a", 1, timing_alone=0), rows("b", 1, step=50), "step_us_p50")
    a, b = timed(rows("a", 1), *LOADED), timed(rows("b", 1, step=50), *LOADED)
    for one in a[2].rounds[:1]:
        one["timing_alone"] = 0  # pyright: ignore[reportIndexIssue]
    found = held(a, b, "step_us_p50")
    for one in a[2].rounds:
        one["timing_alone"] = 0  # pyright: ignore[reportIndexIssue]
    assert (once, found.rounds, held(a, b, "step_us_p50")) == (None, 4, None)


def test_a_cells_times_are_those_of_the_rounds_that_it_ran_alone() -> None:
    (cell,) = timed(rows("a", 1, 1, step=10), 9.0, 1.0, 3.0, 2.0, noise=0.0)
    cell.rounds[0]["timing_alone"] = 0  # pyright: ignore[reportIndexIssue]
    alone, beside = over_rounds(cell.rounds, TIMED), over_rounds(cell.rounds[:1], TIMED)
    assert (alone["repeats"], alone["timing_alone"], alone["step_us_p50"]) == (3, 1, pytest.approx(20))
    assert (beside["repeats"], beside["timing_alone"], beside["step_us_p50"]) == (1, 0, pytest.approx(90))


def test_backends_that_were_timed_once_beside_others_that_were_repeated_are_named() -> None:
    some = of(timed(rows("a", 1), *LOADED), timed(rows("b", 1, step=50), *LOADED), rows("c", 1, step=900))
    assert basis(some) == (
        "Times are medians of 5 rounds; those of c were measured once, and are not compared (--repeats 5 does). One is "
        "called cheaper only beyond 1.5 times: load shifts ratios, too."
    )
    assert compare_costs(some[0], some[1], "cpu_s").standing == "cheaper"
    assert compare_costs(some[0], some[2], "cpu_s").standing == "few"
    assert "cheaper only" not in basis(some[1:])


def test_a_cost_of_nothing_has_no_ratio() -> None:
    assert held(timed(rows("a", 1, step=0.0), *LOADED), timed(rows("b", 1), *LOADED), "cpu_s") is None


def test_the_same_verdict_is_given_whatever_the_machine_did() -> None:
    said = []
    for load in ((1.0,) * 5, (2.1, 3.0, 2.4, 1.9, 2.6)):
        parts = [timed(rows(name, 1, 10, step=step), *load) for name, step in (("a", 10), ("b", 13), ("c", 80))]
        pairs = verdict(of(*parts)).costs["step_us_p50"]
        said.append({(c.first, c.second): c.standing for c in pairs})
    assert said[0] == said[1]
    assert {pair: how for pair, how in said[0].items() if "c" not in pair} in (
        {("a", "b"): "alike"},
        {("b", "a"): "alike"},
    )
    assert {how for pair, how in said[0].items() if "c" in pair} <= {"cheaper", "dearer"}


def test_of_those_alike_in_cost_the_one_with_the_lowest_error_is_advised_and_all_are_named() -> None:
    base = LOGS[:20]

    def advised(ratio: float) -> tuple[str, str]:
        made = [
            told(name, ate_m=(base * e).tolist(), step_us_p50=[c] * 20, cpu_s=[c] * 20)
            for name, e, c in (("a", 1.0, 10.0 * ratio), ("b", 1.005, 10.0))
        ]
        (use,) = verdict(of(*(timed(cells, *LOADED) for cells in made))).uses
        return use.backend, use.why

    assert advised(1.4)[0] == "a"
    assert "costs do not decide between a and b, its median error is the lowest" in advised(1.4)[1]
    assert advised(1.7)[0] == "b"
    assert "1.7 times cheaper" in advised(1.7)[1]
    assert advised(1.7)[0] == advised(17)[0]


def test_cost_is_compared_with_the_next_cheapest_and_with_the_most_accurate() -> None:
    base = LOGS[:20]
    made = [
        told(name, ate_m=(base * e).tolist(), step_us_p50=[c] * 20, cpu_s=[c] * 20)
        for name, e, c in (("a", 1.004, 10.0), ("b", 1.0, 170.0), ("c", 1.002, 25.0))
    ]
    (use,) = verdict(of(*(timed(cells, *LOADED) for cells in made))).uses
    assert use.backend == "a"
    assert re.search(r"2\.\d[^,]* times cheaper than c, 1[67]\S*[^,]* times cheaper than b", use.why), use.why
    (use,) = verdict(of(timed(made[0], *LOADED), made[1], made[2])).uses
    assert "against 25.0 of c (c timed once)" in use.why


def test_costs_measured_once_decide_only_where_they_are_far_apart() -> None:
    a, b = of(rows("a", 1, step=10), rows("b", 1, step=19))
    assert not is_dearer(b, a, "step_us_p50")
    a, c = of(rows("a", 1, step=10), rows("c", 1, step=21))
    assert is_dearer(c, a, "step_us_p50")


def test_a_backend_that_does_something_else_in_a_repeat_is_named() -> None:
    good, bad = timed(rows("a", 1, 4), *LOADED), timed(rows("b", 1, 4), *LOADED)
    bad[1].rounds[2]["path"] = "other"  # pyright: ignore[reportIndexIssue]
    (sentence,) = repeat_troubles(of(good, bad))
    assert sentence.startswith("b is not deterministic: on 1 of 4 cells a repeat with the same seed found another path")
    assert sentence in verdict(of(good, bad)).sentences


def test_what_the_machine_did_is_said_with_its_range() -> None:
    found = of(timed(rows("a", 1, 4), *LOADED, work_us=120.0, waited_share=0.25, load=2.0))
    assert meanwhile(found) == (
        "Meanwhile a fixed piece of work took 120 µs (120 to 120), a backend waited 25 % of the time (up to 25 %) and "
        "the load was 2.00; medians."
    )
    assert meanwhile(of(rows("a", 1))) == ""


def test_a_cell_has_the_medians_of_its_rounds_and_intervals_from_three_on() -> None:
    (cell,) = timed(rows("a", 1, 1, step=10), 1.0, 3.0, 2.0, noise=0.0)
    row = over_rounds(cell.rounds, TIMED)
    assert row["repeats"] == 3
    assert row["step_us_p50"] == pytest.approx(20)
    assert row["step_us_p50_low"] < 20 < row["step_us_p50_high"]
    assert "cpu_s_low" not in over_rounds(cell.rounds[:2], TIMED)


def test_a_change_between_runs_is_judged_by_the_rounds_of_both() -> None:
    old, new = (
        timed(rows("a", 1, 5, step=step), *rounds, noise=0.05) for step, rounds in ((10, LOADED), (40, LOADED[:3]))
    )
    found = between_runs(list(zip(old, new, strict=True)), "step_us_p50")
    assert found.rounds == (5, 3)
    assert found.low < 4 * np.exp(np.mean(np.log(LOADED[:3])) - np.mean(np.log(LOADED))) < found.high
    assert between_runs(list(zip(old, rows("a", 1, 5), strict=True)), "step_us_p50") is None


def test_one_log_has_students_interval_over_its_rounds() -> None:
    values = np.array([[1.0, 2.0, 4.0]])
    found, se = two_way(values), values.std(ddof=1) / 3**0.5
    assert found.value == pytest.approx(7 / 3)
    assert found.high - found.low == pytest.approx(2 * 4.302653 * se, rel=1e-5)


def test_what_all_logs_share_in_a_round_is_counted_once_a_round() -> None:
    shared = np.tile(np.array([0.0, 1.0, 2.0]), (50, 1))
    found, alone = two_way(shared), two_way(shared[:1])
    assert (found.low, found.high) == pytest.approx((alone.low, alone.high))


def cases() -> list[tuple[str, Case, object, tuple[float, float]]]:
    return [(title, case, asked, bounds) for title, asked, bounds, found in COSTS if bounds for case in found]


QUICK = 400


@pytest.mark.parametrize(("title", "case", "asked", "bounds"), cases(), ids=lambda value: getattr(value, "name", ""))
def test_simulated_intervals_and_claims_are_right_as_often_as_they_say(
    title: str, case: Case, asked: object, bounds: tuple[float, float]
) -> None:
    """Within five standard errors of a share of that many comparisons beyond the bounds."""
    del title
    low, high = bounds
    share = case.share(asked, QUICK)  # pyright: ignore[reportArgumentType]
    assert low - 5 * (low * (1 - low) / QUICK) ** 0.5 <= share <= high + 5 * (high * (1 - high) / QUICK) ** 0.5


def sloped(backend: str, exponent: float, n: int = 1, whole: int = 4000, **more: float) -> list[Row]:
    more |= {"slope_steps_low": exponent - 0.1, "slope_steps_high": exponent + 0.1, "whole_from": whole, "steps": 5000}
    more |= {"slope_from": slope_from(whole, 5000)}
    ends: dict[str, Any] = {name: [value] * n for name, value in more.items()}
    return told(backend, slope_steps=[exponent + 0.001 * k for k in range(n)], **ends)


def test_growth_along_a_long_log_is_said_with_its_interval() -> None:
    parts = sloped("smoother", 0.7, last_over_first=16.2), sloped("ekf", 0.0), sloped("ukf", -0.3), sloped("b", 0.08)
    assert grown(of(*parts, sloped("dead-reckoning", 0.0))) == (
        f"The cost of a step grows with smoother as steps{raised('0.70')} (0.60 to 0.80), 16 times from the first "
        "fifth of the log to the last; it does not grow with ekf and ukf; it may or may not grow with b "
        "(-0.02 to 0.18). The map grows until step 4,000: what costs more with a larger map is not told apart from "
        "what costs more with time."
    )


def test_growth_since_the_map_is_whole_says_from_where() -> None:
    found = grown(of(sloped("a", 0.7, whole=900, last_over_whole=2.0, last_over_first=9.0)))
    assert "2.0 times from the first fifth of the log with the whole map to the last." in found
    assert found.endswith(" Counted from step 900 on, once the map is whole.")
    assert "Counted from step 250 on" in grown(of(sloped("a", 0.7, whole=0)))  # a map that was given
    assert "whole" not in grown(of(sloped("a", 0.7, last_over_first=9.0)))  # the slope is of the whole log
    assert grown(of(sloped("a", 0.0))) == "The cost of a step does not grow with a."


def test_growth_while_the_map_grew_is_said_apart() -> None:
    """As with submaps: costs follow the area until all of it is known, and are level from then on."""
    mapping: dict[str, Any] = {"slope_mapping": 0.86, "slope_mapping_low": 0.8, "slope_mapping_high": 0.92}
    level: dict[str, Any] = {"slope_mapping": 0.0, "slope_mapping_low": -0.1, "slope_mapping_high": 0.1}
    found = grown(of(sloped("a", 0.0, whole=2500, **mapping), sloped("b", 0.0, whole=2500, **level)))
    assert found == (
        "The cost of a step does not grow with a and b. Counted from step 2,500 on, once the map is whole. While the "
        f"map grew, so did the cost with a as steps{raised('0.86')} (0.80 to 0.92)."
    )


def test_over_several_logs_the_interval_of_a_slope_is_that_of_the_median() -> None:
    assert "(0.70 to 0.71)" in grown(of(sloped("a", 0.7, n=10)))
    assert "(0.00 to 0.20)" in grown(of(sloped("a", 0.099)))  # never -0.00
    assert "(0.60 to 0.80)" in grown(of(sloped("a", 0.7, n=3)))  # too few: that of one log


def test_of_short_logs_and_of_earlier_versions_no_growth_is_said() -> None:
    assert not grown(of(rows("a", 1), rows("b", 2)))
