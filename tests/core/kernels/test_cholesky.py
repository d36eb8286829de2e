"""The factorisation of fronts against numpy's and against the Schur complement, of every size about eight lanes."""

import numpy as np
import pytest

from slamduel.core.kernels._cholesky import PANEL, factor, row_of
from slamduel.core.se2 import Array

SIZES = [*range(1, 28), 47, 48, 63, 64, 65, 97, 130, 2 * PANEL + 5]


def front(rng: np.random.Generator, m: int, *, definite: bool = True) -> tuple[Array, Array, Array]:
    """A front of `m` scalars, flat, with numbers of no use below the diagonal; its matrix and right-hand side."""
    of = rng.normal(size=(m, m + 3))
    A, b = of @ of.T + 0.1 * np.eye(m), rng.normal(size=m)
    if not definite:
        A[-1, -1] = -1.0
    F = rng.normal(size=(m, row_of(m)))
    F[:, :m][np.triu_indices(m)] = A[np.triu_indices(m)]
    F[:, -1] = b
    return F.ravel(), A, b


@pytest.mark.parametrize("m", SIZES)
def test_rows_become_a_factor_and_the_rest_its_complement(m: int) -> None:
    rng = np.random.default_rng(m)
    for n in sorted({1, 2, 3, min(4, m), m // 2, m - 1, m} & set(range(1, m + 1))):
        F, A, b = front(rng, m)
        assert factor(F, m, n)
        got = F.reshape(m, row_of(m))
        R = np.linalg.cholesky(A[:n, :n]).T
        S, d = np.linalg.solve(R.T, A[:n, n:]), np.linalg.solve(R.T, b[:n])
        bound = 1e-15 * m * np.linalg.cond(A[:n, :n]) * np.abs(A).max()
        np.testing.assert_allclose(np.triu(got[:n, :n]), R, rtol=0, atol=bound)
        np.testing.assert_allclose(got[:n, n:m], S, rtol=0, atol=bound)
        np.testing.assert_allclose(got[:n, -1], d, rtol=0, atol=bound)
        np.testing.assert_allclose(np.triu(got[n:, n:m]), np.triu(A[n:, n:] - S.T @ S), rtol=0, atol=bound)
        np.testing.assert_allclose(got[n:, -1], b[n:] - S.T @ d, rtol=0, atol=bound)


@pytest.mark.parametrize("m", [5, 24, PANEL + 3])
def test_the_bits_are_those_of_a_loop_over_numbers(m: int) -> None:
    """Four rows at a time, then three or one, are subtracted as one sum: the same on every machine."""
    F, A, b = front(np.random.default_rng(m), m)
    assert factor(F, m, m)
    X = np.column_stack((A, b))
    p = 0
    while p < m:
        left = min(m, p // PANEL * PANEL + PANEL) - p if m > PANEL else m - p
        many = 4 if left >= 4 else (3 if left == 3 else 1)
        for q in range(p, p + many):
            for r in range(p, q):
                X[q, q:] -= X[r, q] * X[r, q:]
            X[q, q:] *= 1.0 / np.sqrt(X[q, q])
        for i in range(p + many, m):
            total = X[p, i] * X[p, i:]
            for r in range(p + 1, p + many):
                total = total + X[r, i] * X[r, i:]
            X[i, i:] -= total
        p += many
    got = F.reshape(m, row_of(m))
    np.testing.assert_array_equal(np.triu(got[:, :m]), np.triu(X[:, :m]))
    np.testing.assert_array_equal(got[:, -1], X[:, -1])


@pytest.mark.parametrize("m", [1, 8, 30, PANEL + 9])
def test_what_is_not_positive_definite_has_no_factor(m: int) -> None:
    F, _, _ = front(np.random.default_rng(m), m, definite=False)
    assert not factor(F, m, m)
    G, _, _ = front(np.random.default_rng(m), m)
    G[0] = np.nan
    assert not factor(G, m, 1)
