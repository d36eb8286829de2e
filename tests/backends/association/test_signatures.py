"""Signatures in data association: against dense algebra, and against the same without."""

from dataclasses import replace
from itertools import product
from math import log
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from driven import run
from lost_logs import ring, unnamed
from slamduel.backends._joint_compatibility import Frame, Gates
from slamduel.backends._rules import CHEAPEST, JOINT, NEAREST, NEW, OPEN, decide, decide_frame
from slamduel.backends.association.quantiles import gates, quantile
from slamduel.backends.association.signatures import SignatureFilters
from slamduel.bench.logs.difficulty import difficulty
from slamduel.bench.measure.association import association_columns
from slamduel.core.factors import Dataset, Map, RangeBearing, Truth
from slamduel.core.se2 import Array
from slamduel.core.signatures import Signatures
from slamduel.datasets.on_demand.signatures import WorldSignatures, with_signatures

MATCH, FAR = quantile(0.999, 1, 3), quantile(0.9999, 1, 3)
GATES = gates(0.9999, 20, 3)


def signed(dataset: Dataset, bits: float, seed: int = 0) -> Dataset:
    """The dataset with signatures of so many bits."""
    return with_signatures(dataset, WorldSignatures(signature_bits=bits), np.random.default_rng(seed))


def hidden(dataset: Dataset) -> Dataset:
    truth = dataset.truth
    assert truth is not None
    return Dataset(unnamed(dataset.log), truth._replace(assigned=dataset.log.ids))


def wrong(dataset: Dataset, rule: str, name: str = "ekf", **options: Any) -> dict[str, Any]:
    assert dataset.truth is not None
    assert dataset.truth.assigned is not None
    backend = run(name, dataset.log, association=rule, **options)[0]
    return association_columns(backend.assigned(), dataset.truth.assigned)


def test_gates_have_three_degrees_of_freedom_a_pair() -> None:
    assert quantile(0.999, 1, 3) == pytest.approx(chi2.ppf(0.999, 3))
    assert gates(0.95, 9, 3)[1:] == pytest.approx(chi2.ppf(0.95, 3 * np.arange(1, 10)))
    assert quantile(0.5, 1, 1) == pytest.approx(chi2.ppf(0.5, 1))


def test_a_filter_is_the_mean_weighted_by_information() -> None:
    rng = np.random.default_rng(2)
    filters, seen = SignatureFilters(), list[tuple[int, float, float]]()
    for _ in range(30):
        ids = rng.permutation(100)[:5].tolist()
        s, var = rng.normal(size=5), rng.uniform(0.1, 2.0, 5)
        filters.learn(ids, Signatures.from_arrays(s, var))
        seen += zip(ids, s.tolist(), var.tolist(), strict=True)
    some = sorted({landmark for landmark, _, _ in seen})
    for landmark, (mean, var) in zip(some, filters.of(some).tolist(), strict=True):
        own = np.array([one[1:] for one in seen if one[0] == landmark])
        assert 1 / var == pytest.approx((1 / own[:, 1]).sum())
        assert mean == pytest.approx(np.average(own[:, 0], weights=1 / own[:, 1]))
    every = np.array([s for _, s, _ in seen])
    assert filters.of([1000])[0] == pytest.approx([every.mean(), every.var()])  # any landmark's, as far as is known


def test_before_any_is_known_all_are_alike() -> None:
    pairs = SignatureFilters().pairs(Signatures.from_arrays(np.array([0.2, 7.0]), np.array([0.1, 0.1])), [5, 6, 7])
    np.testing.assert_array_equal(pairs, np.zeros((2, 3, 2)))


def drawn(rng: np.random.Generator) -> tuple[RangeBearing, Array, Array, Array]:
    """Three sightings, three landmarks close together with correlated errors, and their pairs of signatures."""
    expected = np.column_stack((rng.uniform(3, 3.4, 3), rng.uniform(-0.1, 0.1, 3)))
    root = rng.standard_normal((6, 8)) * 0.04
    R = np.tile(np.diag([0.05**2, 0.03**2]), (3, 1, 1))
    z = expected[rng.permutation(3)] + rng.normal(0, 0.08, (3, 2))
    signatures = Signatures.from_arrays(rng.uniform(size=3), rng.uniform(0.01, 0.1, 3))
    filters = SignatureFilters()
    filters.learn([0, 1, 2], Signatures.from_arrays(rng.uniform(size=3), rng.uniform(0.01, 0.1, 3)))
    return (
        RangeBearing(np.full(3, -1), z, R),
        expected,
        root @ root.T,
        filters.pairs(signatures, [0, 1, 2]),
    )


