"""Faults of the wheels: each is the one that its name says, and without any nothing changes."""

import numpy as np
import pytest

from slamduel.core.se2 import Array, between, wrap
from slamduel.datasets.wheel_faults import (
    ODD_WHEEL,
    TOO_MUCH,
    WheelFaults,
    faulty_clock,
    faulty_poses,
    faulty_wheels,
)

T = 0.1 * np.arange(1200, dtype=np.float64)
"""s; two minutes."""

ROLLED = np.stack((0.4 * T + 0.3 * np.sin(0.2 * T), 0.4 * T - 0.3 * np.sin(0.2 * T)), axis=-1)
"""m of the left and the right wheel."""


def read(**faults: float) -> Array:
    return faulty_wheels(ROLLED, T, WheelFaults(**faults), np.random.default_rng(3))


def test_readings_repeat_and_then_catch_up() -> None:
    found = read(stalls=6.0, stall_time=0.8)
    wrong = (found != ROLLED).any(axis=1)
    assert 0.03 < wrong.mean() < 0.16
    after = np.flatnonzero(wrong)
    assert (found[after] == found[after - 1]).all()
    back = np.flatnonzero(wrong[:-1] & ~wrong[1:]) + 1
    assert len(back) >= 6
    assert (found[back] == ROLLED[back]).all()


def test_a_late_heading_is_that_of_an_earlier_time() -> None:
    found = read(late_heading=0.5)
    assert found.sum(axis=1) == pytest.approx(ROLLED.sum(axis=1))
    turned, true = np.diff(found, axis=1)[:, 0], np.diff(ROLLED, axis=1)[:, 0]
    assert turned[5:] == pytest.approx(true[:-5])


@pytest.mark.parametrize("kind", ["stuck", "spins"])
def test_one_wheel_reads_too_little_or_too_much_for_a_second(kind: str) -> None:
    found = read(**{kind: 3.0})
    odd = np.diff(found, axis=0) - np.diff(ROLLED, axis=0)
    wrong = np.abs(odd) > 1e-12
    assert wrong.any(axis=1).sum() == pytest.approx(10 * ODD_WHEEL * 6, abs=30)
    if kind == "stuck":
        assert np.abs(np.diff(found, axis=0)[wrong]).max() < 1e-12
    else:
        assert odd[wrong].min() == pytest.approx(TOO_MUCH * 0.1)


def test_a_clock_that_stands_still_goes_on_where_it_should() -> None:
    stamps = faulty_clock(T, WheelFaults(clock_stalls=6.0), np.random.default_rng(1))
    late = T - stamps
    assert (np.diff(stamps) > 0).all()
    assert late.max() == pytest.approx(ODD_WHEEL, abs=0.11)
    assert late.min() == pytest.approx(0.0)
    assert 0.03 < (late > 1e-9).mean() < 0.2


def test_poses_have_the_faults_of_their_wheels_and_without_any_stay() -> None:
    heading = 0.3 * np.sin(0.3 * T)
    poses = np.stack((np.cumsum(0.04 * np.cos(heading)), np.cumsum(0.04 * np.sin(heading)), heading), axis=-1)
    assert faulty_poses(poses, T, WheelFaults(), np.random.default_rng(0)) is poses
    found = faulty_poses(poses, T, WheelFaults(stalls=6.0), np.random.default_rng(0))
    motion, true = between(found[:-1], found[1:]), between(poses[:-1], poses[1:])
    still = ~motion.any(axis=1)
    assert 20 < still.sum() < 200
    assert motion[:, 0].sum() == pytest.approx(true[:, 0].sum())
    assert wrap(found[-1, 2] - poses[-1, 2]) == pytest.approx(0.0, abs=1e-9)
