"""Claims held against tables whose answers are known by hand, and how often chance alone makes one hold."""

import json
from collections.abc import Mapping, Sequence
from math import inf, isnan, nan
from typing import Any

import numpy as np
import pytest
from scipy.stats import t as student

from slamduel.bench.claims.answer import Answer, answer, measures
from slamduel.bench.claims.conclusion import conclude, document
from slamduel.bench.measure.relations import STRETCHES
from slamduel.bench.record.cell_table import CellTable, numbers, words
from slamduel.bench.study.study import Claim
from slamduel.bench.verdict.statistics import MOST as MOST_LOGS
from slamduel.bench.verdict.statistics import estimate, ranked, shift
from slamduel.core.errors import InputError
from slamduel.core.se2 import Array

EKF, UKF = {"backend": "ekf"}, {"backend": "ukf"}
SIX = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
NUMBERS = (
    "ate_m", "final_ate_m", "nees", "growth_steps", "step_us_mean", "timing_alone", "relation_m", "relation_se_m",
)  # fmt: skip


def table(cells: Sequence[Mapping[str, Any]]) -> CellTable:
    """Of cells by column; done, on a log of its own a seed, and without a value where nothing else is said."""
    swept = dict.fromkeys(name for cell in cells for name in cell if name not in NUMBERS)
    usual = {"dataset": "room", "status": "done", "reason": ""}
    texts = dict.fromkeys(("dataset", "backend", "seed", *swept, "status", "reason", "digest"))
    columns: dict[str, Any] = {
        name: words([cell.get(name, usual.get(name)) for cell in cells]) for name in texts if name != "digest"
    }
    columns["digest"] = words(
        [None if c.get("status") == "waiting" else c.get("digest", f"{c.get('dataset')} {c['seed']}") for c in cells]
    )
    return CellTable(columns | {name: numbers([cell.get(name) for cell in cells]) for name in NUMBERS})


def cells(values: Sequence[float | None] | Array, measure: str = "ate_m", **same: Any) -> list[dict[str, Any]]:
    """A cell a seed, of the EKF where no other backend is named; what has no value is waiting."""
    return [
        {"backend": "ekf", "seed": seed, **({"status": "waiting"} if value is None else {measure: value}), **same}
        for seed, value in enumerate(values)
    ]


def failing(seeds: Sequence[int], status: str = "diverged", **same: Any) -> list[dict[str, Any]]:
    return [{"backend": "ekf", "seed": seed, "status": status, **same} for seed in seeds]


def value(low: float, high: float, measure: str = "ate_m", **rest: Any) -> Claim:
    return Claim("value", "It is so", measure, EKF, {}, low, high, **rest)


def less(factor: float = 1.0, measure: str = "ate_m", **rest: Any) -> Claim:
    return Claim("less", "The EKF is closer", measure, EKF, UKF, factor, **rest)


def alike(by: float, measure: str = "ate_m") -> Claim:
    return Claim("alike", "They are alike", measure, EKF, UKF, 1 / (1 + by), 1 + by)


def both(first: Sequence[float | None] | Array, second: Sequence[float | None] | Array, **rest: Any) -> CellTable:
    return table([*cells(first, **rest), *cells(second, **rest, backend="ukf")])


def decided(verdict: str, claim: Claim, there: CellTable) -> Answer:
    found = answer(claim, there)
    assert found.verdict == verdict
    return found


def verdicts(there: CellTable, *claims: Claim) -> list[str]:
    return [answer(claim, there).verdict for claim in claims]


def ends(found: Answer) -> tuple[float, float]:
    return found.figures["low"], found.figures["high"]


def test_on_one_log_an_error_of_relations_has_the_interval_of_its_mean() -> None:
    assert measures([value(0, 1, "relation_m")]) == ["relation_m", "relation_se_m"]
    assert measures([value(0, 1)]) == ["ate_m"]
    there = table([{"backend": "ekf", "seed": 0, "relation_m": 0.02, "relation_se_m": 0.001}])
    reach = student.ppf(0.975, STRETCHES - 1) * 0.001
    found = answer(value(-inf, 0.0229, "relation_m"), there)
    assert ends(found) == pytest.approx((0.02 - reach, 0.02 + reach), rel=2e-4)
    assert found.sentence == (
        "Holds: It is so: mean 0.0200 m (95 % interval 0.0179 to 0.0221; 1 log); claimed: below 0.0229 m."
    )
    assert verdicts(there, *(value(-inf, most, "relation_m") for most in (0.022, 0.0179))) == ["open", "fails"]