def joint(seen: RangeBearing, expected: Array, cov: Array, signed: Array, pairs: list[tuple[int, int]]) -> float:
    """The squared distance of all pairs, by one dense covariance of three rows a pair."""
    k = len(pairs)
    S, off = np.zeros((3 * k, 3 * k)), np.zeros(3 * k)
    for p, (i, a) in enumerate(pairs):
        spread = float(np.exp(signed[i, a, 1]))
        off[3 * p : 3 * p + 2], off[3 * p + 2] = seen.z[i] - expected[a], np.sqrt(signed[i, a, 0] * spread)
        for q, (_, b) in enumerate(pairs):
            S[3 * p : 3 * p + 2, 3 * q : 3 * q + 2] = cov[2 * a : 2 * a + 2, 2 * b : 2 * b + 2]
        S[3 * p : 3 * p + 2, 3 * p : 3 * p + 2] += seen.cov[i]
        S[3 * p + 2, 3 * p + 2] = spread
    return float(off @ np.linalg.solve(S, off)) if k else 0.0


@pytest.mark.parametrize("seed", range(30))
def test_the_rules_weigh_three_rows_of_a_pair(seed: int) -> None:
    """Every hypothesis is tried, by dense algebra; joint compatibility without its gates of conditional distances."""
    seen, expected, cov, signed = drawn(np.random.default_rng(seed))
    found = {
        rule: decide_frame(rule, seen.z, seen.cov, expected, cov, MATCH, GATES, FAR, 10**6, signed)[0]
        for rule in (NEAREST, CHEAPEST)
    }
    noise = np.zeros((6, 6))
    for i, R in enumerate(seen.cov):
        noise[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = R
    frame = Frame(seen.z, noise, expected, cov)
    found[JOINT] = decide(JOINT, frame, np.zeros(3, np.int64), Gates(MATCH, np.inf, GATES, 10**6), FAR, signed)[0]
    d2 = np.array([[joint(seen, expected, cov, signed, [(i, a)]) for a in range(3)] for i in range(3)])
    order, nearest = sorted((d2[i, a], i, a) for i in range(3) for a in range(3) if d2[i, a] < MATCH), {}
    for _, i, a in order:
        if i not in nearest and a not in nearest.values():
            nearest[i] = a
    assert {i: a for i, a in enumerate(found[NEAREST].tolist()) if a >= 0} == nearest
    assert all(a in (NEW, OPEN) for i, a in enumerate(found[NEAREST].tolist()) if i not in nearest)
    hypotheses = [
        [(i, a) for i, a in enumerate(choice) if a >= 0]
        for choice in product(range(-1, 3), repeat=3)
        if len({a for a in choice if a >= 0}) == sum(a >= 0 for a in choice)
    ]
    fitting = [
        (-len(pairs), joint(seen, expected, cov, signed, pairs), pairs)
        for pairs in hypotheses
        if all(d2[pair] < MATCH for pair in pairs)
    ]
    best = min(one for one in fitting if one[1] < (GATES[-one[0]] if one[0] else np.inf))
    assert [(i, a) for i, a in enumerate(found[JOINT].tolist()) if a >= 0] == best[2]
    own = seen.cov[:, None] + np.array([cov[2 * a : 2 * a + 2, 2 * a : 2 * a + 2] for a in range(3)])[None]
    cost = d2 + np.log(np.linalg.det(own)) + signed[..., 1]
    inside = d2 < MATCH
    worst = max(MATCH, float(np.where(inside, cost - d2 + MATCH, -np.inf).max()))
    likeliest = min(
        (sum(cost[pair] for pair in pairs) + (3 - len(pairs)) * worst, pairs)
        for pairs in hypotheses
        if all(inside[pair] for pair in pairs)
    )
    assert [(i, a) for i, a in enumerate(found[CHEAPEST].tolist()) if a >= 0] == likeliest[1]


@pytest.mark.parametrize("rule", [NEAREST, CHEAPEST, JOINT])
def test_without_signatures_the_decision_is_that_of_signatures_that_agree(rule: int) -> None:
    for seed in range(20):
        seen, expected, cov, signed = drawn(np.random.default_rng(seed))
        plain = decide_frame(rule, seen.z, seen.cov, expected, cov, MATCH, GATES, FAR, 10**6)
        alike = decide_frame(rule, seen.z, seen.cov, expected, cov, MATCH, GATES, FAR, 10**6, np.zeros_like(signed))
        assert plain[0].tolist() == alike[0].tolist()
        assert plain[1] == alike[1]


def test_a_signature_alone_makes_a_landmark_new() -> None:
    expected, R = np.array([[2.0, 0.0]]), np.array([np.diag([0.01, 0.01])])
    for off, said in ((0.0, 0), (0.9 * MATCH, 0), ((MATCH + FAR) / 2, OPEN), (1.1 * FAR, NEW)):
        signed = np.array([[(off, log(0.1))]])
        for rule in (NEAREST, CHEAPEST):
            pair, _ = decide_frame(rule, expected, R, expected, np.eye(2) * 1e-4, MATCH, GATES, FAR, 9, signed)
            assert pair.tolist() == [said]


@pytest.mark.parametrize("rule", ["nn", "ml", "jcbb"])
def test_more_bits_make_fewer_mistakes(rule: str) -> None:
    dataset = hidden(ring(landmarks=80, odometry=0.1, steps=400))
    shares = [wrong(signed(dataset, bits), rule)["wrong_share"] for bits in (0.0, 1.0, 4.0)]
    assert shares[2] <= shares[1] <= shares[0]
    assert shares[2] < 0.001
    assert rule != "nn" or shares[0] > 3 * shares[2]


@pytest.mark.parametrize("options", [{"lookahead": 20}, {"confirm": 2}, {"retire": 50}, {"moved": "out"}])
def test_every_option_of_association_has_them(options: dict[str, Any]) -> None:
    dataset = hidden(ring(landmarks=80, odometry=0.05, steps=200))
    row = wrong(signed(dataset, 4.0), "jcbb", **options)
    assert row["wrong_share"] < 0.002
    assert row["dropped_share"] < 0.25


@pytest.mark.parametrize("name", ["smoother", "isam2", "ukf"])
def test_behind_every_backend_it_is_the_same_layer(name: str) -> None:
    dataset = hidden(ring(landmarks=80, odometry=0.1, steps=150))
    assert wrong(signed(dataset, 4.0), "nn", name)["wrong_share"] < 0.002


def test_ids_that_are_known_teach_the_signature_of_others() -> None:
    """Behind known ids the layer has every landmark's mean; the path is that without signatures, bit for bit."""
    dataset = signed(ring(), 2.0)
    log, found = dataset.log, dataset.log.signatures
    assert found is not None
    backend, path = run("ekf", log, association="jcbb")
    assert path.tobytes() == run("ekf", log.without_signatures(), association="jcbb")[1].tobytes()
    ids = np.unique(log.ids)
    means = [found.s[log.ids == landmark].mean() for landmark in ids]
    np.testing.assert_allclose(backend.signatures(ids)[:, 0], means, atol=1e-12)
    some = replace(log, ids=np.where(np.arange(len(log.ids)) % 3 == 0, -1, log.ids))
    behind = run("ekf", some, association="nn")[0]
    assert (behind.assigned() == log.ids).mean() > 0.95
    assert behind.signatures(ids)[:, 0] == pytest.approx(means, abs=0.05)


def test_a_given_map_has_none_until_its_landmarks_are_sighted() -> None:
    dataset = hidden(ring(landmarks=40))
    assert dataset.truth is not None
    known = dataset.truth.map
    assert known is not None
    given = Map(known.ids, known.xy, 1e-4 * np.eye(2 * len(known.ids)))
    log = replace(signed(dataset, 2.0).log, prior=dataset.log.prior._replace(map=given))
    row = wrong(Dataset(log, dataset.truth), "jcbb")
    assert row["wrong_share"] == 0
    assert row["dropped_share"] < 0.05


def test_the_difficulty_of_a_log_takes_them_into_account() -> None:
    dataset = hidden(ring(landmarks=80, odometry=0.1, steps=400))
    plain, with_bits = difficulty(dataset), difficulty(signed(dataset, 4.0))
    assert plain is not None
    assert with_bits is not None
    assert with_bits.candidates < plain.candidates
    assert with_bits.wrong["nn"] < plain.wrong["nn"] / 2


def test_of_no_ids_and_no_truth_nothing_is_drawn_twice() -> None:
    """Without truth the ids of the log tell whose signature it is."""
    log = ring().log
    found = signed(Dataset(log, None), 2.0).log.signatures
    other = signed(Dataset(log, Truth(np.zeros(0), np.zeros((0, 3)))), 2.0).log.signatures
    assert found is not None
    assert other is not None
    assert found.s.tobytes() == other.s.tobytes()
