"""Rules of data association: against scipy, and against trying every hypothesis."""

from itertools import product

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment
from scipy.stats import chi2

from random_logs import random_covariance
from slamduel.backends._assignment import cheapest
from slamduel.backends._joint_compatibility import Frame, Gates, search
from slamduel.backends._rules import CHEAPEST, JOINT, NEAREST, NEW, OPEN, decide, decide_frame
from slamduel.backends.association.quantiles import gates, quantile
from slamduel.core.se2 import Array, Ints, wrap

FAR, MATCH = quantile(0.9999, 1), quantile(0.999, 1)
GATES = gates(0.9999, 40)


class Drawn:
    """Sightings, some of them of expected landmarks, with errors that they have in common."""

    def __init__(self, rng: np.random.Generator, sightings: int, landmarks: int, steps: int = 1) -> None:
        self.expected = np.column_stack((rng.uniform(1, 6, landmarks), rng.uniform(-3.1, 3.1, landmarks)))
        root = rng.standard_normal((2 * landmarks, 3)) * 0.08
        self.cov = root @ root.T + random_covariance(rng, [0.05] * (2 * landmarks))
        k = sightings * steps
        self.noise = random_covariance(rng, [0.05] * (2 * k)) if steps > 1 else np.zeros((2 * k, 2 * k))
        if steps == 1:
            for i in range(k):
                self.noise[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = random_covariance(rng, [0.05, 0.05])
        self.of = np.repeat(np.arange(steps), sightings)
        error = np.linalg.cholesky(self.cov) @ rng.standard_normal(2 * landmarks)
        own = np.linalg.cholesky(self.noise) @ rng.standard_normal(2 * k)
        who = np.concatenate([rng.permutation(landmarks + 2)[:sightings] for _ in range(steps)])
        places = np.concatenate((self.expected + error.reshape(-1, 2), rng.uniform(-3, 6, (2, 2))))
        self.z = places[who] + own.reshape(-1, 2)
        self.z[:, 1] = wrap(self.z[:, 1])

    def distance(self, pairs: list[tuple[int, int]]) -> float:
        """The joint squared distance of pairs (sighting, landmark)."""
        off = np.array([self.z[i] - self.expected[a] for i, a in pairs])
        off[:, 1] = wrap(off[:, 1])
        rows = [2 * a + h for _, a in pairs for h in (0, 1)]
        own = [2 * i + h for i, _ in pairs for h in (0, 1)]
        S = self.cov[np.ix_(rows, rows)] + self.noise[np.ix_(own, own)]
        return float(off.ravel() @ np.linalg.solve(S, off.ravel()))

    def distances(self) -> Array:
        return np.array([[self.distance([(i, a)]) for a in range(len(self.expected))] for i in range(len(self.z))])

    @property
    def frame(self) -> Frame:
        return Frame(self.z, self.noise, self.expected, self.cov)

    def decided(self, rule: int) -> Ints:
        return decide(rule, self.frame, self.of, Gates(FAR, MATCH, GATES, 10**6), FAR)[0]


@pytest.mark.parametrize("seed", range(60))
def test_joint_compatibility_finds_the_best_of_all_hypotheses(seed: int) -> None:
    """Without the bound of a pair's conditional distance, which depends on the order of the pairs."""
    rng = np.random.default_rng(seed)
    frame = Drawn(rng, *((4, 4, 1) if seed % 2 else (2, 4, 2)))
    k, c = len(frame.z), len(frame.expected)
    d2 = frame.distances()
    best: tuple[int, float] = 0, 0.0
    for choice in product(range(-1, c), repeat=k):
        pairs = [(i, a) for i, a in enumerate(choice) if a >= 0]
        once = len({(a, frame.of[i]) for i, a in pairs}) == len(pairs)
        if not pairs or not once or any(d2[i, a] >= FAR for i, a in pairs):
            continue
        total = frame.distance(pairs)
        if total < GATES[len(pairs)] and (-len(pairs), total) < (-best[0], best[1]):
            best = len(pairs), total
    pair = np.empty(k, np.int64)
    search(frame.frame, frame.of, d2, Gates(FAR, np.inf, GATES, 10**7), pair)
    found = [(i, a) for i, a in enumerate(pair.tolist()) if a >= 0]
    assert len(found) == best[0]
    assert not found or frame.distance(found) == pytest.approx(best[1], rel=1e-9)


def test_an_error_that_all_pairs_have_in_common_costs_none_of_them() -> None:
    """A heading that is off by 3.7 standard deviations puts each pair beyond its narrow gate, and all within theirs."""
    rng = np.random.default_rng(1)
    expected = np.column_stack((np.linspace(2, 5, 8), np.linspace(-1.0, 1.0, 8)))
    turned = np.tile((0.0, 1.0), 8)
    cov = 0.07**2 * np.outer(turned, turned) + 1e-8 * np.eye(16)
    z = expected + rng.normal(0, 0.01, (8, 2)) + [0.0, 3.7 * 0.07]
    R = np.tile(1e-4 * np.eye(2), (8, 1, 1))
    for rule, right in ((JOINT, 8), (NEAREST, 0), (CHEAPEST, 0)):
        pair, _ = decide_frame(rule, z, R, expected, cov, quantile(0.99, 1), GATES, FAR, 1000)
        assert (pair == np.arange(8)).sum() == right


def test_a_search_that_is_cut_short_keeps_the_best_so_far() -> None:
    frame = Drawn(np.random.default_rng(3), 6, 6)
    d2, pair = frame.distances(), np.empty(6, np.int64)
    counts = []
    for most in (1, 7, 10**6):
        nodes = search(frame.frame, frame.of, d2, Gates(FAR, MATCH, GATES, most), pair)
        assert nodes <= most + 1
        counts.append(int((pair >= 0).sum()))
    assert counts == sorted(counts)
    assert counts[-1] > 0


@pytest.mark.parametrize("seed", range(40))
def test_the_cheapest_assignment_is_scipys(seed: int) -> None:
    rng = np.random.default_rng(seed)
    k = int(rng.integers(1, 9))
    cost = rng.normal(0, 5, (k, int(rng.integers(k, 14))))
    column = np.empty(k, np.int64)
    cheapest(cost, column)
    assert len(set(column.tolist())) == k
    assert cost[np.arange(k), column].sum() == pytest.approx(cost[linear_sum_assignment(cost)].sum(), abs=1e-9)


@pytest.mark.parametrize("seed", range(20))
def test_maximum_likelihood_is_the_best_assignment_of_its_costs(seed: int) -> None:
    frame = Drawn(np.random.default_rng(seed), 6, 6)
    d2 = frame.distances()
    k, c = d2.shape
    spread = np.empty((k, c))
    for i, a in product(range(k), range(c)):
        S = frame.cov[2 * a : 2 * a + 2, 2 * a : 2 * a + 2] + frame.noise[2 * i : 2 * i + 2, 2 * i : 2 * i + 2]
        spread[i, a] = np.log(np.linalg.det(S))
    inside = d2 < MATCH
    worst = max([MATCH, *(MATCH + spread[inside])])
    cost = np.full((k, c + k), worst)
    cost[:, :c] = np.where(inside, d2 + spread, 1e9)
    rows, columns = linear_sum_assignment(cost)
    expected = [a if a < c and inside[i, a] else -1 for i, a in zip(rows.tolist(), columns.tolist(), strict=True)]
    assert [a if a >= 0 else -1 for a in frame.decided(CHEAPEST).tolist()] == expected


@pytest.mark.parametrize("seed", range(20))
def test_the_nearest_pair_is_taken_first(seed: int) -> None:
    frame = Drawn(np.random.default_rng(seed), 5, 6, steps=1 + seed % 2)
    d2, pair = frame.distances(), {}
    for i, a in sorted(product(*map(range, d2.shape)), key=lambda at: d2[at]):
        if d2[i, a] < MATCH and i not in pair and (a, frame.of[i]) not in {(b, frame.of[j]) for j, b in pair.items()}:
            pair[i] = a
    assert {i: a for i, a in enumerate(frame.decided(NEAREST).tolist()) if a >= 0} == pair


@pytest.mark.parametrize("rule", [NEAREST, CHEAPEST, JOINT])
def test_steps_may_have_any_numbers(rule: int) -> None:
    """Of a step whose sightings all have ids none is decided on: its number does not come up."""
    for seed in range(10):
        frame = Drawn(np.random.default_rng(seed), 4, 5, steps=3)
        expected = frame.decided(rule).tolist()
        frame.of = 10**12 * frame.of + 7
        assert frame.decided(rule).tolist() == expected


@pytest.mark.parametrize("rule", [NEAREST, CHEAPEST, JOINT])
def test_what_is_far_from_all_that_are_free_is_new_and_what_is_between_is_open(rule: int) -> None:
    expected, cov = np.array([[3.0, 0.0]]), 1e-6 * np.eye(2)
    R = np.array([0.01 * np.eye(2)])
    for off, found in ((0.0, 0), (0.1 * np.sqrt(MATCH) * 1.05, OPEN), (0.1 * np.sqrt(FAR) * 1.05, NEW)):
        if rule == JOINT and found == OPEN:
            continue  # a single pair has the wide gate
        pair, _ = decide_frame(rule, expected + np.array((off, 0.0)), R, expected, cov, MATCH, GATES, FAR, 1000)
        assert pair.tolist() == [found]
    pair, _ = decide_frame(rule, np.repeat(expected, 2, 0), np.repeat(R, 2, 0), expected, cov, MATCH, GATES, FAR, 1000)
    assert sorted(pair.tolist()) == [NEW, 0]  # the other one is of the same place, and that is taken


def test_nothing_expected_or_nothing_seen_is_no_pair() -> None:
    nobody, nothing = np.zeros((0, 2)), np.zeros((0, 0))
    for rule in (NEAREST, CHEAPEST, JOINT):
        pair, tried = decide_frame(
            rule, np.ones((3, 2)), np.tile(np.eye(2), (3, 1, 1)), nobody, nothing, MATCH, GATES, FAR, 9
        )
        assert (pair.tolist(), tried) == ([NEW] * 3, 0)
        pair, _ = decide_frame(rule, nobody, np.zeros((0, 2, 2)), np.ones((1, 2)), np.eye(2), MATCH, GATES, FAR, 9)
        assert len(pair) == 0


def test_gates_are_quantiles_of_chi_square() -> None:
    assert quantile(0.99, 1) == pytest.approx(chi2.ppf(0.99, 2))
    assert gates(0.95, 5)[1:] == pytest.approx(chi2.ppf(0.95, 2 * np.arange(1, 6)))
