"""The linear Kalman filter against one with whole matrices, and against the EKF where the two must agree."""

import dataclasses

import numpy as np
import pytest

from dense_invariant import turning
from random_logs import TextbookKalman, random_log
from slamduel.backends.api import Builder, Diverged
from slamduel.backends.gaussian.ekf import Ekf
from slamduel.backends.gaussian.ekf import Options as EkfOptions
from slamduel.backends.gaussian.kf import Kf, build
from slamduel.bench.check.candidate import Candidate
from slamduel.bench.check.suite import chosen, examine
from slamduel.core.factors import Log, Map, Prior
from slamduel.core.options import NoOptions
from slamduel.core.se2 import Array, wrap
from slamduel.datasets.worlds.linear import Options, linear

LEFT = turning(np.pi / 2)


def whole(log: Log) -> tuple[TextbookKalman, list[float]]:
    """SLAM with matrices A and H written out, linearised at the heading that odometry gives; and the NIS of each step.

    The offset and its noise are the moments of a sighting whose bearing alone is curved, by finite differences else.
    """
    kalman, given, rows = TextbookKalman(log.prior.pose, log.prior.cov), float(log.prior.pose[2]), dict[int, int]()
    nis: list[float] = []
    for step in log:
        n = len(kalman.mean)
        if step.odometry is not None:
            A, R, u = np.eye(n), np.zeros((n, n)), np.zeros(n)
            body = np.eye(3)
            body[:2, :2] = turning(given)
            w = turning(given) @ step.odometry.delta[:2]
            A[:2, 2] = LEFT @ w
            u[:2], u[2] = w - LEFT @ w * given, step.odometry.delta[2]
            R[:3, :3] = body @ step.odometry.cov @ body.T
            kalman.predict(A, R, u)
            given += float(step.odometry.delta[2])
        nis.append(0.0)
        for landmark, z, cov in zip(step.sightings.ids.tolist(), step.sightings.z, step.sightings.cov, strict=True):

            def offset(polar: Array, heading: float = given) -> Array:
                return polar[0] * np.array([np.cos(heading + polar[1]), np.sin(heading + polar[1])])

            by = np.stack([(offset(z + e) - offset(z - e)) / 2e-6 for e in 1e-6 * np.eye(2)], axis=-1)
            # E exp(i b) of a normal b is exp(-var / 2): the arc's middle lies nearer, and its points scatter inwards.
            w = offset(z) * np.exp(-cov[1, 1] / 2)
            Q = by @ cov @ by.T + np.outer(offset(z), offset(z)) * cov[1, 1] ** 2 / 2
            n = len(kalman.mean)
            if landmark not in rows:  # the state grows by m = (x, y) + w + w' (heading - given) + noise
                rows[landmark] = n
                grow = np.eye(n + 2, n)
                grow[n:, :2], grow[n:, 2] = np.eye(2), LEFT @ w
                kalman.mean = grow @ kalman.mean
                kalman.mean[n:] += w - LEFT @ w * given
                kalman.cov = grow @ kalman.cov @ grow.T
                kalman.cov[n:, n:] += Q
                continue
            H = np.zeros((2, n))
            H[:, :2], H[:, 2], H[:, rows[landmark] : rows[landmark] + 2] = -np.eye(2), -LEFT @ w, np.eye(2)
            nis[-1] += kalman.update(w - LEFT @ w * given, H, Q)
    return kalman, nis


def run(log: Log) -> tuple[Kf, list[float]]:
    kf = Kf(log.prior, NoOptions(), np.random.default_rng(0))
    nis: list[float] = []
    for step in log:
        kf.step(step)
        nis.append(kf.belief().nis or 0.0)
    return kf, nis


@pytest.mark.parametrize(("seed", "steps", "landmarks"), [(0, 60, 8), (1, 60, 8), (2, 60, 8), (3, 12, 200)])
def test_it_is_the_filter_with_whole_matrices(seed: int, steps: int, landmarks: int) -> None:
    log = random_log(np.random.default_rng(seed), steps, landmarks).log
    kf, nis = run(log)
    expected, expected_nis = whole(log)
    belief, known = kf.belief(), kf.map()
    assert landmarks == 8 or len(known.ids) > 100  # whose products are made in parts
    assert belief.cov is not None
    assert known.cov is not None
    # Differences of the polar coordinates over 1e-6 leave 1e-10 of them.
    np.testing.assert_allclose(belief.pose[:2], expected.mean[:2], atol=1e-8)
    assert wrap(belief.pose[2] - expected.mean[2]) == pytest.approx(0, abs=1e-8)
    np.testing.assert_allclose(known.xy.ravel(), expected.mean[3:], atol=1e-8)
    np.testing.assert_allclose(belief.cov, expected.cov[:3, :3], atol=1e-9)
    np.testing.assert_allclose(known.cov, expected.cov[3:, 3:], atol=1e-9)
    np.testing.assert_allclose(nis, expected_nis, rtol=1e-6, atol=1e-8)
    assert sum(nis) > 0


