"""The view from above: the colour of what is highest in each cell, up to a height."""

import numpy as np

import depth_clouds as room
from slamduel.core.se2 import Array, compose
from slamduel.frontend.maps.cloud import NOTHING, Cloud
from slamduel.frontend.maps.top_view import UNSEEN, TopView, top_view


def colour_at(view: TopView, place: Array) -> Array:
    """The colour of a place (2,), m, in the picture."""
    column, row = np.floor((place - view.origin) / view.size).astype(int)
    return view.picture[len(view.picture) - 1 - row, column].astype(float)


def test_the_floor_the_walls_and_the_box_have_their_colours() -> None:
    view = top_view(room.room_clouds(), room.PATH, 0.05)
    np.testing.assert_allclose(colour_at(view, np.array([0.5, 0.6])), room.FLOOR, atol=1)
    np.testing.assert_allclose(colour_at(view, np.array([room.HALF[0] - 0.001, 0.9])), room.WALLS, atol=1)
    c, s = np.cos(room.BOX.place[2]), np.sin(room.BOX.place[2])
    edge = room.BOX.place[:2] + np.array([[c, -s], [s, c]]) @ [-0.19, 0.0]  # of the side that faces the robot
    assert colour_at(view, edge)[2] > 100
    np.testing.assert_array_equal(colour_at(view, view.origin + 0.01), UNSEEN)
    low, high = view.corners
    assert (low < -np.array(room.HALF)).all()
    assert (high > np.array(room.HALF)).all()


def test_the_picture_follows_the_path_it_is_drawn_along() -> None:
    motion = np.array([3.0, 1.0, np.pi / 2])
    moved = compose(np.broadcast_to(motion, room.PATH.shape), room.PATH)
    view = top_view(room.room_clouds(), moved, 0.05)
    place = compose(motion, np.array([0.5, 0.6, 0.0]))[:2]
    np.testing.assert_allclose(colour_at(view, place), room.FLOOR, atol=1)


def test_the_highest_layer_below_the_height_is_shown() -> None:
    points = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.52], [1.0, 0.0, 0.58], [1.0, 0.0, 1.5], [2.0, 0.0, 0.0]])
    colours = np.array([[9, 9, 9], [100, 0, 0], [200, 0, 0], [0, 250, 0], [0, 0, 80]], np.uint8)
    made, path = room.spooled([Cloud(points, colours, np.ones(5))]), np.zeros((1, 3))
    view = top_view(made, path, 0.05)
    np.testing.assert_array_equal(colour_at(view, np.array([1.0, 0.0])), [150, 0, 0])
    np.testing.assert_array_equal(colour_at(view, np.array([2.0, 0.0])), [0, 0, 80])
    np.testing.assert_array_equal(colour_at(top_view(made, path, 0.05, high=2.0), np.array([1.0, 0.0])), [0, 250, 0])
    np.testing.assert_array_equal(colour_at(top_view(made, path, 0.05, high=0.3), np.array([1.0, 0.0])), [9, 9, 9])
    large = top_view(made, np.zeros((1, 3)), 0.001, most=100)
    assert max(large.colours.shape[:2]) <= 100
    nothing = room.spooled([NOTHING])
    assert (top_view(nothing, path).picture == UNSEEN).all()
