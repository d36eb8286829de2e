"""How hard the data association of a log is: against counting by hand, and on logs that are easy and hard."""

import numpy as np
import pytest

from slamduel.backends.api import Expected
from slamduel.bench.logs.difficulty import Difficulty, difficulty, distances
from slamduel.bench.plan.load import load
from slamduel.core.factors import Dataset, RangeBearing


def _of(dataset: str) -> Difficulty:
    found = difficulty(load(dataset, 0))
    assert found is not None
    return found


def test_distances_are_those_worked_out_one_by_one() -> None:
    rng = np.random.default_rng(3)
    z, other = rng.uniform((1, -3), (5, 3), (4, 2)), rng.uniform((1, -3), (5, 3), (3, 2))
    R = np.tile(np.diag((0.04, 0.01)), (4, 1, 1))
    A = rng.normal(size=(6, 6))
    found = distances(RangeBearing(np.arange(4), z, R), Expected(np.arange(3), other, A @ A.T))
    for i in range(4):
        for a in range(3):
            off = z[i] - other[a]
            off[1] = (off[1] + np.pi) % (2 * np.pi) - np.pi
            S = (A @ A.T)[2 * a : 2 * a + 2, 2 * a : 2 * a + 2] + R[i]
            assert found[i, a] == pytest.approx(off @ np.linalg.solve(S, off))


def test_hidden_ids_change_nothing() -> None:
    assert _of("circle[steps=60,ids=hidden]") == _of("circle[steps=60]")


def test_crowded_and_noisy_landmarks_are_harder() -> None:
    easy = _of("circle[steps=100,landmarks=20,sighting=0.01,odometry=0.02]")
    hard = _of("circle[steps=100,landmarks=200,sighting=0.1,odometry=0.1]")
    assert easy.several < 0.05 < 0.5 < hard.several
    assert max(easy.wrong.values()) < 0.01 < min(hard.wrong.values())
    assert hard.wrong["jcbb"] < hard.wrong["nn"]


def test_steps_with_a_single_sighting_are_counted() -> None:
    log = load("circle[steps=60]", 0).log
    seen = np.diff(log.sighting_first)
    assert _of("circle[steps=60]").single == pytest.approx((seen == 1).sum() / (seen > 0).sum())


def test_a_log_whose_ids_nobody_knows_has_none() -> None:
    log = load("circle[steps=30,ids=hidden]", 0).log
    assert difficulty(Dataset(log, None)) is None
