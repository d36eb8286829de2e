"""The occupancy grid: what it says of a room, and that it follows the path it is drawn along."""

import numpy as np

from slamduel.core.beside import Scans
from slamduel.core.relations import Anchors
from slamduel.core.se2 import Array, compose
from slamduel.frontend.maps.occupancy import FREE, UNKNOWN, WALL, Occupancy, occupancy

ROOM = (8.0, 5.0)
"""m; its corner is the origin."""


def scans(poses: Array, beams: int = 720) -> Scans:
    """Scans all round in the empty room, each at its own step."""
    angles = np.linspace(-np.pi, np.pi, beams, endpoint=False)
    ranges = np.empty((len(poses), beams), np.float32)
    for k, (x, y, heading) in enumerate(poses):
        c, s = np.cos(heading + angles), np.sin(heading + angles)
        with np.errstate(divide="ignore"):
            along_x = np.where(c > 0, (ROOM[0] - x) / c, -x / c)
            along_y = np.where(s > 0, (ROOM[1] - y) / s, -y / s)
        ranges[k] = np.minimum(np.abs(along_x), np.abs(along_y))
    n = len(poses)
    return Scans(Anchors(np.arange(n), np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(n)), ranges, angles, np.zeros(3))


POSES = np.array([[2.0, 2.0, 0.0], [4.0, 3.0, 1.0], [6.0, 2.0, -2.0]])


def state(grid: Occupancy, x: float, y: float) -> int:
    i, j = np.floor((np.array((x, y)) - grid.origin) / grid.size).astype(int)
    return int(grid.states[i, j])


def test_a_room_is_free_inside_its_walls_and_unknown_beyond() -> None:
    grid = occupancy(scans(POSES), POSES)
    for x in np.arange(0.2, ROOM[0] - 0.1, 0.17):
        for y in np.arange(0.2, ROOM[1] - 0.1, 0.17):
            assert state(grid, x, y) == FREE
    states = grid.states
    i, j = np.nonzero(states == WALL)
    middle = grid.origin + grid.size * (np.column_stack((i, j)) + 0.5)
    off = np.minimum(np.abs(middle), np.abs(middle - ROOM)).min(axis=1)
    assert off.max() <= grid.size  # a wall on the edge of two cells is in one of them
    assert len(i) > 0.9 * 2 * sum(ROOM) / grid.size
    assert states[0, 0] == states[-1, -1] == UNKNOWN


def test_the_grid_moves_with_the_path() -> None:
    seen = scans(POSES)
    motion = np.array((3.0, -1.0, np.pi / 2))
    grid = occupancy(seen, compose(np.broadcast_to(motion, POSES.shape), POSES))
    corners = compose(motion, np.array((ROOM[0] / 2, ROOM[1] / 2, 0.0)))
    assert state(grid, *corners[:2]) == FREE
    low, high = grid.origin, grid.origin + grid.size * np.array(grid.cells.shape[:2])
    assert np.abs(low - (3.0 - ROOM[1], -1.0)).max() < 0.4
    assert np.abs(high - (3.0, -1.0 + ROOM[0])).max() < 0.4


def test_a_wrong_path_doubles_the_walls() -> None:
    seen = scans(POSES)
    right = (occupancy(seen, POSES).states == WALL).sum()
    wrong = POSES + np.array([[0, 0, 0], [0.3, 0.3, 0], [0, 0, 0.1]])
    assert (occupancy(seen, wrong).states == WALL).sum() > 1.3 * right


def test_north_is_up_in_the_picture() -> None:
    grid = occupancy(scans(POSES), POSES)
    picture = grid.picture
    assert picture.shape == grid.cells.shape[1::-1]
    i, j = np.nonzero(grid.states == WALL)
    dark = picture[len(picture) - 1 - j, i]
    assert dark.max() < 140
    assert (picture[len(picture) // 2, 20:-20] == 255).mean() > 0.95
    assert picture[0, 0] == 205


def test_a_large_floor_has_larger_cells() -> None:
    seen = scans(POSES)
    far = POSES + np.array([[0, 0, 0], [900, 0, 0], [0, 0, 0]])
    grid = occupancy(seen, far)
    assert max(grid.cells.shape[:2]) < 4020
    assert grid.size > 0.2
