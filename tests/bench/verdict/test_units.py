"""Logs in clusters: each cluster counts once, and logs by themselves are judged as if clusters were unknown."""

from collections.abc import Sequence
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
import pytest
from scipy import stats

from judged_rows import rows
from slamduel.bench.run.document import document
from slamduel.bench.verdict.bands import averaged
from slamduel.bench.verdict.candidates import accelerated, mixed_model, percentile
from slamduel.bench.verdict.ranking import standing
from slamduel.bench.verdict.statistics import INDEPENDENT, compare, estimate, median_over, shift
from slamduel.bench.verdict.summary import lines, typical
from slamduel.bench.verdict.units import units
from slamduel.bench.verdict.verdict import Verdict, verdict
from slamduel.core.se2 import Array, Ints

SETS = np.repeat(np.arange(9), 5)


def of_sets(sets: Ints | Sequence[int]) -> list[str]:
    return [f"set {k}" for k in sets]


def hodges_lehmann(d: Array) -> float:
    return float(np.median([(a + b) / 2 for a, b in combinations_with_replacement(d.tolist(), 2)]))


def wilcoxon(d: Array) -> float:
    """scipy's exact p."""
    return float(np.asarray(stats.wilcoxon(d, method="exact"))[1])


def clustered(seed: int, sets: Ints, ratio: float = 1.0) -> dict[str, dict[str, float]]:
    """The errors of two backends, on logs of which those of a set have most of their luck in common."""
    rng = np.random.default_rng(seed)
    luck = rng.normal(0, 0.3, sets.max() + 1)[sets] + rng.normal(0, 0.1, len(sets))
    hard = np.exp(rng.normal(0, 1, len(sets)))
    first, second = hard, hard * ratio * np.exp(luck)
    return {name: {f"{k}": float(e) for k, e in enumerate(of)} for name, of in (("a", first), ("b", second))}


# ---------------------------------------------------------------------------------------------------- what a unit is


def test_logs_without_a_cluster_are_units_by_themselves() -> None:
    for found in (units({"a": None, "b": None}), units({"a": "", "b": None})):
        assert (found.n, found.logs, found.noun, found.scope, str(found)) == (2, 2, "log", "", "2 logs")
    mixed = units({"a": "x", "b": "x", "c": None, "d": None})
    assert (mixed.n, mixed.logs, str(mixed)) == (3, 4, "4 logs in 3 clusters")
    assert mixed.unit("a") == mixed.unit("b") != mixed.unit("c")
    assert mixed.unit("of another dataset") == "of another dataset"


def test_a_log_that_is_called_like_a_cluster_is_not_in_it() -> None:
    assert units({"x": None, "b": "x", "c": "x", "d": "y"}).n == 3


def test_logs_of_one_cluster_alone_are_the_units_and_speak_for_it_alone() -> None:
    found = units(dict.fromkeys("abcde", "set 6"))
    assert (found.n, found.logs, found.noun, str(found)) == (5, 5, "log", "5 logs of set 6")
    assert found.scope == (
        "All 5 logs are of one cluster, set 6: what is said holds for logs of set 6, and nothing is claimed of others."
    )
    assert units({"a": "set 6"}).scope == ""  # one log claims nothing anyway


def test_clusters_of_one_log_each_change_no_digit() -> None:
    errors = clustered(1, SETS)
    stated = units({f"{k}": f"set {k}" for k in range(45)})
    assert compare(errors, stated) == compare(errors, INDEPENDENT) == compare(errors)
    values = list(errors["a"].values())
    assert estimate(values, [stated.unit(f"{k}") for k in range(45)]) == estimate(values)
    assert median_over(errors["a"], stated) == np.median(values)
    plain, named = rows("a", 1) + rows("b", 2), rows("a", 1) + rows("b", 2)
    for row in named:
        row.columns["cluster"] = f"drive {row.columns['seed']}"  # pyright: ignore[reportIndexIssue]
    assert verdict(lines(named)) == verdict(lines(plain))


# ------------------------------------------------------------------------------------------------- intervals and tests


@pytest.mark.parametrize("sets", [SETS, np.array([0, 0, 0, 1, 2, 2, 3, 4, 5, 5, 5, 5, 6, 7])], ids=["even", "uneven"])
def test_each_cluster_counts_once_with_the_estimate_of_its_logs(sets: Ints) -> None:
    errors = clustered(2, sets, 1.6)
    (found,) = compare(errors, units({f"{k}": name for k, name in enumerate(of_sets(sets))}))
    d = np.log(list(errors["b"].values())) - np.log(list(errors["a"].values()))
    each = np.array([hodges_lehmann(d[sets == k]) for k in range(sets.max() + 1)])
    assert (found.n, found.units) == (len(sets), len(each))
    assert np.log(found.ratio) == pytest.approx(hodges_lehmann(each))
    assert found.p == pytest.approx(wilcoxon(each))
    walsh = np.sort([(a + b) / 2 for a, b in combinations_with_replacement(each.tolist(), 2)])
    outside = next(k for k in range(len(walsh)) if wilcoxon(each - walsh[k] - 1e-9) > 0.05)
    assert np.log([found.low, found.high]) == pytest.approx([walsh[outside], walsh[-1 - outside]])
    assert found.closer == int((d > 0).sum())  # of the logs


