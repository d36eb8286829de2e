"""The paired comparison: against scipy, against counting every sign, and by a smaller run of its kept study."""

from collections.abc import Sequence
from itertools import product

import numpy as np
import pytest
from scipy import stats

from slamduel.bench.verdict.simulation import QUESTIONS, Question, Simulated, main
from slamduel.bench.verdict.statistics import FEWEST, Comparison, compare, estimate, holm, signed_rank
from slamduel.core.se2 import Array

INF = float("inf")


def by_log(values: Sequence[float] | Array) -> dict[str, float]:
    return {f"log {k}": float(value) for k, value in enumerate(values)}


def pair(first: Sequence[float] | Array, second: Sequence[float] | Array) -> Comparison:
    (found,) = compare({"a": by_log(first), "b": by_log(second)})
    return found


def scipys(d: Array) -> float:
    """The exact p, which scipy has for what is untied."""
    return float(np.asarray(stats.wilcoxon(d, method="exact"))[1])


def counted(differences: Array) -> float:
    """The two-sided p by trying all signs: what is zero has a rank (Pratt) and no sign."""
    ranks = stats.rankdata(abs(differences))[differences != 0]
    found = abs(ranks @ np.sign(differences[differences != 0]))
    sums = [abs(ranks @ np.array(signs)) for signs in product((-1, 1), repeat=len(ranks))]
    return float(np.mean([s >= found - 1e-9 for s in sums]))


@pytest.mark.parametrize("n", [6, 7, 10, 25, 50])
def test_p_is_the_exact_one_of_scipy_where_nothing_is_tied(n: int) -> None:
    rng = np.random.default_rng(n)
    for shift in np.linspace(0, 1, 10):
        d = rng.normal(shift, 1, n)
        assert signed_rank(d)[0] == pytest.approx(scipys(d), rel=1e-9)


def test_beyond_the_exact_ones_p_hardly_differs() -> None:
    rng = np.random.default_rng(0)
    for shift in (0.0, 0.1, 0.15, 0.2):
        d = rng.normal(shift, 1, 140)
        assert signed_rank(d)[0] == pytest.approx(scipys(d), rel=0.02, abs=5e-4)


@pytest.mark.parametrize(
    "d",
    [
        [1, 1, 1, -1, 2, 2, -2, 3],
        [0, 0, 1, 2, 3, 4, 5],
        [0, 0, 0, -1, 1, 1, 2, 2, 2],
        [INF, INF, -INF, 0.5, -0.1, 0.2, 1, 0],
        [INF, INF, INF, INF, 1, 2],
        [-1, -1, -1, -1, -1, -1, -1],
    ],
)
def test_p_counts_signs_where_sizes_are_tied_zero_or_infinite(d: list[float]) -> None:
    assert signed_rank(np.array(d, np.float64))[0] == pytest.approx(counted(np.array(d, np.float64)), rel=1e-12)


def test_effect_is_the_share_of_rank_for_less_that_against() -> None:
    d = np.array([0.3, -0.1, 0.2, 0.5, 0.4, 0.6])
    assert signed_rank(d)[1] == pytest.approx((20 - 1) / 21)
    assert signed_rank(np.abs(d))[1] == 1
    assert signed_rank(-np.abs(d))[1] == -1


@pytest.mark.parametrize("n", [6, 9, 16, 30])
def test_the_interval_holds_the_ratios_that_the_test_does_not_reject(n: int) -> None:
    rng = np.random.default_rng(n)
    for _ in range(5):
        d = rng.normal(0.3, 0.5, n)
        found = pair(np.ones(n), np.exp(d))
        for end, inwards in ((np.log(found.low), 1e-6), (np.log(found.high), -1e-6)):
            assert scipys(d - end - inwards) >= 0.05
            assert scipys(d - end + inwards) < 0.05
        averages = [(x + y) / 2 for k, x in enumerate(d) for y in d[k:]]
        assert found.ratio == pytest.approx(np.exp(np.median(averages)))


