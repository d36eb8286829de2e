import numpy as np
import pytest

from differences import central
from slamduel.core.coordinates import after_motion, as_points, as_range_bearing, before_motion
from slamduel.core.se2 import compose
from small_log import positive_definite


@pytest.fixture(scope="module")
def rng() -> np.random.Generator:
    return np.random.default_rng(1)


def test_range_and_bearing_covariance_is_first_order(rng: np.random.Generator):
    xy, cov = rng.normal(size=(20, 2)) * 5, positive_definite(rng, 20, 2)
    z, z_cov = as_range_bearing(xy, cov)
    np.testing.assert_allclose(z, np.stack((np.hypot(*xy.T), np.arctan2(xy[:, 1], xy[:, 0])), axis=-1))
    jacobian = central(lambda shift: as_range_bearing(xy + shift, cov)[0], np.zeros(2))
    np.testing.assert_allclose(z_cov, jacobian @ cov @ jacobian.swapaxes(1, 2), rtol=1e-6, atol=1e-9)
    np.testing.assert_array_equal(z_cov, z_cov.swapaxes(1, 2))


def test_points_and_sightings_are_each_others_inverse(rng: np.random.Generator):
    z = np.stack((rng.uniform(0.1, 30, 50), rng.uniform(-np.pi, np.pi, 50)), axis=-1)
    cov = positive_definite(rng, 50, 2)
    found, found_cov = as_range_bearing(*as_points(z, cov))
    np.testing.assert_allclose(found, z, rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(found_cov, cov, rtol=1e-10)


def test_an_error_after_the_motion_is_one_before_it(rng: np.random.Generator):
    """To first order, z = delta * exp(e): the same distribution, moved through the numerical Jacobian of d z / d e."""
    delta, cov = rng.uniform(-3, 3, (20, 3)), positive_definite(rng, 20, 3)
    jacobian = central(lambda error: np.array([compose(one, error) for one in delta]), np.zeros(3))
    found = before_motion(delta, cov)
    np.testing.assert_allclose(found, jacobian @ cov @ jacobian.swapaxes(1, 2), rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(after_motion(delta, found), cov, rtol=1e-10, atol=1e-13)
    np.testing.assert_array_equal(found, found.swapaxes(1, 2))