def test_without_a_standard_error_or_on_several_logs_it_has_not() -> None:
    one: dict[str, Any] = {"backend": "ekf", "seed": 0, "relation_m": 0.02}
    found = decided("open", value(-inf, 1, "relation_m"), table([one]))
    assert found.sentence.endswith("; 6 logs at least are needed.")
    one["relation_se_m"] = 0.001
    for several in ([one, {**one, "seed": 1}], [*failing([0]), {**one, "seed": 1}]):
        assert verdicts(table(several), value(-inf, 1, "relation_m")) == ["open"]
    assert verdicts(table(failing([0])), value(-inf, 1, "relation_m")) != ["holds"]


def test_a_median_is_held_against_its_bounds_by_its_whole_interval() -> None:
    there = table(cells(SIX))
    known = estimate(SIX)
    found = verdicts(there, *(value(*bounds) for bounds in ((0, 1), (0.2, 1), (0.7, 1), (-inf, 0.05))))
    assert found == ["holds", "open", "fails", "fails"]
    found = answer(value(0.05, inf), there)
    assert ends(found) == (known.low, known.high)
    assert found.sentence == (
        "Holds: It is so: median 0.350 m (95 % interval 0.136 to 0.564; 6 logs); claimed: above 0.05 m."
    )


def test_five_logs_are_too_few_and_a_waiting_cell_leaves_a_claim_open() -> None:
    few = decided("open", value(0, 1), table(cells(SIX[:5])))
    assert "6 logs at least are needed" in few.sentence
    assert isnan(few.figures["low"])
    later = decided("open", value(0, 1), table(cells([*SIX, None, None])))
    assert later.waiting == 2
    assert later.sentence.startswith("Not decided yet: ")
    assert "2 of 8 cells have not run" in later.sentence


def test_an_errors_failure_is_infinite_and_any_other_measures_might_be_anything() -> None:
    errors, beliefs = (
        table([*cells(SIX * 2, measure), *failing(range(12, 16), "timeout")]) for measure in ("ate_m", "nees")
    )
    assert ends(answer(value(0, inf), errors)) == (pytest.approx(0.2, abs=0.1), inf)
    assert answer(value(0.05, inf), errors).verdict == "holds"
    above, below = (answer(value(*bounds, "nees"), beliefs) for bounds in ((0.05, inf), (-inf, 0.7)))
    assert above.verdict == below.verdict == "open"
    assert ends(above) == (-inf, inf)
    assert "4 of 16 cells failed and might have had any value" in above.sentence
    mostly = answer(value(0, inf), table([*cells(SIX[:2]), *failing(range(2, 8))]))
    assert "median failed" in mostly.sentence
    assert "count as the worst" in mostly.sentence


def test_one_unknown_value_is_lowest_for_the_one_end_and_highest_for_the_other() -> None:
    many = tuple(np.linspace(1, 2, 19))
    found = answer(value(0.5, 2.5, "nees"), table([*cells(many, "nees"), *failing([19])]))
    assert ends(found) == (estimate([-inf, *many]).low, estimate([*many, inf]).high)
    assert found.verdict == "holds"
    assert found.figures["estimate"] == pytest.approx(1.5)


def test_what_was_skipped_or_has_no_value_is_absent_and_said() -> None:
    found = answer(value(0, 1), table([*cells(SIX), *failing([6, 7], "skipped"), *cells([inf], "nees", seed=8)]))
    assert found.figures["n"] == 6
    assert found.verdict == "holds"
    assert "2 of 9 cells were skipped" in found.sentence
    assert "1 of 9 cells had no ate_m" in found.sentence


