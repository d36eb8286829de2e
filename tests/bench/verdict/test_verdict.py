"""What is said of a dataset: a difference only where it is borne out, advice only where the evidence names somebody."""

import re
from math import inf
from typing import Any

import numpy as np
import pytest

from judged_rows import LOGS, SEED, rows, told
from slamduel.bench.record.schema import Row
from slamduel.bench.verdict.accuracy import between
from slamduel.bench.verdict.association import association_sentences
from slamduel.bench.verdict.consistency import belief_clauses, belief_sentences, belief_word
from slamduel.bench.verdict.margin import NEAR
from slamduel.bench.verdict.margin import needed as telling
from slamduel.bench.verdict.ranking import Ranking, needed, ordered, ranking, standing
from slamduel.bench.verdict.statistics import Comparison
from slamduel.bench.verdict.summary import Line, lines, typical
from slamduel.bench.verdict.verdict import Use, Verdict, verdict
from slamduel.bench.words.numerals import larger


def failing(found: list[Row], *seeds: int, status: str = "diverged") -> list[Row]:
    """The cells, those of the seeds without any value."""
    gone = dict.fromkeys(("ate_m", "final_ate_m", "nees", "cpu_s", "step_us_p50"))
    return [
        Row({**row.columns, **gone, "status": status}, "") if row.columns["seed"] in seeds else row for row in found
    ]


def said(*of: list[Row]) -> Verdict:
    return verdict(lines([row for part in of for row in part]))


def use(found: Verdict, purpose: str = "online") -> Use:
    (one,) = [use for use in found.uses if use.purpose == purpose]
    return one


# Who is more accurate


def test_a_difference_that_is_borne_out_is_claimed_with_its_interval() -> None:
    found = said(rows("isam2", 1), rows("ekf", 2))
    claim = re.fullmatch(
        r"isam2's online path is ([\d.]+) to ([\d.]+) times closer to the truth than ekf's on room, 20 logs "
        r"\(Wilcoxon, Holm: p < 0.0001; closer on 20 of 20\)\.",
        found.sentences[0],
    )
    assert 1.85 < float(claim[1]) <= 2 <= float(claim[2]) < 2.15
    assert found.basis == "20 logs; the true path is known"


def test_what_is_claimed_does_not_depend_on_the_order_of_the_record() -> None:
    one, other = rows("isam2", 1), rows("ekf", 2)
    assert said(one, other).sentences == said(other, one).sentences


def test_what_cannot_be_told_apart_is_said_to_be_so_with_what_is_ruled_out() -> None:
    found = said(rows("isam2", 1, sd=0.2), rows("ekf", 1, sd=0.2))
    sentence = found.sentences[0]
    assert "do not differ significantly on room, 20 logs" in sentence
    assert "closer to the truth" not in " ".join(found.sentences)
    (c,) = found.comparisons["ate_m"]
    assert c.low < 1 < c.high
    worse, better = re.findall(r"(\d+) %", sentence)[:2]
    assert int(worse) == pytest.approx(100 * (1 / c.low - 1), abs=0.51)
    assert int(better) == pytest.approx(100 * (c.high - 1), abs=0.51)
    assert f"more than {max(int(worse), int(better))} % apart is ruled out" in sentence


def test_the_same_to_within_one_percent_is_alike_whatever_a_test_makes_of_it() -> None:
    base = LOGS[:20]
    found = said(told("a", ate_m=base.tolist()), told("b", ate_m=(base * 1.001).tolist()))
    (c,) = found.comparisons["ate_m"]
    assert c.holds  # one is closer on every log, by nothing
    assert standing(c) == "alike"
    assert found.sentences[0] == "The online paths of a and b are alike on room, 20 logs: less than 1 % apart."


def test_of_three_the_best_is_held_against_each() -> None:
    sentence = said(rows("a", 1), rows("b", 2), rows("c", 4)).sentences[0]
    assert re.fullmatch(
        r"a's online path is closer to the truth on room, 20 logs: [\d.]+ to [\d.]+ times than b's \(p < 0.0001, "
        r"20 of 20 logs\) and [\d.]+ to [\d.]+ times than c's \(p < 0.0001, 20 of 20 logs\) \(Wilcoxon, Holm\)\.",
        sentence,
    )


def test_of_many_the_sentences_stay_short_and_the_pairs_are_all_there() -> None:
    several = [rows(f"backend-{k}", 1 + 0.2 * max(0, k - 1), 30, nees=1.0) for k in range(10)]
    found = said(*several, rows("dead-reckoning", 40, 30))
    assert len(found.comparisons["ate_m"]) == 45 + 10
    assert max(map(len, found.sentences)) < 330
    assert len(" ".join(found.sentences)) < 1200
    assert "than those of 8 others" in found.sentences[0]


