"""Small vectors and matrices in compiled code, against numpy and scipy."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from slamduel.core.kernels import _small
from slamduel.core.se2 import Array

EPS = float(np.finfo(float).eps)
SIZES = [1, 2, 3, 6, 24]


def any_cov(rng: np.random.Generator, n: int) -> Array:
    root = rng.normal(size=(n, n))
    return root @ root.T + 0.1 * np.eye(n)


def test_products_of_vectors_are_those_of_numpy() -> None:
    rng = np.random.default_rng(0)
    for a, b in rng.normal(size=(100, 2, 3)):
        assert abs(_small.dot(a, b) - a @ b) <= 4 * EPS * (np.abs(a) @ np.abs(b))
        right, bound = np.cross(a, b), 4 * EPS * np.linalg.norm(a) * np.linalg.norm(b)
        out = np.empty(3)
        _small.cross(a, b, out)
        assert (np.abs(out - right) <= bound).all()
        _small.cross(a, b, a)  # in place
        assert (a == out).all()


@pytest.mark.parametrize("angle", [0.0, 1e-9, 9.9e-5, 1.1e-4, 9.9e-3, 1.1e-2, 0.7, 3.0, np.pi, 6.0])
def test_a_rotation_vector_is_that_of_scipy(angle: float) -> None:
    rng = np.random.default_rng(1)
    for axis in rng.normal(size=(20, 3)):
        turn, R = axis / np.linalg.norm(axis) * angle, np.empty((3, 3))
        one, two, three = _small.rodrigues(turn, R)
        np.testing.assert_allclose(R, Rotation.from_rotvec(turn).as_matrix(), atol=1e-14)
        # (1 - cos a) / a^2 loses digits for small a: 2 eps / a^2 from 1e-4 on
        assert one == pytest.approx(np.sinc(angle / np.pi), abs=1e-14)
        assert two == pytest.approx(np.sinc(angle / np.pi / 2) ** 2 / 2, abs=1e-7)
        assert three * angle**3 == pytest.approx(angle - np.sin(angle), abs=1e-14)


@pytest.mark.parametrize("n", SIZES)
@pytest.mark.parametrize("in_place", [False, True])
def test_a_factor_and_its_solution_are_those_of_lapack(n: int, in_place: bool) -> None:
    rng = np.random.default_rng(2)
    for _ in range(20):
        A, b = any_cov(rng, n), rng.normal(size=n)
        right, x = np.linalg.cholesky(A), np.linalg.solve(A, b)
        given = np.tril(A) + np.triu(np.full((n, n), np.nan), 1)  # only the lower triangle is read
        L, out = (given, b) if in_place else (np.zeros((n, n)), np.empty(n))
        assert _small.cholesky(given, L, n, 0.0, 0.0)
        bound = 100 * EPS * np.linalg.cond(A)
        assert np.abs(np.tril(L) - right).max() <= bound * np.abs(right).max()
        _small.solve(L, b, out, n)
        assert np.abs(out - x).max() <= bound * np.abs(x).max()


@pytest.mark.parametrize("n", SIZES)
@pytest.mark.parametrize("value", [-1.0, 0.0, np.nan, np.inf])
def test_what_is_not_positive_definite_and_finite_has_no_factor(n: int, value: float) -> None:
    for k in range(n):
        A = np.eye(n)
        A[k, k] = value
        assert not _small.cholesky(A, np.zeros((n, n)), n, 0.0, 0.0)


def test_pivots_that_are_rounding_are_refused_or_raised_as_asked() -> None:
    for below, least, floor, found in (
        (4 * EPS, 0.0, 0.0, True), (4 * EPS, 1e-12, 0.0, False), (4 * EPS, 0.0, 1e-12, True),
        (-4 * EPS, 0.0, 0.0, False), (-4 * EPS, 0.0, 1e-12, True),
    ):  # fmt: skip
        root = np.zeros((2, 2))
        assert _small.cholesky(np.array([[1.0, 1.0], [1.0, 1.0 + below]]), root, 2, least, floor) == found
        if floor:
            assert root[1, 1] ** 2 == pytest.approx(floor)


def test_the_factor_without_branches_is_the_same_to_the_bit_and_nan_where_there_is_none() -> None:
    rng = np.random.default_rng(3)
    lower = np.tril_indices(3)
    for _ in range(200):
        A, L = any_cov(rng, 3), np.zeros((3, 3))
        assert _small.cholesky(A, L, 3, 0.0, 0.0)
        assert np.array(_small.factored(*A[lower])).tobytes() == L[lower].tobytes()
    for k in range(3):
        indefinite = np.eye(3)
        indefinite[k, k] = -1.0
        assert np.isnan(_small.factored(*indefinite[lower])).any()


def test_an_inverse_is_that_of_lapack() -> None:
    rng = np.random.default_rng(4)
    for _ in range(200):
        A, W = any_cov(rng, 3), np.empty((3, 3))
        assert _small.inverse(A, W)
        right = np.linalg.inv(A)
        assert np.abs(W - right).max() <= 100 * EPS * np.linalg.cond(A) * np.abs(right).max()
        assert (W == W.T).all()


@pytest.mark.parametrize("value", [-1.0, 0.0, np.nan, np.inf])
def test_there_is_no_inverse_of_what_has_no_positive_finite_determinant(value: float) -> None:
    assert not _small.inverse(np.diag([1.0, value, 2.0]), np.empty((3, 3)))