def test_the_interval_excludes_1_exactly_where_p_is_below_5_percent() -> None:
    rng = np.random.default_rng(0)
    found = [pair(np.ones(12), np.exp(rng.normal(0.2, 0.3, 12))) for _ in range(300)]
    assert [c.p < 0.05 for c in found] == [not c.low <= 1 <= c.high for c in found]
    assert 50 < sum(c.holds for c in found) < 250


def test_backends_with_the_same_path_cannot_be_told_apart() -> None:
    errors = np.random.default_rng(0).lognormal(size=20)
    for second in (errors, errors * (1 + 1e-13)):
        found = pair(errors, second)
        assert (found.ratio, found.low, found.high, found.p, found.effect, found.closer) == (1, 1, 1, 1, 0, 0)
        assert not found.holds


def test_logs_alike_speak_for_neither_and_are_counted() -> None:
    """Five of five that differ are for the first: 1 in 16 with no others, and no stronger among 25 that are alike."""
    found = pair(np.ones(30), [1.0] * 25 + [2.0] * 5)
    assert (found.n, found.closer, found.ratio) == (30, 5, 1)
    assert found.p == pytest.approx(1 / 16)
    assert found.effect == pytest.approx((26 + 27 + 28 + 29 + 30) / (30 * 31 / 2))


def test_failures_are_worse_than_every_error_and_as_bad_as_one_another() -> None:
    first, second = np.full(10, 0.1), np.linspace(0.11, 0.2, 10)
    second[:2], first[9], second[9] = INF, INF, INF
    found = pair(first, second)
    assert (found.n, found.closer) == (10, 9)
    assert found.high == INF
    assert 1 < found.low < found.ratio < 2
    assert found.holds
    d = np.log(np.where(np.isinf(second), 1e30, second) / np.where(np.isinf(first), 1e30, first))
    assert found.p == pytest.approx(counted(d))


def test_a_backend_that_always_fails_is_beaten() -> None:
    found = pair(np.full(8, 0.1), np.full(8, INF))
    assert (found.ratio, found.low, found.high, found.effect) == (INF, INF, INF, 1)
    assert found.holds
    assert pair(np.full(8, INF), np.full(8, 0.1)).high == 0
    both = pair(np.full(8, INF), np.full(8, INF))
    assert (both.ratio, both.p) == (1, 1)


def test_failures_of_both_cancel_out() -> None:
    first, second = np.full(12, 0.1), np.geomspace(0.08, 0.13, 12)
    first[:3], second[9:] = INF, INF
    found = pair(first, second)
    assert (found.low, found.high) == (0, INF)
    assert 0.9 < found.ratio < 1.1
    assert found.p > 0.8


def test_infinite_ratios_of_both_signs_count_half_either_way() -> None:
    """Of 12 logs rank sums of up to 13 are rejected, of 78: just inside the interval the lesser sum is 14."""
    d = np.array([-INF, -0.5, -0.41, -0.3, -0.25, 0.11, 0.2, 0.35, 0.47, 0.6, INF, INF])
    found = pair(np.ones(12), np.exp(d))
    assert found.high == INF
    assert signed_rank(d - np.log(found.low) - 1e-9)[1] == pytest.approx(1 - 2 * 14 / 78)


def test_an_error_of_nothing_is_the_best_there_is() -> None:
    assert pair(np.zeros(6), np.ones(6)).low == INF
    assert pair(np.zeros(6), np.zeros(6)).p == 1
    assert pair(np.full(6, 1e-300), np.full(6, 1e300)).ratio == INF


def test_turned_round_the_comparison_says_the_same() -> None:
    rng = np.random.default_rng(3)
    a, b = rng.lognormal(0, 1, (2, 15))
    a[2], b[5] = INF, INF
    there, back = pair(a, b), pair(b, a)
    assert (there.p, there.effect, there.n) == (back.p, -back.effect, back.n)
    assert [there.ratio, there.low, there.high] == pytest.approx([1 / back.ratio, 1 / back.high, 1 / back.low])


