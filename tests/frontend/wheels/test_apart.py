"""Counters read at times of their own: interpolated each by itself, with the noise of readings of both."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from refusals import refused
from slamduel.core.se2 import Array
from slamduel.frontend.wheels.apart import joined
from slamduel.frontend.wheels.encoder import Encoder
from slamduel.frontend.wheels.ticks import Ticks, Wheels

DISTANCE = Encoder(1e-3, 1.1e-3, 0.3, 0.02, "distance")
ENCODERS = [DISTANCE, replace(DISTANCE, noise="proportional"), replace(DISTANCE, noise="proportional", interval=0.05)]
T: Array = np.arange(201.0) / 20
KEYFRAMES = [0.03, 0.5, 1.234, 3.0, 9.9]


def left(t: Array) -> Array:
    return 400 * t + 60 * np.sin(t)


def right(t: Array) -> Array:
    return 300 * t - 80 * np.sin(t)


def together(encoder: Encoder) -> Wheels:
    return Wheels(Ticks(T, np.column_stack((left(T), right(T)))), encoder)


def apart(encoder: Encoder, late: Array | float, first: Array = T) -> Wheels:
    other = first + late
    return Wheels(joined((first, other), (left(first), right(other)), "cart"), encoder, source="cart: encoder")


@pytest.mark.parametrize("encoder", ENCODERS)
def test_at_coinciding_times_the_factors_are_those_of_one_table(encoder: Encoder) -> None:
    one, other = together(encoder), apart(encoder, 0.0)
    for start, end in pairwise(KEYFRAMES):
        expected, found = one.odometry(start, end), other.odometry(start, end)
        np.testing.assert_allclose(found.delta, expected.delta, rtol=0, atol=1e-9)
        np.testing.assert_allclose(found.cov, expected.cov, rtol=0, atol=1e-9)


@pytest.mark.parametrize("encoder", ENCODERS)
def test_at_times_of_their_own_the_factors_agree_within_the_noise(encoder: Encoder) -> None:
    one, other = together(encoder), apart(encoder, 0.02)
    other.check()
    for start, end in pairwise(KEYFRAMES):
        expected, found = one.odometry(start, end), other.odometry(start, end)
        np.testing.assert_allclose(found.delta, expected.delta, rtol=0, atol=1e-3)
        assert (np.abs(found.delta - expected.delta) < 0.1 * np.sqrt(np.diag(expected.cov))).all()
        np.testing.assert_allclose(found.cov, expected.cov, rtol=0.03, atol=1e-6)


def test_each_counter_is_interpolated_by_itself() -> None:
    ticks = joined((T, T[::4] + 0.01), (left(T), right(T[::4] + 0.01)), "cart")
    for wheel, (t, counts) in enumerate(((T, left(T)), (T[::4] + 0.01, right(T[::4] + 0.01)))):
        at = np.linspace(0.3, 9.5, 77)
        np.testing.assert_allclose(np.interp(at, ticks.t, ticks.counts[:, wheel]), np.interp(at, t, counts), atol=1e-9)
    assert ticks.t[[0, -1]].tolist() == [0.01, 10.0]


def test_a_wheel_that_is_not_read_for_long_is_a_hole_though_the_other_one_is() -> None:
    seen = (T < 4) | (T > 6)
    ticks = joined((T, T[seen] + 0.01), (left(T), right(T[seen] + 0.01)), "cart")
    holes = Wheels(ticks, DISTANCE).holes
    assert len(holes.start) == 1
    assert holes.start[0] == pytest.approx(3.96, abs=0.06)
    assert holes.end[0] == pytest.approx(6.06, abs=0.06)
    assert len(apart(DISTANCE, 0.01).holes.start) == 0


def test_a_misread_count_is_named_with_its_wheel() -> None:
    counts = right(T + 0.01)
    counts[50] += 3000
    wheels = Wheels(joined((T, T + 0.01), (left(T), counts), "cart"), DISTANCE, source="cart: encoder")
    refused(r"cart: encoder: between readings \d+ and \d+, .* the right wheel's count goes from \d+ to", wheels.check)


def test_counters_without_a_time_in_common_are_refused() -> None:
    refused(r"cart: the left and right counts are from 0\.0 to 10\.0 s and 20\.0 to 30\.0 s", apart, DISTANCE, 20.0)


def test_eq_1s_noise_is_that_of_a_pair_of_readings() -> None:
    """As many readings again would halve the variance of a noise that each of them has."""
    proportional = ENCODERS[1]
    assert apart(proportional, 0.02).stated.interval == pytest.approx(0.05)
    assert apart(proportional, 0.0).stated is proportional
    assert apart(ENCODERS[2], 0.02).stated is ENCODERS[2]
