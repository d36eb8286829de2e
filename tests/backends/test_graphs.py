"""The GTSAM backends: against one another and the EKF, with wrong sightings among right ones, and at their limits."""

import re
from typing import Any

import numpy as np
import pytest

from driven import NO_LOOPS, NO_SIGHTINGS, asking_changes_nothing, final, make, rmse, run
from motions import chain
from random_logs import random_covariance, random_log
from slamduel.backends import newcomers
from slamduel.backends.api import Diverged
from slamduel.backends.common_options import LOSSES
from slamduel.backends.graphs import _gtsam
from slamduel.bench.measure.misfit import misfit
from slamduel.core.factors import Dataset, Log, Odometry, Prior, RangeBearing, Step
from slamduel.core.se2 import Array, between, compose, rotation
from slamduel.datasets import registry as datasets
from slamduel.datasets.worlds.outliers import swapped
from tiers import first_quick

ROBUST = ("huber", "cauchy", "geman-mcclure")
SMOOTHERS = ("isam2", "graph", "fixed-lag by gtsam", "fixed-lag by own")


@pytest.fixture(scope="module")
def drive() -> Dataset:
    return random_log(np.random.default_rng(20), 200, 20, noise=0.5)


def test_the_smoothers_agree_where_the_window_is_longer_than_the_log(drive: Dataset) -> None:
    batch = final("graph", drive.log)
    for name, options in (("isam2", {}), ("fixed-lag by gtsam", {"lag": 1e9}), ("fixed-lag by own", {"lag": 1e9})):
        solution = final(name, drive.log, **options)
        assert solution.path == pytest.approx(batch.path, abs=1e-3), name
        assert solution.map.ids.tolist() == batch.map.ids.tolist()
        assert solution.map.xy == pytest.approx(batch.map.xy, abs=1e-3), name


def test_isam2_and_a_long_window_agree_step_by_step(drive: Dataset) -> None:
    """One takes the pose from the top of the tree, the other from full back-substitution."""
    _, one = run("isam2", drive.log, relinearize_skip=1)
    _, other = run("fixed-lag by gtsam", drive.log, lag=1e9, relinearize_skip=1)
    assert one == pytest.approx(other, abs=1e-6)


def test_isam2_ends_at_the_optimum_of_victoria_park() -> None:
    source = datasets.find("victoria-park")
    log = source.make(source.options(), np.random.default_rng(0)).log.head(500)
    batch, solution = final("graph", log), final("isam2", log)
    assert solution.path[:, :2] == pytest.approx(batch.path[:, :2], abs=1e-2)
    window = final("fixed-lag by gtsam", log, lag=1e9)
    assert window.path[:, :2] == pytest.approx(batch.path[:, :2], abs=1e-2)


def test_the_last_update_relinearizes_whatever_the_skip(drive: Dataset) -> None:
    batch = final("graph", drive.log, solver="gtsam")  # whose J is isam2's to the last digit
    never = {"relinearize_skip": 10**6, "relinearize_threshold": 1e-4}
    assert final("isam2", drive.log, **never).path == pytest.approx(batch.path, abs=1e-5)


@pytest.mark.parametrize("name", ["isam2", "fixed-lag by gtsam"])
def test_asking_changes_nothing(name: str, drive: Dataset) -> None:
    asking_changes_nothing(make(name, drive.log.prior), make(name, drive.log.prior), drive.log.head(100))


def test_covariances_are_turned_into_the_frame_after_the_motion() -> None:
    rng = np.random.default_rng(21)
    for _ in range(20):
        motion = Odometry(rng.uniform(-3, 3, 3), random_covariance(rng, [0.3, 0.2, 0.1]))
        factor: Any = _gtsam.motion_factor(0, 1, motion)
        found = factor.noiseModel().covariance()
        R = rotation(motion.delta[2])
        assert found == pytest.approx(R.T @ motion.cov @ R, rel=1e-9, abs=1e-12)


# --- wrong sightings


