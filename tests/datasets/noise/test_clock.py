"""Motions between other times: exact where the robot moves evenly, whole steps, and halves of them."""

import numpy as np
import pytest

from slamduel.core.se2 import summed
from slamduel.datasets.noise.clock import motions_after

ROW = np.full((1, 3), np.nan)


def columns(moved: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Motions (n, 3) and covariances, with the rows 0 that nothing is known of."""
    cov = np.arange(1.0, len(moved) + 1)[:, None, None] * np.diag([1e-4, 4e-4, 1e-6])
    return np.vstack((ROW, moved)), np.concatenate((np.full((1, 3, 3), np.nan), cov))


@pytest.mark.parametrize("steps", [2, -2])
def test_whole_steps_are_those_of_other_rows(steps: int) -> None:
    t = np.linspace(0.0, 0.8, 9)
    delta, cov = columns(np.random.default_rng(0).normal(0, 0.1, (8, 3)))
    moved, moved_cov = motions_after(t, delta, cov, 0.1 * steps)
    here, there = (slice(1, -2), slice(3, None)) if steps > 0 else (slice(3, None), slice(1, -2))
    np.testing.assert_allclose(moved[here], delta[there], atol=1e-12)
    np.testing.assert_allclose(moved_cov[here], cov[there], atol=1e-12)
    beyond, last = (slice(-2, None), -1) if steps > 0 else (slice(1, 3), 1)
    np.testing.assert_allclose(moved[beyond], delta[[last, last]], atol=1e-12)
    np.testing.assert_allclose(moved_cov[beyond], cov[[last, last]], atol=1e-12)


def test_times_that_are_uneven_give_the_same_path() -> None:
    """Straight ahead at 1 m/s and then at 3: half a second later, from step to step."""
    t = np.array([0.0, 1.0, 1.5, 4.0])
    moved, cov = motions_after(t, *columns(np.array([[1.0, 0, 0], [0.5, 0, 0], [7.5, 0, 0]])), 0.5)
    assert moved[1:, 0] == pytest.approx([1.0, 1.5, 7.5])
    assert cov[1:, 0, 0] == pytest.approx([0.5e-4 + 2e-4, 0.2 * 3e-4, 3e-4])
    assert np.isnan(moved[0]).all()


def test_there_and_back_is_the_same_path_but_for_its_ends_and_what_is_interpolated() -> None:
    t = np.cumsum(np.random.default_rng(1).uniform(0.05, 0.15, 200))
    rates = np.column_stack((0.5 + 0.2 * np.sin(0.5 * t), 0 * t, 0.5 * np.cos(0.3 * t)))
    delta, cov = columns(rates[1:] * np.diff(t)[:, None])
    back, back_cov = motions_after(t, *motions_after(t, delta, cov, 0.03), -0.03)
    np.testing.assert_allclose(summed(np.zeros(3), back[1:]), summed(np.zeros(3), delta[1:]), atol=2e-3)
    assert (np.linalg.eigvalsh(back_cov[1:]) > 0).all()