def test_too_few_logs_are_too_few_to_test() -> None:
    found = said(told("a", ate_m=[0.5, 0.7, 0.6], final_ate_m=[0.1] * 3), told("b", ate_m=[0.1, 0.2, 0.3]))
    assert found.sentences[0] == (
        "room: 3 logs are too few to test, 6 at least; measured, median error of the online path: b 0.200 m, a 0.600 m."
    )
    assert found.sentences[1] == "Measured, median error of the final path: a 0.100 m."
    assert use(found) == Use("online", "", "3 logs are too few, 6 at least (--seeds).")


def test_six_logs_cannot_bear_three_pairs() -> None:
    found = said(rows("a", 1, 6), rows("b", 2, 6), rows("c", 4, 6))
    assert found.sentences[0].startswith("No claim can be made on room, 6 logs of a's online path, measured ")
    assert "6 logs are too few to test 3 pairs, 7 would do" in found.sentences[0]
    assert "closer to the truth" in said(rows("a", 1, 7), rows("b", 2, 7), rows("c", 4, 7)).sentences[0]
    assert use(found).backend == "a"
    assert [needed(pairs) for pairs in (1, 3, 28)] == [6, 7, 11]


def test_one_log_is_nothing_to_test_and_repeats_speak_for_it_alone() -> None:
    found = said(
        told("a", one_log=True, ate_m=[0.1] * 4),
        told("b", one_log=True, ate_m=[0.2, 0.3, 0.4, 0.25]),
        told("c", one_log=True, ate_m=[0.9] * 4),
    )
    assert list(found.sentences[:2]) == [
        "room is one log, nothing to test; measured error of the online path: a 0.100 m, b 0.275 m, c 0.900 m.",
        (
            "b draws at random: its 4 runs on this log lie between 0.200 and 0.400 m, all further off than a and all "
            "closer than c; that does not carry over to other logs."
        ),
    ]
    assert use(found) == Use("online", "", "There is one log, nothing to test.")
    assert "--seeds" in use(said(told("a", ate_m=[0.1]), told("b", ate_m=[0.2]))).why


@pytest.mark.parametrize(
    ("dataset", "words"),
    [
        ("circle", "One log is too few, 6 at least (--seeds)."),
        ("w20000", "One log is too few, 6 at least: w20000[draw=true] draws its noise anew for each seed."),
        ("csv", "One log is too few, 6 at least of a dataset; --seeds draws no others of a recording."),
    ],
)
def test_more_seeds_are_advised_where_they_draw_other_logs(dataset: str, words: str) -> None:
    found = [*told("a", ate_m=[0.1]), *told("b", ate_m=[0.2])]
    assert use(said([Row({**row.columns, "dataset": dataset}, "") for row in found])).why == words


def test_online_and_final_are_never_held_against_each_other() -> None:
    found = said(
        rows("ekf", 1),
        rows("isam2", 1, final_ate_m=(0.2 * LOGS[:20]).tolist()),
        told("graph", final_ate_m=LOGS[:20].tolist()),
    )
    assert {
        column: {c.first for c in pairs} | {c.second for c in pairs} for column, pairs in found.comparisons.items()
    } == {"ate_m": {"ekf", "isam2"}, "final_ate_m": {"isam2", "graph"}}
    assert any(sentence.startswith("isam2's final path is 5.0 times closer") for sentence in found.sentences)


def test_failures_count_as_the_worst_and_are_said_in_words() -> None:
    found = said(rows("a", 1), failing(rows("b", 0.5), *range(18)))
    assert found.sentences[0].startswith(
        "a's online path is closer to the truth than b's, which mostly failed, on room"
    )
    assert "b failed on 18 of 20 cells (18 diverged); a failure counts as worse than any path." in found.sentences
    some = said(rows("a", 1), failing(rows("b", 2), 0, 1, 2, status="timeout"))
    assert re.search(r"is at least [\d.]+ times closer", some.sentences[0])
    assert any("3 timeout" in sentence for sentence in some.sentences)


def test_what_was_skipped_is_absent() -> None:
    found = said(rows("a", 1), failing(rows("b", 2), *range(10), status="skipped"))
    (c,) = found.comparisons["ate_m"]
    assert c.n == 10
    assert "Skipped, and so not compared there: b (why, below)." in found.sentences
    few = said(rows("a", 1), failing(rows("b", 2), *range(17), status="skipped"))
    assert "Too few logs in common with a to test, 6 at least: b (3)." in few.sentences