def test_the_median_over_clusters_is_that_of_their_medians() -> None:
    values = np.random.default_rng(3).exponential(size=45)
    found = estimate(values.tolist(), of_sets(SETS))
    medians = [float(np.median(values[k == SETS])) for k in range(9)]
    assert found == estimate(medians)._replace(n=45)
    assert median_over(
        {f"{k}": v for k, v in enumerate(values)}, units({f"{k}": f"{s}" for k, s in enumerate(SETS)})
    ) == (found.value)


@pytest.mark.parametrize("clusters", [2, 3, 4, 5])
def test_of_few_clusters_there_is_an_interval_and_no_test(clusters: int) -> None:
    sets = np.repeat(np.arange(clusters), 5)
    d = np.random.default_rng(4).normal(0.5, 0.2, len(sets))
    found = shift(d, units=of_sets(sets))
    each = [hodges_lehmann(d[sets == k]) for k in range(clusters)]
    expected = stats.t.interval(0.95, clusters - 1, np.mean(each), stats.sem(each))
    assert (found.low, found.high) == pytest.approx(expected, rel=1e-6)
    assert np.isnan(found.p)
    assert np.isnan(found.effect)
    d[:3] = np.inf  # of the five logs of a cluster
    assert shift(d, units=of_sets(sets))[1:3] == (-np.inf, np.inf)
    d[:3] = (np.inf, 0.5, 0.5)  # one failure of five moves the estimate of its cluster, and no more
    assert np.isfinite(shift(d, units=of_sets(sets))[1:3]).all()


def test_below_six_logs_clusters_have_no_interval_either() -> None:
    found = shift(np.array([0.1, 0.2, 0.3, 0.4, 0.5]), units=of_sets([0, 0, 1, 1, 2]))
    assert (found.n, found.units) == (5, 3)
    assert np.isnan(found.low)
    one = shift(np.linspace(1, 2, 8), units=["one"] * 8)
    assert np.isnan(one.low)
    assert np.isnan(estimate([1.0] * 25, of_sets(np.repeat(np.arange(5), 5))).low)


def test_a_difference_in_one_cluster_alone_is_none_in_the_others() -> None:
    """Eight logs of one set, and one log of each of five: taken one by one they would be significant."""
    sets = [0] * 15 + [1, 2, 3, 4, 5]
    d = np.concatenate((np.full(15, 0.5), [-0.1, 0.2, -0.3, 0.15, -0.05])) + np.linspace(0, 1e-3, 20)
    assert shift(d).p < 0.01
    assert shift(d, units=of_sets(sets)).p > 0.2


def test_the_bands_of_nees_count_a_cluster_once() -> None:
    t = np.arange(50.0)
    rng = np.random.default_rng(5)
    runs = [(t, rng.chisquare(3, 50)) for _ in range(4)]
    plain, doubled = averaged(runs), averaged([*runs, *runs], [*"abcd", *"abcd"])
    assert plain is not None
    assert doubled is not None
    for one, other in zip(plain, doubled, strict=True):
        np.testing.assert_allclose(one, other)
    alone = averaged([*runs, *runs])
    assert alone.n.max() == 8  # what would be wrong: the same logs twice
    assert averaged(runs, ["a"] * 4) is None  # one cluster is not averaged over any


# ------------------------------------------------------------------------------------------------------ what is said


def of_clusters(clusters: int, each: int, *backends: tuple[str, float], sd: float = 0.05, **more: Any) -> Verdict:
    return verdict(lines(cells(clusters, each, *backends, sd=sd, **more)))


def cells(clusters: int, each: int, *backends: tuple[str, float], sd: float = 0.05, **more: Any) -> list[Any]:
    found = [row for name, times in backends for row in rows(name, times, clusters * each, sd=sd, **more)]
    for row in found:
        seed = row.columns["seed"]
        row.columns["cluster"] = f"set {seed // each}"  # pyright: ignore[reportIndexIssue]
        row.columns["log_name"] = f"log {seed}"  # pyright: ignore[reportIndexIssue]
    return found


