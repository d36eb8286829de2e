"""A backend whose start is not known, or whose robot is carried elsewhere."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import slamduel
from driven import asking_changes_nothing
from lost_logs import RING, astray, kidnapped, surveyed, unnamed
from slamduel.backends.api import Backend
from slamduel.backends.locating.locating import Locating, begin
from slamduel.backends.registry import find
from slamduel.bench.measure.drive import Outcome, drive
from slamduel.bench.measure.score import score
from slamduel.core.errors import SlamduelError
from slamduel.core.factors import Log, Map, Truth
from slamduel.core.se2 import Array, compose

BACKENDS = ("ekf", "invariant-ekf", "isam2", "fixed-lag", "smoother", "fastslam")
FOUND_AGAIN = 20
"""Steps in which a robot that was carried elsewhere is found again."""


@cache
def lost(seed: int = 0) -> tuple[Log, Truth]:
    """A log on a given map, from an unknown start; its prior's pose is nowhere near."""
    log, truth = slamduel.load(RING, seed=seed)
    assert truth is not None
    assert truth.map is not None
    return with_map(log, truth.map), truth


def with_map(log: Log, true: Map) -> Log:
    nowhere = np.array((500.0, -300.0, 1.0))
    return replace(log, prior=log.prior._replace(pose=nowhere, map=surveyed(true), start="unknown"))


def begun(name: str, log: Log, **options: Any) -> Backend:
    builder = find(name)
    return begin(builder, log.prior, builder.options(**options), np.random.default_rng(0))


def followed(name: str, log: Log, steps: int, **options: Any) -> tuple[Backend, Array, Array]:
    """The backend after these steps, its poses, and where it was located."""
    backend = begun(name, log, **options)
    poses, located = list[Array](), list[bool]()
    for step in log.head(steps):
        pose = backend.step(step)
        belief = backend.belief()
        assert pose is not None
        poses.append(pose)
        located.append(belief.located)
    return backend, np.array(poses), np.array(located)


def outcome(name: str, log: Log) -> Outcome:
    builder = find(name)
    return drive(builder, builder.options(), log, lambda: np.random.default_rng(0))


BLIND = 12


def late(log: Log) -> Log:
    """Without the sightings of the first steps."""
    seen = log.sighting_step >= BLIND
    sightings = (log.sighting_step[seen], log.ids[seen], log.z[seen], log.z_cov[seen])
    return Log.from_arrays("late", log.prior, log.t, log.delta, log.delta_cov, *sightings)


@pytest.mark.parametrize("name", BACKENDS)
def test_every_backend_starts_where_the_robot_is_found(name: str) -> None:
    log, truth = lost()
    _, poses, located = followed(name, log, 60)
    first = int(located.argmax())
    assert located[first:].all()
    assert first < 10
    assert truth.map is not None
    assert not any(astray(poses[k], truth.poses[k], truth.map) for k in range(first, 60))


def test_before_it_is_found_the_pose_is_the_priors_and_odometry_from_there() -> None:
    log, _ = lost()
    backend, poses, located = followed("ekf", late(log), BLIND)
    assert not located.any()
    assert poses[0] == pytest.approx(log.prior.pose)
    assert poses[1] == pytest.approx(compose(poses[0], log.delta[1]))
    belief = backend.belief()
    assert belief.cov is None
    assert np.array_equal(backend.map().ids, log.prior.map.ids)


@pytest.mark.parametrize("name", ["smoother", "graph"])
def test_the_final_path_leads_back_to_the_first_step(name: str) -> None:
    log, truth = lost()
    found = outcome(name, late(log).head(80))
    assert (found.online is None) == (name == "graph")  # a batch method is asked for no pose on the way
    assert found.located.any()
    path = found.solution.path
    assert len(path) == 80
    # Odometry leads back twelve steps of 0.02 m: a tenth of a metre would be six of its standard deviations.
    assert np.hypot(*(path - truth.poses[:80])[:, :2].T).max() < 0.5
    for k in range(1, BLIND):
        assert compose(path[k - 1], log.delta[k])[:2] == pytest.approx(path[k][:2], abs=1e-9)


def test_a_batch_method_that_does_not_say_so_is_told_of() -> None:
    log, _ = lost()
    with pytest.raises(SlamduelError, match="a batch method is one with online=False"):
        drive(replace(find("graph"), online=True), find("graph").options(), log.head(60), np.random.default_rng)


