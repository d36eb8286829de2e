"""Commands as odometry: each is held until the next, late by a delay, on arcs, and its holes are those of the rows."""

from typing import Any

import numpy as np
import pytest

from refusals import refused
from slamduel.core.se2 import Array
from slamduel.frontend.wheels.commands import Commanded, Commands, Speeds

T: Array = np.arange(9) / 2
HELD = np.tile([0.5, 1.0], (9, 1))  # m/s, rad/s: a circle of 0.5 m


def commanded(speeds: Array, t: Array = T, wheels: bool = False, **settings: Any) -> Commanded:
    return Commanded.by(Speeds(t, speeds, wheels), Commands(**settings), 5.0, "cart: commands")


def on_circle(turn: float) -> Array:
    """(3,) the motion along a circle of 0.5 m."""
    return np.array([0.5 * np.sin(turn), 0.5 * (1 - np.cos(turn)), turn])


@pytest.mark.parametrize(("start", "end"), [(0.0, 4.0), (0.5, 1.0), (0.7, 0.8), (1.3, 2.9)])
def test_a_speed_is_held_on_an_arc(start: float, end: float) -> None:
    turn = np.arctan2(np.sin(end - start), np.cos(end - start))
    expected = [*on_circle(end - start)[:2], turn]
    np.testing.assert_allclose(commanded(HELD).odometry(start, end).delta, expected, atol=3e-4)  # chords of 0.1 rad


def test_wheels_are_speeds_of_their_rims() -> None:
    rims = np.tile([0.4 / 2, 0.6 / 2], (9, 1))  # of 2 m/s at full power: 0.5 m/s, and 0.2 m/s of difference
    found = commanded(rims, wheels=True, full=2.0, base=0.2).odometry(0.2, 1.7)
    np.testing.assert_allclose(found.delta, commanded(HELD).odometry(0.2, 1.7).delta, atol=1e-12)
    refused(r"cart: commands: found speeds of the left and right wheel, expected base", commanded, rims, wheels=True)


def test_a_command_acts_later_by_the_delay() -> None:
    steps = np.zeros((9, 2))
    steps[4:, 0] = 0.5  # from 2 s on
    late = commanded(steps, delay=0.25)
    np.testing.assert_allclose(late.odometry(2.0, 2.25).delta, 0, atol=1e-12)
    np.testing.assert_allclose(late.odometry(2.25, 3.25).delta, [0.5, 0, 0], atol=1e-12)
    assert late.t[[0, -1]].tolist() == [0.25, 4.25]


def test_a_turn_of_more_than_half_a_turn_between_two_rows_is_whole() -> None:
    t = np.array([0.0, 3.0, 6.0, 9.0])
    found = commanded(np.tile([0.5, 1.5], (4, 1)), t)
    assert found.odometry(0.0, 3.0).delta[2] == pytest.approx(4.5 - 2 * np.pi)
    assert found.odometry(1.0, 1.5).delta[2] == pytest.approx(0.75)
    assert len(found.holes.start) == 0


def test_the_time_without_a_row_is_a_hole_and_its_end_is_lost() -> None:
    t = np.array([*np.arange(20) / 10, 3.9, *(4 + np.arange(20) / 10)])
    speeds = np.tile([0.5, 0.2], (len(t), 1))
    found = commanded(speeds, t)
    found.check()
    assert (found.holes.start.tolist(), found.holes.end.tolist()) == ([1.9], [3.9])
    assert "cart: commands: no reading for 2 s" in found.remarks(0.0, 6.0)[0]
    bare = commanded(speeds[:20], t[:20])
    assert found.odometry(1.8, 4.0).cov[0, 0] > 0.5 > 100 * bare.odometry(0.0, 1.9).cov[0, 0] / 10


def test_rates_that_turn_without_end_are_refused_and_fast_ones_a_remark() -> None:
    refused("cart: commands: the robot turns by .* rad in all", commanded, HELD * 1e7)
    degrees = np.tile([0.5, 20.0], (40, 1))
    remarks = commanded(degrees, np.arange(40) / 20).remarks(0.0, 2.0)
    assert any("perhaps turning rates are in degrees" in one for one in remarks)


def test_the_settings_name_what_is_stated() -> None:
    stated = commanded(HELD, delay=0.1).settings["commands"]
    assert (stated["delay"], stated["noise"]["forward"], "base" in stated) == (0.1, 0.1, False)
