"""What is remembered of landmarks, against the same computed from all motions and dense covariances."""

from typing import Any

import numpy as np
import pytest

from driven import make
from slamduel.backends import _vicinity
from slamduel.backends._vicinity import NOISE, STATE, SUMS
from slamduel.backends.gaussian import compressed
from slamduel.backends.invariant import _plain
from slamduel.backends.smoothing import _step
from slamduel.backends.vicinity import Vicinity
from slamduel.bench.speed.world import world
from slamduel.core.factors import Odometry, RangeBearing
from slamduel.core.se2 import Array, between, compose

SD = np.array([0.05, 0.02, 0.03])


LOOK = RangeBearing(np.zeros(1, np.int64), np.array([[2.0, 0.0]]), np.diag([0.01, 0.01])[None])
"""A sighting 2 m ahead."""


def motions(n: int) -> list[Array]:
    rng = np.random.default_rng(3)
    return [np.array([0.5, 0.1, 0.2]) + 0.1 * rng.standard_normal(3) for _ in range(n)]


def test_the_odometer_s_sums_are_the_variance_that_turns_put_on_any_place() -> None:
    o, pose, poses = np.zeros(STATE), np.zeros(3), list[Array]()
    for delta in motions(30):
        _vicinity.add_motion(o, np.vstack((delta, np.diag(SD**2))))
        pose = compose(pose, delta)
        poses.append(pose)
    assert o[:3] == pytest.approx(pose, abs=1e-12)
    assert o[NOISE] == pytest.approx(30 * SD[0] ** 2, rel=1e-12)
    for place in np.random.default_rng(0).uniform(-20, 20, (10, 2)):
        away = sum(SD[2] ** 2 * np.square(place - one[:2]).sum() for one in poses)
        assert _vicinity.turned(o, np.zeros(SUMS), *place) == pytest.approx(away, rel=1e-9)


def test_a_landmark_is_remembered_as_the_robot_saw_it() -> None:
    """Its deviation in the robot's frame, by numerical Jacobians of the offset in that frame."""
    rng = np.random.default_rng(5)
    pose, at, A = np.array([3.0, -1.0, 0.7]), rng.uniform(-5, 5, (4, 2)), rng.standard_normal((11, 11))
    joint = 0.01 * A @ A.T
    vicinity: Any = Vicinity(follows=True)
    vicinity.move(Odometry(np.array([2.0, 1.0, 0.4]), np.diag(SD**2)))
    vicinity.expected(
        pose, None, None, RangeBearing(np.zeros(1, np.int64), np.array([[2.0, 0.0]]), np.eye(2)[None]), 10.0,
        [7, 8, 9, 10], lambda landmarks: (pose, at, joint),
    )  # fmt: skip
    places = vicinity._places

    def offset(k: int, state: Array) -> Array:
        x, y, heading = state[8:]
        c, s = np.cos(heading), np.sin(heading)
        dx, dy = state[2 * k] - x, state[2 * k + 1] - y
        return np.array([c * dx + s * dy, c * dy - s * dx])

    mean = np.concatenate((at.ravel(), pose))
    for k in range(4):
        J = np.array([(offset(k, mean + h) - offset(k, mean - h)) / 2e-6 for h in 1e-6 * np.eye(11)]).T
        assert places.apart[k] == pytest.approx(np.sqrt(np.linalg.eigvalsh(J @ joint @ J.T)[-1]), rel=1e-6)
        assert between(np.array([2.0, 1.0, 0.4]), np.array([*places.off[k], 0.0]))[:2] == pytest.approx(
            offset(k, mean), abs=1e-12
        )


def counted(name: str, backend: Any, monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The number of landmarks whose joint covariance each question needs, from now on."""
    asked = list[int]()
    compiled = {"smoother": (_step, "ask"), "invariant-ekf": (_plain, "ask"), "ekf": (compressed, "choose")}
    if name in compiled:
        ask = getattr(*compiled[name])

        def counting(*arguments: Any) -> int:
            asked.append(ask(*arguments))
            return asked[-1]

        monkeypatch.setattr(*compiled[name], counting)
        return asked
    attribute = "_joint_marginals" if name == "isam2" else "_marginals"
    marginals = getattr(backend, attribute)

    def of(landmarks: list[int]) -> Any:
        asked.append(len(landmarks))
        return marginals(landmarks)

    monkeypatch.setattr(backend, attribute, of)
    return asked


@pytest.mark.parametrize("name", ["ekf", "invariant-ekf", "smoother", "isam2", "fixed-lag"])
def test_few_landmarks_are_asked_for_beside_those_in_view(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where nothing but their places in the world says which are near, three times as many are."""
    here = world(60, 60, 6, 0)
    backend = make(name, here.prior, **{"fixed-lag": {"lag": 1e6}, "ekf": {"compress_above": 20}}.get(name, {}))
    for step in here.survey:
        backend.step(step)
    asked, offered = counted(name, backend, monkeypatch), list[int]()
    for step in here.drive:
        offered.append(len(backend.expected(step.odometry, step.sightings, 18.4).ids))
        backend.step(step)
    assert np.mean(offered[10:]) >= 6
    assert np.mean(asked[10:]) <= 1.6 * np.mean(offered[10:])


@pytest.mark.parametrize("x", [0.0, 1e-9, 0.5])
@pytest.mark.parametrize("follows", [False, True])
def test_a_landmark_that_was_never_asked_for_is_expected_wherever_the_robot_is(x: float, follows: bool) -> None:
    """At the world's origin, too, where the places of such landmarks are before they are known."""
    vicinity, here = Vicinity(follows=follows), np.array([x, 0.0, 0.0])

    def marginals(landmarks: list[int]) -> tuple[Array, Array, Array]:
        assert landmarks == [7]
        return here, here[None, :2] + [2.05, 0.0], 1e-4 * np.eye(5)

    found = vicinity.expected(here, 1e-4 * np.eye(3), None, LOOK, 9.0, [7], marginals)
    assert found.ids.tolist() == [7]
    assert found.z == pytest.approx(np.array([[2.05, 0.0]]))


@pytest.mark.parametrize("follows", [False, True])
def test_a_landmark_that_is_left_out_is_not_expected_there_either(follows: bool) -> None:
    vicinity = Vicinity(follows=follows)
    vicinity.ready(None, [7])
    vicinity.forget(7)

    def marginals(landmarks: list[int]) -> tuple[Array, Array, Array]:
        pytest.fail(f"asked for {landmarks}")

    found = vicinity.expected(np.zeros(3), np.eye(3), None, LOOK, 9.0, [], marginals)
    assert len(found.ids) == 0
