"""Scores of data association: against counting all pairs one by one."""

from itertools import combinations

import numpy as np
import pytest

from slamduel.bench.measure.association import association_columns, by_true_ids, majority
from slamduel.core.factors import UNKNOWN, Map


def test_the_majority_is_the_true_landmark_of_most_sightings() -> None:
    assigned = np.array([-2, -2, -2, -3, -3, -1, 7, 7, -4])
    true = np.array([4, 4, 5, 5, -1, 4, 9, 9, -1])
    found = majority(assigned, true)
    assert found.ids.tolist() == [-4, -3, -2, 7]
    assert found.true.tolist() == [UNKNOWN, UNKNOWN, 4, 9]  # of a draw the smaller number
    assert found.right.tolist() == [1, 1, 2, 2]
    assert found.total.tolist() == [1, 2, 3, 2]


@pytest.mark.parametrize("seed", range(20))
def test_pairs_are_those_counted_one_by_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 40))
    assigned, true = rng.integers(-5, 0, n), rng.integers(-1, 6, n)
    named = real = same = 0
    for i, j in combinations(range(n), 2):
        taken = assigned[i] == assigned[j] != UNKNOWN
        right = true[i] == true[j] != UNKNOWN
        named, real, same = named + taken, real + right, same + (taken and right)
    row = association_columns(assigned, true)
    assert row.get("pair_precision") == (pytest.approx(same / named) if named else None)
    assert row.get("pair_recall") == (pytest.approx(same / real) if real else None)
    assert row["dropped_share"] == pytest.approx((assigned == UNKNOWN).mean())


def test_wrong_double_merged_and_clutter_are_told_apart() -> None:
    true = np.array([0, 0, 0, 0, 1, 1, 2, 2, -1, 3])
    assigned = np.array([-2, -2, -3, -3, -4, -4, -4, -1, -5, -2])
    row = association_columns(assigned, true)
    assert row["landmarks_double"] == 1  # landmark 0 as -2 and -3
    assert row["landmarks_clutter"] == 1  # -5
    assert row["landmarks_merged"] == 2  # the sightings of 2 went to -4, that of 3 to -2
    assert row["wrong_share"] == pytest.approx(2 / 9)
    assert row["dropped_share"] == pytest.approx(0.1)


def test_nothing_sighted_has_no_score() -> None:
    assert association_columns(np.zeros(0, np.int64), np.zeros(0, np.int64)) == {}


def test_all_dropped_is_no_precision_and_no_recall() -> None:
    row = association_columns(np.full(3, UNKNOWN), np.array([1, 1, 2]))
    assert row["dropped_share"] == 1
    assert row["pair_recall"] == 0
    assert "pair_precision" not in row
    assert "wrong_share" not in row


def test_a_map_gets_the_true_ids_of_those_with_most_sightings() -> None:
    """Landmark 4 is there twice, -5 is clutter, and 8 was given and is not sighted."""
    assigned = np.array([-2, -2, -3, -3, -3, -4, -5])
    true = np.array([4, 4, 4, 4, 4, 6, -1])
    landmarks = Map(np.array([-2, -3, -4, -5, 8]), np.arange(10.0).reshape(5, 2), np.diag(np.arange(1.0, 11.0)))
    found = by_true_ids(landmarks, assigned, true)
    place = dict(zip(found.ids.tolist(), found.xy.tolist(), strict=True))
    assert place == {4: [2.0, 3.0], 6: [4.0, 5.0], 8: [8.0, 9.0]}
    assert sorted(found.cov.diagonal().tolist()) == [3.0, 4.0, 5.0, 6.0, 9.0, 10.0]
