"""The backends against independent implementations, against linear theory and against one another."""

from typing import Any

import numpy as np
import pytest

from driven import NO_LOOPS, NO_SIGHTINGS, final, make, rmse, run
from random_logs import TextbookKalman, random_log
from slamduel.backends import models
from slamduel.backends.api import Diverged
from slamduel.core.factors import Log, Map, Odometry, Prior, RangeBearing, Step, Truth
from slamduel.core.se2 import Array, act_jacobians, compose, compose_jacobians, wrap
from slamduel.datasets import registry as datasets

GAUSSIAN = ("ekf", "isam2", "graph")


def numerical(function: Any, at: Array) -> Array:
    """Central differences (..., 2 or 3, n): truncation and rounding each about 1e-9 at this step."""
    step = 1e-5
    return np.stack([(function(at + e) - function(at - e)) / (2 * step) for e in step * np.eye(len(at))], axis=-1)


def test_model_jacobians_are_the_derivatives() -> None:
    rng = np.random.default_rng(1)
    for _ in range(50):
        pose, xy, z = rng.normal(size=3), 3 * rng.normal(size=2), np.array([rng.uniform(0.5, 9), rng.uniform(-3, 3)])
        odometry = Odometry(rng.normal(size=3), np.diag(rng.uniform(0.1, 1, 3)))

        _, by_pose, by_landmark = models.sight(pose, xy)
        centre = models.sight(pose, xy)[0]
        assert by_pose == pytest.approx(
            numerical(lambda p, c=centre, m=xy: models.innovation(models.sight(p, m)[0], c), pose), abs=1e-7
        )
        assert by_landmark == pytest.approx(
            numerical(lambda m, c=centre, p=pose: models.innovation(models.sight(p, m)[0], c), xy), abs=1e-7
        )

        _, by_pose, by_z = models.place(pose, z)
        assert by_pose == pytest.approx(numerical(lambda p, z=z: models.place(p, z)[0], pose), abs=1e-7)
        assert by_z == pytest.approx(numerical(lambda z, p=pose: models.place(p, z)[0], z), abs=1e-7)

        reckoner = make("dead-reckoning", Prior(pose, odometry.cov))
        after = reckoner.step(Step(0.0, odometry, NO_SIGHTINGS, NO_LOOPS))
        assert off(after.copy(), compose(pose, odometry.delta)) == pytest.approx(np.zeros(3), abs=1e-12)
        G = numerical(lambda p, o=odometry, a=after: off(compose(p, o.delta), a), pose)
        V = numerical(lambda d, p=pose, a=after: off(compose(p, d), a), odometry.delta)
        assert reckoner.belief().cov == pytest.approx(G @ odometry.cov @ G.T + V @ odometry.cov @ V.T, abs=1e-7)


def off(pose: Array, centre: Array) -> Array:
    """pose - centre, the heading wrapped, so that differences across the cut are small."""
    difference = pose - centre
    difference[2] = wrap(difference[2])
    return difference


def test_place_undoes_sight() -> None:
    rng = np.random.default_rng(2)
    poses, xy = rng.normal(size=(100, 3)), 3 * rng.normal(size=(100, 2))
    assert models.place(poses, models.sight(poses, xy)[0])[0] == pytest.approx(xy, abs=1e-12)


def test_a_landmark_at_the_robot_is_named_not_divided_by() -> None:
    with pytest.raises(Diverged, match="robot's own position"):
        models.sight(np.zeros(3), np.zeros(2))


