"""The marginal that `isam2` carries from step to step, against the one that its Bayes tree computes at every step."""

from typing import Any

import numpy as np
import pytest

from asked import ANYWHERE
from dense_delayed import with_loops
from driven import make
from random_logs import random_log
from slamduel.backends.graphs import neighbourhood
from slamduel.bench.speed.world import world
from slamduel.core.factors import Log
from slamduel.core.se2 import rotation

WIDE = 1e9
"""A gate that lets everything through."""


def counted(backend: Any) -> list[int]:
    """The number of landmarks of each question to the tree from now on."""
    asked, ask = list[int](), backend._tree.around._ask

    def counting(pose: int, most: int) -> None:
        asked.append(most)
        ask(pose, most)

    backend._tree.around._ask = counting
    return asked


def compare_with_tree(backend: Any, landmarks: list[int]) -> None:
    """The places and the joint covariance in the world frame are those of the tree, to rounding."""
    pose, at, cov = backend._joint_marginals(landmarks)
    keys = [backend._factors.keys.landmarks[landmark] for landmark in landmarks]
    keys.append(backend._factors.keys.pose(backend._tree.steps - 1))
    joint = backend._tree.isam.jointMarginalCovariance(keys)
    there = np.block([[joint.at(a, b) for b in keys] for a in keys])
    R = np.eye(len(there))
    R[-3:, -3:] = rotation(pose[2])
    there = R @ there @ R.T
    scale = np.sqrt(np.outer(there.diagonal(), there.diagonal()))
    assert np.abs((cov - there) / scale).max() < 1e-8
    places = [backend._tree.isam.calculateEstimatePoint2(key) for key in keys[:-1]]
    assert at == pytest.approx(np.array(places), abs=1e-8)


def logs(kind: str) -> Log:
    rng = np.random.default_rng(23)
    made = random_log(rng, 60, 12, radius=4.0)
    return with_loops(rng, made, 0.1) if kind == "loops" else made.log


@pytest.mark.parametrize("most", [2, 30])
@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("plain", {"relinearize_threshold": 1e3}),
        ("plain", {"relinearize_skip": 4}),
        ("plain", {"loss": "cauchy", "relinearize_threshold": 1e3}),
        ("plain", {"factorization": "cholesky", "relinearize_skip": 10}),
        ("loops", {"relinearize_threshold": 1e3}),
    ],
)
def test_what_is_carried_is_what_the_tree_has(
    kind: str, options: dict[str, Any], most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever is asked for: few landmarks, all of them, in any order, and after steps without a question."""
    monkeypatch.setattr(neighbourhood, "MOST", most)
    log = logs(kind)
    backend = make("isam2", log.prior, **options)
    rng, questions = np.random.default_rng(2), 0
    for k, step in enumerate(log):
        known = list(backend._factors.keys.landmarks)
        if k > 0 and known and rng.random() < 0.8:
            backend.expected(step.odometry, ANYWHERE, WIDE)  # else nothing is carried
            compare_with_tree(backend, rng.permutation(known)[: rng.integers(1, 5)].tolist())
            questions += 1
        backend.step(step)
    assert questions > 30


def test_the_tree_is_asked_for_landmarks_that_come_into_view_alone() -> None:
    here = world(60, 60, 6, 0)
    backend = make("isam2", here.prior, relinearize_threshold=1e3)
    for step in here.survey:
        backend.step(step)
    asked = counted(backend)
    for step in here.drive:
        backend.expected(step.odometry, step.sightings, 18.4)
        backend.step(step)
    assert 1 <= len(asked) <= len(here.drive) / 2


def test_nothing_is_carried_where_nobody_asks() -> None:
    here = world(20, 30, 6, 0)
    backend = make("isam2", here.prior, relinearize_threshold=1e3)
    folded, fold = list[int](), backend._tree.around.fold

    def counting(*arguments: Any, **named: Any) -> None:
        folded.append(len(backend._tree.around._keys))
        fold(*arguments, **named)

    backend._tree.around.fold = counting
    for step in here.survey:
        backend.step(step)
    assert not folded
    backend.expected(here.drive[0].odometry, here.drive[0].sightings, 18.4)
    for step in here.drive:
        backend.step(step)
    assert folded[0] > 0
    assert not any(folded[neighbourhood.IDLE + 1 :])