def test_wrong_ids_ruin_the_plain_graph_and_not_the_robust_one() -> None:
    log, truth = random_log(np.random.default_rng(30), 120, 12, noise=0.3, blind=0.0)
    assert truth is not None
    wrong = swapped(log, truth, 0.05, np.random.default_rng(0)).log
    clean = rmse(final("graph", log).path, truth.poses)
    assert rmse(final("graph", wrong).path, truth.poses) > 5 * clean
    for options in ({"loss": "cauchy"}, {"loss": "geman-mcclure"}, {"gnc": True}):
        assert rmse(final("graph", log, **options).path, truth.poses) < 1.5 * clean, options
        assert rmse(final("graph", wrong, **options).path, truth.poses) < 2 * clean, options
    for name in ("isam2", "fixed-lag by gtsam", "fixed-lag by own"):
        options = {"lag": 1e9} if name.startswith("fixed-lag") else {}
        assert rmse(final(name, wrong, **options).path, truth.poses) > 5 * clean, name
        assert rmse(final(name, wrong, loss="cauchy", **options).path, truth.poses) < 2 * clean, name


@pytest.mark.parametrize("name", SMOOTHERS)
@pytest.mark.parametrize("loss", ROBUST)
def test_a_wrong_first_sighting_does_not_shut_out_the_right_ones(name: str, loss: str) -> None:
    motion = Odometry(np.array([0.1, 0.0, 0.02]), 1e-6 * np.eye(3))
    pose, landmark, steps = np.zeros(3), np.array([6.0, 2.0]), list[Step]()
    for k in range(40):
        pose = pose if k == 0 else compose(pose, motion.delta)
        there = between(pose, np.array([*landmark, 0.0]))
        z = np.array([np.hypot(*there[:2]), np.arctan2(there[1], there[0])])
        if k == 0:
            z += [-4.0, 0.7]
        seen = RangeBearing(np.array([3]), z[None], np.diag([1e-4, 1e-4])[None])
        steps.append(Step(float(k), None if k == 0 else motion, seen, NO_LOOPS))
    log = Log.from_steps("liar", Prior(np.zeros(3), 1e-6 * np.eye(3)), steps)
    options = {"lag": 1e9} if name.startswith("fixed-lag") else {}
    solution = final(name, log, loss=loss, **options)
    assert np.hypot(*(solution.map.xy[0] - landmark)) < 0.02
    plain = final(name, log, **options)
    assert np.hypot(*(plain.map.xy[0] - landmark)) > 0.04


@pytest.mark.parametrize("name", SMOOTHERS)
def test_what_was_sighted_once_is_on_the_last_map(name: str, drive: Dataset) -> None:
    steps, ids = list(drive.log), drive.log.ids
    once = RangeBearing(np.array([10**9]), np.array([[2.0, 0.5]]), np.diag([1e-3, 1e-3])[None])
    steps[30] = steps[30]._replace(sightings=once)
    solution = final(name, Log.from_steps("once", drive.log.prior, steps), loss="cauchy")
    there = dict(zip(solution.map.ids.tolist(), solution.map.xy, strict=True))
    assert set(there) <= {*ids.tolist(), 10**9}
    offset = between(solution.path[30], np.array([*there[10**9], 0.0]))[:2]
    assert offset == pytest.approx(2.0 * np.array([np.cos(0.5), np.sin(0.5)]), abs=1e-3)


def test_a_landmark_starts_once_its_sightings_say_where_it_is() -> None:
    """Sixteen sightings of one cannot tell where it is, nor twenty-five of another's bearing; one more of each can."""
    for z_cov, enough in ((np.diag([16.5 * 2.0**2, 1e-4]), 17), (np.diag([1e-4, 25.5]), 26)):
        known = newcomers.Newcomers(two=False)
        for k in range(1, enough):
            assert not known.sighted(7, (k, np.array([2.0, 0.3]), z_cov))
        held = known.sighted(7, (enough, np.array([2.0, 0.3]), z_cov))
        assert [k for k, _, _ in held] == list(range(1, enough + 1))
        assert not known.alone()