def linearised_answer(log: Log, truth: Truth) -> Array:
    """The last pose (3,) by a Kalman filter on the log linearised at the truth: what Gaussian backends tend to."""
    n = 3 + 2 * len(truth.map.ids)
    place = {landmark: 3 + 2 * k for k, landmark in enumerate(truth.map.ids.tolist())}
    cov = np.diag([0.0, 0, 0] + [1e6] * (n - 3))  # of landmarks nothing is known: 1 km, against errors below 1 m
    cov[:3, :3] = log.prior.cov
    kalman = TextbookKalman(np.zeros(n), cov)
    kalman.mean[:3] = off(log.prior.pose.copy(), truth.poses[0])
    for k, step in enumerate(log):
        if step.odometry is not None:
            exact = compose(truth.poses[k - 1], step.odometry.delta)
            by_pose, by_delta = compose_jacobians(truth.poses[k - 1], step.odometry.delta)
            F, Q, u = np.eye(n), np.zeros((n, n)), np.zeros(n)
            F[:3, :3], Q[:3, :3] = by_pose, by_delta @ step.odometry.cov @ by_delta.T
            u[:3] = off(exact, truth.poses[k])
            kalman.predict(F, Q, u)
        for landmark, z, R in zip(step.sightings.ids.tolist(), *step.sightings[1:], strict=True):
            at = place[landmark]
            xy = truth.map.xy[(at - 3) // 2]
            expected, by_pose, by_landmark = models.sight(truth.poses[k], xy)
            H = np.zeros((2, n))
            H[:, :3], H[:, at : at + 2] = by_pose, by_landmark
            kalman.update(models.innovation(z.copy(), expected), H, R)
    return truth.poses[-1] + kalman.mean[:3]


@pytest.mark.parametrize("name", GAUSSIAN)
def test_the_distance_from_the_linear_answer_falls_with_the_square_of_the_noise(name: str) -> None:
    distances: list[float] = []
    for noise in (0.3, 0.03):
        log, truth = random_log(np.random.default_rng(4), 40, 8, noise=noise)
        assert truth is not None
        backend, poses = run(name, log)
        last = poses[-1] if poses[-1] is not None else backend.finish().path[-1]
        distances.append(float(np.abs(off(last.copy(), linearised_answer(log, truth))).max()))
    assert distances[0] > 1e-6  # there is something to fall
    assert distances[1] < distances[0] / 100 * 3  # e^2 is a factor of 100; the next order may add its share


def test_isam2_marginal_is_the_ekf_covariance_on_a_short_log() -> None:
    log = random_log(np.random.default_rng(5), 25, 10, noise=0.3).log
    filters = [make(name, log.prior) for name in ("ekf", "isam2")]
    for step in log:
        for backend in filters:
            backend.step(step)
        ours, theirs = (backend.belief().cov for backend in filters)
        assert np.linalg.norm(theirs - ours) <= 0.01 * np.linalg.norm(ours)
    ours, theirs = (backend.map() for backend in filters)
    assert ours.ids.tolist() == theirs.ids.tolist()
    assert np.linalg.norm(theirs.cov - ours.cov) <= 0.01 * np.linalg.norm(ours.cov)


def test_ekf_ends_where_it_should_on_victoria_park() -> None:
    source = datasets.find("victoria-park")
    log = source.make(source.options(), np.random.default_rng(0)).log
    assert rmse(run("ekf", log)[1], final("graph", log).path) == pytest.approx(11.0, abs=0.1)


@pytest.mark.parametrize("with_covariance", [True, False])
def test_gaussian_backends_localise_alike_on_a_given_map(with_covariance: bool) -> None:
    log, truth = random_log(np.random.default_rng(8), 60, 8, noise=0.1)
    n = len(truth.map.ids)
    root = np.random.default_rng(9).normal(size=(2 * n, 2 * n))
    cov = 1e-5 * (root @ root.T + np.eye(2 * n)) if with_covariance else None
    prior = log.prior._replace(map=truth.map._replace(cov=cov))
    poses = {name: make(name, prior) for name in ("ekf", "isam2", "fastslam")}
    paths = {name: np.array([backend.step(step) for step in log]) for name, backend in poses.items()}
    assert paths["isam2"] == pytest.approx(paths["ekf"], abs=2e-3)
    if cov is None:
        assert np.array_equal(poses["ekf"].map().xy, truth.map.xy)  # held fixed
        assert poses["isam2"].map().xy == pytest.approx(truth.map.xy, abs=1e-6)
        assert paths["fastslam"][:, :2] == pytest.approx(truth.poses[:, :2], abs=0.05)
    given = Log.from_steps("given", prior, list(log))
    assert final("graph", given).path[-1] == pytest.approx(paths["ekf"][-1], abs=2e-3)


@pytest.mark.parametrize(("name", "noise"), [("ukf", 3.0), ("invariant-ekf", 2.0)])
def test_covariances_stay_positive_definite_over_a_long_log(name: str, noise: float) -> None:
    log = random_log(np.random.default_rng(6), 1500, 12, noise=noise, blind=0.4).log
    backend = make(name, log.prior)
    for k, step in enumerate(log):
        backend.step(step)
        covs = (backend.belief().cov, backend.map().cov) if k % 50 == 0 else (backend.belief().cov,)
        assert all(np.array_equal(cov, cov.T) for cov in covs)
        assert k % 50 or all(np.linalg.eigvalsh(cov)[0] > 0 for cov in covs if cov.size)


def test_map_of_one_landmark_from_a_known_pose() -> None:
    """The smallest case by hand: eqs (17), (18) and (20) with a pose that is all but certain."""
    cov = np.diag([0.04, 0.01])
    z = np.array([2.0, np.pi / 2])
    prior = Prior(np.array([1.0, 1.0, 0.0]), 1e-12 * np.eye(3))
    seen = RangeBearing(np.array([7]), z[None], cov[None])
    log = Log.from_steps("one", prior, [Step(0.0, None, seen, NO_LOOPS)])
    # straight to the left, at 2 m: range is y, and bearing is -x at a lever of 2 m
    expected = Map(np.array([7]), np.array([[1.0, 3.0]]), np.diag([4 * 0.01, 0.04]))
    for name in ("ekf", "isam2", "fastslam"):
        found = run(name, log)[0].map()
        assert found.ids.tolist() == [7], name
        assert found.xy == pytest.approx(expected.xy, abs=1e-5), name
        assert found.cov == pytest.approx(expected.cov, abs=1e-5), name
    assert act_jacobians(prior.pose, np.array([0.0, 2.0]))[0][:, 2] == pytest.approx([-2.0, 0.0])