def test_less_is_paired_by_log_and_needs_interval_and_test() -> None:
    hard = np.array([1, 10, 100, 1000, 1e4, 1e5])  # far wider apart than the sides: only pairs tell
    there = both(hard, hard * (1.4, 1.5, 1.6, 1.7, 1.8, 1.9))
    found = decided("holds", less(), there)
    assert ends(found) == pytest.approx((1.4, 1.9))
    assert found.figures["p"] == pytest.approx(2 / 2**6)
    assert found.sentence.endswith("1.4 to 1.9 times less (95 % interval; 6 logs, p = 0.031).")
    assert verdicts(there, less(1.39), less(1.6), less(2)) == ["holds", "open", "fails"]
    other = decided("fails", less(), both(hard * 2, hard))
    assert "2.0 times more" in other.sentence
    assert answer(less(0.45), both(hard * 2, hard)).verdict == "holds"  # no more than 2.2 times as much
    assert answer(less(2), both(hard, hard * 2)).verdict == "open"  # at the bound itself


def test_pairs_are_those_logs_that_both_sides_have_in_whatever_order() -> None:
    first, second = cells([1, 2, 3, 4, 5, 6, 7]), cells([2, 4, 6, 8, 10, 12], backend="ukf")
    found = answer(less(), table([*first, *reversed(second)]))
    assert found.figures["n"] == 6
    assert found.figures["estimate"] == pytest.approx(2)
    assert "1 log left out, where one side has no value" in found.sentence


def test_a_failure_is_worse_than_everything_and_as_bad_as_another() -> None:
    ones = [1.0] * 8
    there = [*cells(ones), *cells(ones[:4], backend="ukf"), *failing(range(4, 8), backend="ukf")]
    found = decided("open", less(), table(there))
    assert found.figures["low"] == 1
    assert found.figures["high"] == inf
    there = [*cells(ones), *failing(range(8), backend="ukf")]
    assert "1.00 m against failed, infinitely many times less" in decided("holds", less(5), table(there)).sentence
    neither = table([*failing(range(8)), *failing(range(8), backend="ukf")])
    assert verdicts(neither, less(), alike(0.01)) == ["open", "open"]


def test_of_what_is_no_error_a_failure_counts_against_whatever_is_to_be_said() -> None:
    times = np.linspace(1, 2, 10)
    there = [*cells(times, "step_us_mean"), *cells(times[:7] * 3, "step_us_mean", backend="ukf")]
    found = decided("open", less(2, "step_us_mean"), table([*there, *failing(range(7, 10), "timeout", backend="ukf")]))
    assert ends(found) == (0, inf)
    assert found.figures["estimate"] == pytest.approx(3)


def test_times_that_were_taken_in_company_are_marked() -> None:
    assert measures([less()]) == ["ate_m"]
    assert measures([less(1, "step_us_mean")]) == ["step_us_mean", "timing_alone"]
    there = both(SIX, np.array(SIX) * 2, measure="step_us_mean", timing_alone=0)
    assert "12 of 12 cells were timed beside others" in answer(less(1, "step_us_mean"), there).sentence
    alone = both(SIX, np.array(SIX) * 2, measure="step_us_mean", timing_alone=1)
    assert "beside" not in answer(less(1, "step_us_mean"), alone).sentence


def test_sides_may_measure_different_things_of_the_same_cells() -> None:
    there = table([cell | {"final_ate_m": cell["ate_m"] / 2} for cell in cells(SIX)])
    claim = Claim("less", "Smoothed", "ate_m", {"measure": "final_ate_m"}, {}, 1.5)
    assert measures([claim]) == ["ate_m", "final_ate_m"]
    assert decided("holds", claim, there).figures["estimate"] == pytest.approx(2)


def test_alike_holds_within_its_bounds_and_by_nothing_where_all_are_the_same() -> None:
    near = np.array(SIX) * (1.001, 0.999, 1.002, 0.998, 1.003, 0.997)
    assert verdicts(both(SIX, near), alike(0.01), alike(0.001)) == ["holds", "open"]
    assert answer(alike(0.01), both(SIX, np.array(SIX) * 1.5)).verdict == "fails"
    same = decided("holds", alike(0), both(SIX, np.array(SIX) * (1 + 1e-12)))
    assert ends(same) == (1, 1)
    assert "the same on every log" in same.sentence
    assert answer(alike(0, "nees"), both([0.0] * 6, [0.0] * 6, measure="nees")).verdict == "holds"
    assert answer(alike(0), both([0.0] * 6, [1e-12] * 6)).verdict == "holds"  # an error of rounding
    assert answer(alike(0.5, "nees"), both([0.0] * 6, SIX, measure="nees")).verdict == "fails"