def test_who_was_told_the_truth_does_not_compete() -> None:
    found = said(rows("a", 1), rows("b", 2), rows("c", 0.1, told=1))
    assert "than b's" in found.sentences[0]
    assert found.sentences[-1] == "Not compared: c (given the ground truth)."


def test_dead_reckoning_costs_the_others_no_power() -> None:
    alone, with_it = said(rows("a", 1), rows("b", 2)), said(rows("a", 1), rows("b", 2), rows("dead-reckoning", 9))
    assert alone.comparisons["ate_m"][0] == with_it.comparisons["ate_m"][0]
    assert [(c.first, c.second) for c in with_it.comparisons["ate_m"][1:]] == [
        ("a", "dead-reckoning"),
        ("b", "dead-reckoning"),
    ]
    assert any(re.match("All beat dead reckoning, a [89]", sentence) for sentence in with_it.sentences)
    lost = said(rows("a", 1), rows("b", 9), rows("dead-reckoning", 9))
    assert "Not significantly closer than dead reckoning's: the online path of b." in lost.sentences


def test_without_a_truth_there_is_no_verdict_on_accuracy() -> None:
    for kind in ("reference", ""):
        parts = [told(name, kind, ate_m=[v] * 8, cpu_s=[v] * 8) for name, v in (("a", 0.1), ("b", 0.9))]
        found = said(*parts)
        assert "no verdict on accuracy" in found.sentences[0]
        assert not found.comparisons
        assert {use.backend for use in found.uses} == {""}
    assert said(failing(rows("a", 1, 2), 0, 1)).sentences[0] == "room: no cell is done."


def test_a_first_backend_that_failed_does_not_hide_what_is_known_of_the_log() -> None:
    parts = [told(name, "reference", map_rmse_m=[v] * 8, surveyed=[1] * 8) for name, v in (("b", 0.1), ("c", 0.3))]
    found = said(told("a", "reference", status=["error"] * 8), *parts)
    assert any(sentence.startswith("b's online map is 3.0 times closer") for sentence in found.sentences)
    assert (use(found, "map").backend, use(found).backend) == ("b", "")
    assert found.basis == "8 logs; the true path is not known, the landmarks' places are"


def test_where_some_paths_are_known_maps_count_on_all_logs_and_paths_on_those() -> None:
    """Of seven sets of two logs the path is known in one; elsewhere ATE is a distance from a reference, no error."""
    sets: dict[str, Any] = {
        "cluster": [f"set {k // 2}" for k in range(14)],
        "truth_kind": ["reference"] * 12 + ["truth"] * 2,
    }
    sets |= {"surveyed": [1] * 12 + [0] * 2, "log_name": [f"log {k}" for k in range(14)]}
    hard = LOGS[:14]
    parts = [
        told(
            name,
            map_rmse_m=(times * hard).tolist(),
            ate_m=[far] * 12 + [near] * 2,
            nees=[None] * 12 + [1.5, 1.5],
            **sets,
        )
        for name, times, far, near in (("a", 1.0, 9.0, 0.2), ("b", 2.0, 0.001, 0.1))
    ]
    lost = [row._replace(columns={**row.columns, "status": "error", "ate_m": None}) for row in parts[1][:1]]
    found = said(parts[0], lost + parts[1][1:])
    (one, other) = lines([*parts[0], *lost, *parts[1][1:]])
    assert (one.truth_kind, one.surveyed, str(one.over("ate_m"))) == ("truth", True, "2 logs of set 6")
    assert (str(one.over("map_rmse_m")), one.values["ate_m"].median, one.values["map_rmse_m"].n) == (
        "14 logs in 7 clusters", 0.2, 14,
    )  # fmt: skip
    assert other.by_log("ate_m") == {"d12": 0.1, "d13": 0.1}  # the failure is one of a map
    assert other.by_log("map_rmse_m")["d0"] == inf
    assert found.basis == "14 logs in 7 clusters; the landmarks' places are known, and the true path of 2 logs of set 6"
    assert found.sentences[0].startswith("a's online map is ")
    assert "2 logs of set 6 are too few to test" in " ".join(found.sentences)
    assert (use(found, "map").backend, use(found).why) == ("a", "2 logs of set 6 are too few, 6 at least.")
    assert [(c.n, c.units) for c in found.comparisons["map_rmse_m"]] == [(14, 7)]