def test_errors_are_those_from_the_fix_on() -> None:
    log, truth = lost()
    found = outcome("ekf", log)
    first = int(found.located.argmax())
    row = score(log, found, truth).row
    assert row["ate_m"] < 0.1
    # Sightings used to find the start do not make it too sure. 400 steps of 3 degrees of freedom; errors of a pose last
    # some tens of steps, and the map's all along.
    assert 0.4 < row["nees"] < 2.0
    assert row["located_share"] == pytest.approx(1 - first / len(log))
    assert row["locate_steps"] == first + 1
    assert row["wrong_fix_share"] == 0
    assert row["locate_ms"] == pytest.approx(found.step_ns[: first + 1].sum() / 1e6)


def test_a_robot_on_another_worlds_map_is_not_found_and_that_is_said() -> None:
    log, truth = lost()
    other = lost(50)[0].prior
    strange = replace(log.head(60), prior=other, ids=np.full(log.sighting_first[60], -1))
    builder = replace(find("dead-reckoning"), associates=True)  # so that it is given sightings without ids
    found = drive(builder, builder.options(), strange, lambda: np.random.default_rng(0))
    assert not found.located.any()
    head = truth._replace(t=truth.t[:60], poses=truth.poses[:60])
    judged = score(strange, found, head)
    assert "the robot was not found on the given map: no path" in judged.remark
    told = score(replace(strange, notes={"given map": "foreign"}), found, head)
    assert "not found on the given map, which is another world's: no path" in told.remark
    assert judged.row["located_share"] == 0
    assert "ate_m" not in judged.row


def test_a_known_start_needs_no_search() -> None:
    log, _ = lost()
    known = replace(log, prior=log.prior._replace(start="known"))
    assert not isinstance(begun("ekf", known), Locating)
    assert isinstance(begun("ekf", log), Locating)
    assert not isinstance(begun("mcl", log), Locating)


@pytest.mark.parametrize("name", ["ekf", "smoother"])
@pytest.mark.parametrize("seed", range(4))
def test_a_robot_carried_elsewhere_is_found_again(name: str, seed: int) -> None:
    log, truth = lost(seed)
    rng = np.random.default_rng(seed)
    leaves, arrives = int(rng.integers(100, 150)), int(rng.integers(220, 300))
    drive_, true = kidnapped(log, truth, 0, leaves, arrives)
    _, poses, _ = followed(name, drive_, leaves + 40)
    known = log.prior.map
    assert known is not None
    assert not any(astray(poses[k], true[k], known) for k in range(20, leaves))
    assert not any(astray(poses[k], true[k], known) for k in range(leaves + FOUND_AGAIN, leaves + 40))


def test_a_smoother_keeps_the_path_from_before_the_robot_was_carried_away() -> None:
    log, truth = lost(3)
    drive_, true = kidnapped(log, truth, 0, 120, 260)
    backend, _, _ = followed("smoother", drive_, 180)
    solution = backend.finish()
    assert np.hypot(*(solution.path - true[:180])[:, :2].T).max() < 0.5


def test_a_wrong_sighting_now_and_then_does_not_move_the_robot() -> None:
    log, truth = lost()
    wrong = np.random.default_rng(0).random(len(log.ids)) < 0.05
    z = np.array(log.z)
    z[wrong] += (2.0, 1.0)
    hard = replace(log, z=z)
    _, poses, located = followed("ekf", hard, 200, gate=0.999)
    first = int(located.argmax())
    known = log.prior.map
    assert known is not None
    assert not any(astray(poses[k], truth.poses[k], known) for k in range(first, 200))


def test_asking_changes_nothing() -> None:
    carried, _ = kidnapped(*lost(), 0, 100, 250)
    asking_changes_nothing(begun("ekf", carried), begun("ekf", carried), carried.head(160))


def test_without_ids_the_robot_is_found_by_a_backend_that_needs_none() -> None:
    log, truth = lost()
    bare = unnamed(log)
    _, poses, located = followed("mcl", bare, 40)
    known = log.prior.map
    assert known is not None
    assert located[-1]
    assert not astray(poses[39], truth.poses[39], known)


def test_a_batch_has_room_for_landmarks_that_are_given_and_never_sighted() -> None:
    log, _ = lost()
    known = replace(log.head(3), prior=log.prior._replace(start="known"))
    assert len(np.unique(known.ids)) < len(log.prior.map.ids) - 10
    backend = begun("graph", known)
    for step in known:
        backend.step(step)
    solution = backend.finish()
    assert np.array_equal(np.sort(solution.map.ids), np.sort(log.prior.map.ids))
    assert np.isfinite(solution.map.xy).all()
