"""Turns by a gyro: columns, views, digest, archive, checks, and what they make of the odometry."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from gyro_logs import small_gyro_log, with_gyro
from random_logs import random_log
from refusals import refused
from slamduel.backends.api import Builder
from slamduel.backends.common_options import FRONT, IGNORED, STATE
from slamduel.backends.given import given
from slamduel.core.factors import Dataset, Log
from slamduel.core.factors.check import problems
from slamduel.core.gyro import CORRELATED, Bias, Gyro, conditioned, fused
from slamduel.datasets import archive
from small_log import small_log


def gyro_of(log: Log) -> Gyro:
    assert log.gyro is not None
    return log.gyro


def test_a_step_has_its_turn() -> None:
    log = small_gyro_log()
    for steps in (list(log), [log[k] for k in range(len(log))]):
        assert [step.gyro is None for step in steps] == [True, False, False, True, False, False]
        assert steps[4].gyro == (gyro_of(log).turn[2], gyro_of(log).var[2], 0.5, 1e-6)
    assert log.prior.gyro == Bias(0.01, 0.1)
    assert log.without_gyro().prior.gyro is None
    assert small_log().prior.gyro is None


def test_a_log_of_its_own_steps_is_the_same() -> None:
    log = small_gyro_log()
    assert Log.from_steps(log.name, log.prior, list(log), log.notes).digest == log.digest
    assert archive.unpacked(archive.packed(Dataset(log, None))).log.digest == log.digest
    assert archive.unpacked(archive.packed(Dataset(log, None))).log.prior.gyro == Bias(0.01, 0.1)
    assert log.head(6).digest == log.digest
    assert gyro_of(log.head(3)).step.tolist() == [1, 2]
    assert log.head(1).gyro is None


def test_the_digest_covers_it_and_is_the_old_one_without() -> None:
    log = small_gyro_log()
    assert log.without_gyro().digest == small_log().digest
    changed = [replace(gyro_of(log), turn=gyro_of(log).turn + 1e-15), replace(gyro_of(log), bias=np.array([0.01, 0.2]))]
    assert len({log.digest, *(replace(log, gyro=gyro).digest for gyro in changed)}) == 3


def test_the_walk_of_rows_left_out_is_kept() -> None:
    gyro = replace(gyro_of(small_gyro_log()), walk=np.array([1.0, 2.0, 4.0, 8.0]))
    assert gyro.rows(np.array([1, 3])).walk.tolist() == [3.0, 12.0]
    assert gyro.rows(slice(2)).walk.tolist() == [1.0, 2.0]
    assert gyro_of(small_gyro_log()).knot.tolist() == [0, 0, 1, 1]


def test_a_good_log_has_no_problem() -> None:
    assert list(problems(small_gyro_log())) == []


BAD: dict[str, tuple[str, Any, str, str]] = {
    "a turn in degrees": ("turn", 90.0, "gyro", "turn is 90.0, expected radians from -pi to pi"),
    "a turn that is NaN": ("turn", np.nan, "gyro", "turn is nan, expected a finite number"),
    "no variance": ("var", 0.0, "gyro", "var is 0.0, expected a variance, more than 0"),
    "no time": ("dt", -0.5, "gyro", "dt is -0.5, expected seconds, more than 0"),
    "a walk back": ("walk", -1e-9, "gyro", "walk is -1e-09, expected a variance, 0 or more"),
    "a step twice": ("step", 4, "gyro", "step is 4 after 4, expected one row a step, sorted"),
    "a step too late": ("step", 6, "gyro", "step is 6, expected 1 to 5, steps with one before"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_turn_is_named(case: str) -> None:
    name, value, table, message = BAD[case]
    log = small_gyro_log()
    column = getattr(gyro_of(log), name).copy()
    column[3] = value
    found = list(problems(replace(log, gyro=replace(gyro_of(log), **{name: column}))))
    assert (found[0].table, found[0].row, found[0].message) == (table, 3, message)


def test_a_bad_prior_and_bad_shapes_are_named() -> None:
    log = small_gyro_log()
    bad = replace(log, gyro=replace(gyro_of(log), bias=np.array([np.nan, -1.0])))
    assert [one.message[:25] for one in problems(bad)] == ["the gyro's bias is nan, e", "the gyro's bias_sd is -1."]
    flat = replace(log, gyro=replace(gyro_of(log), turn=np.zeros(3)))
    assert "turn has shape (3,), expected (4,)" in [one.message for one in problems(flat)]
    one = np.array([1])
    refused(r"gyro.dt: found shape \(2,\), expected \(1,\)", Gyro.from_arrays, one, one, one, np.ones(2))
    refused("row 1 is 1 after 2, expected them sorted", Gyro.from_arrays, np.array([2, 1]), one, one, one)


def test_a_motion_and_a_turn_split_exactly() -> None:
    """Against the joint information of motion and bias."""
    rng = np.random.default_rng(4)
    root, delta, b = rng.normal(size=(3, 3)), np.array([1.0, -0.5, 3.0]), np.array([0.0, 0.0])
    Q, turn, var, dt, bias, sd = root @ root.T, -3.1, 0.3, 0.7, 0.2, 0.4
    H = np.array([[0.0, 0.0, 1.0, dt]])
    information = np.zeros((4, 4))
    information[:3, :3], information[3, 3] = np.linalg.inv(Q), 1 / sd**2
    mean = np.append(delta, bias)
    off = (turn + 2 * np.pi) - H @ mean
    total = information + H.T @ H / var
    cov = np.linalg.inv(total)
    expected = mean + cov @ H[0] * off / var
    split = conditioned(delta[None], Q[None], np.array([turn]), np.array([var]), np.array([dt]))
    gain = sd**2 * dt / (sd**2 * dt**2 + split.told_var[0])
    b = bias + gain * (split.told[0] - bias * dt)
    P = sd**2 * (1 - gain * dt)
    np.testing.assert_allclose([b, P], [expected[3], cov[3, 3]])
    moved, slope = split.delta[0] + split.slope[0] * b, split.slope[0]
    np.testing.assert_allclose(np.cos(moved[2] - expected[2]), 1.0)
    np.testing.assert_allclose(moved[:2], expected[:2])
    np.testing.assert_allclose(split.cov[0] + np.outer(slope, slope) * P, cov[:3, :3], atol=1e-12)
    np.testing.assert_allclose(slope * P, cov[:3, 3], atol=1e-12)


def still_log(moves: bool) -> Log:
    """A minute at rest, then a minute of driving, at 1 Hz; or all of it driving."""
    t = np.arange(121.0)
    delta = np.zeros((121, 3))
    delta[0 if moves else 61 :, 0] = 0.5
    cov = np.tile(np.diag([1e-4, 1e-4, 1e-4]), (121, 1, 1))
    cov[: 0 if moves else 61] *= 1e-4
    none = np.zeros(0, np.int64)
    rng = np.random.default_rng(0)
    turn = 0.017 + 1e-4 * rng.standard_normal(120)
    gyro = Gyro.from_arrays(np.arange(1, 121), turn, np.full(120, 1e-8), np.ones(120), bias=Bias(0.0, 0.02))
    return Log.from_arrays(
        "still", small_log().prior, t, delta, cov, none, none, np.zeros((0, 2)), np.zeros((0, 2, 2)), gyro=gyro
    )


def test_a_robot_that_stands_tells_the_bias_in_front() -> None:
    log = still_log(moves=False)
    delta, cov = fused(gyro_of(log), log.delta, log.delta_cov)
    assert np.abs(delta[61:, 2]).max() < 5e-4  # of 0.017
    assert (cov[61:, 2, 2] < 0.02 * 1e-4).all()
    np.testing.assert_array_equal(delta[61:, :2], log.delta[61:, :2])
    driven = still_log(moves=True)
    _, cov = fused(gyro_of(driven), driven.delta, driven.delta_cov)
    np.testing.assert_allclose(1 / cov[1:, 2, 2], 1e4 + 1 / (1e-8 + 0.02**2 * CORRELATED), rtol=1e-9)


def test_a_known_bias_fuses_exactly() -> None:
    made, biases = with_gyro(random_log(np.random.default_rng(5), 30, 4), np.random.default_rng(6), bias=0.0, walk=0.0)
    log, truth = made
    assert truth is not None
    assert not biases.any()
    delta, cov = fused(gyro_of(log), log.delta, log.delta_cov)
    assert (cov[1:, 2, 2] < np.minimum(log.delta_cov[1:, 2, 2], 1e-6)).all()
    np.testing.assert_allclose(np.cos(np.diff(truth.poses[:, 2]) - delta[1:, 2]), 1.0, atol=1e-5)


@dataclass(frozen=True)
class Treated:
    """Options of a backend that can estimate a bias."""

    gyro: str = STATE


def test_a_backend_gets_turns_or_the_odometry_with_them() -> None:
    def make(prior: object, options: object, rng: object) -> object:
        raise NotImplementedError

    log = small_gyro_log()
    takes: Builder = Builder(make, loops=True, gyro=True)  # pyright: ignore[reportArgumentType]
    assert given(takes, log).log is log
    assert given(takes, log, Treated()).log is log
    way: Callable[..., Any] = lambda builder, options=None: given(builder, log, options)  # noqa: E731
    front, ignored = way(takes, Treated(FRONT)), way(takes, Treated(IGNORED))
    assert (front.turns, front.bias, ignored.bias) == (4, "estimated in front", "ignored")
    assert front.log.gyro is ignored.log.gyro is None
    assert front.log.digest != ignored.log.digest
    assert way(replace(takes, gyro=False), Treated()).log.digest == front.log.digest
    np.testing.assert_array_equal(front.log.delta_cov[3], log.delta_cov[3])  # without a turn
    assert given(replace(takes, gyro=False), small_log()).turns == 0