# What beliefs are worth


def one(**columns: Any) -> Line:
    (found,) = lines(told("ekf", **columns))
    return found


@pytest.mark.parametrize(
    ("center", "width", "word"),
    [
        (1.0, 0.2, "consistent"), (0.8, 0.05, "consistent"), (1.5, 0.02, "overconfident"), (1.2, 0.2, "consistent"),
        (9.0, 1.0, "overconfident"), (0.6, 0.05, "cautious"), (0.1, 0.01, "cautious"), (1.3, 2.5, ""), (0.75, 0.9, ""),
    ],
)  # fmt: skip
def test_a_belief_has_a_word_where_the_interval_of_its_median_is_clear(center: float, width: float, word: str) -> None:
    ten = center + width * np.linspace(-0.5, 0.5, 10)
    assert belief_word(one(nees=ten.tolist())) == word


@pytest.mark.parametrize(
    ("nees", "inside", "word"),
    [
        ([1.0], [0.95], "consistent"), ([0.6, 1.9], [0.99, 0.86], "consistent"), ([1.0, 1.2], [0.95, 0.8], ""),
        ([3.0, 5.0], [0.6, 0.8], "overconfident"), ([3.0, 1.5], [0.6, 0.8], ""), ([3.0], [0.95], ""),
        ([0.1, 0.4], [1.0, 1.0], "cautious"), ([0.1, 0.6], [1.0, 1.0], ""),
    ],
)  # fmt: skip
def test_of_few_logs_the_word_is_a_rule_of_thumb_and_said_to_be(
    nees: list[float], inside: list[float], word: str
) -> None:
    line = one(nees=nees, nees_inside=inside)
    assert belief_word(line) == word
    assert "by a rule of thumb: an interval takes 6 logs" in belief_sentences([line])[0]


def test_without_nees_there_is_no_word() -> None:
    assert belief_word(one(ate_m=[1.0])) == ""
    assert belief_sentences([one(ate_m=[1.0])]) == []


def test_a_run_whose_errors_are_one_error_is_not_called_cautious() -> None:
    rng = np.random.default_rng(SEED)
    words = [belief_word(one(nees=(rng.chisquare(3, 30) / 3).tolist())) for _ in range(400)]
    assert words.count("cautious") + words.count("overconfident") <= 0.05 * 400


def test_a_log_that_nobody_can_believe_is_said_to_be_one() -> None:
    parts = [
        told("a", nees=[40.0, 30.0], nees_inside=[0.1, 0.1]),
        told("b", nees=[400.0, 300.0], nees_inside=[0.1, 0.1]),
    ]
    parts += [told("dead-reckoning", nees=[1.0, 1.0], nees_inside=[0.9, 0.9])]
    assert any("No belief fits this log" in sentence for sentence in said(*parts).sentences)
    parts += [told("c", nees=[1.0, 1.0], nees_inside=[0.9, 0.9])]
    assert not any("None of them" in sentence for sentence in said(*parts).sentences)


def test_of_runs_on_one_log_the_sentence_has_the_median_that_the_table_has() -> None:
    """A lost run would carry the mean: 20.5 here."""
    (line,) = lines(told("fastslam", one_log=True, nees=[2.0, 3.0, 4.0, 73.0], nees_inside=[0.5] * 4))
    (sentence,) = belief_sentences([line])
    assert typical(line, "nees").value == 3.5
    assert "fastslam (3.50)" in sentence
    assert "medians of the runs on one log" in sentence
    (alone,) = lines(told("ekf", one_log=True, nees=[3.0], nees_inside=[0.5]))
    assert "medians of the runs" not in belief_sentences([alone])[0]


def test_every_belief_is_named_clear_or_not() -> None:
    (sentence,) = belief_sentences(
        lines(rows("a", 1, nees=1.0) + rows("b", 1, nees=5.0) + rows("c", 1, nees=[0.1, 9.0] * 10))
    )
    assert "a (1.00 to 1.00) is consistent; b (5.00 to 5.00) is overconfident; it is not clear for c (0.1" in sentence


# Whom to use


def test_of_those_that_cannot_be_told_apart_the_cheapest_is_advised() -> None:
    found = use(said(rows("isam2", 1, step=170, nees=1.0), rows("ekf", 1, step=10, nees=1.0)))
    assert found.backend == "ekf"
    assert "10.0 µs a step against 170 of isam2 (each timed once)." in found.why
    assert "consistent" in found.why


