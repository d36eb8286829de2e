"""Degrees for radians and milliseconds for seconds are noticed, and nothing in an ordinary drive."""

import numpy as np
import pytest

from slamduel.core.se2 import Array, wrap
from slamduel.frontend.wheels.units import in_degrees, odd_units

T: Array = np.arange(0.0, 60.0, 0.1)


def drive(turns: float = 0.4, speed: float = 0.5) -> Array:
    """(m, 3) a drive in bends, its headings in radians and not wrapped."""
    heading = turns * T + 0.5 * np.sin(T)
    xy = np.cumsum(speed * 0.1 * np.column_stack((np.cos(heading), np.sin(heading))), axis=0)
    return np.column_stack((xy, heading))


def test_an_ordinary_drive_is_in_the_right_units() -> None:
    assert list(odd_units("cart", T, drive())) == []
    for poses in (drive(), drive() * [-1, -1, 1], drive(turns=0.0)):  # backwards, and straight on
        assert not in_degrees(poses)
    wrapped = drive()
    wrapped[:, 2] = wrap(wrapped[:, 2])
    assert not in_degrees(wrapped)


@pytest.mark.parametrize("sign", [1, -1])
def test_headings_in_degrees_are_told_by_the_way_the_robot_drives(sign: int) -> None:
    degrees = drive() * [sign, sign, 180 / np.pi]
    assert in_degrees(degrees)
    degrees[:, 2] = (degrees[:, 2] + 180) % 360 - 180
    assert in_degrees(degrees)


def test_a_robot_that_drives_sideways_is_no_hint() -> None:
    poses = drive()
    poses[:, 2] = np.random.default_rng(0).uniform(-3, 3, len(poses))
    assert not in_degrees(poses)


@pytest.mark.parametrize(
    ("t", "poses", "words"),
    [
        (1000 * T, drive(), "the median time between readings is 100 s: perhaps it is in milliseconds"),
        (10 * T, drive(speed=0.01), "median speed while moving is 0.001 m/s: perhaps the times are in milliseconds"),
        (T, drive() * [1, 1, 30], "while turning is 1.* rad/s: perhaps headings or turning rates are in degrees"),
    ],
)
def test_what_looks_like_another_unit_is_a_sentence(t: Array, poses: Array, words: str) -> None:
    (found,) = odd_units("cart", t, poses)
    assert found.startswith("cart: ")
    assert all(part in found for part in words.split("1.*"))