@pytest.mark.parametrize("name", SMOOTHERS)
def test_sightings_that_say_next_to_nothing_move_nothing(name: str) -> None:
    """Sightings with a standard deviation of a kilometre among good ones: as if they were not there."""
    log = random_log(np.random.default_rng(28), 120, 8, noise=0.1, blind=0.0).log
    steps = list(log)
    for k, step in enumerate(steps):
        ids, z, cov = step.sightings
        vague = RangeBearing(np.array([*ids, 10**9]), np.array([*z, [3.0, 0.4]]), np.array([*cov, 1e6 * np.eye(2)]))
        steps[k] = step._replace(sightings=vague)
    found = final(name, Log.from_steps("vague", log.prior, steps))
    assert found.path == pytest.approx(final(name, log).path, abs=1e-3)
    assert 10**9 in found.map.ids


def test_the_losses_weigh_down_as_they_say_and_leave_odometry_alone() -> None:
    log = random_log(np.random.default_rng(22), 5, 6, blind=0.0).log
    for loss, weight in (
        ("huber", lambda e, c: min(1.0, c / e)),
        ("cauchy", lambda e, c: 1 / (1 + (e / c) ** 2)),
        ("geman-mcclure", lambda e, c: 1 / (1 + (e / c) ** 2) ** 2),
    ):
        for given, scale in ((0.0, LOSSES[loss]), (0.7, 0.7)):
            factors = _gtsam.Factors(log.prior, loss, given, at_once=True)
            factors.prior()
            for k, step in enumerate(log):
                graph, _ = factors.step(k, step, _gtsam.pose2(log.prior.pose))
                for i in range(graph.size()):
                    factor: Any = graph.at(i)
                    model = factor.noiseModel()
                    if len(step.sightings.ids) and i >= (k > 0):
                        assert model.robust().weight(3.0) == pytest.approx(weight(3.0, scale))
                    else:
                        assert not hasattr(model, "robust")


def test_two_sightings_agree_as_often_as_they_should() -> None:
    """AGREE passes 999 of 1000 right pairs: of 500, half a one fails on average, and 6 with a probability of 1e-5."""
    rng = np.random.default_rng(23)
    refused = 0
    for _ in range(500):
        known, path, held = newcomers.Newcomers(two=True), [np.zeros(3)], list[newcomers.Sighting]()
        covs = [random_covariance(rng, [0.02, 0.02, 0.01]) for _ in range(4)]
        z_cov = random_covariance(rng, [0.05, 0.01])
        known.move(None)
        landmark = np.array([*rng.uniform(3, 6, 2), 0.0])
        for step in range(5):
            if step:
                delta = rng.uniform(-0.3, 0.3, 3)
                path.append(compose(path[-1], delta))
                known.move(Odometry(delta + rng.multivariate_normal(np.zeros(3), covs[step - 1]), covs[step - 1]))
            there = between(path[-1], landmark)
            z = np.array([np.hypot(*there[:2]), np.arctan2(there[1], there[0])])
            if step in (0, 4):
                held = known.sighted(7, (step, z + rng.multivariate_normal(np.zeros(2), z_cov), z_cov))
        refused += not held
    assert refused < 6


def test_the_motion_between_two_sightings_is_chained_odometry() -> None:
    rng = np.random.default_rng(24)
    motions = [Odometry(rng.uniform(-1, 1, 3), random_covariance(rng, [0.1, 0.1, 0.1])) for _ in range(6)]
    known = newcomers.Newcomers(two=True)
    known.move(None)
    for motion in motions:
        known.move(motion)
    delta, cov = motions[2]
    for motion in motions[3:]:
        delta, cov = chain(delta, cov, *motion)
    found, found_cov = known.motion(2, 6)
    assert found == pytest.approx(delta, abs=1e-12)
    assert found_cov == pytest.approx(cov, abs=1e-12)


# --- the window


