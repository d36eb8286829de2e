"""Smoothers where J is a narrow valley, or where landmarks are passed over; elsewhere they are as without."""

from typing import Any

import numpy as np
import pytest

from dense_lowest import lowest
from driven import final, make, run
from near_logs import near_log, uneven_graph
from slamduel.backends.graphs import batch
from slamduel.backends.incremental import smoother
from slamduel.backends.smoothing import forest, valleys
from slamduel.bench.measure.misfit import misfit
from slamduel.bench.measure.nees import nees
from slamduel.bench.plan.load import load
from slamduel.core.factors import Dataset, Log, Map
from tiers import first_quick

AT_THE_OPTIMUM = 1.01  # most J over that of the optimum
NO_MAP = Map(np.zeros(0, np.int64), np.zeros((0, 2)), None)


def cost(log: Log, found: Any) -> float:
    return misfit(log, found.path, found.map).total


def ends_at_the_optimum(name: str, made: Dataset) -> None:
    log, truth = made
    found = final(name, log)
    best = min(lowest(log, path, known) for path, known in ((truth.poses, truth.map or NO_MAP), found[:2]))
    assert cost(log, found) <= AT_THE_OPTIMUM * best + 1e-12
    assert found.converged is True


@pytest.mark.parametrize("kind", ["one", "weak", "alternating"])
@pytest.mark.parametrize("seed", first_quick(range(8), 2))
@pytest.mark.parametrize("name", ["graph", "smoother"])
def test_with_information_of_1e8_and_1e_4_it_ends_at_the_optimum(name: str, seed: int, kind: str) -> None:
    ends_at_the_optimum(name, uneven_graph(seed, kind))


@pytest.mark.parametrize("seed", first_quick(range(8), 1))
@pytest.mark.parametrize("name", ["graph", "smoother", "isam2"])
def test_a_robot_that_passes_over_landmarks_ends_at_the_optimum(name: str, seed: int) -> None:
    ends_at_the_optimum(name, near_log(seed, steps=120))


@pytest.mark.parametrize("seed", first_quick(range(8), 1))
@pytest.mark.parametrize("name", ["graph", "smoother"])
def test_it_does_where_bearings_are_stated_far_too_good(name: str, seed: int) -> None:
    ends_at_the_optimum(name, near_log(seed, steps=120, bearing=0.02))


def test_what_isam2_cannot_settle_it_does_not_call_converged() -> None:
    """With bearings stated far too good, in whole or in part: it ends at the optimum, or says that it does not."""
    ends = list[tuple[bool, bool]]()
    for seed in range(8):
        log, _ = near_log(seed, bearing=0.02)
        found = final("isam2", log)
        ends.append((cost(log, found) <= 1.1 * cost(log, final("graph", log)), found.converged is True))
    assert all(there for there, converged in ends if converged)
    assert not all(there for there, _ in ends)


def test_the_belief_is_consistent_beside_landmarks_that_are_near(monkeypatch: pytest.MonkeyPatch) -> None:
    """At 0.25 m, with odometry that is worse than the sightings: the median NEES of eight logs is near 1."""
    logs = [near_log(seed, aside=0.25, spacing=0.3, stride=0.1, drive=(0.05, 0.002, 0.03)) for seed in range(8)]
    assert np.median([online_nees(one) for one in logs]) < 1.5
    monkeypatch.setattr(smoother, "SMALL", 1e-9)
    assert np.median([online_nees(one) for one in logs]) > 3


def online_nees(made: Dataset) -> float:
    backend, poses, covs = make("smoother", made.log.prior), [], []
    for step in made.log:
        poses.append(backend.step(step))
        covs.append(backend.belief().cov)
    return float(nees(np.array(poses), np.array(covs), made.truth.poses).mean() / 3)


@pytest.mark.parametrize("dataset", ["circle", "victoria-park", "aruco-room", "bailey", "matlab-report"])
def test_ordinary_logs_have_the_same_bits_as_without(dataset: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def all_bits() -> list[bytes]:
        backend, path = run("smoother", log)
        ends = [backend.finish(), final("graph", log)]
        return [path.tobytes(), *(one.tobytes() for end in ends for one in (end.path, end.map.xy, end.cov))]

    log = load(dataset).log
    now = all_bits()
    monkeypatch.setattr(smoother, "SMALL", 1e-9)
    monkeypatch.setattr(smoother, "settled", forest.Forest.settled)
    monkeypatch.setattr(batch, "descend", lambda *_: True)
    monkeypatch.setattr(valleys, "near", lambda _: False)
    assert all_bits() == now
