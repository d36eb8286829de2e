"""The scale of the wheels as a state of the filters."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from beacon_drives import drive
from slamduel.backends.gaussian import ekf
from slamduel.backends.invariant import invariant_ekf
from slamduel.backends.unscented import ukf
from slamduel.core.factors import Log, Systematic
from slamduel.core.se2 import Array, compose, wrap

FILTERS: dict[str, Any] = {"ekf": ekf, "invariant-ekf": invariant_ekf, "ukf": ukf}


def run(name: str, log: Log) -> tuple[Array, Array]:
    """The path (n, 3) and its covariances (n, 3, 3)."""
    build = FILTERS[name].build
    filter_ = build.make(log.prior, build.options(), np.random.default_rng(0))
    path, covs = [], []
    for step in log:
        path.append(filter_.step(step))
        covs.append(filter_.belief().cov)
    return np.array(path), np.array(covs)


def of_scale(log: Log, sd: float, factor: float = 1.0) -> Log:
    """The log with a way that is `factor` times as long, and this belief about the wheels' scale."""
    delta = log.delta * [factor, factor, 1.0]
    return replace(log, delta=delta, prior=log.prior._replace(systematic=Systematic(wheel_scale=sd)))


@pytest.mark.parametrize("name", FILTERS)
def test_without_sightings_the_covariance_is_that_of_numerical_jacobians(name: str) -> None:
    """By the start, the scale, and the noise of every motion."""
    log = of_scale(replace(drive(1, steps=12).log, partial=None), 0.01)

    def end(errors: Array) -> Array:
        pose = log.prior.pose + errors[:3]
        for delta, noise in zip(log.delta[1:], errors[4:].reshape(-1, 3), strict=True):
            pose = compose(pose, delta / [1 + errors[3], 1 + errors[3], 1] + noise)
        return pose

    errors, each = np.zeros(4 + 3 * (len(log) - 1)), 1e-6
    jacobian = np.array([(end(errors + one) - end(errors - one)) / (2 * each) for one in each * np.eye(len(errors))])
    var = np.concatenate((np.diag(log.prior.cov), [0.01**2], np.einsum("kii->ki", log.delta_cov[1:]).ravel()))
    path, covs = run(name, log)
    np.testing.assert_allclose(path[-1], end(errors), atol=1e-3)
    np.testing.assert_allclose(covs[-1], jacobian.T @ (var[:, None] * jacobian), rtol=0.02, atol=2e-6)


@pytest.mark.parametrize("name", FILTERS)
def test_a_scale_of_the_wheels_is_found_by_positions(name: str) -> None:
    """With wheels that are 5 % off, the path is as close as with good ones; else it is not."""
    made = drive(4, steps=400, fix_every=10, fix_sd=0.02)

    def off(sd: float, factor: float) -> float:
        path, _ = run(name, of_scale(made.log, sd, factor))
        return float(np.sqrt(np.mean((path[200:, :2] - made.path[200:, :2]) ** 2)))

    right, wrong, estimated = off(0.0, 1.0), off(0.0, 1.05), off(0.1, 1.05)
    assert estimated < 1.1 * right
    assert wrong > 1.5 * estimated


@pytest.mark.parametrize("name", FILTERS)
def test_whole_sightings_alone_tell_it_too(name: str) -> None:
    """Beacons by range and bearing at once: the covariance stays that of the errors."""
    made = drive(6, steps=300)
    assert made.log.partial is not None
    ids, seen = made.log.partial.ids, made.log.partial.step
    to = made.beacons[ids] - made.path[seen, :2]
    rng = np.random.default_rng(0)
    z = np.column_stack((np.hypot(*to.T), wrap(np.arctan2(to[:, 1], to[:, 0]) - made.path[seen, 2])))
    whole = Log.from_arrays(
        "whole", made.log.prior, made.log.t, made.log.delta * [1.05, 1.05, 1.0], made.log.delta_cov, seen, ids,
        z + rng.normal(0, (0.05, 0.02), z.shape), np.tile(np.diag([0.05**2, 0.02**2]), (len(z), 1, 1)),
    )  # fmt: skip
    path, covs = run(name, of_scale(whole, 0.1))
    off = path - made.path
    off[:, 2] = wrap(off[:, 2])
    nees = np.einsum("ki,kij,kj->k", off, np.linalg.inv(covs), off)[20:].mean() / 3
    assert 0.3 < nees < 2
