from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from differences import central
from motions import between_jacobians, chain
from slamduel.core import se2
from slamduel.core.se2 import Array

metres = st.floats(-100, 100)
headings = st.floats(-np.pi, np.pi, exclude_min=True)
poses = st.tuples(metres, metres, headings).map(np.array)
points = st.tuples(metres, metres).map(np.array)
TOLERANCE = 300 * 8 * np.finfo(float).eps  # coordinates reach 300 m, a handful of roundings each


def assert_same_pose(a: Array, b: Array) -> None:
    np.testing.assert_allclose(a[..., :2], b[..., :2], rtol=0, atol=TOLERANCE)
    np.testing.assert_allclose(se2.wrap(a[..., 2] - b[..., 2]), 0, atol=TOLERANCE)


@given(poses, poses, poses)
def test_composition_is_associative(a: Array, b: Array, c: Array):
    assert_same_pose(se2.compose(se2.compose(a, b), c), se2.compose(a, se2.compose(b, c)))


@given(poses)
def test_standing_still_is_the_identity(a: Array):
    assert_same_pose(se2.compose(a, np.zeros(3)), a)
    assert_same_pose(se2.compose(np.zeros(3), a), a)


@given(poses)
def test_a_motion_and_its_inverse_cancel(a: Array):
    assert_same_pose(se2.compose(a, se2.inverse(a)), np.zeros(3))
    assert_same_pose(se2.compose(se2.inverse(a), a), np.zeros(3))


@given(poses, poses)
def test_between_is_the_motion_from_one_to_the_other(a: Array, b: Array):
    assert_same_pose(se2.compose(a, se2.between(a, b)), b)
    assert_same_pose(se2.between(a, b), se2.compose(se2.inverse(a), b))


@given(poses, poses, points)
def test_acting_with_a_composition_is_acting_twice(a: Array, b: Array, p: Array):
    twice = se2.act(a, se2.act(b, p))
    np.testing.assert_allclose(se2.act(se2.compose(a, b), p), twice, rtol=0, atol=TOLERANCE)


@given(headings)
def test_an_angle_in_range_comes_back_bit_for_bit(angle: float):
    assert se2.wrap(np.array(angle)).tobytes() == np.array(angle).tobytes()


@given(st.floats(-1e4, 1e4))
def test_a_wrapped_angle_is_in_range_and_the_same_direction(angle: float):
    wrapped = float(se2.wrap(np.array(angle)))
    assert -np.pi < wrapped <= np.pi
    turns = (angle - wrapped) / (2 * np.pi)
    assert abs(turns - round(turns)) < 1e-11


def test_one_pose_has_the_bits_of_many() -> None:
    rng = np.random.default_rng(5)
    a, b = rng.normal(size=(2, 5000, 3)) * 10.0 ** rng.uniform(-6, 6, (2, 5000, 1))
    turns = np.array([0.0, -0.0, np.pi, -np.pi, 3 * np.pi, -3 * np.pi, 1e300, np.nan, np.inf, -np.inf])
    a = np.concatenate((a, np.column_stack((np.zeros((100, 2)), np.repeat(turns, 10)))))
    b = np.concatenate((b, np.column_stack((-np.zeros((100, 2)), np.tile(turns, 10)))))
    with np.errstate(invalid="ignore"):
        for function in (se2.compose, se2.between):
            one_by_one = np.array([function(*pair) for pair in zip(a, b, strict=True)])
            together = function(a, b)
            np.testing.assert_array_equal(together, one_by_one)
            there = ~np.isnan(together)
            np.testing.assert_array_equal(np.signbit(together[there]), np.signbit(one_by_one[there]))
        angles = np.concatenate((a[:, 2], turns))
        np.testing.assert_array_equal(se2.wrap(angles), [se2.wrap(angle) for angle in angles])


def test_pi_is_in_range_and_minus_pi_is_not():
    np.testing.assert_array_equal(se2.wrap(np.array([np.pi, -np.pi, 3 * np.pi])), np.pi)


@given(poses, poses)
def test_headings_come_out_wrapped(a: Array, b: Array):
    for pose in (se2.compose(a, b), se2.between(a, b), se2.inverse(a)):
        assert -np.pi < pose[2] <= np.pi


@pytest.mark.parametrize(
    ("function", "jacobians", "sizes"),
    [
        (se2.compose, se2.compose_jacobians, (3, 3)),
        (se2.between, between_jacobians, (3, 3)),
        (se2.act, se2.act_jacobians, (3, 2)),
    ],
)
def test_jacobians_equal_central_differences(function: Callable[..., Array], jacobians: Callable[..., Any], sizes: Any):
    rng = np.random.default_rng(5)
    for _ in range(50):
        a, b = (rng.uniform(-1.5, 1.5, size) for size in sizes)  # headings add up to less than pi: no jump
        by_a, by_b = jacobians(a, b)
        np.testing.assert_allclose(by_a, central(lambda v, b=b: function(v, b), a, 1e-5), atol=1e-9)
        np.testing.assert_allclose(by_b, central(lambda v, a=a: function(a, v), b, 1e-5), atol=1e-9)


@pytest.mark.parametrize(
    ("function", "sizes"),
    [
        (se2.compose, (3, 3)),
        (se2.compose_jacobians, (3, 3)),
        (se2.between, (3, 3)),
        (between_jacobians, (3, 3)),
        (se2.act, (3, 2)),
        (se2.act_jacobians, (3, 2)),
        (se2.inverse, (3,)),
    ],
)
def test_a_batch_is_its_members_one_by_one(function: Callable[..., Any], sizes: Sequence[int]):
    rng = np.random.default_rng(6)
    batch = [rng.uniform(-3, 3, (2, 4, size)) for size in sizes]
    together = function(*batch)
    together = together if isinstance(together, tuple) else (together,)
    for place in np.ndindex(2, 4):
        alone = function(*(column[place] for column in batch))
        for whole, part in zip(together, alone if isinstance(alone, tuple) else (alone,), strict=True):
            np.testing.assert_allclose(whole[place], part, rtol=1e-14, atol=1e-14)


@given(headings, poses)
def test_rotation_is_turning_without_moving(heading: float, a: Array):
    turned = se2.compose(np.array([0.0, 0.0, heading]), a)
    np.testing.assert_allclose(se2.rotation(heading)[:2] @ a, turned[:2], atol=TOLERANCE)
    np.testing.assert_allclose(se2.rotation(heading)[2], [0, 0, 1])


def test_a_chain_is_two_motions_and_first_order_covariance():
    rng = np.random.default_rng(7)
    a, b = rng.uniform(-1, 1, 3), rng.uniform(-1, 1, 3)
    spread = [1e-6 * (root @ root.T + np.eye(3)) for root in rng.normal(size=(2, 3, 3))]
    delta, cov = chain(a, spread[0], b, spread[1])
    np.testing.assert_allclose(delta, se2.compose(a, b))
    draws = 200_000
    noisy = [mean + rng.multivariate_normal(np.zeros(3), c, draws) for mean, c in zip((a, b), spread, strict=True)]
    sample = np.cov(se2.compose(*noisy).T)
    scale = np.sqrt(np.outer(np.diag(cov), np.diag(cov)))
    # the standard error of a sample covariance of N normal draws is sqrt(1 + rho^2) / sqrt(N) of the scale
    np.testing.assert_allclose((sample - cov) / scale, 0, atol=6 * np.sqrt(2 / draws))
