"""The way through way points: where it leads, how it bends, and that it can always be driven."""

import numpy as np
import pytest

from slamduel.core.se2 import between
from slamduel.datasets.own_worlds.route import route

CORNERS = np.array([[0.0, 0.0], [5.0, 0.0], [5.0, 5.0], [0.0, 5.0], [2.0, 1.0]])


def test_it_comes_within_near_of_every_way_point_in_their_order() -> None:
    way = route(CORNERS, radius=0.4, near=0.2)
    poses = way.at(np.linspace(0, way.length, 20_000))
    np.testing.assert_array_equal(poses[0], [0, 0, 0])
    far = np.hypot(*(poses[:, None, :2] - CORNERS[None]).transpose(2, 0, 1))
    first = [int(np.argmax(far[:, k] <= 0.2 + 1e-3)) for k in range(len(CORNERS))]
    assert first == sorted(first)
    assert (far.min(axis=0) <= 0.2 + 1e-3).all()
    assert np.hypot(*(poses[-1, :2] - CORNERS[-1])) == pytest.approx(0.2, abs=1e-9)


def test_it_bends_no_more_than_its_radius_allows_and_is_as_long_as_it_says() -> None:
    way = route(CORNERS, radius=0.4, near=0.2)
    step = way.length / 20_000
    poses = way.at(np.linspace(0, way.length, 20_001))
    moved = between(poses[:-1], poses[1:])
    np.testing.assert_allclose(np.hypot(moved[:, 0], moved[:, 1]), step, rtol=1e-4)
    assert np.abs(moved[:, 2]).max() <= step / 0.4 * (1 + 1e-9)
    assert np.abs(moved[:, 1]).max() < 2e-3 * step  # it rolls and does not slide


def test_a_straight_way_is_straight() -> None:
    way = route(np.array([[0.0, 0.0], [3.0, 4.0], [6.0, 8.0]]), radius=1.0, near=0.5)
    assert way.length == pytest.approx(9.5)
    np.testing.assert_allclose(way.at(np.array([9.5]))[0], [5.7, 7.6, np.arctan2(4, 3)])


def test_a_way_point_inside_the_circle_of_a_turn_is_reached_the_other_way_round() -> None:
    way = route(np.array([[0.0, 0.0], [5.0, 0.0], [4.9, 0.7]]), radius=1.0, near=0.01)
    assert way.around.tolist() == [2]
    assert np.hypot(*(way.at(np.array([way.length]))[0, :2] - [4.9, 0.7])) == pytest.approx(0.01, abs=1e-9)
    assert way.length > 5 + np.pi  # more than half a circle


def test_way_points_that_are_near_already_are_left_out() -> None:
    way = route(np.array([[0.0, 0.0], [0.1, 0.0], [5.0, 0.0]]), radius=1.0, near=0.5)
    assert way.passed.tolist() == [1]
    assert way.length == pytest.approx(4.5)
    assert route(np.array([[0.0, 0.0], [0.1, 0.0]]), 1.0, 0.5).length == 0


def test_any_way_points_can_be_driven() -> None:
    """Whatever the radius: each is met within `near`, or is in reach of the arc that turns towards it."""
    rng = np.random.default_rng(0)
    for _ in range(50):
        points = rng.normal(size=(8, 2)) * 10.0 ** rng.uniform(-2, 2)
        way = route(points, radius=1.0, near=0.3)
        poses = way.at(np.linspace(0, way.length, 2000))
        assert np.isfinite(poses).all()
        assert (np.abs(poses[:, 2]) <= np.pi).all()
        moved = np.hypot(*np.diff(poses[:, :2], axis=0).T)
        assert (moved <= way.length / 1999 + 1e-9).all()
