"""Small matrices: the products, factors and inverses that numpy's linear algebra gives, to rounding."""

import numpy as np
import pytest

from slamduel.core.small_matrices import cholesky, inverse, product, propagated

rng = np.random.default_rng(3)
EPS = float(np.finfo(float).eps)


@pytest.mark.parametrize("shapes", [((3, 3), (3, 3)), ((50, 3, 2), (50, 2, 3)), ((50, 2), (2, 4)), ((9, 3, 3), (3, 1))])
def test_a_product_is_that_of_matmul(shapes: tuple[tuple[int, ...], tuple[int, ...]]) -> None:
    a, b = (rng.normal(size=shape) for shape in shapes)
    assert (np.abs(product(a, b) - a @ b) <= 4 * EPS * (np.abs(a) @ np.abs(b))).all()


@pytest.mark.parametrize("k", [1, 2, 3])
def test_a_factor_and_an_inverse_are_those_of_lapack(k: int) -> None:
    root = rng.normal(size=(200, k, k))
    cov = root @ root.swapaxes(1, 2) + 0.1 * np.eye(k)
    for found, right in ((cholesky(cov), np.linalg.cholesky(cov)), (inverse(cov), np.linalg.inv(cov))):
        bound = 100 * EPS * np.linalg.cond(cov) * np.linalg.norm(right, axis=(1, 2))
        assert (np.abs(found - right).max((1, 2)) <= bound).all()
    assert (inverse(cov) == inverse(cov).swapaxes(1, 2)).all()
    jacobian = rng.normal(size=(200, 2, k))
    right = jacobian @ cov @ jacobian.swapaxes(1, 2)
    np.testing.assert_allclose(propagated(jacobian, cov), right, rtol=1e-12, atol=1e-12)


def test_what_is_not_positive_definite_has_none() -> None:
    cov = np.array([np.eye(2), [[1.0, 2.0], [2.0, 1.0]]])
    for found in (cholesky(cov), inverse(cov)):
        assert np.isfinite(found).all((1, 2)).tolist() == [True, False]


def test_one_inverse_has_the_bits_of_many() -> None:
    root = rng.normal(size=(2000, 3, 3)) * 10.0 ** rng.uniform(-4, 4, (2000, 3, 1))
    root[::3, 1:, 0] = root[::5, 2, :2] = 0.0  # axes that know nothing of each other: zeros, and their signs
    cov = root @ root.swapaxes(1, 2)
    odd = np.array([
        np.eye(3), np.diag([1.0, 0.0, 1.0]), np.diag([1.0, 1.0, -1.0]), np.diag([1e-300, 1.0, 1.0]),
        np.diag([1.0, 1e250, 1.0]), np.diag([1.0, np.nan, 1.0]), np.full((3, 3), np.inf), -np.eye(3), np.zeros((3, 3)),
    ])  # fmt: skip
    for some in (cov, -cov, cov * np.array([1.0, -1.0, 1.0]), odd):
        with np.errstate(invalid="ignore"):  # infinity times zero
            together, one_by_one = inverse(some), np.array([inverse(one) for one in some])
        np.testing.assert_array_equal(together, one_by_one)
        there = ~np.isnan(together)
        np.testing.assert_array_equal(np.signbit(together[there]), np.signbit(one_by_one[there]))