def test_landmarks_come_and_go() -> None:
    """One seen at the start and at the end alone, with another in view throughout."""
    log, truth = there_and_back()
    backend = make("fixed-lag by gtsam", log.prior, lag=5.0)
    keys = []
    for step in log:
        backend.step(step)
        keys.append(dict(backend._factors.keys.landmarks))
    assert 5 in keys[0]
    assert 5 in keys[7]  # last sighted at 2 s, so it stays to the 7th
    assert 5 not in keys[8]
    assert keys[-1][5] != keys[0][5]  # back as a new one
    assert all(keys[k][9] == keys[0][9] for k in range(len(keys)))
    solution = backend.finish()
    assert sorted(solution.map.ids.tolist()) == [5, 9]
    assert solution.path[:, :2] == pytest.approx(truth[:, :2], abs=0.5)


def test_a_pose_is_what_it_was_when_it_left_the_window() -> None:
    log, _ = there_and_back()
    backend, twin = make("fixed-lag by gtsam", log.prior, lag=5.0), make("fixed-lag by gtsam", log.prior, lag=5.0)
    inside: dict[int, Array] = {}
    for k, step in enumerate(log):
        backend.step(step)
        twin.step(step)
        for i in range(max(0, k - 5), k + 1):
            inside[i] = _gtsam.array(twin._smoother.calculateEstimatePose2(_gtsam.Keys.pose(i)))
    assert backend.finish().path[:-6] == pytest.approx(np.array([inside[i] for i in range(len(log) - 6)]), abs=1e-12)


@pytest.mark.parametrize("solver", ["own", "gtsam"])
def test_without_a_window_it_is_a_filter(solver: str, drive: Dataset) -> None:
    """With no lag all but the last pose and what it sees is marginalised: the path is the online one."""
    backend, path = run("fixed-lag", drive.log, lag=0.0, solver=solver)
    assert backend.finish().path == pytest.approx(path, abs=1e-9)


@pytest.mark.parametrize("solver", ["own", "gtsam"])
def test_a_gap_longer_than_the_window_is_bridged_by_odometry(solver: str, drive: Dataset) -> None:
    late = [step._replace(t=step.t + 1e4 * (k >= 100)) for k, step in enumerate(drive.log)]
    _, path = run("fixed-lag", Log.from_steps("gap", drive.log.prior, late), lag=5.0, solver=solver)
    assert np.hypot(*(path[-1] - drive.truth.poses[-1])[:2]) < 1.0


@pytest.mark.parametrize("with_covariance", [True, False])
def test_a_given_map_is_never_forgotten(with_covariance: bool) -> None:
    log, truth = random_log(np.random.default_rng(8), 120, 8, noise=0.1)
    n = len(truth.map.ids)
    root = np.random.default_rng(9).normal(size=(2 * n, 2 * n))
    cov = 1e-5 * (root @ root.T + np.eye(2 * n)) if with_covariance else None
    log = Log.from_steps("given", log.prior._replace(map=truth.map._replace(cov=cov)), list(log))
    backend, path = run("fixed-lag by gtsam", log, lag=0.5)
    _, ekf = run("ekf", log)
    assert set(backend._factors.keys.landmarks) == set(truth.map.ids.tolist())
    assert path == pytest.approx(ekf, abs=5e-3)
    if cov is None:
        assert backend.map().xy == pytest.approx(truth.map.xy, abs=1e-4)


def there_and_back() -> tuple[Log, Array]:
    """Thirty seconds ahead, a step a second; landmark 5 is seen in the first and the last three steps, 9 always."""
    places = {5: np.array([3.0, 3.0]), 9: np.array([5.0, -4.0])}
    motion, pose, steps, path = np.array([0.2, 0.0, 0.1]), np.zeros(3), list[Step](), list[Array]()
    rng, cov, z_cov = np.random.default_rng(25), np.diag([1e-4, 1e-4, 1e-4]), np.diag([1e-4, 1e-4])
    for k in range(30):
        pose = pose if k == 0 else compose(pose, motion)
        path.append(pose)
        ids = [5, 9] if k < 3 or k >= 27 else [9]
        offsets = [between(pose, np.array([*places[i], 0.0])) for i in ids]
        z = np.array([(np.hypot(*o[:2]), np.arctan2(o[1], o[0])) for o in offsets]) + 0.01 * rng.normal(
            size=(len(ids), 2)
        )
        odometry = None if k == 0 else Odometry(motion + rng.multivariate_normal(np.zeros(3), cov), cov)
        steps.append(
            Step(float(k), odometry, RangeBearing(np.array(ids), z, np.tile(z_cov, (len(ids), 1, 1))), NO_LOOPS)
        )
    return Log.from_steps("there and back", Prior(np.zeros(3), 1e-6 * np.eye(3)), steps), np.array(path)