def test_negative_values_have_no_ratio() -> None:
    found = decided("open", less(1, "growth_steps"), both([-0.1, *SIX], [*SIX, 0.2], measure="growth_steps"))
    assert "growth_steps has negative values, such as -0.1" in found.sentence


def power(exponents: Sequence[float], sizes: Sequence[float] = (10, 20, 40), **same: Any) -> list[dict[str, Any]]:
    return [
        cell | {"tags": tags}
        for tags in sizes
        for cell in cells([tags**b * (seed + 1) for seed, b in enumerate(exponents)], "step_us_mean", **same)
    ]


def grows(low: float, high: float, measure: str = "step_us_mean") -> Claim:
    return Claim("grows", "It grows so", measure, EKF, {}, low, high, along="tags")


def test_an_exponent_is_that_of_each_log() -> None:
    exponents = (1.7, 1.8, 1.9, 2.0, 2.1, 2.2)
    found = decided("holds", grows(1.5, 2.5), table(power(exponents)))
    assert found.figures["estimate"] == pytest.approx(1.95)
    assert ends(found) == pytest.approx(estimate(exponents)[1:3])
    assert "tags 10 to 40" in found.sentence
    assert answer(grows(2.5, inf), table(power(exponents))).verdict == "fails"
    two = decided("open", grows(1, 3), table(power(exponents, (10, 20))))
    assert "too few values of tags for an exponent: 10, 20; expected at least 3" in two.sentence
    nothing = answer(grows(1, 3), table(power(exponents, (0, 10, 20))))
    assert "tags = 0 among its cells" in nothing.sentence


def test_a_log_whose_error_fails_at_large_sizes_grows_without_bound_and_one_that_lacks_a_size_is_left_out() -> None:
    there = [{**cell, "ate_m": cell["step_us_mean"]} for cell in power((1.0,) * 12)]
    for cell in there:
        if cell["tags"] == 40 and cell["seed"] < 9:
            cell |= {"status": "diverged", "ate_m": None}
    assert decided("holds", grows(0.9, inf, "ate_m"), table(there)).figures["estimate"] == inf
    lacking = power((2.0,) * 7)
    lacking[0]["status"] = "skipped"
    found = decided("holds", grows(1.5, 2.5), table(lacking))
    assert found.figures["n"] == 6
    assert "1 log left out" in found.sentence


def crosses(low: float = -inf, high: float = inf, first: Mapping[str, Any] = UKF, **rest: Any) -> Claim:
    second = EKF if first is UKF else UKF
    return Claim("crosses", "The UKF overtakes", "step_us_mean", first, second, low, high, along="tags", **rest)


def crossing(at: Sequence[float], sizes: Sequence[float] = (10, 30, 100, 300)) -> CellTable:
    """On each log the EKF's cost is a square and the UKF's a straight line, which meet at that size."""
    return table(
        [
            {"backend": backend, "seed": seed, "tags": tags, "step_us_mean": tags**b * meet ** (2 - b)}
            for seed, meet in enumerate(at)
            for tags in sizes
            for backend, b in (("ekf", 2), ("ukf", 1))
        ]
    )


def test_two_powers_cross_where_they_meet() -> None:
    at = (50, 60, 70, 80, 90, 95)
    found = decided("holds", crosses(40, 100), crossing(at))
    assert found.figures["estimate"] == pytest.approx((70 * 80) ** 0.5)
    assert ends(found) == pytest.approx(np.exp(estimate(np.log(at).tolist())[1:3]))
    assert verdicts(crossing(at), crosses(), crosses(60, 80), crosses(100, 300)) == ["holds", "open", "fails"]


