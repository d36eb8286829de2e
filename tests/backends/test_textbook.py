"""The yardstick is itself measured: against differences, against batch least squares, against the linear filter."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from random_logs import TextbookKalman, moved, random_log
from slamduel.backends.association.signatures import SignatureFilters
from slamduel.backends.programs.textbook_ekf import Options, TextbookEkf, build, wrapped
from slamduel.core.factors import Log, Map, Odometry, Prior, RangeBearing, RelativePoses, Step
from slamduel.core.se2 import Array, between
from slamduel.core.signatures import Signatures


def differences(function: Callable[[Array], Array], at: Array, step: float = 1e-6) -> Array:
    """Central differences, (m, n): error about step^2 times the third derivative plus 1e-16 / step."""
    columns = [(function(at + e) - function(at - e)) / (2 * step) for e in step * np.eye(len(at))]
    return np.array(columns).T


def batch_covariance(log: Log, path: Array, ids: list[int], xy: Array) -> Array:
    """The covariance of (last pose, landmarks in the order of ids) by inverting the whole log's information matrix.

    Linearised at `path` and `xy`, with difference Jacobians of the residuals: no line is shared with a filter's.
    """
    n = len(path)
    place = {landmark: 3 * n + 2 * i for i, landmark in enumerate(ids)}
    at = np.concatenate((path.ravel(), xy.ravel()))
    information = np.zeros((len(at), len(at)))
    information[:3, :3] = np.linalg.inv(log.prior.cov)

    def add(residual: Callable[[Array], Array], variables: list[int], cov: Array) -> None:
        J = np.zeros((len(cov), len(at)))
        J[:, variables] = differences(residual, at[variables])
        nonlocal information
        information = information + J.T @ np.linalg.inv(cov) @ J

    for k, step in enumerate(log):
        pose = list(range(3 * k, 3 * k + 3))
        if step.odometry is not None:
            before = list(range(3 * k - 3, 3 * k))
            add(lambda v: between(v[:3], v[3:]), before + pose, step.odometry.cov)
        for landmark, cov in zip(step.sightings.ids.tolist(), step.sightings.cov, strict=True):
            j = place[landmark]
            # near the cut the bearing itself would jump, so the residual is taken from where it is
            middle = np.arctan2(at[j + 1] - path[k, 1], at[j] - path[k, 0])
            add(lambda v, m=middle: sighting(v, m), [*pose, j, j + 1], cov)
    covariance = np.asarray(np.linalg.inv(information), np.float64)
    wanted = [*range(3 * n - 3, 3 * n), *range(3 * n, len(at))]
    return covariance[np.ix_(wanted, wanted)]


def sighting(v: Array, middle: float) -> Array:
    x, y, theta, m_x, m_y = v
    bearing = middle + wrapped(np.arctan2(m_y - y, m_x - x) - middle) - theta
    return np.array([np.hypot(m_x - x, m_y - y), bearing], np.float64)


@pytest.mark.parametrize("together", [False, True])
def test_on_an_exact_log_the_filter_is_batch_least_squares(together: bool) -> None:
    log, truth = random_log(np.random.default_rng(1), 40, 8, errors=0.0)
    ekf = TextbookEkf(log.prior, together=together)
    path = np.array([ekf.step(step) for step in log])
    np.testing.assert_allclose(between(path, truth.poses), 0, atol=1e-11)
    xy = dict(zip(truth.map.ids.tolist(), truth.map.xy, strict=True))
    assert sorted(xy) == sorted(ekf.ids)
    assert np.diff(log.sighting_first).min() == 0
    true_xy = np.array([xy[i] for i in ekf.ids])
    np.testing.assert_allclose(ekf.mean[3:].reshape(-1, 2), true_xy, atol=1e-11)
    expected = batch_covariance(log, truth.poses, ekf.ids, true_xy)
    np.testing.assert_allclose(ekf.cov, expected, atol=1e-7 * np.abs(expected).max())


def test_both_orders_of_update_agree_as_the_noise_goes_to_zero() -> None:
    gaps = []
    for noise in (1e-2, 1e-3):
        log, _ = random_log(np.random.default_rng(2), 60, 10, noise=noise)
        one, all_ = TextbookEkf(log.prior), TextbookEkf(log.prior, together=True)
        paths = [np.array([ekf.step(step) for step in log]) for ekf in (one, all_)]
        gaps.append(np.abs(between(*paths)).max())
        assert gaps[-1] > 0
    assert gaps[1] < gaps[0] / 50  # the difference is of second order: a hundredth, with room for the constants


@pytest.mark.parametrize("together", [False, True])
def test_a_unit_start_is_a_given_map_whose_landmarks_are_where_first_seen_to_a_metre(together: bool) -> None:
    log, _ = random_log(np.random.default_rng(4), 30, 6)
    first = log[0].sightings
    assert len(first.ids) > 1
    places = []
    for z in first.z:
        there = log.prior.pose[2] + z[1]
        places.append(log.prior.pose[:2] + z[0] * np.array([np.cos(there), np.sin(there)]))
    known = Map(first.ids, np.array(places), np.eye(2 * len(places)))
    unit = TextbookEkf(log.prior, start="unit", together=together)
    given = TextbookEkf(log.prior._replace(map=known), start="unit", together=together)
    model = TextbookEkf(log.prior, together=together)
    for step in log:
        np.testing.assert_allclose(unit.step(step), given.step(step), atol=1e-12)
        model.step(step)
    assert unit.ids == given.ids
    np.testing.assert_allclose(unit.cov, given.cov, atol=1e-12)
    assert np.abs(unit.mean - model.mean).max() > 1e-6
    assert sorted(unit.ids) == sorted(model.ids)


def test_a_unit_start_is_an_option_of_the_backend() -> None:
    log, _ = random_log(np.random.default_rng(4), 5, 6)
    built = build.make(log.prior, Options(start="unit"), np.random.default_rng(0))
    built.step(log[0])
    assert built.belief().nis_dof == 2 * len(log[0].sightings.ids)  # the first sightings are used, too


def test_jacobians_are_the_differences() -> None:
    log, _ = random_log(np.random.default_rng(3), 30, 6)
    ekf = TextbookEkf(log.prior)
    for step in log:
        ekf.step(step)
    mean = ekf.mean.copy()
    for landmark in ekf.ids:
        _, H = ekf.predict_sighting(landmark)

        def at(state: Array, landmark: int = landmark) -> Array:
            ekf.mean = state
            return ekf.predict_sighting(landmark)[0]

        np.testing.assert_allclose(H, differences(at, mean), atol=1e-8)
        ekf.mean = mean
    odometry = Odometry(np.array([0.3, 0.1, 0.2]), np.diag([1e-4, 2e-4, 3e-4]))
    before = ekf.cov
    ekf.predict(odometry)
    G = np.eye(len(mean))
    G[:3, :3] = differences(lambda pose: moved(pose, odometry.delta), mean[:3])
    V = differences(lambda delta: moved(mean[:3], delta), odometry.delta)
    expected = G @ before @ G.T
    expected[:3, :3] += V @ odometry.cov @ V.T
    np.testing.assert_allclose(ekf.cov, expected, atol=1e-9)


def test_the_kalman_filter_is_regression() -> None:
    """A constant seen n times through rows of H: the filter must give the least squares answer."""
    rng = np.random.default_rng(4)
    H, R, cov = rng.standard_normal((20, 3)), rng.uniform(0.5, 2, 20), np.diag([4.0, 5.0, 6.0])
    z = H @ np.array([1.0, -2.0, 3.0]) + np.sqrt(R) * rng.standard_normal(20)
    kalman = TextbookKalman(np.zeros(3), cov)
    for row, value, variance in zip(H, z, R, strict=True):
        kalman.predict(np.eye(3), np.zeros((3, 3)))
        kalman.update(np.array([value]), row[None], np.array([[variance]]))
    information = np.linalg.inv(cov) + H.T @ np.diag(1 / R) @ H
    np.testing.assert_allclose(kalman.cov, np.linalg.inv(information), rtol=1e-10, atol=1e-14)
    np.testing.assert_allclose(kalman.mean, np.linalg.solve(information, H.T @ (z / R)), rtol=1e-10)


def test_with_one_landmark_dead_ahead_it_is_the_kalman_filter_of_the_line() -> None:
    """Straight towards a landmark, with exact bearings, the range is linear in (x, m_x) and the rest does not move."""
    rng = np.random.default_rng(5)
    noise, q, r = 1e-4, 1e-3, 2e-3
    prior = Prior(np.zeros(3), np.diag([1e-2, noise, noise]))
    ekf = TextbookEkf(prior)
    none = RelativePoses(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3, 3)))
    z = [10 - 0.2 * k + np.sqrt(r) * rng.standard_normal() for k in range(30)]
    kalman = TextbookKalman(np.array([0.0, z[0]]), 1e-2 * np.ones((2, 2)) + np.diag([0, r]))
    for k in range(30):
        odometry = None if k == 0 else Odometry(np.array([0.2, 0, 0]), np.diag([q, noise, noise]))
        seen = RangeBearing(np.array([3]), np.array([[z[k], 0.0]]), np.diag([r, noise])[None])
        ekf.step(Step(float(k), odometry, seen, none))
        if k > 0:
            kalman.predict(np.eye(2), np.diag([q, 0]), np.array([0.2, 0]))
            kalman.update(np.array([z[k]]), np.array([[-1.0, 1.0]]), np.array([[r]]))
    np.testing.assert_allclose(ekf.mean[[0, 3]], kalman.mean, atol=1e-12)
    np.testing.assert_allclose(ekf.mean[[1, 2, 4]], 0, atol=1e-12)
    np.testing.assert_allclose(ekf.cov[np.ix_([0, 3], [0, 3])], kalman.cov, atol=1e-12)


def test_a_map_without_covariance_stays_and_one_with_it_moves() -> None:
    log, truth = random_log(np.random.default_rng(6), 60, 8)
    assert truth.map is not None
    ids, xy, _ = truth.map
    fixed = TextbookEkf(log.prior._replace(map=Map(ids, xy, None)))
    loose = TextbookEkf(log.prior._replace(map=Map(ids, xy, 1e-2 * np.eye(2 * len(ids)))))
    for step in log:
        fixed.step(step)
        loose.step(step)
    np.testing.assert_array_equal(fixed.mean[3:], xy.ravel())
    assert not fixed.cov[3:].any()
    assert np.abs(loose.mean[3:] - xy.ravel()).min() > 0
    assert (np.diag(loose.cov)[3:] < 1e-2).all()
    # knowing the map can only help, up to the two being linearised at slightly different places
    assert np.linalg.eigvalsh(loose.cov - fixed.cov).min() > -1e-2 * np.linalg.eigvalsh(fixed.cov[:3, :3]).min()


def test_random_logs_are_honest_and_odd_enough() -> None:
    log, truth = random_log(np.random.default_rng(7), 400, 30)
    counts = np.diff(log.sighting_first)
    assert counts.min() == 0
    assert counts.max() >= 3
    assert (np.diff(truth.map.ids) < 0).any()
    assert np.linalg.eigvalsh(log.delta_cov[1:]).min() > 0
    assert np.linalg.eigvalsh(log.z_cov).min() > 0
    motions = np.array([between(a, b) for a, b in pairwise(truth.poses)])
    errors = log.delta[1:] - motions
    squares = np.einsum("ki,kij,kj->k", errors, np.linalg.inv(log.delta_cov[1:]), errors)
    # chi-square with 3 degrees of freedom: variance 6, so six standard errors of the mean of n are 6 sqrt(6 / n)
    assert abs(squares.mean() - 3) < 6 * np.sqrt(6 / len(squares))
    ekf = TextbookEkf(log.prior)
    nis = dof = 0.0
    for step in log:
        ekf.step(step)
        nis, dof = nis + ekf.nis, dof + ekf.nis_dof
    # chi-square with `dof` degrees of freedom has variance 2 dof; a tenth is left to the linearisation
    assert abs(nis / dof - 1) < 6 * np.sqrt(2 / dof) + 0.1


def signed_log(seed: int) -> Log:
    """A random log whose sightings have signatures, each with a variance of its own."""
    log, rng = random_log(np.random.default_rng(seed), 40, 6).log, np.random.default_rng(seed + 1)
    own, var = rng.uniform(0, 9, log.ids.max() + 1), rng.uniform(0.1, 2.0, len(log.ids))
    s = own[log.ids] + np.sqrt(var) * rng.standard_normal(len(var))
    return replace(log, signatures=Signatures.from_arrays(s, var))


@pytest.mark.parametrize("together", [False, True])
@pytest.mark.parametrize("given", [False, True])
def test_a_signature_in_the_state_is_a_scalar_filter_of_its_own(together: bool, given: bool) -> None:
    """The survey's third row of a landmark, lines 6 to 20: nothing of it is correlated with pose or place."""
    log = signed_log(7)
    if given:
        ids = np.unique(log.ids)[:3]
        known = Map(ids, np.random.default_rng(1).uniform(-5, 5, (3, 2)), 4.0 * np.eye(6))
        log = replace(log, prior=log.prior._replace(map=known))
    plain = log.without_signatures()
    ekf, without = TextbookEkf(log.prior, together=together), TextbookEkf(plain.prior, together=together)
    filters = SignatureFilters()
    for step, other in zip(log, plain, strict=True):
        np.testing.assert_allclose(ekf.step(step), without.step(other), rtol=0, atol=1e-9)
        filters.learn(step.sightings.ids.tolist(), step.signatures)
    assert len(ekf.mean) == 3 + 3 * len(ekf.ids)
    mean, var = ekf.signatures()
    expected = filters.of(ekf.ids)
    np.testing.assert_allclose(mean, expected[:, 0], rtol=1e-12)
    np.testing.assert_allclose(var, expected[:, 1], rtol=1e-12)
    rows = [5 + 3 * i for i in range(len(ekf.ids))]
    cross = ekf.cov.copy()
    cross[rows, rows] = 0.0
    assert not cross[rows].any()
    mine, its = ekf.map(), without.map()
    assert mine.ids.tolist() == its.ids.tolist()
    np.testing.assert_allclose(mine.xy, its.xy, rtol=0, atol=1e-9)
    assert mine.cov is not None
    assert its.cov is not None
    np.testing.assert_allclose(mine.cov, its.cov, rtol=0, atol=1e-9)


def test_the_nis_of_a_sighting_with_a_signature_has_three_degrees_of_freedom() -> None:
    log = signed_log(3)
    ekf, plain, dof = TextbookEkf(log.prior), TextbookEkf(log.prior._replace(signatures=False)), 0
    for step in log:
        ekf.step(step)
        plain.step(step)
        mine, its = ekf.belief(), plain.belief()
        assert mine.nis_dof * 2 == its.nis_dof * 3
        assert mine.nis is None or its.nis is None or mine.nis >= its.nis - 1e-9
        dof += mine.nis_dof
    assert dof > 30


def test_forgetting_a_landmark_takes_its_signature_out() -> None:
    log = signed_log(5)
    ekf = TextbookEkf(log.prior)
    for step in log:
        ekf.step(step)
    before, first = ekf.signatures(), ekf.ids[0]
    ekf.forget(first)
    np.testing.assert_array_equal(ekf.signatures()[0], before[0][1:])
    np.testing.assert_array_equal(ekf.signatures()[1], before[1][1:])