def test_a_claim_names_logs_and_clusters() -> None:
    found = of_clusters(8, 5, ("a", 1), ("b", 2))
    assert found.basis == "40 logs in 8 clusters; the true path is known"
    assert "closer to the truth than b's on room, 40 logs in 8 clusters (Wilcoxon, Holm: " in found.sentences[0]
    assert (
        "Logs of one cluster are not independent of each other: intervals and tests are over the 8 clusters, and hold "
        "for clusters like these." in found.sentences
    )
    assert found.uses[0].backend == "a"


def test_of_five_clusters_a_difference_is_measured_and_not_claimed() -> None:
    found = of_clusters(5, 5, ("a", 1), ("b", 2))
    (c,) = found.comparisons["ate_m"]
    assert standing(c) == "unproven"
    assert c.low > 1
    assert found.sentences[0].startswith(
        "No claim can be made on room, 25 logs in 5 clusters of a's online path, measured "
    )
    assert found.sentences[0].endswith("times better than b's: 5 clusters are too few to test 1 pair, 6 would do.")
    assert found.uses[0].why == "25 logs in 5 clusters are too few, 6 clusters at least."
    four = of_clusters(5, 5, ("a", 1), ("b", 2), ("c", 3), ("d", 4)).sentences[0]
    assert "5 clusters are too few to test 6 pairs, 8 would do" in four


def test_of_few_logs_in_clusters_nothing_is_said_but_what_was_measured() -> None:
    found = of_clusters(2, 2, ("a", 1), ("b", 2))
    assert found.sentences[0].startswith(
        "room: 4 logs in 2 clusters are too few to test, 6 clusters at least; measured, median error of the "
    )
    assert found.uses[0].why == "4 logs in 2 clusters are too few, 6 clusters at least."


def test_of_one_cluster_the_logs_count_and_nothing_is_claimed_of_others() -> None:
    found = of_clusters(1, 20, ("a", 1), ("b", 2))
    assert found.basis == "20 logs of set 0; the true path is known"
    assert "closer to the truth than b's on room, 20 logs of set 0 (Wilcoxon, Holm: " in found.sentences[0]
    assert "All 20 logs are of one cluster, set 0: " in " ".join(found.sentences)
    plain = verdict(lines(rows("a", 1) + rows("b", 2)))
    assert found.comparisons == plain.comparisons


def test_a_backend_that_ran_in_too_few_clusters_is_not_tested() -> None:
    both = cells(8, 5, ("a", 1), ("b", 2))
    few = [row for row in both if row.columns["backend"] == "a" or row.columns["seed"] < 5]
    said = " ".join(verdict(lines(few)).sentences)
    assert "Too few clusters in common with a to test, 6 at least: b (1)." in said


def test_consistency_takes_an_interval_over_clusters() -> None:
    nees: dict[str, Any] = {"nees": np.linspace(1.3, 1.5, 40).tolist(), "nees_inside": [0.8] * 40}
    assert "a (1.3" in " ".join(of_clusters(8, 5, ("a", 1), **nees).sentences)
    few: dict[str, Any] = {name: values[:25] for name, values in nees.items()}
    assert "(by a rule of thumb: an interval takes 6 clusters)" in " ".join(
        of_clusters(5, 5, ("a", 1), **few).sentences
    )
    (line,) = lines(cells(5, 5, ("a", 1)))
    found = typical(line, "ate_m")
    assert (found.n, found.interval) == (25, False)


def test_the_document_has_both_numbers() -> None:
    found = lines(cells(5, 5, ("a", 1), ("b", 2)))
    made = document("x", "x/report.html", 0, found, {"room": verdict(found)}, "", {})["datasets"][0]
    assert (made["logs"], made["units"], made["cluster"]) == (25, 5, None)
    assert made["verdict"]["comparisons"]["ate_m"][0]["units"] == 5
    one = lines(cells(1, 6, ("a", 1)))
    assert document("x", "y", 0, one, {"room": verdict(one)}, "", {})["datasets"][0]["cluster"] == "set 0"


# ---------------------------------------------------------------------------------- the methods that were not chosen


@pytest.mark.parametrize("method", [mixed_model, percentile, accelerated])
def test_the_other_methods_hold_the_mean_between_their_ends(method: Any) -> None:
    d = np.random.default_rng(6).normal(0.3, 1, 45)
    low, high = method(d, of_sets(SETS))
    assert low < d.mean() < high


def test_a_mixed_model_of_strong_clusters_is_the_t_of_their_means() -> None:
    d = np.random.default_rng(7).normal(0, 1, 9)[SETS] + np.random.default_rng(8).normal(0, 0.01, 45)
    means = [d[k == SETS].mean() for k in range(9)]
    assert mixed_model(d, of_sets(SETS)) == pytest.approx(stats.t.interval(0.95, 8, np.mean(means), stats.sem(means)))