def test_sides_that_never_cross_cross_the_wrong_way_or_more_than_once_are_said_to() -> None:
    less_all_along, not_yet = (answer(crosses(), crossing([at] * 6)) for at in (5, 500))
    assert less_all_along.verdict == not_yet.verdict == "fails"
    assert "no crossing: less at every value, from 10 on" in less_all_along.sentence
    assert "no crossing: not less at any value, up to 300" in not_yet.sentence
    assert answer(crosses(200, 1000), crossing([500] * 6)).verdict == "open"  # where, nobody knows
    wrong = decided("fails", crosses(first=EKF), crossing([50] * 6))
    assert "on 6 of 6 logs they cross the other way round" in wrong.sentence
    there = crossing([20] * 6)
    back = (there.columns["tags"] == 100) & (there.columns["backend"] == "ekf")
    there.columns["step_us_mean"][back] = 1
    twice = decided("open", crosses(15, 25), there)
    assert "on 6 of 6 logs they cross more than once" in twice.sentence
    low, high = ends(twice)
    assert low == pytest.approx(20)
    assert 100 < high < 300


def test_a_side_that_does_not_have_the_parameter_is_the_same_all_along() -> None:
    there = power((1.0,) * 6)
    level = cells([15.0 * (seed + 1) for seed in range(6)], "step_us_mean", backend="ukf")
    found = decided("holds", crosses(14, 16), table([*there, *level]))
    assert found.figures["estimate"] == pytest.approx(15)


def test_each_has_to_hold_for_every_value_and_tells_of_the_worst() -> None:
    there = [
        *(cell | {"tags": 6} for cell in [*cells(SIX), *cells(np.array(SIX) * 3, backend="ukf")]),
        *(cell | {"tags": 12} for cell in [*cells(SIX), *cells(np.array(SIX) * 2, backend="ukf")]),
    ]
    found = decided("holds", less(1.5, each="tags"), table(there))
    assert found.figures["estimate"] == pytest.approx(2)
    assert [(part.value, part.found.verdict) for part in found.parts] == [(6, "holds"), (12, "holds")]
    assert "for all 2 values of tags, at worst with 12: " in found.sentence
    assert "not for 1 of 2 values of tags" in decided("fails", less(2.5, each="tags"), table(there)).sentence


def test_each_and_where_say_nothing_of_a_side_that_does_not_have_the_parameter() -> None:
    there = [
        *(cell | {"particles": n} for n in (10, 100) for cell in cells(np.array(SIX) * n)),
        *cells(np.array(SIX) * 1000, backend="ukf"),
    ]
    found = answer(less(each="particles"), table(there))
    assert [part.found.estimate for part in found.parts] == pytest.approx([100, 10])
    assert answer(less(where={"particles": 10}), table(there)).figures["estimate"] == pytest.approx(100)


def test_a_side_that_is_no_one_configuration_is_refused() -> None:
    there = [cell | {"tags": tags} for tags in (6, 12) for cell in [*cells(SIX), *cells(SIX, backend="ukf")]]
    found = decided("open", less(), table(there))
    assert "cells with tags = 6 and 12; expected one value" in found.sentence
    assert "no cell of the study has backend = ekf, tags = 7" in answer(less(where={"tags": 7}), table(there)).sentence
    assert "has no parameter tag, but" in answer(less(where={"tag": 6}), table(there)).sentence


def test_runs_on_one_log_are_one_log_and_datasets_of_one_log_each_are_logs() -> None:
    once = [*cells(SIX, digest="park"), *cells([1.0], backend="ukf", digest="park")]
    found = decided("open", less(), table(once))
    assert found.figures["n"] == 1
    assert found.figures["estimate"] == pytest.approx(1 / np.mean(SIX))
    parks = [
        cell | {"dataset": f"park {k}"}
        for k in range(6)
        for cell in [*cells([1.0, 3.0], digest=f"{k}"), *cells([4.0 + k], backend="ukf", digest=f"{k}")]
    ]
    found = answer(less(), table(parks))
    assert found.figures["n"] == 6
    assert ends(found) == pytest.approx((2, 4.5))
    rooms = [cell | {"dataset": d} for d in ("a", "b") for cell in [*cells(SIX), *cells(SIX, backend="ukf")]]
    assert "cells with dataset = a and b" in answer(less(), table(rooms)).sentence


