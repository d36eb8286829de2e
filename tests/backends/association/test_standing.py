"""Landmarks that move are told from misread sightings and from a robot that is lost, and taken out."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from driven import aligned_error, asking_changes_nothing, make
from random_logs import random_log
from slamduel.backends.api import Unsuited
from slamduel.core.factors import UNKNOWN, Dataset, Log, Map
from slamduel.core.se2 import Array
from slamduel.datasets import registry as datasets
from tiers import first_quick


def world(name: str = "circle", seed: int = 1, **options: Any) -> Dataset:
    source = datasets.find(name)
    if name == "circle":
        options = {"steps": 150, "landmarks": 40, "sighting": 0.05, "odometry": 0.05} | options
    return source.make(source.options(**options), np.random.default_rng(seed))


def driven(name: str, log: Log, **options: Any) -> tuple[Any, Array]:
    options |= {"lag": 1e6} if name == "fixed-lag" else {}
    backend = make(name, log.prior, moved="out", **options)
    return backend, np.array([backend.step(step) for step in log])


def sighted(log: Log, moving: Any, times: int) -> set[int]:
    ids, counts = np.unique(log.ids, return_counts=True)
    return set(ids[counts >= times].tolist()) & set(moving.tolist())


@pytest.mark.parametrize(
    "name", first_quick(["ekf", "smoother", "fastslam", "fixed-lag", "invariant-ekf", "isam2", "ukf"])
)
def test_landmarks_that_move_are_taken_out_and_those_that_stand_are_not(name: str) -> None:
    log, truth = world(moving=0.2)
    backend, path = driven(name, log)
    out, movers = set(backend.taken_out().moved.tolist()), sighted(log, truth.moving, 8)
    assert len(movers) >= 3
    assert out <= set(truth.moving.tolist())
    assert len(movers - out) <= 1
    assert not out & set(backend.map().ids.tolist())
    assert set(np.unique(log.ids).tolist()) - out - set(truth.moving.tolist()) <= set(backend.map().ids.tolist())
    plain = make(name, log.prior, **({"lag": 1e6} if name == "fixed-lag" else {}))
    apart = aligned_error(np.array([plain.step(step) for step in log]), truth.poses)
    assert aligned_error(path, truth.poses) < apart / 2
    solution = backend.finish()
    assert solution is None or solution.map.ids.tolist() == backend.map().ids.tolist()


@pytest.mark.parametrize("seed", [0, 1])
def test_a_misread_id_makes_no_landmark_one_that_moves(seed: int) -> None:
    log, truth = world(seed=seed, wrong_ids=0.05)
    backend, path = driven("ekf", log)
    out, misread = backend.taken_out()
    assert len(out) == 0
    wrong = int((log.ids != truth.assigned).sum())
    assert wrong / 2 < misread < 2 * wrong
    assert aligned_error(path, truth.poses) < 0.2


@pytest.mark.parametrize(
    ("name", "options"), [("circle", {}), ("bailey", {"loops": 1}), ("city", {"landmarks": 100, "steps": 250})]
)
def test_where_nothing_moves_and_none_is_misread_nothing_is_named(name: str, options: dict[str, Any]) -> None:
    log, truth = world(name, **options)
    backend, path = driven("ekf", log)
    plain = make("ekf", log.prior)
    known = np.array([plain.step(step) for step in log])
    assert len(backend.taken_out().moved) == 0
    assert aligned_error(path, truth.poses) < 1.3 * aligned_error(known, truth.poses) + 0.01
    assert set(backend.map().ids.tolist()) == set(np.unique(log.ids).tolist())


def test_of_a_robot_that_is_elsewhere_no_landmark_is_taken_out() -> None:
    log, truth = world()
    delta = log.delta.copy()
    delta[75] += (0.25, 0.1, 0.05)  # which the stated noise does not cover
    delta.flags.writeable = False
    backend, path = driven("ekf", replace(log, delta=delta))
    assert len(backend.taken_out().moved) == 0
    assert np.hypot(*(path[-1] - truth.poses[-1])[:2]) < 0.5


def test_a_landmark_that_creeps_is_found() -> None:
    log, truth = world(moving=0.1, moving_speed=0.03)
    assert truth is not None
    assert truth.moving is not None
    right = np.isin(driven("ekf", log)[0].taken_out().moved, truth.moving)
    assert right.any()
    assert right.mean() > 0.6  # until it is found, it displaces the robot and so the others


def test_a_landmark_whose_first_sighting_was_misread_is_mapped_again() -> None:
    log, truth = world()
    late = next(i for i in np.unique(log.ids).tolist() if log.sighting_step[log.ids == i][0] > 20)
    first = np.flatnonzero(log.ids == late)[0]
    z = log.z.copy()
    z[first] += (1.5, 0.4)
    z.flags.writeable = False
    backend, _ = driven("ekf", replace(log, z=z))
    found = backend.map()
    assert sorted(found.ids.tolist()) == np.unique(log.ids).tolist()
    place = found.xy[found.ids.tolist().index(late)]
    assert np.hypot(*(place - truth.map.xy[truth.map.ids.tolist().index(late)])) < 0.5
    assert len(backend.taken_out().moved) == 0
    assert late in backend.expected(None, log[-1].sightings, 1e6).ids


def test_nothing_changes_where_every_sighting_is_right_and_asking_changes_nothing() -> None:
    log = random_log(np.random.default_rng(3), 40, 8, errors=0.1).log
    plain = make("ekf", log.prior)
    _, path = driven("ekf", log)
    assert path.tobytes() == np.array([plain.step(step) for step in log]).tobytes()
    moving = world(moving=0.2).log
    asking_changes_nothing(make("ekf", moving.prior, moved="out"), make("ekf", moving.prior, moved="out"), moving)


def test_behind_data_association_made_up_ids_are_taken_out() -> None:
    log = world(moving=0.2).log
    hidden = replace(log, ids=np.full(len(log.ids), UNKNOWN))
    backend, _ = driven("ekf", hidden, association="jcbb")
    out = backend.taken_out()
    assert (out.moved < UNKNOWN).all()
    assert not set(out.moved.tolist()) & set(backend.map().ids.tolist())
    assert make("ekf", log.prior, association="jcbb").taken_out() is None


def test_a_given_map_is_settled_from_the_start_and_one_that_is_exact_is_unsuited() -> None:
    log, truth = world(moving=0.2)
    known = Map(truth.map.ids, truth.map.xy, 0.01 * np.eye(2 * len(truth.map.ids)))
    backend, _ = driven("ekf", replace(log, prior=log.prior._replace(map=known)))
    out = set(backend.taken_out().moved.tolist())
    assert out
    assert out <= set(truth.moving.tolist())
    with pytest.raises(Unsuited, match="moved=out needs the covariance of the given map"):
        make("ekf", log.prior._replace(map=known._replace(cov=None)), moved="out")
    with pytest.raises(Unsuited, match="cannot state what it expects to see: no moved=out"):
        make("fixed-lag by gtsam", log.prior, moved="out")
