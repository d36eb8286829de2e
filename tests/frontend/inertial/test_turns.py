"""Turns between steps: sums of single ones, exact on slopes, as far off as stated, and none where they are unknown."""

from dataclasses import replace

import numpy as np
import pytest

from inertial_drives import attitude, drive
from slamduel.core.se2 import Array
from slamduel.frontend.inertial.imu import Imu
from slamduel.frontend.inertial.levels import Levels, levels
from slamduel.frontend.inertial.standing import standing
from slamduel.frontend.inertial.turns import KNOTS, turns
from tiers import first_quick


def tilted(roll: Array, pitch: Array) -> Levels:
    return Levels(roll, pitch, np.zeros_like(roll), np.zeros_like(roll), 0.1, 0.3)


def rotated(turn: Array) -> Array:
    """The rotation (3, 3) by a vector, rad (Rodrigues)."""
    angle = float(np.linalg.norm(turn))
    x, y, z = turn / angle if angle else turn
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def test_the_turn_on_a_slope_is_the_product_of_single_rotations() -> None:
    """A robot turns about the vertical on a constant slope: its body's axes see the rate by their shares of it."""
    rng = np.random.default_rng(0)
    t = np.cumsum(rng.uniform(0.005, 0.015, 400))
    rate = np.cumsum(rng.normal(0, 0.1, 400))
    roll, pitch = np.full(400, 0.2), np.full(400, -0.3)
    world = attitude(roll[:1], pitch[:1], np.zeros(1))[0]
    imu = Imu(t, rate[:, None] * world[2])
    at = t[[3, 50, 51, 399]]
    found = turns(imu, at, tilted(roll, pitch))
    whole = world.copy()
    for k in range(3, 399):
        mean = (imu.gyro[k] + imu.gyro[k + 1]) / 2
        whole = whole @ rotated(mean * (t[k + 1] - t[k]))
    heading = np.arctan2(whole[1, 0], whole[0, 0]) - np.arctan2(world[1, 0], world[0, 0])
    total = float(found.turn.sum())
    assert abs(np.remainder(total - heading + np.pi, 2 * np.pi) - np.pi) < 1e-9
    assert abs(turns(imu, at).turn.sum() / total - np.cos(0.2) * np.cos(0.3)) < 1e-9  # the body's axis turns less


def test_parts_of_a_step_add_up_wherever_it_is_cut() -> None:
    one = drive(0, 20.0)
    rng = np.random.default_rng(1)
    at = np.sort(np.append(rng.uniform(0, 19.9, 300), (0.0, 19.9)))
    fine, whole = turns(one.imu, at), turns(one.imu, at[[0, -1]])
    for name in ("turn", "var", "dt"):
        np.testing.assert_allclose(getattr(fine, name).sum(), getattr(whole, name).sum(), rtol=1e-9, atol=1e-12)
    assert fine.step.tolist() == list(range(1, 302))


def test_a_step_that_begins_and_ends_between_readings_has_its_parts_of_them() -> None:
    imu = Imu(np.array([0.0, 1.0, 2.0]) / 10, np.array([[0, 0, 0.0], [0, 0, 1.0], [0, 0, 3.0]]))
    found = turns(imu, np.array([0.05, 0.15]))
    np.testing.assert_allclose(found.turn, [0.05 * 0.75 + 0.05 * 1.5], rtol=1e-12)


@pytest.mark.parametrize("seeds", first_quick([range(4), range(4, 20)]))
def test_turns_are_as_far_off_as_stated(seeds: range) -> None:
    nees, flat = [], []
    for seed in seeds:
        one = drive(seed)
        stood, at = standing(one.imu), np.arange(1, 59, 0.37)
        tilt = levels(one.imu, stood)
        true = np.diff(np.interp(at, one.t, one.heading))
        for into, found in ((nees, turns(one.imu, at, tilt, stood.noise)), (flat, turns(one.imu, at))):
            assert len(found.step) == len(true)
            into.append(((found.turn - true - one.bias[2] * found.dt) ** 2 / found.var).mean())
    assert 0.5 < np.mean(nees) < 2
    assert np.mean(flat) > 2 * np.mean(nees)  # as if the hills were flat


def test_a_step_that_is_not_all_known_has_no_turn() -> None:
    t = np.append(np.arange(0, 10, 0.01), np.arange(15, 20, 0.01))
    imu = Imu(t, np.ones((len(t), 3)))
    at = np.arange(-1.0, 22.0)
    assert turns(imu, at).step.tolist() == [*range(2, 11), *range(17, 21)]
    clipped = (t > 3.2) & (t < 3.4)
    assert 5 not in turns(replace(imu, clipped=clipped), at).step


def test_slow_readings_are_stated_wider_by_what_lies_between() -> None:
    """At 2 Hz a robot that turns to and fro within two seconds is not seen to do so."""
    errors = []
    for phase in np.linspace(0, 6, 20):
        t = np.arange(0, 60, 0.5)
        imu = Imu(t, np.column_stack((0 * t, 0 * t, np.sin(np.pi * t + phase))))
        at = np.arange(1.0, 59.0, 0.7)
        found = turns(imu, at)
        true = np.diff(-np.cos(np.pi * at + phase) / np.pi)
        errors.append(((found.turn - true) ** 2 / found.var).mean())
    assert 0.05 < np.mean(errors) < 2


def test_the_walk_of_the_bias_is_gathered_at_knots() -> None:
    one = drive(0, 60.0)
    at = np.arange(0.0, 59.0, 0.5)
    found = turns(one.imu, at, bias_walk=1e-3)
    rows = np.flatnonzero(found.walk)
    assert found.walk[0] == 0
    assert len(rows) == 11
    np.testing.assert_allclose(found.walk[rows], 1e-6 * KNOTS)