def test_a_cheaper_one_that_may_be_much_worse_is_not_advised_and_the_logs_that_would_tell_are_estimated() -> None:
    sure, unsure = rows("ekf", 1, 20, sd=0.05, step=10), rows("ekf", 1.2, 20, sd=0.7, step=10)
    best = rows("isam2", 1, 20, sd=0.05, step=170)
    assert use(said(best, sure)).backend == "ekf"  # a few percent worse at most
    found = use(said(best, unsure))
    assert found.backend == "isam2"
    words = re.search(
        r"ekf costs less, but may be more than 25 % worse \(up to (.*) is not ruled out\); some (\d+) logs",
        found.why,
    )
    assert words
    (c,) = said(best, unsure).comparisons["ate_m"]
    assert words[1] == larger(c.high)
    assert int(words[2]) > 20


def test_none_is_advised_where_another_one_may_be_twice_as_close() -> None:
    def found(n: int) -> Use:
        return use(said(rows("a", 1, n, sd=0.05), rows("b", 1.2, n, sd=1.2), rows("dead-reckoning", 90, n)))

    assert found(40).why.startswith("Not significantly different from a (at most 1.5 times worse); ")
    assert re.fullmatch(
        r"None can be named: b comes first, but may be more than 2 times as far off as a \(up to 3.1 times is not "
        r"ruled out\); some \d+ logs like these would tell\.",
        found(8).why,
    )


