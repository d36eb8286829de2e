"""Backends with a gyro's bias in their state: against dense filters and least squares, one another, and the truth."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import binom, chi2

from dense_gyro import filtered, least_squares
from gyro_logs import with_gyro
from random_logs import random_log
from slamduel.backends import registry
from slamduel.backends.api import Solution
from slamduel.backends.constant_errors import fitted_biases, turn_cost
from slamduel.backends.gaussian.ekf import Ekf, Options
from slamduel.backends.given import given
from slamduel.bench.measure.cell import Job, run_on
from slamduel.bench.measure.misfit import misfit
from slamduel.bench.plan.load import load
from slamduel.core.factors import Dataset, Log, Systematic
from slamduel.core.fixes import FixTable
from slamduel.core.gyro import conditioned
from slamduel.core.kernels import _turns
from slamduel.core.se2 import Array, wrap


def drive(seed: int = 1, steps: int = 60, noise: float = 1.0, **of_gyro: Any) -> tuple[Dataset, Array]:
    rng = np.random.default_rng(seed)
    return with_gyro(random_log(rng, steps, 8, noise=noise), rng, **of_gyro)


def ended(log: Log, solver: str) -> Solution:
    build = registry.find("graph")
    batch = build.make(log.prior, build.options(solver=solver), np.random.default_rng(0))
    for step in log:
        batch.step(step)
    found = batch.finish()
    assert found is not None
    return found


def test_the_split_of_a_kernel_is_that_of_arrays() -> None:
    log = drive()[0].log
    assert log.gyro is not None
    at, gyro = log.gyro.step, log.gyro
    whole = conditioned(log.delta[at], log.delta_cov[at], gyro.turn, gyro.var, gyro.dt)
    for j in range(len(gyro)):
        motion, slope = np.vstack((log.delta[at[j]], log.delta_cov[at[j]])), np.empty(3)
        told, var = _turns.conditioned(motion, gyro.turn[j], gyro.var[j], gyro.dt[j], slope)
        np.testing.assert_allclose(motion, np.vstack((whole.delta[j], whole.cov[j])), rtol=1e-9, atol=1e-14)
        np.testing.assert_allclose(slope, whole.slope[j])
        np.testing.assert_allclose((told, var), (whole.told[j], whole.told_var[j]))


def test_the_ekf_is_the_dense_one() -> None:
    log = drive()[0].log
    poses, covs, biases, variances = filtered(log)
    ekf = Ekf(log.prior, Options(), np.random.default_rng(0))
    for k, step in enumerate(log):
        np.testing.assert_allclose(ekf.step(step), poses[k], atol=1e-9)
        belief = ekf.belief()
        assert belief.cov is not None
        np.testing.assert_allclose(belief.cov, covs[k], rtol=1e-7, atol=1e-13)
        found = ekf.gyro_bias
        assert found is not None
        np.testing.assert_allclose((found.mean, found.sd**2), (biases[k], variances[k]), rtol=1e-7, atol=1e-13)


@pytest.mark.parametrize("walk", [1e-3, 0.0])
@pytest.mark.parametrize("solver", ["own", "gtsam"])
def test_a_batch_is_the_least_squares_of_all_rows(solver: str, walk: float) -> None:
    log = drive(steps=40, walk=walk)[0].log
    path, xy, biases, cost = least_squares(log)
    found = ended(log, solver)
    tolerance = 1e-6 if solver == "own" else 2e-4  # GTSAM's residual of a motion is another
    off = found.path - path
    assert np.abs(wrap(off[:, 2])).max() < tolerance
    assert np.abs(off[:, :2]).max() < 20 * tolerance
    np.testing.assert_allclose(found.map.xy[np.argsort(found.map.ids)], xy, atol=20 * tolerance)
    assert found.gyro_bias is not None
    assert found.gyro_bias.mean == pytest.approx(biases[-1], abs=tolerance)
    total = misfit(log, found.path, found.map, found.constant)
    assert total is not None
    assert total.total == pytest.approx(cost, rel=1e-6 if solver == "own" else 1e-2)


def test_the_cost_of_turns_with_a_known_bias_is_that_of_their_noise() -> None:
    dataset, _ = drive(steps=40, bias=0.0, walk=0.0)
    gyro, truth = dataset.log.gyro, dataset.truth
    assert gyro is not None
    assert truth is not None
    off = wrap(gyro.turn - np.diff(truth.poses[:, 2]))
    assert turn_cost(gyro, truth.poses) == pytest.approx((off**2 / gyro.var).sum(), rel=1e-9)


def test_a_bias_is_the_same_in_either_frame_where_the_start_is_known() -> None:
    """The start's frame, with fixes, a gyro and wheels of unknown scale in one state."""
    log, truth = drive(steps=80)[0]
    assert truth is not None
    step, n = np.arange(5, 80, 5), 15
    noise = 0.1 * np.random.default_rng(2).standard_normal((n, 2))
    z = np.column_stack((truth.poses[step, :2] + noise, np.full(n, np.nan)))
    fixes = FixTable.from_arrays(len(log), step, z, np.broadcast_to(np.diag([0.01, 0.01, 0.01]), (n, 3, 3)))
    prior = log.prior._replace(cov=1e-14 * np.eye(3), systematic=Systematic(wheel_scale=0.05))
    log = replace(log, fixes=fixes, prior=prior)
    assert log.prior.fixes
    ended = []
    for frame in ("start", "world"):
        ekf = Ekf(log.prior, Options(frame=frame), np.random.default_rng(0))
        path = np.array([ekf.step(one) for one in log])
        ended.append((path, ekf.belief().cov, ekf.gyro_bias))
    for one, other in zip(*ended, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e-8)


