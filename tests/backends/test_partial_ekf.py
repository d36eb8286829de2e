"""The EKF on sightings of a range or a bearing alone, and on fixes."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from beacon_drives import BEACONS, BEARING, RANGE, Drive, drive
from dense_partial import DensePartial
from slamduel.backends.gaussian import ekf
from slamduel.backends.gaussian._partial import place_in_world
from slamduel.core.se2 import Array, compose, wrap

DRIVES: dict[str, dict[str, Any]] = {
    "ranges": {},
    "bearings": {"kinds": (BEARING,)},
    "both in turn": {"kinds": (RANGE, BEARING)},
    "ranges of unknown scale": {"scale_sd": 0.1},
    "ranges and positions": {"fix_every": 10},
    "bearings, positions and headings": {"kinds": (BEARING,), "fix_every": 7, "compass": True},
}


def run(made: Drive, **options: Any) -> tuple[ekf.Ekf, Array, Array]:
    """The filter at the end, its path (n, 3) and covariances (n, 3, 3)."""
    filter_ = ekf.Ekf(made.log.prior, ekf.Options(**options), np.random.default_rng(0))
    path, covs = [], []
    for step in made.log:
        path.append(filter_.step(step))
        cov = filter_.belief().cov
        assert cov is not None
        covs.append(cov)
    return filter_, np.array(path), np.array(covs)


@pytest.mark.parametrize("case", DRIVES)
def test_it_is_the_dense_filter(case: str) -> None:
    """The same path and covariances, to what a prior variance 1e8 times the posterior one leaves of 16 digits."""
    made = drive(3, steps=120, **DRIVES[case])
    filter_, path, covs = run(made, frame="world")
    dense = DensePartial(made.log)
    expected, theirs = dense.run(made.log)
    assert set(dense.at) == set(filter_.map().ids.tolist()) == {0, 1, 2, 3}
    np.testing.assert_allclose(path[:, :2], expected[:, :2], atol=1e-6)
    np.testing.assert_allclose(wrap(path[:, 2] - expected[:, 2]), 0, atol=1e-6)
    np.testing.assert_allclose(covs, theirs, atol=1e-7)


@pytest.mark.parametrize("case", DRIVES)
@pytest.mark.parametrize("jacobians", ["standard", "first-estimates"])
def test_it_finds_the_beacons(case: str, jacobians: str) -> None:
    """Within four standard deviations of each, of a map whose covariance it states."""
    made = drive(5, steps=400, **DRIVES[case])
    filter_, path, _ = run(made, jacobians=jacobians)
    found = filter_.map()
    assert found.cov is not None
    assert len(found.ids) == len(BEACONS)
    for i, landmark in enumerate(found.ids.tolist()):
        off = found.xy[i] - BEACONS[landmark]
        own = found.cov[2 * i : 2 * i + 2, 2 * i : 2 * i + 2]
        assert off @ np.linalg.solve(own, off) < 4**2
    assert np.hypot(*(path[-1, :2] - made.path[-1, :2])) < 0.3


def test_the_derivative_of_a_fix_is_the_numerical_one() -> None:
    """By the pose, the heading's offset and the place of the state's frame."""
    at, arm, H, each = np.array([3.0, -1.0, 0.7, 0.1, 5.0, 2.0, -1.2]), np.array([0.4, -0.3]), np.empty((3, 7)), 1e-6
    place_in_world(at, arm, H)

    def expected(at: Array) -> Array:
        return np.array(place_in_world(at, arm, np.empty((3, 7))))

    numerical = [(expected(at + one) - expected(at - one)) / (2 * each) for one in each * np.eye(7)]
    np.testing.assert_allclose(H.T, numerical, atol=1e-9)
    turned, pose = compose(at[4:], at[:3]), np.array([*arm, at[3]])
    np.testing.assert_allclose(expected(at), compose(turned, pose), atol=1e-12)


def test_in_the_frame_of_the_start_small_errors_have_the_same_estimates() -> None:
    """Pose, map and their covariances are those of a state in the world's frame, to first order."""
    made = drive(3, steps=120, kinds=(RANGE, BEARING), fix_every=10, noise=0.01)
    prior = made.log.prior._replace(pose=np.array([0.3e-4, -0.2e-4, 0.5e-4]), cov=np.diag([1e-8, 1e-8, 1e-8]))
    made = made._replace(log=replace(made.log, prior=prior))
    (one, path, covs), (other, theirs, their_covs) = run(made), run(made, frame="world")
    np.testing.assert_allclose(path, theirs, atol=1e-5)
    np.testing.assert_allclose(covs, their_covs, rtol=0.02, atol=1e-10)
    np.testing.assert_allclose(one.map().xy, other.map().xy, atol=1e-5)
    found, same = one.map().cov, other.map().cov
    assert found is not None
    assert same is not None
    np.testing.assert_allclose(found, same, rtol=0.05, atol=1e-8)
    assert one.pairs == other.pairs + 2


def test_the_scale_of_ranges_is_estimated() -> None:
    made = drive(8, steps=400, scale_sd=0.1)
    filter_, _, _ = run(made)
    found = filter_.range_errors
    assert found is not None
    assert abs(made.scale) > 0.02
    assert abs(found[0] - made.scale) < 0.01


def test_kept_poses_leave_the_state_when_nothing_waits() -> None:
    made = drive(2, steps=300)
    filter_, _, _ = run(made)
    assert len(filter_.map().ids) == 4
    assert filter_.pairs == 4


def test_a_gate_refuses_a_range_that_is_far_off() -> None:
    made = drive(4, steps=300)
    assert made.log.partial is not None
    z = made.log.partial.z.copy()
    z[250] += 3.0
    wrong = made._replace(log=replace(made.log, partial=replace(made.log.partial, z=z)))
    plain, gated = run(wrong)[1], run(wrong, gate=0.999)[1]
    right = run(made)[1]
    assert np.hypot(*(gated - right)[251, :2]) < 0.2 * np.hypot(*(plain - right)[251, :2])


@pytest.mark.slow
@pytest.mark.parametrize("case", DRIVES)
def test_first_estimates_are_consistent(case: str) -> None:
    """NEES of 20 drives within 0.5 to 2."""
    total = []
    for seed in range(20):
        made = drive(seed, steps=300, **DRIVES[case])
        _, path, covs = run(made, jacobians="first-estimates")
        off = path - made.path
        off[:, 2] = wrap(off[:, 2])
        total.append(np.einsum("ni,ni->n", off, np.linalg.solve(covs, off[..., None])[..., 0])[1:].mean() / 3)
    assert 0.5 < np.mean(total) < 2