def test_a_study_reproduces_its_finding_where_all_claims_hold() -> None:
    there = both(SIX, np.array(SIX) * 2)
    yes, no, unsure = (answer(less(factor), there) for factor in (1.5, 3, 2))
    assert [found.verdict for found in (yes, no, unsure)] == ["holds", "fails", "open"]
    assert conclude([yes, yes], "So").sentence == "Reproduced: all 2 claims hold."
    assert conclude([yes, unsure, no], "So").sentence == "Not reproduced: 1 of 3 claims fails: The EKF is closer."
    assert conclude([yes, unsure], "So").sentence == "Not decided: 1 of 2 claims is open: The EKF is closer."
    assert conclude([yes], "").sentence == "The answer is yes: the claim holds."
    waiting = answer(less(), both([*SIX, None], [*SIX, None]))
    assert conclude([yes, waiting], "").sentence.startswith("There is no answer yet: 1 of 2 claims is open")
    assert conclude([], "").reproduced == "open"


def test_holms_correction_is_over_all_tests_of_a_study() -> None:
    closer, half = answer(less(), both(SIX, np.array(SIX) * 3)), answer(less(1.01), both(SIX, np.array(SIX) * 1.5))
    plain = answer(value(0, 1), table(cells(SIX)))
    assert plain.verdict == closer.verdict == half.verdict == "holds"
    found = conclude([closer, plain, half], "So")
    assert found.adjusted == pytest.approx((4 / 2**6, nan, 4 / 2**6), nan_ok=True)  # each 2 / 2^6 by itself, times two
    assert found.tests == "Of the 2 claims that hold by a test, the largest is p = 0.062 (Holm, 2 tests)."
    assert [one["p_holm"] for one in document(found)["claims"]] == [
        pytest.approx(4 / 2**6),
        None,
        pytest.approx(4 / 2**6),
    ]
    assert conclude([closer, plain], "So").tests == ""


def test_a_conclusion_is_json() -> None:
    there = [*cells(SIX), *failing(range(6), backend="ukf")]
    found = conclude([answer(less(2), table(there)), answer(value(0, 1), table(cells(SIX[:2])))], "So")
    told = json.loads(json.dumps(document(found), allow_nan=False))
    assert told["reproduced"] == "open"
    assert told["claims"][0]["low"] == told["claims"][0]["high"] == "Infinity"
    assert told["claims"][0]["bounds"] == [2, "Infinity"]
    assert told["claims"][1]["low"] is None