def test_pairs_are_made_by_log_whatever_their_order_and_number() -> None:
    rng = np.random.default_rng(4)
    a, b = by_log(rng.lognormal(size=9)), by_log(rng.lognormal(size=12))
    (found,) = compare({"a": dict(reversed(a.items())), "b": b})
    assert found == pair(list(a.values()), list(b.values())[:9])
    assert found.n == 9
    (apart,) = compare({"a": {"x": 1.0}, "b": {"y": 1.0}})
    assert apart.n == 0
    assert np.isnan(apart.ratio)
    assert not apart.holds


def test_fewer_than_six_logs_have_a_ratio_and_no_test() -> None:
    found, value = pair([1] * (FEWEST - 1), [2] * (FEWEST - 1)), estimate([1, 2, 3, 4, 5])
    assert (found.ratio, found.closer, value.value) == (pytest.approx(2), 5, 3)
    assert np.isnan([found.low, found.high, found.p, found.adjusted, found.effect, value.low, value.high]).all()
    assert not found.holds
    assert pair([1] * FEWEST, range(2, 2 + FEWEST)).holds


def test_holm_steps_down_over_the_pairs_that_have_a_test() -> None:
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.04, np.nan, 0.01, 0.9]) == pytest.approx([0.08, np.nan, 0.03, 0.9], nan_ok=True)
    errors = {name: by_log(np.random.default_rng(k).lognormal(k == 3, 0.2, 10)) for k, name in enumerate("abcd")}
    found = compare(errors)
    assert [c.first + c.second for c in found] == ["ab", "ac", "ad", "bc", "bd", "cd"]
    assert [c.adjusted for c in found] == pytest.approx(holm([c.p for c in found]))
    assert {c.first + c.second for c in found if c.holds} == {"ad", "bd", "cd"}


def test_a_median_s_interval_is_that_of_hettmansperger_and_sheather() -> None:
    """Ten values: 1 - 22 / 1024 at the second order statistic and 1 - 112 / 1024 at the third, lambda 0.6577."""
    found = estimate([*range(10)])
    assert (found.low, found.high) == pytest.approx((1.6577, 7.3423), abs=1e-4)


@pytest.mark.parametrize("n", [6, 10, 17, 40])
def test_a_median_s_interval_is_between_order_statistics_that_cover_more_and_less(n: int) -> None:
    values = np.random.default_rng(n).lognormal(size=n)
    found, ordered = estimate(values.tolist()), np.sort(values)
    depth = max(k for k in range(1, n) if 2 * stats.binom.cdf(k - 1, n, 0.5) <= 0.05)
    assert ordered[depth - 1] < found.low < ordered[depth]
    assert ordered[n - depth - 1] < found.high < ordered[n - depth]
    assert found.value == np.median(values)


def test_a_median_among_failures_has_an_end_at_infinity() -> None:
    found = estimate([1, 2, 3, 4, 5, 6, 7, 8, INF, INF])
    assert (found.value, found.high, found.n) == (5.5, INF, 10)
    assert 1 < found.low < 3
    assert estimate([INF] * 8) == (INF, INF, INF, 8, 8)
    assert estimate([1.0] + [INF] * 5)[:3] == (INF, 1, INF)
    assert estimate([2.0] * 7)[:3] == (2, 2, 2)


def _few() -> list[tuple[Question, Simulated]]:
    """The hardest cases of every question: the fewest logs, failures, most backends."""
    return [(q, case) for q in QUESTIONS if q.bounds for case in {q.cases[0], q.cases[-1]}]


@pytest.mark.parametrize(("question", "case"), _few(), ids=lambda x: x.title if isinstance(x, Question) else None)
def test_verdicts_are_right_as_often_as_they_say(question: Question, case: Simulated) -> None:
    """Within four binomial standard deviations of the bounds."""
    assert question.bounds
    comparisons = 1000
    share = case.share(question.asked, comparisons)
    low, high = (b + s * 4 * (b * (1 - b) / comparisons) ** 0.5 for s, b in zip((-1, 1), question.bounds, strict=True))
    assert low <= share <= high


def test_the_study_says_what_is_out_of_bounds(capsys: pytest.CaptureFixture[str]) -> None:
    """Of one comparison each share is 0 or 1, which no coverage may be."""
    assert main(1) == 1
    assert "missed: 100.00 %" in capsys.readouterr().out