# --- at the limits


@pytest.mark.parametrize("name", first_quick(["isam2", "fixed-lag by gtsam", "fixed-lag by own"]))
def test_a_long_stretch_without_landmarks_is_survived(name: str) -> None:
    """6,000 steps straight ahead, where GTSAM's default Cholesky factorization fails."""
    ahead = Odometry(np.array([0.1, 0.0, 0.0]), np.diag([1e-4, 1e-4, 1e-4]))
    steps = [Step(float(k), ahead, NO_SIGHTINGS, NO_LOOPS) for k in range(6000)]
    log = Log.from_steps("blind", Prior(np.zeros(3), 1e-9 * np.eye(3)), steps)
    backend, path = run(name, log)
    _, reckoned = run("dead-reckoning", log)
    assert path == pytest.approx(reckoned, abs=1e-6)
    assert backend.finish().path == pytest.approx(reckoned, abs=1e-6)
    if name == "isam2":
        assert re.search(r"Cholesky factorization failed at step \d+: QR from there", backend.finish().remark)
        assert run(name, log, factorization="qr")[0].finish().remark == ""
        with pytest.raises(Diverged, match="GTSAM"):
            run(name, log, factorization="cholesky")


@pytest.mark.parametrize("seed", [4, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2, 3, 5, 6, 7))])
def test_isam2_gives_way_to_qr_where_cholesky_fails_and_ends_where_qr_does(seed: int) -> None:
    """Cholesky fails in seven of eight short cities, in all of eight circles."""
    source = datasets.find("city")
    log = source.make(source.options(steps=400), np.random.default_rng(seed)).log
    (auto, path), (qr, by_qr) = (run("isam2", log, factorization=name) for name in ("auto", "qr"))
    mixed, whole = auto.finish(), qr.finish()
    assert re.search(r"failed at step \d+: QR from there", mixed.remark)
    assert path == pytest.approx(by_qr, abs=0.1)
    costs = [misfit(log, one.path, one.map) for one in (mixed, whole)]
    assert costs[0].total == pytest.approx(costs[1].total, rel=2e-3)  # pyright: ignore[reportOptionalMemberAccess]


@pytest.mark.parametrize("name", SMOOTHERS)
def test_a_landmark_at_no_distance_is_no_division_by_zero(name: str) -> None:
    log = random_log(np.random.default_rng(26), 30, 5, noise=0.3).log
    steps = list(log)
    touched = RangeBearing(np.array([10**9]), np.zeros((1, 2)), np.diag([0.01, 0.1])[None])
    steps[10] = steps[10]._replace(sightings=touched)
    solution = final(name, Log.from_steps("touched", log.prior, steps))
    steps[10] = steps[10]._replace(sightings=RangeBearing(touched.ids[:0], touched.z[:0], touched.cov[:0]))
    # What is seen once says nothing of the path; iSAM2 stops within its threshold of the optimum.
    assert solution.path == pytest.approx(final(name, Log.from_steps("blind", log.prior, steps)).path, abs=1e-3)


@pytest.mark.parametrize("name", SMOOTHERS)
def test_what_gtsam_cannot_solve_is_diverged_in_its_words(name: str) -> None:
    steps = list(random_log(np.random.default_rng(27), 10, 3).log)
    bad = RangeBearing(np.array([1]), np.array([[np.nan, 0.0]]), np.eye(2)[None])
    steps[4] = steps[4]._replace(sightings=bad)
    with pytest.raises(Diverged):
        final(name, Log.from_steps("nan", Prior(np.zeros(3), np.eye(3)), steps))
