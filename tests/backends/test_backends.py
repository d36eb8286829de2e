"""The backends against independent implementations, against linear theory and against one another."""

from typing import Any

import numpy as np
import pytest

from random_logs import TextbookKalman, random_log
from slamduel.backends import models
from slamduel.backends.api import Diverged, Solution
from slamduel.backends.registry import find
from slamduel.bench.speed.textbook_ekf import TextbookEkf
from slamduel.datasets import registry as datasets
from slamduel.frontend.factors import Log, Map, Odometry, Prior, RangeBearing, RelativePoses, Step, Truth
from slamduel.frontend.se2 import Array, act_jacobians, compose, compose_jacobians, wrap

NO_SIGHTINGS = RangeBearing(np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros((0, 2, 2)))
NO_LOOPS = RelativePoses(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3, 3)))
GAUSSIAN = ("ekf", "isam2", "graph")


def make(name: str, prior: Prior, seed: int = 0, **options: Any) -> Any:
    builder = find(name)
    return builder.make(prior, builder.options(**options), np.random.default_rng(seed))


def run(name: str, log: Log, seed: int = 0, **options: Any) -> tuple[Any, list[Any]]:
    backend = make(name, log.prior, seed, **options)
    return backend, [backend.step(step) for step in log]


@pytest.fixture(scope="module")
def victoria_park() -> Log:
    source = datasets.find("victoria-park")
    return source.make(source.options(), np.random.default_rng(0)).log


@pytest.fixture(scope="module")
def optimum(victoria_park: Log) -> Solution:
    return run("graph", victoria_park)[0].finish()


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


@pytest.mark.slow
def test_ekf_is_the_textbook_filter_on_victoria_park(victoria_park: Log) -> None:
    mine, textbook = make("ekf", victoria_park.prior), TextbookEkf(victoria_park.prior)
    for k, step in enumerate(victoria_park.head(700)):
        assert mine.step(step) == pytest.approx(textbook.step(step), abs=1e-8)
        if k % 50 == 0:
            assert mine.map().cov == pytest.approx(textbook.cov[3:, 3:], abs=1e-8)
            assert mine.belief().cov == pytest.approx(textbook.cov[:3, :3], abs=1e-8)


def linearised_answer(log: Log, truth: Truth) -> Array:
    """The last pose (3,) by a Kalman filter on the log linearised at the truth: what Gaussian backends tend to."""
    assert truth.map is not None
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


def test_smoothers_agree_on_a_random_log() -> None:
    log = random_log(np.random.default_rng(6), 200, 20).log
    batch, incremental = (run(name, log)[0].finish() for name in ("graph", "isam2"))
    assert incremental.path == pytest.approx(batch.path, abs=1e-2)  # iSAM2 leaves alone what moves by less than 0.1
    assert incremental.map.ids.tolist() == batch.map.ids.tolist()
    assert incremental.map.xy == pytest.approx(batch.map.xy, abs=1e-2)


def test_ekf_ends_where_it_should_on_victoria_park(victoria_park: Log, optimum: Solution) -> None:
    _, path = run("ekf", victoria_park)
    distance = np.hypot(*(np.array(path) - optimum.path)[:, :2].T)
    assert np.sqrt((distance**2).mean()) == pytest.approx(11.0, abs=0.1)


def test_isam2_ends_at_the_optimum_of_a_third_of_victoria_park(victoria_park: Log) -> None:
    part = victoria_park.head(2400)
    optimum, final = (run(name, part)[0].finish() for name in ("graph", "isam2"))
    distance = np.hypot(*(final.path - optimum.path)[:, :2].T)
    assert np.sqrt((distance**2).mean()) < 0.1


def test_isam2_survives_a_long_stretch_without_landmarks() -> None:
    """6,000 steps straight ahead; GTSAM's default Cholesky factorization gives up on this log: it is a hard one."""
    ahead = Odometry(np.array([0.1, 0.0, 0.0]), np.diag([1e-4, 1e-4, 1e-4]))
    steps = [Step(float(k), ahead, NO_SIGHTINGS, NO_LOOPS) for k in range(6000)]
    log = Log.from_steps("blind", Prior(np.zeros(3), 1e-9 * np.eye(3)), steps)
    backend, path = run("isam2", log)
    _, reckoned = run("dead-reckoning", log)
    assert np.array(path) == pytest.approx(np.array(reckoned), abs=1e-6)
    assert backend.finish().path == pytest.approx(np.array(reckoned), abs=1e-6)
    with pytest.raises(Diverged, match="GTSAM"):
        run("isam2", log, factorization="cholesky")


@pytest.mark.parametrize("with_covariance", [True, False])
def test_gaussian_backends_localise_alike_on_a_given_map(with_covariance: bool) -> None:
    log, truth = random_log(np.random.default_rng(8), 60, 8, noise=0.1)
    assert truth is not None
    assert truth.map is not None
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
    batch = make("graph", prior)
    for step in log:
        batch.step(step)
    assert batch.finish().path[-1] == pytest.approx(paths["ekf"][-1], abs=2e-3)


def test_loop_closures_pull_a_drifting_path_together() -> None:
    """Round a square: the last pose stands on the first, and one relative pose says so."""
    cov = np.diag([1e-2, 1e-2, 1e-2])
    deltas = [np.array([1.0, 0.0, np.pi / 2 + 0.1])] * 4
    steps = [Step(0.0, None, NO_SIGHTINGS, NO_LOOPS)]
    steps += [Step(k + 1.0, Odometry(delta, cov), NO_SIGHTINGS, NO_LOOPS) for k, delta in enumerate(deltas)]
    closure = RelativePoses(np.array([0]), np.zeros((1, 3)), 1e-8 * np.eye(3)[None])
    steps[-1] = steps[-1]._replace(loops=closure)
    log = Log.from_steps("square", Prior(np.zeros(3), 1e-8 * np.eye(3)), steps)
    for name in ("isam2", "graph"):
        final = run(name, log)[0].finish().path
        assert final[-1] == pytest.approx(np.zeros(3), abs=1e-3), name
        assert np.hypot(*final[2, :2]) == pytest.approx(np.sqrt(2), abs=0.1), name


def test_fastslam_is_close_to_the_ekf_where_noise_is_small() -> None:
    log, truth = random_log(np.random.default_rng(10), 100, 10)
    assert truth is not None
    errors = [
        np.sqrt((np.hypot(*(np.array(run(name, log, **options)[1]) - truth.poses)[:, :2].T) ** 2).mean())
        for name, options in (("ekf", {}), ("fastslam", {"particles": 2000, "version": 1}))
    ]
    assert errors[1] < 2 * errors[0]


def test_fastslam_weights_count_every_particle_again_after_resampling() -> None:
    log = random_log(np.random.default_rng(12), 30, 6).log
    backend = make("fastslam", log.prior, particles=50, version=1, resample_below=0.0)
    for step in log:
        backend.step(step)
    assert backend.belief().n_eff < 25  # never resampled: the weights have degenerated
    backend._resample()
    assert backend.belief().n_eff == pytest.approx(50)


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
