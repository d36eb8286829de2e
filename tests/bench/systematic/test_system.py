"""Equations against differences, and their elimination against dense matrices."""

import numpy as np
import pytest

from planted_errors import drive
from slamduel.bench.systematic import reduced, system
from slamduel.bench.systematic.fit import of_estimate, of_truth
from slamduel.bench.systematic.known_path import OnPath
from slamduel.bench.systematic.reduced import Linear
from slamduel.bench.systematic.system import System
from slamduel.datasets.noise.systematic import NAMES, SENSOR, Systematic

HERE = Systematic(0.1, -0.05, 0.1, 0.02, -0.03, 0.01, 0.01, 0.02, -0.02, 0.01, 0.03, 0.04)


@pytest.fixture(autouse=True)
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("slamduel.bench.systematic.fit.FEWEST", 10)
    monkeypatch.setattr(system, "FAR", 1e6)  # weights are not differentiated
    monkeypatch.setattr(system, "JUMP", 1e6)


def around(*, by_truth: bool, seconds: float = 6.0) -> System:
    log, truth = drive(HERE, 3, seconds=seconds)
    assert truth is not None
    assert truth.map is not None
    found = of_truth(log, truth) if by_truth else of_estimate(log, truth.poses, truth.map)
    assert found is not None
    return found


@pytest.mark.parametrize("by_truth", [True, False])
def test_derivatives_are_those_of_differences(by_truth: bool) -> None:
    """All but those by the wheels' errors, whose factors are averaged over windows."""
    one, h = around(by_truth=by_truth), 1e-6
    errors = HERE if by_truth else HERE._replace(lag=0.0)
    _, sparse, step = one.linearised(errors)
    J = sparse.toarray()
    variables = J.shape[1] - len(NAMES)
    for k in range(0, variables, 7):
        slope = np.zeros(len(J))
        for sign in (1, -1):
            moved = around(by_truth=by_truth)
            by = np.zeros(J.shape[1])
            by[k] = sign * h
            moved.move(by)
            slope += sign * moved.linearised(errors)[0] / (2 * h)
        np.testing.assert_allclose(J[:, k], slope, atol=1e-5 * (1 + np.abs(slope).max()))
    for k, name in enumerate(SENSOR):
        here = getattr(HERE, name)
        up, down = (one.linearised(errors._replace(**{name: here + s * h}))[0] for s in (1, -1))
        slope = (up - down) / (2 * h)
        tolerance = 0.2 if name == "delay" else 1e-5  # speeds are those of six tenths of a second
        within = step[:, None] < 50  # past the last step the body stands
        off = (J[:, [variables + k]] - slope[:, None])[within]
        np.testing.assert_allclose(off, 0, atol=tolerance * (1 + np.abs(slope).max()))


def test_the_derivative_by_the_lag_is_that_of_differences_along_a_known_path() -> None:
    """To what speeds of two tenths of a second lose; the first and the last of those have none."""
    one, h = around(by_truth=True, seconds=30.0), 1e-6
    _, sparse, step = one.linearised(HERE)
    up, down = (one.linearised(HERE._replace(lag=HERE.lag + sign * h))[0] for sign in (1, -1))
    slope, motions = (up - down) / (2 * h), np.arange(len(step)) < 3 * 10
    found = sparse.toarray()[motions, -1]
    within = np.arange(3, 3 * 9)
    np.testing.assert_allclose(found[within], slope[motions][within], atol=0.02 * np.abs(slope[motions]).max())


@pytest.mark.parametrize("by_truth", [True, False])
def test_elimination_is_that_of_dense_matrices(by_truth: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reduced, "STRETCHES", 5)
    one = around(by_truth=by_truth, seconds=20.0)
    r, J, step = one.linearised(HERE)
    full, free = (
        J.toarray(),
        [k for k, name in enumerate(NAMES) if by_truth or name not in ("range_scale", "heading", "lag")],
    )
    kept = [*range(J.shape[1] - len(NAMES)), *(J.shape[1] - len(NAMES) + np.array(free))]
    best = -np.linalg.lstsq(full[:, kept], r)[0]
    found = Linear(one, HERE)
    joint = found.reduced()
    x = np.zeros(len(NAMES))
    x[free] = -np.linalg.solve(joint.H[np.ix_(free, free)], joint.g[free])
    np.testing.assert_allclose(x[free], best[-len(free) :], rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(found.change(x)[kept], best, rtol=1e-4, atol=1e-7)
    edges = reduced.edges_of(one)
    for b in range(len(edges) - 1):
        left = np.flatnonzero((step < edges[b]) | ((step >= edges[b + 1]) & (b < len(edges) - 2)))
        without = -np.linalg.solve(joint.H_without[b][np.ix_(free, free)], joint.g_without[b][free])
        expected = -np.linalg.lstsq(full[left][:, kept], r[left])[0][-len(free) :]
        np.testing.assert_allclose(without, expected, rtol=1e-4, atol=1e-7)


def test_landmarks_one_by_one_along_a_known_path_are_as_all_together() -> None:
    one, by = around(by_truth=True, seconds=20.0), np.full(len(NAMES), 0.01)
    fast, whole = OnPath(one, HERE), Linear(one, HERE)
    for found, expected in zip(fast.reduced(), whole.reduced(), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
    np.testing.assert_allclose(fast.change(by), whole.change(by), rtol=1e-9, atol=1e-12)
