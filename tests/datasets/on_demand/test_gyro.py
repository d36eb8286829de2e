"""A gyro and slipping wheels on demand: around the truth, as stated, and the rest of the log as it was."""

from dataclasses import replace

import numpy as np
import pytest

from slamduel.bench.plan.load import load
from slamduel.core.factors import Dataset
from slamduel.core.factors.check import problems
from slamduel.core.gyro import Bias, Gyro
from slamduel.core.se2 import Array, between, wrap
from slamduel.datasets.on_demand.gyro import GYRO_NOTE
from slamduel.datasets.on_demand.slip import SLIP_NOTE, STRETCH
from slamduel.datasets.worlds import depth_room
from slamduel.datasets.worlds.laser_floor import Options, record
from slamduel.frontend.wheels.track import Track

DEGREE = np.pi / 180


def made(options: str = "", seed: int = 1, world: str = "circle[steps=1000") -> Dataset:
    dataset = load(f"{world}{options}]", seed)
    assert list(problems(dataset.log)) == []
    return dataset


def gyro(dataset: Dataset) -> Gyro:
    assert dataset.log.gyro is not None
    return dataset.log.gyro


def errors(dataset: Dataset) -> Array:
    """(n,) rad, what each turn has too much, in a world with a pose at each step."""
    assert dataset.truth is not None
    return wrap(gyro(dataset).turn - np.diff(dataset.truth.poses[:, 2]))


def test_turns_have_white_noise_as_stated() -> None:
    dataset = made(",gyro=0.1")
    off = errors(dataset) / np.sqrt(gyro(dataset).var)
    assert len(off) == 999
    assert gyro(dataset).var == pytest.approx((0.1 * DEGREE) ** 2)
    assert abs((off**2).mean() - 1) < 4 * np.sqrt(2 / len(off))
    assert gyro(dataset).prior == Bias(0.0, 0.0)
    assert not gyro(dataset).walk.any()


def test_the_bias_is_drawn_or_given_and_walks_at_knots() -> None:
    given = made(",gyro=0.001,gyro_bias=2,gyro_start=given")
    assert errors(given) == pytest.approx(2 * DEGREE, abs=1e-4)
    assert gyro(given).prior == (0.0, pytest.approx(2 * DEGREE))
    drawn = np.array([errors(made(",gyro=0.001,gyro_bias=2", seed))[0] for seed in range(12)]) / (2 * DEGREE)
    assert 4.4 < (drawn**2).sum() < 23.4  # 95 % of chi-square of 12
    walked = made(",gyro=0.001,gyro_bias=2,gyro_walk=0.01,gyro_knots=20")
    moved = gyro(walked).step[gyro(walked).walk > 0]
    assert moved.tolist() == list(range(20, 1000, 20))
    assert gyro(walked).walk[gyro(walked).walk > 0] == pytest.approx(20 * (0.01 * DEGREE) ** 2)
    biases = np.array(walked.log.notes[GYRO_NOTE]["biases"])
    np.testing.assert_allclose(errors(walked), biases[gyro(walked).knot], atol=5 * 0.001 * DEGREE)
    assert 26 < (np.diff(biases) ** 2).sum() / (20 * (0.01 * DEGREE) ** 2) < 78


def test_the_rest_of_the_log_is_as_it_was() -> None:
    before, after = made().log, made(",gyro=0.1,gyro_bias=1,gyro_walk=0.01").log
    assert after.without_gyro().digest == before.digest
    assert after.digest != before.digest
    slipping = made(",slip_share=0.1").log
    assert replace(slipping, delta=before.delta).digest == before.digest


def test_wheels_slip_on_a_share_of_the_way() -> None:
    before, few, many = made().log, made(",slip_share=0.1").log, made(",slip_share=0.3").log
    less, more = few.delta - before.delta, many.delta - before.delta
    share = few.notes[SLIP_NOTE] / 999
    stretches = 0.25 * 999 / STRETCH
    assert abs(share - 0.1) < 4 * np.sqrt(0.09 / stretches)
    slips = less[1:, 2] != 0
    assert slips.sum() == few.notes[SLIP_NOTE]
    np.testing.assert_allclose(np.abs(wrap(less[1:][slips, 2])), 0.2 * 0.25 / 0.5, rtol=0.2)  # over a track of 0.5 m
    assert np.abs(less[1:][slips, 0]).max() < 0.2 * 0.25 / 2 * 1.3
    turn, y = less[1:][slips, 2], less[1:][slips, 1]
    np.testing.assert_allclose(y, 0.25 / 2 * wrap(turn), atol=0.004)  # the arc that the wheels believe in
    np.testing.assert_allclose(more[1:][slips], less[1:][slips])
    assert many.notes[SLIP_NOTE] > 2 * few.notes[SLIP_NOTE]


def test_on_the_floor_wheels_slip_before_scans_are_matched() -> None:
    (before, at), (after, there) = (
        record(Options(laps=0.3, slip_share=share), np.random.default_rng(3)) for share in (0.0, 0.2)
    )
    np.testing.assert_array_equal(at.poses, there.poses)
    np.testing.assert_array_equal(before.ranges, after.ranges)
    assert before.odometry is not None
    assert after.odometry is not None
    motion, read = (between(one[:-1], one[1:]) for one in (before.odometry, after.odometry))
    off = wrap(read[:, 2] - motion[:, 2])
    slips = np.abs(off) > 1e-9
    way = np.hypot(motion[:, 0], motion[:, 1])
    assert 0.05 < way[slips].sum() / way.sum() < 0.4
    np.testing.assert_allclose(np.abs(off[slips]), 0.2 * way[slips] / 0.5, rtol=1e-6)  # over a track of 0.5 m
    np.testing.assert_allclose(read[~slips], motion[~slips], atol=1e-9)


def test_in_the_depth_room_wheels_slip_before_frames_are_matched() -> None:
    before, after = (
        depth_room.record(depth_room.Drive(laps=0.3, slip_share=share), np.random.default_rng(3))[0].motion
        for share in (0.0, 0.2)
    )
    assert isinstance(before, Track)
    assert isinstance(after, Track)
    motion, read = (between(one.poses[:-1], one.poses[1:]) for one in (before, after))
    slips = np.abs(wrap(read[:, 2] - motion[:, 2])) > 1e-9
    way = np.hypot(motion[:, 0], motion[:, 1])
    assert 0.05 < way[slips].sum() / way.sum() < 0.6  # 7 stretches: a fifth of them, with 0.15 standard deviation
    np.testing.assert_allclose(read[~slips], motion[~slips], atol=1e-9)


def test_scans_correct_most_of_the_slip_on_the_floor() -> None:
    (log, truth) = made(",slip_share=0.2", world="laser-floor[laps=0.3")
    assert truth is not None
    n = len(truth.poses)
    off = wrap(log.delta[-n + 1 :] - between(truth.poses[:-1], truth.poses[1:]))[:, 2]
    assert np.median(np.abs(off)) < 0.003
    assert np.sqrt(np.mean(off**2)) < 0.02  # that of the wheels alone is 0.09


def test_a_step_without_truth_has_no_turn() -> None:
    dataset = made(",gyro=0.1,slip_share=1", world="matlab-report[bearing_noise=0.02")
    assert len(gyro(dataset)) == len(dataset.log) - 1