def apart(turning_noise: float, noise: float) -> float:
    """m, how far KF and EKF ever are from each other in the linear world, whose other noises are all `noise` m."""
    options = Options(steps=100, turning=turning_noise, sliding=noise, sighting=noise)
    log = linear(options, np.random.default_rng(1)).log
    kf = Kf(log.prior, NoOptions(), np.random.default_rng(0))
    ekf = Ekf(log.prior, EkfOptions(), np.random.default_rng(0))
    return max(float(np.hypot(*(kf.step(step) - ekf.step(step))[:2])) for step in log)


def test_in_the_linear_world_it_is_the_ekf() -> None:
    # What is left is the curvature of polar coordinates, noise squared over the range, 2 m at least: a bound of
    # 100 such, one a step. Of the second order, it is a hundred times smaller with noise that is ten times smaller.
    assert apart(1e-6, 1e-3) < 100 * 1e-3**2 / 2
    assert 50 * apart(1e-6, 1e-3) < apart(1e-6, 1e-2)


def test_where_the_heading_is_lost_it_is_not() -> None:
    assert apart(0.1, 1e-2) > 1.0


def test_where_the_heading_is_off_it_is_held_to_dead_reckoning_alone() -> None:
    (check,) = chosen(["near-and-far"])
    assert examine(check, Candidate(build, NoOptions())).status == "passed"
    assert examine(check, Candidate(Builder(Kf), NoOptions())).status == "failed"


def test_a_map_that_is_given_is_kept_to() -> None:
    log, truth = linear(Options(steps=20), np.random.default_rng(2))
    given = Prior(log.prior.pose, log.prior.cov, truth.map)
    kf = Kf(given, NoOptions(), np.random.default_rng(0))
    for step in log:
        kf.step(step)
    np.testing.assert_array_equal(kf.map().xy, truth.map.xy)
    belief = kf.belief()
    assert belief.nis_dof == 2 * len(log[len(log) - 1].sightings.ids)
    sure = Prior(
        log.prior.pose, log.prior.cov, Map(truth.map.ids, truth.map.xy, 1e-12 * np.eye(2 * len(truth.map.ids)))
    )
    other = Kf(sure, NoOptions(), np.random.default_rng(0))
    for step in log:
        other.step(step)
    np.testing.assert_allclose(other.belief().pose, belief.pose, atol=1e-6)


def test_a_landmark_at_the_robots_own_place_has_no_bearing_and_is_taken_all_the_same() -> None:
    log = random_log(np.random.default_rng(5), 40, 8).log
    z = log.z.copy()
    z[::7, 0] = 0.0
    at_robot = dataclasses.replace(log, z=z)
    kf, nis = run(at_robot)
    expected, expected_nis = whole(at_robot)
    np.testing.assert_allclose(kf.belief().pose[:2], expected.mean[:2], atol=1e-7)
    np.testing.assert_allclose(nis, expected_nis, rtol=1e-5, atol=1e-7)


def test_what_is_no_covariance_is_said() -> None:
    log = linear(Options(steps=5), np.random.default_rng(3)).log
    kf = Kf(log.prior, NoOptions(), np.random.default_rng(0))
    step = log[0]
    assert len(step.sightings.ids)
    kf.step(step)
    wrong = step.sightings._replace(cov=-100 * np.eye(2) + 0 * step.sightings.cov)
    with pytest.raises(Diverged, match="not positive definite"):
        kf.step(step._replace(sightings=wrong))


def test_the_linear_world_states_the_noise_that_it_has() -> None:
    log, truth = linear(Options(steps=4000, turning=0.01), np.random.default_rng(4))
    errors = log.delta[1:] - np.column_stack((np.diff(truth.poses[:, :2], axis=0), np.zeros(3999)))
    off = errors / np.sqrt(np.einsum("kii->ki", log.delta_cov[1:]))
    # The variance of the mean of n squares of normals is 2 / n: six standard deviations.
    assert np.abs((off**2).mean(axis=0) - 1).max() < 6 * np.sqrt(2 / 3999)
    assert (truth.poses[:, 2] == 0).all()
