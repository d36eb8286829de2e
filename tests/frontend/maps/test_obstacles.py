"""Obstacles and free floor of a depth camera, against a room whose walls are known."""

import numpy as np
import pytest

import depth_clouds as room
from slamduel.core.beside import Clouds
from slamduel.core.se2 import Array
from slamduel.frontend.maps.cloud import VOXEL, Cloud
from slamduel.frontend.maps.obstacles import Obstacles
from slamduel.frontend.maps.occupancy import FREE, UNKNOWN, WALL, Occupancy, occupancy

CELL = 0.05


def black(points: Array) -> Cloud:
    return Cloud(points, np.zeros((len(points), 3), np.uint8), np.ones(len(points)))


def clouds(points: Array) -> Clouds:
    return room.spooled([black(points)])


def middles(grid: Occupancy) -> Array:
    """The middles (n m, 2) of the cells, row by row."""
    n, m = grid.cells.shape[:2]
    i, j = np.meshgrid(np.arange(n), np.arange(m), indexing="ij")
    return grid.origin + grid.size * (np.column_stack((i.ravel(), j.ravel())) + 0.5)


@pytest.fixture(scope="module")
def grid() -> Occupancy:
    return occupancy(Obstacles(room.room_clouds()), room.PATH, CELL)


def test_walls_are_where_the_room_has_them(grid: Occupancy) -> None:
    states, at = grid.states.ravel(), middles(grid)
    off = np.abs(np.abs(at) - np.array(room.HALF)).min(axis=1)
    on_wall = (off < CELL) & (np.abs(at) < np.array(room.HALF) + CELL).all(axis=1)
    on_box = room.on_box(at, 0.75 * CELL)
    wall = states == WALL
    assert (on_wall | on_box)[wall].all()
    # nearly every cell that a wall passes through is one: those that a view ended on
    for axis, other in ((0, 1), (1, 0)):
        for side in (-1, 1):
            hit = wall & (np.abs(at[:, axis] - side * room.HALF[axis]) < CELL)
            along = np.unique(np.floor(at[hit, other] / CELL))
            assert len(along) > 0.8 * 2 * room.HALF[other] / CELL


def test_floor_that_was_seen_is_free_and_what_is_behind_walls_or_the_box_is_unknown(grid: Occupancy) -> None:
    states, at = grid.states.ravel(), middles(grid)
    inside = (np.abs(at) < np.array(room.HALF) - 2 * CELL).all(axis=1) & ~room.on_box(at, 2 * CELL)
    assert (states[inside] == FREE).mean() > 0.97
    assert (states[inside] != WALL).all()
    outside = (np.abs(at) > np.array(room.HALF) + CELL).any(axis=1)
    assert (states[outside] == UNKNOWN).all()
    deep = room.on_box(at, -0.13)
    assert deep.sum() > 10
    assert (states[deep] != FREE).all()


def test_a_bearing_is_free_from_the_nearest_floor_to_the_farthest_before_an_obstacle() -> None:
    camera = room.CAMERA.mounting[:2, 3]
    along = np.arange(0.8, 3.0, 0.02)
    floor = np.column_stack((camera[0] + along, np.full(len(along), camera[1]), np.zeros(len(along))))
    post = np.array([[camera[0] + 2.0, camera[1], z] for z in np.arange(0.12, 0.9, 0.05)])
    lamp, hole = np.array([[camera[0] + 1.5, camera[1], 1.4]]), np.array([[camera[0] + 1.2, camera[1], -0.5]])
    beams = Obstacles(clouds(np.concatenate((floor, post, lamp, hole)))).beams(0)
    free = ~beams.reflected
    ahead = np.abs(np.arctan2(*(beams.ends[free] - camera).T[::-1])) < 0.005
    start, end = (np.hypot(*(part[free][ahead] - camera).T) for part in (beams.starts, beams.ends))
    assert ahead.sum() >= 1
    np.testing.assert_allclose(start, 0.8, atol=0.006)
    assert (end < 2.0).all()
    assert (end > 2.0 - 0.03).all()
    np.testing.assert_allclose(beams.ends[beams.reflected], post[:1, :2], atol=0.006)  # all its points are one
    assert (beams.starts == beams.ends)[beams.reflected].all()
    nothing = Obstacles(clouds(post)).beams(0)
    assert nothing.reflected.all()
    low = Obstacles(clouds(np.concatenate((floor, post))), 0.5, 0.6).beams(0)
    assert low.reflected.sum() == 1
    none = Obstacles(clouds(np.concatenate((floor, post))), 1.0, 1.5).beams(0)
    assert not none.reflected.any()
    assert VOXEL > 0.04  # a point's width, by which the bearings beside it are free, too


def test_what_is_seen_over_a_near_box_does_not_wipe_it_out() -> None:
    """A box is seen at 1 m; then it is too near to be in view, and only the wall behind it is seen, over it."""
    camera = room.CAMERA.mounting[:2, 3]
    wide = np.arange(-0.1, 0.1, 0.02)
    box = np.array([[camera[0] + 1.0, camera[1] + y, 0.2] for y in wide])
    wall = np.array([[camera[0] + 2.0, camera[1] + y, 0.5] for y in wide])
    parts = [black(one) for one in (box, *[wall - [0.7, 0, 0]] * 9)]
    grid = occupancy(Obstacles(room.spooled(parts)), np.array([[0.0, 0, 0], *[[0.7, 0, 0]] * 9]), CELL)
    states, at = grid.states.ravel(), middles(grid)
    near = np.hypot(*(at - camera - [1.0, 0.0]).T) < 0.03
    assert (states[near] == WALL).all()
