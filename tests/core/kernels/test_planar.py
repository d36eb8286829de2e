"""Planar motions in compiled code: those of `core.se2`, and covariances by products of dense matrices."""

import numpy as np
import pytest

from slamduel.core import se2
from slamduel.core.kernels import _planar
from slamduel.core.se2 import Array

EPS = float(np.finfo(float).eps)
ROWS, COLUMNS = np.triu_indices(3)


def six(cov: Array) -> Array:
    """xx, xy, xt, yy, yt, tt"""
    return cov[ROWS, COLUMNS]


def any_cov(rng: np.random.Generator) -> Array:
    root = rng.normal(size=(3, 3)) * 10 ** rng.uniform(-2, 2, (3, 1))
    return root @ root.T


def test_an_angle_is_wrapped_as_by_numpy_and_kept_where_it_is_in_range() -> None:
    rng = np.random.default_rng(0)
    angles = np.concatenate((rng.uniform(-12, 12, 4000), np.arange(-8, 9) * np.pi / 4, [1e6, -1e6]))
    wrapped = np.array([_planar.wrap(angle) for angle in angles])
    assert ((-np.pi < wrapped) & (wrapped <= np.pi)).all()
    off = np.abs(se2.wrap(wrapped - se2.wrap(angles)))
    assert (off <= 4 * EPS * np.maximum(np.abs(angles), np.pi)).all()
    inside = (-np.pi < angles) & (angles <= np.pi)
    assert wrapped[inside].tobytes() == angles[inside].tobytes()
    assert _planar.wrap(-np.pi) == np.pi
    assert np.isnan(_planar.wrap(np.nan))


def test_a_motion_is_that_of_se2() -> None:
    rng = np.random.default_rng(1)
    for pose, motion in zip(rng.normal(0, 3, (200, 3)), rng.normal(0, 3, (200, 3)), strict=True):
        bound = 8 * EPS * (np.pi + np.abs(pose).sum() + np.abs(motion).sum())
        assert (np.abs(se2.between(se2.compose(pose, motion), np.array(_planar.moved(*pose, *motion)))) <= bound).all()


@pytest.mark.parametrize("seed", range(20))
def test_covariances_are_propagated_as_by_dense_matrices(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cov, noise, heading, gx, gy = any_cov(rng), any_cov(rng), *rng.normal(0, 3, 3)
    G, R = np.array([[1, 0, gx], [0, 1, gy], [0, 0, 1.0]]), se2.rotation(heading)
    levered, added = G @ cov @ G.T, R @ noise @ R.T
    bound = 50 * EPS * (np.abs(G) @ np.abs(cov) @ np.abs(G.T) + np.abs(R) @ np.abs(noise) @ np.abs(R.T))

    P = cov.copy()
    _planar.propagate(P, gx, gy, heading, np.vstack((rng.normal(size=3), noise)))
    assert (np.abs(P - levered - added) <= bound).all()
    assert (P == P.T).all()

    S = six(cov)
    _planar.levered(S, gx, gy)
    assert (np.abs(S - six(levered)) <= six(bound)).all()
    _planar.add_turned(S, np.cos(heading), np.sin(heading), np.concatenate((np.zeros(4), six(noise))), 4)
    assert (np.abs(S - six(levered + added)) <= six(bound)).all()

    xx, xy, yy = _planar.rotated(np.cos(heading), np.sin(heading), noise[0, 0], noise[0, 1], noise[1, 1])
    assert (np.abs(np.array([xx, xy, yy]) - added[[0, 0, 1], [0, 1, 1]]) <= bound[[0, 0, 1], [0, 1, 1]]).all()


def test_an_information_is_the_inverse() -> None:
    rng = np.random.default_rng(2)
    for _ in range(200):
        cov, W = any_cov(rng), np.zeros(8)
        assert _planar.information(np.concatenate(([7.0], six(cov))), 1, W, 2)
        right = np.asarray(np.linalg.inv(cov), float)
        assert np.abs(W[2:] - six(right)).max() <= 100 * EPS * np.linalg.cond(cov) * np.abs(right).max()
        assert (W[:2] == 0).all()


@pytest.mark.parametrize("entry", range(6))
@pytest.mark.parametrize("value", [-1e9, np.nan])
def test_there_is_no_information_in_what_is_no_covariance(entry: int, value: float) -> None:
    S = six(np.diag([1.0, 2.0, 3.0]))
    S[entry] = value
    assert not _planar.information(S, 0, np.zeros(6), 0)