def test_filter_and_batch_end_alike_where_all_is_nearly_linear() -> None:
    """With little noise, the last step's marginals of both are one."""
    log = drive(noise=0.01, sd=1e-5, bias=1e-3, walk=1e-5)[0].log
    ekf = Ekf(log.prior, Options(), np.random.default_rng(0))
    for step in log:
        ekf.step(step)
    batch, belief = ended(log, "own"), ekf.belief()
    assert batch.cov is not None
    assert belief.cov is not None
    sd = np.sqrt(np.diag(batch.cov[-1]))
    assert (np.abs(belief.pose - batch.path[-1]) < 0.02 * sd).all()
    np.testing.assert_allclose(belief.cov, batch.cov[-1], atol=0.01 * float(np.max(sd)) ** 2)
    found, online = batch.gyro_bias, ekf.gyro_bias
    assert found is not None
    assert online is not None
    assert abs(found.mean - online.mean) < 0.02 * found.sd
    assert online.sd == pytest.approx(found.sd, rel=0.005)


@pytest.mark.parametrize("walk", [0.0, 1e-3])
def test_the_biases_along_a_path_are_those_that_fit_best(walk: float) -> None:
    """A little more or less of each costs more; one bias where none walks."""
    made, _ = drive(walk=walk)
    assert made.log.gyro is not None
    assert made.truth is not None
    gyro, path = made.log.gyro, made.truth.poses
    best, cost = fitted_biases(gyro, path), turn_cost(gyro, path)
    off = wrap(gyro.turn - (path[1:, 2] - path[:-1, 2]))

    def of(bias: Array) -> float:
        walks = (np.diff(bias) ** 2).sum() / walk**2 if walk else 0.0
        return float(((off - bias[gyro.knot] * gyro.dt) ** 2 / gyro.var).sum() + walks + (bias[0] / gyro.prior.sd) ** 2)

    assert len(best) == (3 if walk else 1)
    assert of(best) == pytest.approx(cost)
    for more in np.vstack((np.eye(len(best)), -np.eye(len(best)))):
        assert of(best + 1e-4 * more) > cost


WORLD = "circle[steps=800,gyro=0.05,gyro_bias=1,gyro_start={},gyro_walk=0.005,slip_share={}]"


@pytest.mark.parametrize("name", ["smoother", "isam2"])
def test_one_that_has_the_turns_in_its_odometry_is_judged_by_those_factors(name: str) -> None:
    """Its J is the least of the log that it was given: wheels that slip put the other one far above."""
    log, _ = drive(steps=200, noise=0.1, bias=0.05)[0]
    slipping = log.delta + np.where(np.arange(len(log)) % 10 == 0, 30.0, 0.0)[:, None] * [0.0, 0.0, 0.001]
    log = replace(log, delta=slipping)
    build = registry.find(name)
    job = Job(name, name, build.options(gyro="front"), 0, 4000)
    done = run_on(job, lambda: log, lambda: None)
    assert done.status == "done", done.reason
    assert "in the odometry" in done.reason


def driven(log: Log, way: str) -> tuple[Array, Array, Array]:
    """Online path, covariances and biases with their deviations of the EKF with a treatment of the bias."""
    build = registry.find("ekf")
    options = build.options(gyro=way)
    used = given(build, log, options).log
    ekf = Ekf(used.prior, options, np.random.default_rng(0))
    path, covs, biases = [], [], []
    for step in used:
        path.append(ekf.step(step))
        covs.append(ekf.belief().cov)
        biases.append(ekf.gyro_bias or (np.nan, np.nan))
    return np.array(path), np.array(covs), np.array(biases)


def errors(dataset: Dataset, way: str) -> tuple[float, float]:
    """The heading's error, RMS in rad, and the mean NEES per degree of freedom."""
    path, covs, _ = driven(dataset.log, way)
    assert dataset.truth is not None
    off = path - dataset.truth.poses
    off[:, 2] = wrap(off[:, 2])
    return float(np.sqrt((off[:, 2] ** 2).mean())), float(
        np.einsum("ni,nij,nj->n", off, np.linalg.inv(covs), off).mean() / 3
    )


@pytest.mark.parametrize("seeds", [3, pytest.param(20, marks=pytest.mark.slow)])
def test_a_bias_of_a_degree_is_estimated_and_slip_shows_not(seeds: int) -> None:
    found = {
        way: np.array([errors(load(WORLD.format("given", 0.1), s), way) for s in range(seeds)])
        for way in ("state", "ignored")
    }
    state, ignored = found["state"].mean(axis=0), found["ignored"].mean(axis=0)
    assert 5 * state[0] < ignored[0]
    assert 0.5 < state[1] < 2
    assert ignored[1] > 5


@pytest.mark.slow
def test_the_true_bias_is_in_its_interval() -> None:
    """At 93 to 97 % of steps of 20 drives; a drive's steps are taken as some ten independent ones."""
    inside, drives = [], 20
    for seed in range(drives):
        made, biases = drive(seed, 400, every=20, walk=2e-3)
        _, _, found = driven(made.log, "state")
        inside.append(np.abs(found[1:, 0] - biases) < np.sqrt(chi2.ppf(0.95, 1)) * found[1:, 1])
    share = float(np.mean(inside))
    independent = 10 * drives
    low, high = binom.interval(0.999, independent, 0.95)
    assert low / independent < share < high / independent