def test_as_many_logs_as_are_said_to_tell_do_tell() -> None:
    def ranked(n: int, times: float = 1.0, spread: float = 0.5) -> Ranking:
        ratios = times * np.exp(spread * np.tile([-1, 1, -0.5, 0.5, 0.1, -0.1], n // 6))
        found = ranking(lines(told("a", ate_m=[0.1] * n) + told("b", ate_m=(0.1 * ratios).tolist())), "ate_m")
        assert found is not None
        return found

    def ends(found: Ranking) -> tuple[float, float]:
        """Of b's error over a's."""
        (c,) = found.comparisons
        return (c.low, c.high) if c.first == "a" else (1 / c.high, 1 / c.low)

    assert ends(ranked(6))[1] > NEAR
    many = telling(ranked(6), "b", "a", NEAR)
    assert many is not None
    assert ends(ranked(many))[1] <= NEAR < ends(ranked(many - 6))[1]
    many = telling(ranked(6, 1.5), "b", "a", NEAR)  # beyond the margin: as many as show that it is worse
    assert many is not None
    assert ends(ranked(many, 1.5))[0] > 1 >= ends(ranked(many - 6, 1.5))[0]
    assert telling(ranked(6, spread=20.0), "b", "a", NEAR) is None
    lost = ranking(lines(rows("a", 1, 6) + failing(rows("b", 1, 6), 0, 1, 2)), "ate_m")
    assert lost is not None
    assert telling(lost, "b", "a", NEAR) == 12  # that fail as often


def test_a_backend_that_is_worse_is_not_advised_however_cheap() -> None:
    found = use(said(rows("isam2", 1, step=170), rows("ekf", 2, step=10)))
    assert found.backend == "isam2"
    assert re.match(r"The most accurate, 1.9 to 2.[01] times closer than ekf; ", found.why)
    assert "170 µs a step against 10.0 of ekf (each timed once)" in found.why


def test_one_that_is_overconfident_is_passed_over_for_one_that_is_not() -> None:
    found = use(said(rows("isam2", 1, step=170, nees=1.0), rows("ekf", 1, step=10, nees=5.0)))
    assert found.backend == "isam2"
    assert "consistent, as ekf is not" in found.why
    unclear = [1.0, 4.0] * 10
    found = use(said(rows("isam2", 1, step=170, nees=unclear), rows("ekf", 1, step=10, nees=5.0)))
    assert found.backend == "isam2"
    assert "not clearly overconfident, as ekf is" in found.why
    found = use(said(rows("isam2", 1, step=170, nees=6.0), rows("ekf", 1, step=10, nees=5.0)))
    assert (found.backend, "overconfident" in found.why) == ("ekf", True)


def test_one_that_fails_is_passed_over_for_one_that_does_not() -> None:
    found = use(said(rows("isam2", 1, step=170), failing(rows("ekf", 1, step=10), 3)))
    assert found.backend == "isam2"
    assert "done on every log, as ekf is not" in found.why


def test_one_that_fails_on_most_logs_is_not_advised_even_alone() -> None:
    alone = failing(told("smoother", final_ate_m=LOGS[:20]), *range(14))
    found = use(said(alone, told("ekf", ate_m=LOGS[:20])), "final")
    assert found.backend == ""
    assert found.why.startswith("None can be named: smoother is done on 6 of 20 logs")
    half = failing(told("smoother", final_ate_m=LOGS[:20]), *range(9))
    assert use(said(half), "final").backend == "smoother"


@pytest.mark.parametrize(("dearer", "advised"), [(14, "a"), (21, "b")])
def test_of_about_the_same_cost_the_more_accurate_is_advised(dearer: float, advised: str) -> None:
    found = [(name, (LOGS[:20] * e).tolist(), [c] * 20) for name, e, c in (("a", 1.0, dearer), ("b", 1.005, 10))]
    one = use(said(*(told(name, ate_m=errors, step_us_p50=costs) for name, errors, costs in found)))
    assert one.backend == advised
    words = "costs do not decide between a and b, its median error is the lowest"
    assert (words in one.why) == (advised == "a")


def test_dead_reckoning_is_advised_where_nobody_beats_it() -> None:
    found = said(rows("a", 1), rows("b", 1), rows("dead-reckoning", 1))
    assert use(found).backend == "dead-reckoning"
    assert use(said(rows("a", 1), rows("dead-reckoning", 2))).backend == "a"


def test_a_method_with_a_final_path_alone_is_no_candidate_online_and_costs_its_whole_log() -> None:
    found = said(
        rows("isam2", 1, step=200, final_ate_m=LOGS[:20].tolist()), told("graph", final_ate_m=LOGS[:20], cpu_s=[3] * 20)
    )
    assert use(found).backend == "isam2"
    assert use(found, "final").backend == "graph"
    assert "3.00 s of CPU for the whole log against 200 s of isam2 (each timed once)" in use(found, "final").why


def test_times_that_others_ran_beside_are_marked() -> None:
    found = said(rows("a", 1, timing_alone=0), rows("b", 2))
    assert "timed while others ran beside" in use(found).why
    assert any("a* 10.0 s" in sentence for sentence in found.sentences)


def test_costs_are_ranked_without_dead_reckoning() -> None:
    sentences = " ".join(
        said(rows("a", 1, cpu_s=2.0), rows("b", 1, cpu_s=1.0), rows("dead-reckoning", 9, cpu_s=0.1)).sentences
    )
    assert "Median CPU time for the whole log: b 1.00 s and a 2.00 s. Each cell was timed once" in sentences


def test_the_order_is_by_accuracy_with_dead_reckoning_last() -> None:
    parts = (
        rows("dead-reckoning", 9)
        + rows("c", 3)
        + told("none", cpu_s=[1] * 20)
        + rows("a", 1)
        + told("late", final_ate_m=LOGS)
    )
    assert [line.backend for line in ordered(lines(parts))] == ["a", "c", "late", "none", "dead-reckoning"]
    unknown = told("z", "", cpu_s=[1]) + told("a", "", cpu_s=[2])
    assert [line.backend for line in ordered(lines(unknown))] == ["z", "a"]


def test_a_lower_median_does_not_outrank_one_that_is_closer_for_sure() -> None:
    hard = [1.0] * 9 + [5.0] * 11
    a = told("a", ate_m=[0.9 * h for h in hard[:8]] + [4.0] + [6.0] * 11)
    b = told("b", ate_m=[value * 1.2 for value in [0.9 * h for h in hard[:8]] + [4.0] + [6.0] * 11])
    found = ranking(lines(b + a), "ate_m")
    assert [line.backend for line in found.lines] == ["a", "b"]
    assert found.between(*found.lines).ratio == pytest.approx(1.2)


def test_repeats_on_a_log_are_averaged_and_a_failure_among_them_is_one() -> None:
    (line,) = lines(told("a", one_log=True, ate_m=[1.0, 3.0]))
    assert line.by_log("ate_m") == {"d": 2.0}
    assert line.runs("ate_m") == [("d", 1.0), ("d", 3.0)]
    (line,) = lines(failing(told("a", one_log=True, ate_m=[1.0, 3.0], nees=[2.0, 4.0]), 1))
    assert line.by_log("ate_m") == {"d": inf}
    assert line.by_log("nees") == {"d": 2.0}
    assert (line.failed, line.done) == (1, 1)


# What neither the sentences nor the advice may make of little, of failures, or of nothing


def skipping(found: list[Row], *seeds: int) -> list[Row]:
    """The cells, those of the seeds skipped."""
    return failing(found, *seeds, status="skipped")


def test_who_ran_on_a_few_logs_alone_neither_hides_the_others_nor_is_advised() -> None:
    found = said(skipping(rows("a", 1), *range(4, 20)), rows("b", 2), rows("c", 4), rows("dead-reckoning", 9))
    assert found.sentences[0].startswith("b's online path is")
    assert "Too few logs in common with b to test, 6 at least: a (4)." in found.sentences
    assert "b and c beat dead reckoning, b" in " ".join(found.sentences)
    assert use(found).backend == "b"
    alone = said(skipping(rows("a", 1), *range(4, 20)), skipping(rows("b", 2), *range(16)))
    assert use(alone) == Use("online", "", "No backend ran on enough logs: a test needs 6 at least.")


def test_too_few_logs_for_so_many_pairs_are_no_reason_to_advise_dead_reckoning() -> None:
    found = said(rows("a", 1, 6), rows("b", 1, 6), rows("dead-reckoning", 10, 6))
    assert found.sentences[1].endswith(" (6 logs are too few to test 2 pairs, 7 would do).")
    assert use(found).backend == ""
    assert re.fullmatch(
        r"Not significant: [ab] was measured [\d.]+ to \d+ times better than dead reckoning, but 6 logs are too "
        r"few to test 2 pairs, 7 would do\.",
        use(found).why,
    )
    assert use(said(rows("a", 1, 7), rows("b", 1, 7), rows("dead-reckoning", 10, 7))).backend in ("a", "b")


def test_one_that_is_beaten_for_sure_is_not_advised_though_it_is_level_with_the_best() -> None:
    wide = told("wide", ate_m=(LOGS[:12] * np.exp(np.linspace(-1.0, 1.4, 12))).tolist(), step_us_p50=[50] * 12)
    found = said(wide, rows("a", 1, 12, sd=0.001), rows("b", 1.1, 12, sd=0.001, step=1))
    (best,) = [c for c in found.comparisons["ate_m"] if (c.first, c.second) == ("a", "b")]
    assert best.holds
    assert use(found).backend == "a"


def test_where_each_is_beaten_by_another_nobody_is_the_best() -> None:
    each = {"a": (1, 0, 2), "b": (2, 1, 0), "c": (0, 2, 1)}
    cells = [
        Row({**row.columns, "ate_m": row.columns["ate_m"] * level[k // 10]}, "") if level[k // 10] else row
        for name, level in each.items()
        for k, row in enumerate(skipping(rows(name, 1, 30), *[k for k in range(30) if not level[k // 10]]))
    ]
    found = said(cells)
    assert "No online path is the best" in " ".join(found.sentences)
    assert "differ significantly" not in " ".join(found.sentences)
    assert use(found).backend == ""


def test_an_error_of_nothing_makes_no_failure_of_the_others_nor_rounding_a_difference() -> None:
    found = said(rows("a", 0), rows("b", 1))
    assert "failed" not in " ".join([*found.sentences, use(found).why])
    assert use(found).backend == "a"
    assert "alike" in said(rows("a", 1e-14), rows("b", 3e-14)).sentences[0]
    assert "alike" in said(rows("a", 1e-14), rows("b", 3e-14), rows("c", 1)).sentences[1]


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        (4, inf, "at least 4.0 times better"),
        (0, 0.25, "at least 4.0 times worse"),
        (inf, inf, "beyond measure better"),
        (0, 0, "beyond measure worse"),
        (0, 2, "at most 2.0 times better"),
        (1, inf, "no worse"),
        (0, inf, "anything from worse to better"),
    ],
)
def test_a_difference_without_an_end_is_told_by_the_other(low: float, high: float, words: str) -> None:
    assert between(Comparison("a", "b", 9, 9, 1, low, high, 0.01, 0.1, 1, 9)) == words


def test_a_cost_of_nothing_is_not_about_that_of_another() -> None:
    why = use(said(rows("a", 1, step=0.0), rows("b", 2, step=20.0))).why
    assert why.endswith("; 0 µs a step against 20.0 of b (each timed once).")


CHANCES = 120
"""Records drawn for what must hold of every verdict."""


def test_of_whatever_record_the_verdict_bears_what_it_says() -> None:
    for seed in range(CHANCES):
        rng = np.random.default_rng([SEED, seed])
        n = int(rng.choice((6, 7, 10, 20)))
        cells: list[Row] = []
        for name in ("a", "b", "c", "d", "dead-reckoning")[int(rng.integers(4)) :]:
            errors = LOGS[:n] * np.exp(rng.normal(0, rng.choice((0.02, 0.5)), n)) * np.exp(rng.normal(0, 0.5))
            part = told(name, ate_m=errors.tolist(), step_us_p50=[float(rng.choice((0, 1, 30)))] * n, cpu_s=[1.0] * n)
            part = failing(part, *np.flatnonzero(rng.random(n) < rng.choice((0, 0, 0.3, 0.7))).tolist())
            cells += skipping(part, *np.flatnonzero(rng.random(n) < rng.choice((0, 0, 0.5))).tolist())
        found = said(cells)
        words = " ".join([*found.sentences, *(one.why for one in found.uses)])
        assert not re.search(
            r"nan|not a number|∞|\binf|None(?! can be named)|(?<![\d.,])0(\.0)? (%|times)|by beyond", words
        ), words
        pairs = found.comparisons.get("ate_m", [])
        sure = [c for c in pairs if c.second != "dead-reckoning" and standing(c) in ("better", "worse")]
        for c in sure:
            assert c.holds
            assert [one.backend for one in found.uses] != [c.second if c.low > 1 else c.first]
        assert bool(re.search(r"'s online path is .*closer to the truth", words)) <= bool(sure), words
        for line in lines(cells):
            assert not line.failed or f"{line.backend} failed on {line.failed} of {n} cells" in words


@pytest.mark.parametrize("nees", [None, 0.0, 0.3, 1.0, 9.0])
def test_a_backend_with_a_covariance_that_is_none_is_neither_cautious_nor_consistent(nees: float | None) -> None:
    void = rows("void", 1, n=10, nees=nees, nees_void=[0] * 9 + [1], step=1.0)
    found = said(void, rows("ekf", 1, n=10, nees=1.0, nees_void=0), rows("dead-reckoning", 5, n=10))
    assert belief_word(lines(void)[0]) == "not a covariance"
    text = " ".join(found.sentences)
    assert "Not a covariance at some steps, so that NEES does not judge void." in text
    assert "void (" not in text
    assert use(found).backend == "ekf"
    assert "consistent, and with covariances, as void is not at every step" in use(found).why
    alone = said(void, rows("dead-reckoning", 5, n=10))
    assert "its covariances are none at some steps" in use(alone).why


def test_right_ids_are_compared_log_by_log() -> None:
    share = np.linspace(0.001, 0.003, 12)
    found = lines([
        *rows("ekf", 1.0, 12, wrong_share=(10 * share).tolist()),
        *rows("ukf", 1.0, 12, wrong_share=share.tolist()),
        *rows("kf", 1.0, 12, wrong_share=(share[::-1] + 1e-6).tolist()),
    ])  # fmt: skip
    (said,) = association_sentences(found)
    assert said.startswith("Data association (12 logs, median): ukf's ids are right for 99.80 % of the sightings")
    assert "kf's for 99.80 % (no significant difference)" in said
    assert "ekf's for 98.0 % (significantly fewer, Wilcoxon, Holm: p =" in said


def test_of_few_logs_right_ids_are_only_stated() -> None:
    found = lines([*rows("ekf", 1.0, 2, wrong_share=[0.5, 0.25]), *rows("ukf", 1.0, 2, final_wrong_share=[0.0, 0.0])])
    assert association_sentences(found) == [
        "Data association (2 logs, median): ekf's ids are right for 62.5 % of the sightings that it used."
    ]
    assert association_sentences(lines(rows("ekf", 1.0))) == []


def test_clauses_and_sentences_have_the_same_word_for_a_backend() -> None:
    """The caption of the figure of NEES has the clauses, without sizes and under the names of its legend."""
    spread = np.linspace(-1, 1, 7)
    found = lines([
        *told("ekf", nees=(1.8 + 1.2 * spread).tolist()), *told("fastslam", nees=(3.0 + 2.4 * spread).tolist()),
        *told("smoother", nees=(1.3 + 0.5 * spread).tolist()),
    ])  # fmt: skip
    (sentence,) = belief_sentences(found)
    clauses = belief_clauses(found, {"ekf": "EKF", "fastslam": "FastSLAM", "smoother": "smoother"})
    assert clauses == (
        "smoother is consistent; FastSLAM is consistent or a little overconfident; it is not clear for EKF"
    )
    for one in ("is consistent;", "is consistent or a little overconfident;", "it is not clear for ekf ("):
        assert one in sentence
    assert belief_clauses(found, {"ekf": "EKF"}) == "it is not clear for EKF"
    assert belief_clauses(lines(told("ekf", ate_m=[1.0])), {"ekf": "EKF"}) == ""