@pytest.mark.parametrize("infinite", [0, 3])
def test_averages_that_are_infinite_both_ways_count_half_as_either(infinite: int) -> None:
    d = np.random.default_rng(0).normal(0.1, 1, 50)
    d[:infinite], d[infinite : 3 * infinite] = -inf, inf
    one, other = np.triu_indices(len(d))
    with np.errstate(invalid="ignore"):
        every = (d[one] + d[other]) / 2
    opposed = int(np.isnan(every).sum())
    every[np.flatnonzero(np.isnan(every))[: opposed // 2]] = -inf
    wanted = np.sort(np.nan_to_num(every, nan=inf, posinf=inf, neginf=-inf))
    assert ranked(d, range(len(every))) == wanted.tolist()


def test_more_logs_than_can_be_compared_are_refused() -> None:
    d = np.random.default_rng(0).normal(0.1, 1, MOST_LOGS + 1)
    assert shift(d[:MOST_LOGS]).low < 0.1 < shift(d[:MOST_LOGS]).high
    with pytest.raises(InputError, match=r"found 2,001 logs on which two backends .*, expected at most 2,000\."):
        shift(d)
    found = decided("open", less(), both(np.exp(d).tolist(), np.exp(d).tolist()))
    assert "there are 2,001 logs of both sides, and at most 2,000 can be compared" in found.sentence


def test_the_test_against_a_factor_is_that_of_shifted_differences() -> None:
    d = np.random.default_rng(1).normal(0.5, 0.4, 15)
    assert shift(d, 0.3).p == pytest.approx(shift(d - 0.3).p)
    assert shift(d, 0.3).low == shift(d).low


TRIALS = 300
MOST = 0.025 + 4 * (0.025 * 0.975 / TRIALS) ** 0.5
"""The share of claims that may hold at their bound: one in 40, and four standard deviations of what chance adds."""


def _held(claim: Claim, draw: Any, logs: int = 12) -> float:
    rng = np.random.default_rng(0)
    return float(np.mean([answer(claim, draw(rng, logs)).verdict == "holds" for _ in range(TRIALS)]))


@pytest.mark.slow
def test_a_claim_holds_at_its_bound_no_more_often_than_it_says() -> None:
    def luck(rng: np.random.Generator, logs: int) -> Array:
        return np.exp(0.3 * rng.standard_normal(logs))

    assert _held(value(1, inf), lambda rng, logs: table(cells(luck(rng, logs)))) <= MOST
    assert _held(less(1.5), lambda rng, logs: both(luck(rng, logs), 1.5 * luck(rng, logs))) <= MOST
    assert _held(alike(0.5), lambda rng, logs: both(luck(rng, logs), 1.5 * luck(rng, logs))) <= MOST
    assert _held(crosses(60, inf), lambda rng, logs: crossing((60 * luck(rng, logs)).tolist(), (10, 300))) <= MOST


# ------------------------------------------------------------------------------------------------- logs in clusters


def grouped(values: Sequence[float] | Array, each: int, **same: Any) -> list[dict[str, Any]]:
    """Cells of logs, of which so many in a row are of one cluster."""
    return [cell | {"cluster": f"set {cell['seed'] // each}"} for cell in cells(values, **same)]


def test_a_median_over_clusters_counts_each_once() -> None:
    values = np.random.default_rng(1).uniform(0.1, 0.2, 40)
    found = answer(value(0.0, 1.0), table(grouped(values, 5)))
    medians = np.median(values.reshape(8, 5), axis=1)
    assert ends(found) == pytest.approx(estimate(medians.tolist())[1:3])
    assert "; 40 logs in 8 clusters)" in found.sentence
    few = decided("open", value(0.0, 1.0), table(grouped(values[:25], 5)))
    assert few.sentence.endswith("6 clusters at least are needed.")


def test_a_ratio_over_clusters_takes_six_of_them_for_a_test() -> None:
    rng = np.random.default_rng(2)
    first = rng.uniform(0.1, 0.2, 40)
    second = 2 * first * np.exp(rng.normal(0, 0.02, 40))
    both_sides = table([*grouped(first, 5), *grouped(second, 5, backend="ukf")])
    found = answer(less(), both_sides)
    each = [shift(d).value for d in np.log(second / first).reshape(8, 5)]
    assert ends(found) == pytest.approx(np.exp(shift(np.array(each))[1:3]))
    assert found.verdict == "holds"
    assert "40 logs in 8 clusters, p = 0.0078" in found.sentence
    few = decided("open", less(), table([*grouped(first[:25], 5), *grouped(second[:25], 5, backend="ukf")]))
    assert few.figures["low"] > 1  # what was measured
    assert "25 logs in 5 clusters" in few.sentence
    assert answer(alike(1.5), both_sides).verdict == "holds"


def test_logs_of_one_cluster_are_tested_among_themselves_and_the_answer_says_so() -> None:
    found, plain = (answer(value(0, 1), table(made)) for made in (grouped(SIX, 6), cells(SIX)))
    assert (ends(found), found.verdict) == (ends(plain), plain.verdict)
    assert found.sentence.endswith("; all logs are of set 0.")


def test_of_few_clusters_a_crossing_is_open() -> None:
    def side(factor: float, **same: Any) -> list[dict[str, Any]]:
        return [
            cell | {"steps": steps}
            for steps in (10, 100)
            for cell in grouped([0.1 * (steps / 30) ** factor] * 10, 2, **same)
        ]

    claim = Claim("crosses", "They cross", "ate_m", EKF, UKF, 1, 1000, along="steps")
    assert "10 logs in 5 clusters" in decided("open", claim, table([*side(0.0), *side(1.0, backend="ukf")])).sentence
    plain = [
        {name: v for name, v in cell.items() if name != "cluster"} for cell in (*side(0.0), *side(1.0, backend="ukf"))
    ]
    assert answer(claim, table(plain)).verdict == "holds"
